"""What commands take where a plan's folder, a value of Python or a scene alone is given."""

from __future__ import annotations

import argparse
import atexit
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TypeAlias

from seqopt._files import csv_text, write_folder
from seqopt.arms.reach import find_postures
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import SceneError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.build import GivenSequence, ShownBuild
from seqopt.plan.plan import Plan
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import dump_scene, load_scene
from seqopt.sequence.rules import FREE
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan
from seqopt.workflow import optimize

Steps: TypeAlias = tuple[Step, ...]
STEPS = "--method, --plan or a plan's folder in place of SCENE names others"


def is_folder(path: Path) -> bool:
    """Return whether a path is the folder of a plan."""
    return (path / "scene.json").is_file() and (path / "plan.csv").is_file()


def take(options: argparse.Namespace, note: str) -> None:
    """Say in a line what is taken where nothing is asked for."""
    options.taken = (*getattr(options, "taken", ()), note)


def given_scene(options: argparse.Namespace) -> Scene:
    """Return the scene that is given; its steps too become options, where a plan is given."""
    asked = options.scene
    plan: ShownBuild | Path | None = None
    if isinstance(asked, ShownBuild):
        options.scene, plan = asked.engine.network.scene, asked
    elif isinstance(asked, str | Path) and is_folder(folder := Path(asked)):
        options.scene, plan = folder / "scene.json", folder
    if not (getattr(options, "plan", None) or getattr(options, "method", None)):
        options.plan = plan
    return options.scene if isinstance(options.scene, Scene) else load_scene(options.scene)


def file_name(name: str | Path, end: str) -> Path:
    """Return what a file about a scene is called where no name is given: in this folder."""
    return Path(re.sub(r"\W+", "-", re.sub(r"\.json$", "", Path(name).name)).strip("-") + end)


def plan_folder(options: argparse.Namespace, asked: object, *, free: bool = False) -> Path:
    """Return the folder of a plan, which is made where a plan, a scene or its name is given.

    The steps of a scene are usual ones, or the best ``free`` ones.
    """
    if isinstance(asked, str | Path) and Path(asked).is_dir():
        return Path(asked)
    if not isinstance(asked, ShownBuild):
        scene = asked if isinstance(asked, Scene) else load_scene(str(asked))
        options.plan = options.method = None
        find_postures(scene, getattr(options, "cache", None), options.tell)
        engine = make_engine(USUAL, build_network(scene))
        steps = _free(options, scene) if free else _usual(options, engine.network, ())
        asked = options.plan or GivenSequence(engine, steps, options.method)
    return _written(asked)


def _written(plan: ShownBuild) -> Path:
    """Return a folder with a plan, which is there as long as this process."""
    told = plan.summary() if isinstance(plan, Plan) else {}
    folder = Path(mkdtemp(prefix="seqopt-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    files: dict[str, bytes | str] = {
        "scene.json": dump_scene(plan.engine.network.scene),
        "plan.csv": csv_text(plan.responses()),
        "summary.json": json.dumps(told),
    }
    write_folder(folder, files)
    return folder


def given_steps(options: argparse.Namespace, network: Network, robots: Sequence[str]) -> Steps:
    """Return the closed sequence that a command is asked for, or the usual one.

    Raises `SceneError` if the method is not for the scene.
    """
    scene, plan = network.scene, options.plan
    if isinstance(plan, ShownBuild):
        return plan.steps
    if plan is not None:
        return read_plan(scene, plan / "plan.csv" if is_folder(plan) else plan)
    find_postures(scene, getattr(options, "cache", None), options.tell)
    if options.method is None:
        return _usual(options, network, robots)
    if options.method != PUBLISHED:
        return METHODS[options.method](network, robots)
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return published_plan(scene)


def plan_name(options: argparse.Namespace) -> str:
    """Return what a sequence is called: its method, its title, or the stem of its file."""
    plan = options.plan
    return options.method or (plan.title if isinstance(plan, ShownBuild) else plan.stem)


def _usual(options: argparse.Namespace, network: Network, robots: Sequence[str]) -> Steps:
    """Return the steps of the first fixed method that fits, else of a plan; the name is noted."""
    for name, method in METHODS.items():
        with suppress(StepError):
            steps = method(network, robots)
            options.method = name
            take(options, f"steps: of the {name} method; {STEPS}")
            return steps
    return _free(options, network.scene)


def _free(options: argparse.Namespace, scene: Scene) -> Steps:
    """Return the steps of the best free schedule, which is noted."""
    options.plan = plan = optimize(scene, FREE, progress=options.tell)
    take(options, f"steps: of the best free schedule, {plan.result}")
    return plan.steps
