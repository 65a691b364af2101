"""Inputs of commands: steps, engine and verdicts from names, files and folders."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, NamedTuple

from seqopt._cli.words import ARCH25, Built, parse_mortar
from seqopt.arms.reach import find_postures
from seqopt.contact.mortar import Mortar, _mortar_name
from seqopt.engines.interface import Engine
from seqopt.engines.registry import DEFAULT, LIMITED, make_engine, simplest
from seqopt.errors import ExtraError, ProblemError, SceneError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.problem.standing import Standing
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.rules import FREE
from seqopt.sequence.schedule_file import read_plan
from seqopt.sequence.steps import Step
from seqopt.stability._builds import BuildProver
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan
from seqopt.work.progress import Tell
from seqopt.workflow import optimize


class Sequenced(NamedTuple):
    """A closed sequence: its method, title, or the stem of its file; notes say what was taken."""

    network: Network
    name: str
    steps: tuple[Step, ...]
    notes: tuple[str, ...] = ()

    @property
    def scene(self) -> Scene:
        """What is built."""
        return self.network.scene


def read_steps(
    scene: Built = ARCH25,
    *,
    robots: int | str | None = None,
    cache: Path | None = None,
    progress: Tell,
    method: str | None = None,
    plan: Annotated[Path | None, ("value", "FILE")] = None,
) -> Sequenced:
    """Return the steps that a command is about.

    Parameters
    ----------
    scene, robots, cache, progress : optional
        As of `optimize`; of a plan its steps are taken too.
    method : str, optional
        How it is built: by two robots, or published, the three-robot plan that Bruun et al. print
        for arch25 (default: the first of sequential, cantilever that fits, or the steps of a plan's
        folder).
    plan : pathlib.Path, optional
        A plan's folder, or a CSV file of steps: step, type, bricks, NAME_node of each robot.
    """
    if method is not None and plan is not None:
        raise ProblemError(f"--method {method}: not allowed with --plan; leave one of them out")
    network, named = build_network(scene.parse(robots)), robots if isinstance(robots, tuple) else ()
    given = plan or (None if method else scene.folder)
    if robots and (given is not None or method == PUBLISHED):
        raise StepError(
            f"--robots {','.join(named) or robots}: a plan says itself who holds; leave it out, "
            f"or give --method {' or '.join(METHODS)}"
        )
    if given is not None:
        file = given / "plan.csv" if given.is_dir() else given
        return Sequenced(network, given.stem, read_plan(network.scene, file))
    find_postures(network.scene, cache, progress)
    if method is None:
        return usual_steps(network, named, progress)
    if method != PUBLISHED:
        return Sequenced(network, method, METHODS[method](network, named))
    if not is_reference_arch(network.scene):
        raise SceneError(
            f"scene {network.scene.name}: --method {PUBLISHED} is the printed plan for arch25; "
            "give --plan FILE for another scene"
        )
    return Sequenced(network, method, published_plan(network.scene))


def usual_steps(network: Network, robots: Sequence[str], tell: Tell) -> Sequenced:
    """Return the steps of the first feasible fixed method, else of the best free schedule."""
    for name, method in METHODS.items():
        with suppress(StepError):
            steps = method(network, robots)
            others = "--method, --plan or a plan's folder in place of SCENE names others"
            return Sequenced(network, name, steps, (f"steps: of the {name} method; {others}",))
    plan = optimize(network.scene, FREE, progress=tell)
    note = f"steps: of the best free schedule, {plan.result}"
    return Sequenced(network, plan.title, plan.steps, (note,))


def mortar_of_engine(engine: str | None, mortar: str | None, *, verdicts: bool) -> Mortar | None:
    """Return the mortar that an engine is asked with; that of ``verdicts`` may be theirs alone."""
    own = None if mortar is None else parse_mortar(mortar, "--mortar")
    return None if verdicts and engine not in LIMITED else own


def find_engine(
    network: Network, engine: str | None, mortar: str | None, *, verdicts: bool = False
) -> Engine:
    """Return the requested engine, by default that of the scene."""
    own = mortar_of_engine(engine, mortar, verdicts=verdicts)
    found = make_engine(engine or DEFAULT, network, own)
    # with a mortar of its own an engine is asked where joints open: set by set
    return simplest(found) if engine is None and own is None else found


def posture_trouble(scene: Scene, cache: Path | None, tell: Tell) -> str:
    """Compute or load postures of arms; return the error message if there are none."""
    try:
        find_postures(scene, cache, tell)
    except (ExtraError, SceneError) as error:
        return str(error)
    return ""


def find_prover(
    network: Network,
    mortar: str | None,
    tell: Tell | None,
    *,
    asks: bool,
    stands: Standing | None = None,
) -> BuildProver:
    """Return the prover of stability, with the mortars that a command shows."""
    own = parse_mortar(mortar or "epoxy", "--mortar") if stands is None else stands.mortar
    shown = {"dry": Mortar(friction=own.friction), mortar or _mortar_name(own): own}
    return BuildProver(network, shown if asks else {}, tell)
