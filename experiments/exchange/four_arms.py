"""Claim: four real arms build a wall and the first phase of a vault by plans that are proven.

Method: four ABB IRB 4600-40/2.55, as compas_fab ships them, stand two on either side of a wall of
16 blocks of aerated concrete, and of a herringbone vault's middle arch of 13 bricks with the first
four bricks on each side of it. Both scenes are put through the command line: ``seqopt optimize
--schedule free``. The tasks are then read with pandas alone. The claim holds
if each plan is proven optimal and keeps the postures of its arms, no other plan of the table being
better; no robot exceeds its payload; every step stands, the wall dry, the vault with epoxy; every
arm holds some time, and has joint values in every task but that of picking.

Inputs: the wall's generator, the stored scene of the vault, the models in compas_fab. With
``--store`` the folders of ``docs/examples/four_arms`` are written, each with scene, plan, tasks and
film.
Command: ``python -m experiments four_arms [--quick] [--films]``.
"""

import io
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from PIL import Image

import seqopt
from experiments.harness.claim import Claim, ClaimError, Extra, Finding, Option, Options
from experiments.harness.results import FIGURES
from experiments.harness.scenes import read_folder
from seqopt._cli.main import main
from seqopt.arms import Arm
from seqopt.arms._model import PosedArm, idle_arm
from seqopt.errors import ExtraError, SceneError
from seqopt.report._pictures import steps_picture
from seqopt.report._robots import Arms
from seqopt.scene.library import WallShape, wall
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

EXAMPLES = FIGURES.parent / "examples" / "four_arms"
COLORS = 128  # of a film: less than half the bytes
ABB = "compas_fab:data/robot_library/abb_irb4600_40_255/urdf/robot_description.urdf"
PAYLOAD = 390.0  # N
FILES = ("plan.csv", "tasks.json", "tasks.csv")


def armed(scene: Scene, west: float, east: float, aside: float, tool: float) -> Scene:
    """Return a scene with four arms, two on either side, that look across it."""

    def robot(name: str, x: float, toward: int) -> Robot:
        axes: dict[str, Any] = {"x_axis": (0, toward, 0), "y_axis": (-toward, 0, 0)}
        place = (x, -toward * aside, 0.0)
        arm = Arm(urdf=ABB, position=place, **axes, tool_length=tool, tool_radius=0.05)
        return Robot(name=name, payload=PAYLOAD, arm=arm)

    sides = (("north", -1), ("south", 1))
    ends = (("west", west), ("east", east))
    return scene.with_robots(
        *(robot(f"{side}-{end}", x, toward) for side, toward in sides for end, x in ends)
    )


def wall_scene(columns: int = 4, courses: int = 4) -> Scene:
    shape = WallShape(columns=columns, courses=courses, dimensions=(0.6, 0.2, 0.25), density=500)
    return armed(wall(shape), west=-0.2, east=0.6 * columns - 0.2, aside=1.7, tool=0.4)


def vault_scene() -> Scene:
    scene = seqopt.load_scene(EXAMPLES / "vault" / "scene.json")
    return armed(scene, west=0.0, east=1.7, aside=1.5, tool=0.3)


SCENES: dict[str, Callable[[], Scene]] = {"wall": wall_scene, "vault": vault_scene}
STANDS = {"wall": "dry", "vault": "epoxy"}  # with which mortar every step stands


def built(name: str, scene: Scene, folder: Path) -> dict[str, object]:
    """Write the plan of a scene to a folder, as the command line does; return a row about it."""
    given, plan = folder / "scene.json", folder / "plan"
    seqopt.save_scene(scene, given)
    run("optimize", given, "--schedule", "free", "--out", plan)
    said = json.loads((plan / "summary.json").read_text(encoding="utf-8"))
    tasks = pd.read_csv(plan / "tasks.csv")
    driven = tasks[tasks["action"] != "pick"]
    return {
        "build": name,
        "blocks": len(scene.bricks),
        "arms": len(scene.robots),
        "steps": said["steps"],
        "regrips": said["regrips"],
        "status": said["status"],
        "worst_ratio": said["objective"]["minmax"],
        "arms_said": said["arms"]["said"],
        "best_of_table": said["arms"]["best_of_table"],
        "overloads": len(said["payload_exceeded"]),
        "mortar": STANDS[name],
        "fall": said["stability"][STANDS[name]]["falls"],
        "undecided": said["stability"][STANDS[name]]["undecided"],
        "holding": driven["robot"].nunique(),
        "tasks": len(tasks),
        "without_joints": int(driven.filter(like="joint_").isna().any(axis=1).sum()),
    }


