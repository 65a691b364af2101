"""What commands take where a plan's folder, a value of Python or a scene alone is given."""

from __future__ import annotations

import atexit
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import NamedTuple

from seqopt._cli.options import Asked, Built, Fixed
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


class NamedSteps(NamedTuple):
    """A closed sequence, and what it is called: its method, its title, or the stem of its file."""

    name: str
    steps: tuple[Step, ...]


def is_folder(path: Path) -> bool:
    """Return whether a path is the folder of a plan."""
    return (path / "scene.json").is_file() and (path / "plan.csv").is_file()


def given_scene(asked: Built) -> Scene:
    """Return the scene that is given, also as a plan or the folder of one."""
    scene = asked.scene
    if isinstance(scene, ShownBuild):
        return scene.engine.network.scene
    if isinstance(scene, Scene):
        return scene
    return load_scene(Path(scene) / "scene.json" if is_folder(Path(scene)) else scene)


def given_plan(asked: Fixed) -> ShownBuild | Path | None:
    """Return the plan whose steps are asked for, if one is named or stands for the scene."""
    scene = asked.scene
    if asked.plan is not None or asked.method is not None or isinstance(scene, ShownBuild):
        return scene if asked.plan is None and isinstance(scene, ShownBuild) else asked.plan
    return None if isinstance(scene, Scene) or not is_folder(Path(scene)) else Path(scene)


def file_name(name: str | Path, end: str) -> Path:
    """Return what a file about a scene is called where no name is given: in this folder."""
    return Path(re.sub(r"\W+", "-", re.sub(r"\.json$", "", Path(name).name)).strip("-") + end)


def plan_folder(asked: Asked, given: object, *, free: bool = False) -> Path:
    """Return the folder of a plan, which is made where a plan, a scene or its name is given.

    The steps of a scene are usual ones, or the best ``free`` ones.
    """
    if isinstance(given, str | Path) and Path(given).is_dir():
        return Path(given)
    if not isinstance(given, ShownBuild):
        scene = given if isinstance(given, Scene) else load_scene(str(given))
        find_postures(scene, asked.cache, asked.tell)
        given = _free(asked, scene) if free else _usual(asked, build_network(scene), ())
    folder = Path(mkdtemp(prefix="seqopt-"))  # there as long as this process
    atexit.register(rmtree, folder, ignore_errors=True)
    files: dict[str, bytes | str] = {
        "scene.json": dump_scene(given.engine.network.scene),
        "plan.csv": csv_text(given.responses()),
        "summary.json": json.dumps(given.summary() if isinstance(given, Plan) else {}),
    }
    write_folder(folder, files)
    return folder


def given_steps(asked: Fixed, network: Network, robots: Sequence[str]) -> NamedSteps:
    """Return the closed sequence that a command is asked for, or the usual one.

    Raises `SceneError` if the method is not for the scene.
    """
    scene, plan, method = network.scene, given_plan(asked), asked.method
    if isinstance(plan, ShownBuild):
        return NamedSteps(plan.title, plan.steps)
    if plan is not None:
        return NamedSteps(
            plan.stem, read_plan(scene, plan / "plan.csv" if is_folder(plan) else plan)
        )
    find_postures(scene, asked.cache, asked.tell)
    if method is None:
        build = _usual(asked, network, robots)
        return NamedSteps(build.title, build.steps)
    if method != PUBLISHED:
        return NamedSteps(method, METHODS[method](network, robots))
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return NamedSteps(method, published_plan(scene))


def _usual(asked: Asked, network: Network, robots: Sequence[str]) -> ShownBuild:
    """Return the build by the first fixed method that fits, else a plan; which one is noted."""
    for name, method in METHODS.items():
        with suppress(StepError):
            steps = method(network, robots)
            others = "--method, --plan or a plan's folder in place of SCENE names others"
            asked.taken.append(f"steps: of the {name} method; {others}")
            return GivenSequence(make_engine(USUAL, network), steps, name)
    return _free(asked, network.scene)


def _free(asked: Asked, scene: Scene) -> Plan:
    """Return the best free schedule, which is noted."""
    plan = optimize(scene, FREE, progress=asked.tell)
    asked.taken.append(f"steps: of the best free schedule, {plan.result}")
    return plan
