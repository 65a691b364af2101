"""Inputs of commands: scene, steps, engine and states from names, files, folders or values."""

from __future__ import annotations

import atexit
import json
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import NamedTuple

from seqopt._cli import grammar, options
from seqopt._files import csv_text, read_text, write_folder
from seqopt.arms.reach import find_postures
from seqopt.contact.mortar import Mortar, _mortar_name
from seqopt.engines.interface import Engine
from seqopt.engines.registry import DEFAULT, LIMITED, USUAL, make_engine, simplest
from seqopt.errors import ExtraError, ProblemError, SceneError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.build import GivenSequence, ShownBuild
from seqopt.plan.plan import Plan
from seqopt.scene.scene import Scene, in_order
from seqopt.scene.scene_file import dump_scene, load_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.rules import FREE, FreeRules, with_robots
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.schedule_file import _what_is_left, read_plan, read_site
from seqopt.sequence.steps import Site, Step
from seqopt.stability._builds import BuildProver
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan
from seqopt.workflow import optimize

FORMS = "PLAN:STEP (a plan's folder or CSV file), a STATE.json, or a number of bricks"


class NamedSteps(NamedTuple):
    """A closed sequence with its name: its method, its title, or the stem of its file.

    ``notes``: the default that was chosen, if none was requested.
    """

    name: str
    steps: tuple[Step, ...]
    notes: tuple[str, ...] = ()


def is_folder(path: Path) -> bool:
    """Return whether a path is the folder of a plan."""
    return (path / "scene.json").is_file() and (path / "plan.csv").is_file()


def given_scene(asked: options.Built) -> Scene:
    """Return the scene of the options, also from a plan or its folder."""
    scene = asked.scene
    if isinstance(scene, ShownBuild):
        return scene.engine.network.scene
    if isinstance(scene, Scene):
        return scene
    return load_scene(Path(scene) / "scene.json" if is_folder(Path(scene)) else scene)


def given_plan(asked: options.Fixed) -> ShownBuild | Path | None:
    """Return the plan of --plan, or the one given in place of the scene, if any."""
    scene, plan = asked.scene, asked.plan
    if plan is not None:
        return plan if isinstance(plan, ShownBuild) else Path(plan)
    if isinstance(scene, ShownBuild):
        return scene
    if asked.method is not None or isinstance(scene, Scene):
        return None
    return Path(scene) if is_folder(Path(scene)) else None


def file_name(name: str | Path, end: str) -> Path:
    """Return the default file name about a scene, in the working directory."""
    return Path(re.sub(r"\W+", "-", re.sub(r"\.json$", "", Path(name).name)).strip("-") + end)


def plan_folder(
    asked: options.Postures, given: options.BuiltFrom, *, free: bool = False
) -> tuple[Path, tuple[str, ...]]:
    """Return the folder of a plan, written to a temporary one for a plan or a scene.

    A scene gets default steps, or the optimal ``free`` ones; notes name them.
    """
    notes: tuple[str, ...] = ()
    if isinstance(given, str | Path) and Path(given).is_dir():
        return Path(given), notes
    if not isinstance(given, ShownBuild):
        scene = given if isinstance(given, Scene) else load_scene(given)
        find_postures(scene, asked.cache, asked.tell)
        usual = _free(asked, scene) if free else _usual(asked, build_network(scene), ())
        given, notes = usual
    folder = Path(mkdtemp(prefix="seqopt-"))  # there as long as this process
    atexit.register(rmtree, folder, ignore_errors=True)
    files: dict[str, bytes | str] = {
        "scene.json": dump_scene(given.engine.network.scene),
        "plan.csv": csv_text(given.responses()),
        "summary.json": json.dumps(given.summary() if isinstance(given, Plan) else {}),
    }
    write_folder(folder, files)
    return folder, notes