def run(*words: object) -> None:
    """Run a command; it must end well."""
    if status := main([*map(str, words)]):
        raise ClaimError(f"seqopt {words[0]} ended with status {status}")


def keep(name: str, folder: Path) -> None:
    """Keep the scene and the files of its plan among the examples."""
    (EXAMPLES / name).mkdir(parents=True, exist_ok=True)
    for path in (folder / "scene.json", *(folder / "plan" / file for file in FILES)):
        (EXAMPLES / name / path.name).write_bytes(path.read_bytes())


def faults(table: pd.DataFrame) -> list[str]:
    """Return what speaks against the claim."""
    out = [] if len(table) else ["no build"]
    for row in table.to_dict("records"):
        wrong = {
            "is not optimal": row["status"] != "optimal",
            "does not keep its postures, or others are better": not row["best_of_table"],
            "overloads a robot": row["overloads"] > 0,
            f"has steps that do not stand ({row['mortar']})": row["fall"] + row["undecided"] > 0,
            "leaves an arm idle": row["holding"] < row["arms"],
            "has tasks without joints": row["without_joints"] > 0,
        }
        out += [f"{row['build']}: the plan {what}" for what, is_so in wrong.items() if is_so]
    return out


def stored_build(name: str) -> tuple[Scene, tuple[Step, ...], Arms]:
    """Return an example as it is stored, with its arms in the postures of its tasks.

    Where nothing is installed that knows the model there are no arms, which are then sketched.
    """
    scene, steps = read_folder(EXAMPLES / name)
    tasks = pd.read_csv(EXAMPLES / name / "tasks.csv")
    held = tasks[~tasks["action"].isin(["pick", "release"])].set_index(["robot", "step"])
    joints = held.filter(like="joint_")
    arms: dict[str, list[Any]] = {}
    try:
        for robot in scene.robots:
            assert robot.arm is not None
            own = joints.loc[robot.name]
            arms[robot.name] = [
                PosedArm(robot.arm, own.loc[step.number].to_numpy())
                if step.number in own.index
                else idle_arm(robot.arm)
                for step in steps
            ]
    except (ExtraError, SceneError):
        return scene, steps, {}
    return scene, steps, arms


def draw_films() -> None:
    """Write the film of every example into its folder."""
    for name in SCENES:
        scene, steps, arms = stored_build(name)
        engine = seqopt.make_engine("compliance", scene)
        frames = []
        for step in steps:
            shown = io.BytesIO()
            picture = steps_picture(engine, steps, step.number, arms=arms)
            picture.savefig(shown, format="png", dpi=65)
            frames.append(Image.open(shown).convert("RGB"))
        colors = frames[len(frames) // 2].quantize(COLORS, Image.Quantize.FASTOCTREE)
        first, *more = (f.quantize(palette=colors, dither=Image.Dither.NONE) for f in frames)
        path = EXAMPLES / name / "film.gif"
        first.save(path, save_all=True, append_images=more, loop=0, optimize=True, duration=400)
        print("drawn:", path.name)


def experiment(options: Options) -> Finding | None:
    if options.films:
        draw_films()
        return None
    rows = []
    scenes = {"wall": lambda: wall_scene(3, 2)} if options.quick else SCENES
    for name, scene in scenes.items():
        with tempfile.TemporaryDirectory() as folder:
            rows.append(built(name, scene(), Path(folder)))
            if options.store:
                keep(name, Path(folder))
    if options.store:
        draw_films()
    table = pd.DataFrame(rows)
    print(table.T.to_string(header=False))
    return Finding(dict.fromkeys(faults(table), False), tables={"four_arms": table})


CLAIM = Claim(
    experiment,
    digits=6,
    quick="a wall of six blocks alone",
    options=(Option("--films", "draw the films anew from stored plans, run nothing"),),
    needs=(
        Extra("pinocchio", "pip install 'seqopt[arms]'"),
        Extra("compas_fab", "pip install compas_fab"),
    ),
)
