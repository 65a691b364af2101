"""Inputs of commands: steps, engine and verdicts from names, files, folders or values."""

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

from seqopt._cli.words import BuiltFrom, Words, as_built, is_folder, parse_mortar
from seqopt._files import csv_text, write_folder
from seqopt.arms.reach import find_postures
from seqopt.contact.mortar import Mortar, _mortar_name
from seqopt.engines.interface import Engine
from seqopt.engines.registry import DEFAULT, LIMITED, USUAL, make_engine, simplest
from seqopt.errors import ExtraError, SceneError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.build import GivenSequence, ShownBuild
from seqopt.plan.plan import Plan
from seqopt.problem.standing import Standing
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import dump_scene, load_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.rules import FREE
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.stability._builds import BuildProver
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan
from seqopt.work.progress import Tell
from seqopt.workflow import optimize


class NamedSteps(NamedTuple):
    """A closed sequence with its name: its method, its title, or the stem of its file."""

    name: str
    steps: tuple[Step, ...]
    notes: tuple[str, ...] = ()


def given_plan(
    scene: BuiltFrom, plan: ShownBuild | Path | str | None, method: str | None
) -> ShownBuild | Path | None:
    """Return the plan that is named, or the one given in place of the scene, if any."""
    own = as_built(scene).scene
    if plan is not None:
        return plan if isinstance(plan, ShownBuild) else Path(plan)
    if isinstance(own, ShownBuild):
        return own
    if method is not None or isinstance(own, Scene):
        return None
    return Path(own) if is_folder(Path(own)) else None


def file_name(name: str | Path, end: str) -> Path:
    """Return the default file name about a scene, in the working directory."""
    return Path(re.sub(r"\W+", "-", re.sub(r"\.json$", "", Path(name).name)).strip("-") + end)


def plan_folder(
    given: BuiltFrom, cache: Path | str | None, tell: Tell, *, free: bool = False
) -> tuple[Path, tuple[str, ...]]:
    """Return the folder of a plan, written to a temporary one for a plan or a scene.

    A scene gets default steps, or the optimal ``free`` ones; notes name them.
    """
    notes: tuple[str, ...] = ()
    if isinstance(given, str | Path) and Path(given).is_dir():
        return Path(given), notes
    if not isinstance(given, ShownBuild):
        scene = given if isinstance(given, Scene) else load_scene(given)
        find_postures(scene, cache, tell)
        given, notes = _free(scene, tell) if free else _usual(build_network(scene), (), tell)
    folder = Path(mkdtemp(prefix="seqopt-"))  # there as long as this process
    atexit.register(rmtree, folder, ignore_errors=True)
    files: dict[str, bytes | str] = {
        "scene.json": dump_scene(given.engine.network.scene),
        "plan.csv": csv_text(given.responses()),
        "summary.json": json.dumps(given.summary() if isinstance(given, Plan) else {}),
    }
    write_folder(folder, files)
    return folder, notes


def find_steps(
    network: Network,
    scene: BuiltFrom,
    plan: ShownBuild | Path | str | None,
    method: str | None,
    robots: int | Words | None,
    tell: Tell,
    cache: Path | str | None = None,
) -> NamedSteps:
    """Return the requested closed sequence, or the default one."""
    given, named = given_plan(scene, plan, method), robots if isinstance(robots, tuple) else ()
    if robots and (given is not None or method == PUBLISHED):
        raise StepError(
            f"--robots {','.join(named) or robots}: a plan says itself who holds; leave it out, "
            f"or give --method {' or '.join(METHODS)}"
        )
    if isinstance(given, ShownBuild):
        return NamedSteps(given.title, given.steps)
    if given is not None:
        file = given / "plan.csv" if is_folder(given) else given
        return NamedSteps(given.stem, read_plan(network.scene, file))
    find_postures(network.scene, cache, tell)
    if method is None:
        build, notes = _usual(network, named, tell)
        return NamedSteps(build.title, build.steps, notes)
    if method != PUBLISHED:
        return NamedSteps(method, METHODS[method](network, named))
    if not is_reference_arch(network.scene):
        raise SceneError(
            f"scene {network.scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return NamedSteps(method, published_plan(network.scene))


def _usual(
    network: Network, robots: Sequence[str], tell: Tell
) -> tuple[ShownBuild, tuple[str, ...]]:
    """Return the build of the first feasible fixed method, else a plan, and a note on it."""
    for name, method in METHODS.items():
        with suppress(StepError):
            steps = method(network, robots)
            others = "--method, --plan or a plan's folder in place of SCENE names others"
            build = GivenSequence(make_engine(USUAL, network), steps, name)
            return build, (f"steps: of the {name} method; {others}",)
    return _free(network.scene, tell)


def _free(scene: Scene, tell: Tell) -> tuple[Plan, tuple[str, ...]]:
    """Return the optimal free schedule, and a note that says so."""
    plan = optimize(scene, FREE, progress=tell)
    return plan, (f"steps: of the best free schedule, {plan.result}",)


def mortar_of_engine(
    engine: str | None, mortar: Mortar | str | None, *, verdicts: bool
) -> Mortar | None:
    """Return the mortar that an engine is asked with; that of ``verdicts`` may be theirs alone."""
    own = None if mortar is None else parse_mortar(mortar, "--mortar")
    return None if verdicts and engine not in LIMITED else own


def find_engine(
    network: Network, engine: str | None, mortar: Mortar | str | None, *, verdicts: bool = False
) -> Engine:
    """Return the requested engine, by default that of the scene."""
    own = mortar_of_engine(engine, mortar, verdicts=verdicts)
    found = make_engine(engine or DEFAULT, network, own)
    # with a mortar of its own an engine is asked where joints open: set by set
    return simplest(found) if engine is None and own is None else found


def posture_trouble(scene: Scene, cache: Path | str | None, tell: Tell) -> str:
    """Compute or load postures of arms; return the error message if there are none."""
    try:
        find_postures(scene, cache, tell)
    except (ExtraError, SceneError) as error:
        return str(error)
    return ""


def find_prover(
    network: Network,
    mortar: Mortar | str | None,
    tell: Tell,
    *,
    asks: bool,
    stands: Standing | None = None,
) -> BuildProver:
    """Return the prover of stability, with the mortars that a command shows."""
    own = parse_mortar(mortar or "epoxy", "--mortar") if stands is None else stands.mortar
    name = mortar if isinstance(mortar, str) else _mortar_name(own)
    shown = {"dry": Mortar(friction=own.friction), name: own}
    return BuildProver(network, shown if asks else {}, tell)