def find_steps(asked: options.Fixed, network: Network) -> NamedSteps:
    """Return the requested closed sequence, or the default one.

    Raises `SceneError`, `StepError` if the method is not applicable to the scene, or robots are
    named beside a plan.
    """
    robots = grammar.parse_robots(asked.robots)
    scene, plan, method = network.scene, given_plan(asked), asked.method
    if asked.robots and (plan is not None or method == PUBLISHED):
        raise StepError(
            f"--robots {asked.robots}: a plan says itself who holds; leave it out, or give "
            f"--method {' or '.join(METHODS)}"
        )
    if isinstance(plan, ShownBuild):
        return NamedSteps(plan.title, plan.steps)
    if plan is not None:
        file = plan / "plan.csv" if is_folder(plan) else plan
        return NamedSteps(plan.stem, read_plan(scene, file))
    find_postures(scene, asked.cache, asked.tell)
    if method is None:
        build, notes = _usual(asked, network, robots)
        return NamedSteps(build.title, build.steps, notes)
    if method != PUBLISHED:
        return NamedSteps(method, METHODS[method](network, robots))
    if not is_reference_arch(scene):
        raise SceneError(
            f"scene {scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return NamedSteps(method, published_plan(scene))


def _usual(
    asked: options.Postures, network: Network, robots: Sequence[str]
) -> tuple[ShownBuild, tuple[str, ...]]:
    """Return the build of the first feasible fixed method, else a plan, and a note on it."""
    for name, method in METHODS.items():
        with suppress(StepError):
            steps = method(network, robots)
            others = "--method, --plan or a plan's folder in place of SCENE names others"
            build = GivenSequence(make_engine(USUAL, network), steps, name)
            return build, (f"steps: of the {name} method; {others}",)
    return _free(asked, network.scene)


def _free(asked: options.Postures, scene: Scene) -> tuple[Plan, tuple[str, ...]]:
    """Return the optimal free schedule, and a note that says so."""
    plan = optimize(scene, FREE, progress=asked.tell)
    return plan, (f"steps: of the best free schedule, {plan.result}",)


@dataclass(frozen=True, eq=False, repr=False)
class Place:
    """Where a build begins or ends, and the steps that led there, if known."""

    site: Site | None = None
    done: tuple[Step, ...] | None = ()


def find_place(text: int | str | None, name: str, scene: Scene) -> tuple[Scene, Place]:
    """Return the place of --from or --to, and the scene in an order that begins with its bricks."""
    if text is None:
        return scene, Place()
    try:
        return read_place(scene, str(text), bare=name == "from")
    except StepError as error:
        raise StepError(f"--{name} {text}: {error}") from None


def read_place(scene: Scene, text: str, *, bare: bool = True) -> tuple[Scene, Place]:
    """Return a place from words, and the scene in an order that begins with its bricks.

    ``bare``: whether a number of bricks means a state without grips.
    """
    if text.isdecimal():
        grips = (None,) * len(scene.robots) if bare else None
        site = Site(int(text), grips)
        site.holds(scene)
        return scene, Place(site, None if site.bricks else ())
    file, _, step = text.rpartition(":")
    if file and step.isdecimal():
        return scene, _of_plan(scene, Path(file), int(step))
    if not text.endswith(".json"):
        raise StepError(f"give {FORMS}")
    found, site = read_site(scene, Path(text))
    return found, Place(site, None)


def _of_plan(scene: Scene, path: Path, step: int) -> Place:
    """Return the place of a plan after a step; robots that it does not list hold nothing."""
    file = path / "plan.csv" if path.is_dir() else path
    columns = read_text(file).partition("\n")[0].split(",")
    known = [robot for robot in scene.robots if f"{robot.name}_node" in columns]
    steps = read_plan(scene.with_robots(*known) if known else scene, file)
    where = [known.index(robot) if robot in known else None for robot in scene.robots]
    if known != [*scene.robots]:
        steps = tuple(
            replace(s, grips=tuple(None if k is None else s.grips[k] for k in where)) for s in steps
        )
    site = Site.after(steps, step)
    done = tuple(each for each in steps if each.number <= step)
    return Place(site, done if steps[0].number == 1 else None)


def between(moves: Schedule | FreeRules, begin: Place, end: Place) -> Schedule | FreeRules:
    """Return the moves between two places."""
    if begin.site is None and end.site is None:
        return moves
    if isinstance(moves, FreeRules):
        return replace(moves, begin=begin.site, finish=end.site)
    if begin.done is None or end.done is None:
        raise StepError(
            f"schedule {moves.method}: it goes on, and ends, at a step of a plan of its own; give "
            "PLAN:STEP, or --schedule free"
        )
    return _what_is_left(moves, begin.done, end.site)


def find_scene(asked: options.Built) -> Scene:
    """Return the scene of the options; for a range of --grips with its own stiffness."""
    if asked.order == "search":
        raise ProblemError(
            "--order search: only the free schedule has it; give optimize --schedule free"
        )
    order = None if asked.order is None else str(asked.order)
    scene = in_order(given_scene(asked), order)
    for text in options.listed(asked.payload):
        scene = grammar.with_payload(text, scene)
    if isinstance(asked, options.Team) and (count := str(asked.robots)).isdecimal():
        scene = with_robots(scene, int(count))
    if asked.props is not None:
        scene = scene.with_props(*grammar.parse_props(str(asked.props), scene))
    return scene if asked.grips is None else grammar.with_grips(asked.grips, scene)


def in_seconds(asked: options.Timed, scene: Scene) -> Scene:
    """Return a scene with the durations of --durations, if any."""
    try:
        return scene.with_durations(*asked.durations) if asked.durations else scene
    except SceneError as error:
        raise SceneError(f"--{error}") from None


def find_engine(asked: options.Computed, network: Network) -> Engine:
    """Return the requested engine, by default that of the scene."""
    mortar = None if asked.mortar is None else grammar.parse_mortar(asked.mortar, "--mortar")
    if asked.engine not in LIMITED and isinstance(asked, options.Judged) and asked.stability:
        mortar = None  # it is that of verdicts alone
    if asked.engine is None:
        engine = make_engine(DEFAULT, network, mortar)
        # with a mortar of its own an engine is asked where joints open: set by set
        return simplest(engine) if mortar is None else engine
    try:
        return make_engine(asked.engine, network, mortar)
    except SceneError as error:
        why = str(error).removeprefix(f"engine {asked.engine}: ")
        raise SceneError(f"--engine {asked.engine}: {why}") from error


def posture_trouble(asked: options.Postures, scene: Scene) -> str:
    """Compute or load postures of arms; return the error message if there are none."""
    try:
        find_postures(scene, asked.cache, asked.tell)
    except (ExtraError, SceneError) as error:
        return str(error)
    return ""


def find_prover(asked: options.Judged, network: Network) -> BuildProver:
    """Return the prover of stability, with the mortars that a command shows."""
    demanded = grammar.parse_standing(asked) if isinstance(asked, options.Stands) else None
    own = getattr(asked, "stands", None) or asked.mortar or "epoxy"
    mortar = grammar.parse_mortar(own, "--mortar") if demanded is None else demanded.mortar
    name = own if isinstance(own, str) else _mortar_name(mortar)
    shown = {"dry": Mortar(friction=mortar.friction), name: mortar}
    return BuildProver(network, shown if asked.stability else {}, asked.tell)
