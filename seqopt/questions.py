"""What is asked of a scene beside the best grips: one function for each question."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from math import dist, inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pandas as pd

from seqopt._files import parse_json, read_text
from seqopt._registry import Later, required
from seqopt.contact.mortar import Mortar, _with_friction, find_mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import DEFAULT, find_engine
from seqopt.errors import (
    FileError,
    InfeasibleError,
    NothingFoundError,
    SceneError,
    StepError,
    did_you_mean,
)
from seqopt.network.network import Network, build_network
from seqopt.plan.build import GivenSequence, ShownBuild
from seqopt.plan.plan import Plan
from seqopt.plan.solve import graph_of
from seqopt.problem.criteria import Criterion
from seqopt.problem.requirements import Filter, Limit
from seqopt.responses import table
from seqopt.scene.scene import Scene, find_postures, with_robots
from seqopt.scene.scene_file import find_scene, plan_folder
from seqopt.sequence.methods import METHODS
from seqopt.sequence.part import Part, _Place
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Site, Step, StepKind
from seqopt.stability._steps import assess_steps
from seqopt.stability.assessment import Stability
from seqopt.stability.standing import Standing
from seqopt.study import CRITERIA, PUBLISHED, is_reference_arch, published_plan
from seqopt.work import Clock, Tell
from seqopt.workflow import Search, optimize, parse_numbers, pose_build

if TYPE_CHECKING:
    from seqopt.plan.front import Front

FRONT = Later("seqopt.plan.front")  # 20 ms, of one question each
REPLAN = Later("seqopt.plan.replan")
SEARCH = Search()  # it is frozen
FOUR = "F_largest,M_sup,T_max,D_max"
Steps = Sequence[Step] | Path | str
Built = Scene | ShownBuild | Path | str


class Given(NamedTuple):
    """Steps that are given, and where they come from."""

    network: Network
    title: str
    steps: tuple[Step, ...]
    result: str = "given, not optimized"


def find_steps(
    scene: Built,
    steps: Steps | None = None,
    *,
    robots: int | Sequence[str] | None = None,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> Given:
    """Return steps that are given, without an engine; as of `find_build`."""
    if isinstance(scene, ShownBuild):
        return Given(scene.engine.network, scene.title, scene.steps, scene.result)
    steps = plan_folder(scene) if steps is None else steps
    named = isinstance(steps, str) and steps in (*METHODS, PUBLISHED)
    if robots and not (steps is None or (named and steps != PUBLISHED)):
        text = robots if isinstance(robots, int) else ",".join(robots)
        raise StepError(
            f"robots {text}: a plan says itself who holds; leave it out, or give "
            f"{' or '.join(f'method={name!r}' for name in METHODS)}"
        )
    scene = find_scene(scene, robots=robots)
    names = () if robots is None or isinstance(robots, int) else robots
    network = build_network(scene)
    if not (steps is None or named):
        return _read_steps(network, steps)
    find_postures(scene, cache, progress)
    if steps is None:
        for name, method in METHODS.items():  # the first that fits
            with suppress(StepError):
                return Given(network, name, method(network, names))
        plan = optimize(scene, FREE, progress=progress)
        return Given(network, plan.title, plan.steps, plan.result)
    if steps != PUBLISHED:
        return Given(network, str(steps), METHODS[str(steps)](network, names))
    if not is_reference_arch(scene):
        text = f"method {PUBLISHED} is the printed plan for arch25; give a plan for another scene"
        raise SceneError(f"scene {scene.name}: {text}")
    return Given(network, PUBLISHED, published_plan(scene))


def _read_steps(network: Network, steps: Steps) -> Given:
    """Return steps by their folder or file, or these."""
    if not isinstance(steps, str | Path):
        return Given(network, "sequence", tuple(steps))
    path = Path(steps)
    if isinstance(steps, str) and not path.suffix and not path.exists():
        known = (*METHODS, PUBLISHED)
        hint = did_you_mean(steps, known)
        raise StepError(
            f"steps {steps!r} do not exist{hint}; give {', '.join(known)}, a file or steps"
        )
    return Given(network, path.stem, required("read_plan")(network.scene, path))


def find_build(
    scene: Built,
    steps: Steps | None = None,
    engine: str | None = None,
    *,
    mortar: Mortar | str | None = None,
    robots: int | Sequence[str] | None = None,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> ShownBuild:
    """Return a build whose steps are given.

    Parameters
    ----------
    scene : Scene, Plan, GivenSequence, str or pathlib.Path
        A scene as of `optimize`; a plan's folder, whose steps are taken too; or a build, which is
        returned.
    steps : sequence of Step, str or pathlib.Path, optional
        A method, by two robots, or published, the three-robot plan that Bruun et al. print for
        arch25; a plan's folder, or a CSV file of steps; or the steps (default: the first of
        sequential, cantilever that fits, else the best free schedule).
    engine, mortar, robots, cache, progress : optional
        As of `optimize`.

    Examples
    --------
    >>> find_build("arch25", "cantilever")
    <GivenSequence cantilever of arch25: 49 steps>
    """
    if isinstance(scene, ShownBuild):
        return scene
    found = find_steps(scene, steps, robots=robots, cache=cache, progress=progress)
    own = find_engine(found.network, engine, mortar)
    return GivenSequence(own, found.steps, found.title, result=found.result)


def analyze(
    scene: Built | Engine,
    steps: Steps | None = None,
    engine: str | None = None,
    *,
    mortar: Mortar | str | None = None,
    robots: int | Sequence[str] | None = None,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Return the responses of every step, a row each, with the columns of Table A.1.

    Parameters
    ----------
    scene, steps : optional
        As of `find_build`; or an engine, for steps that need not follow each other.
    engine, mortar, robots, cache, progress : optional
        As of `optimize`.

    Returns
    -------
    pandas.DataFrame
        One row per step. Forces are in N, moments in N m, displacements in 1e-3 mm, as the names of
        the columns say. A cell is empty if the robot does not grip. If a scene has several ground
        ends, ``F_sup`` and ``M_sup`` are the largest over them. Two further columns per end, such
        as ``F_sup_25_N`` and ``M_sup_25_Nm`` for the end of brick 25, have its own values; they are
        empty until the end acts.

    Raises
    ------
    MechanismError, SolverError
        As the engine raises them; the message says which step it is.

    Examples
    --------
    >>> found = analyze("arch25", "sequential").select_dtypes("number").round(1)
    >>> found.loc[46, ["step", "bricks", "M_sup_Nm", "D_max_1e-3mm"]].tolist()
    [47.0, 24.0, 66.3, 305.9]
    """
    if not isinstance(scene, Scene | ShownBuild | Path | str):
        return table.analyze(scene, steps)  # type: ignore[arg-type]  # which says what is wrong
    how: dict[str, Any] = {"mortar": mortar, "robots": robots, "cache": cache}
    return find_build(scene, steps, engine, **how, progress=progress).responses()


def assess(  # noqa: PLR0913  # every question is a word of its own
    scene: Built | Network,
    steps: Steps | None = None,
    mortar: Mortar | str = "epoxy",
    margins: Collection[str] | str = "",
    *,
    friction: float | None = None,
    workers: int = 1,
    robots: int | Sequence[str] | None = None,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> tuple[Stability, ...]:
    """Return whether every step stands, with a proof, and the margins that are asked for.

    Parameters
    ----------
    scene, steps : optional
        As of `find_build`; with a scene or its network also steps that do not follow each other.
    mortar : Mortar or str, optional
        What is in the joints: the epoxy of Bruun et al. (3 MPa in tension, 2 MPa in shear), dry
        (nothing), or bond=STRENGTH (Pa) (default: epoxy; of the command dry, then epoxy, which
        alone decides the exit status).
    margins : str or collection of str, optional
        Margins beside the verdicts, or all, with commas between them; each takes several times as
        long.
    friction : float, optional
        Coefficient of friction of all joints (default: 0.466, of 25°, with every mortar).
    workers : int, optional
        Processes to share the steps among (default: 1).
    robots, cache, progress : optional
        As of `optimize`.

    Returns
    -------
    tuple of Stability

    Examples
    --------
    >>> [step.verdict.value for step in assess("chain:bricks=7", "sequential", "dry")][:3]
    ['stands', 'stands', 'stands']
    """
    own = find_mortar(mortar)
    own = own if friction is None else _with_friction(own, friction)
    if isinstance(scene, ShownBuild | Path | str) or isinstance(steps, Path | str | None):
        found = find_steps(scene, steps, robots=robots, cache=cache, progress=progress)  # type: ignore[arg-type]
        scene, steps = found.network, found.steps
    return assess_steps(scene, steps, own, margins or (), progress, workers)


def pareto(  # noqa: PLR0913  # every question is a word of its own
    scene: Scene | Path | str,
    schedule: Schedule | Part | Path | str = FREE,
    aim: str = FOUR,
    *,
    criterion: Criterion | str | None = None,
    rounding: Mapping[str, float] | Sequence[str] = (),
    engine: str = DEFAULT,
    limits: Sequence[Limit | Filter | str] | str = (),
    stands: Standing | Mortar | str | None = None,
    order: str | Sequence[int] | None = None,
    mortar: Mortar | str | None = None,
    robots: int | Sequence[str] | None = None,
    rules: FreeRules | Sequence[str] | str = (),
    time_limit: float = inf,
    cache: Path | str | None = None,
    progress: Tell | None = None,
) -> Front:
    """Find every plan of the free schedule, or of a sequence with open grips, that no other beats.

    Parameters
    ----------
    scene, schedule : optional
        As of `optimize`.
    aim : str, optional
        What is to be small: responses and, of the free schedule, steps or regrips (default:
        F_largest,M_sup,T_max,D_max).
    criterion : Criterion or str, optional
        What a step costs, for the aim minmax: worst-ratio (over the least worst of fixed methods;
        default), another one that does not rank, or its name.
    rounding : mapping of str to float or sequence of str, optional
        Round a number up to multiples of a step (SI units).
    engine, limits, stands, order, mortar, robots, rules, time_limit, cache, progress : optional
        As of `optimize`.

    Returns
    -------
    Front
        Every plan is checked, and that none is missing, unless time is over.

    Examples
    --------
    >>> pareto("chain:bricks=7", aim="F_largest,steps")
    <Front: 2 plans, complete; F_largest, steps, regrips>
    """
    asked = locals()  # all of its parameters
    clock = Clock(time_limit)
    more = dict.fromkeys(("formulation", "robust", "candidates"))
    with clock.needed("posing the problem"):
        own = {"budgets": (), "search": Search(cache=cache)}
        problem = pose_build({**asked, **more, **own})
        goals = [str(goal) for goal in graph_of(problem).goals]
    if not isinstance(rounding, Mapping):
        rounding = parse_numbers("round", rounding, goals)
    tell = progress or (lambda _: None)
    front: Front = FRONT.find_front(problem, rounding=rounding, progress=tell, clock=clock)
    return front


def replan(  # noqa: PLR0913  # every question is a word of its own
    build: Plan | Path | str,
    at: int = 1,
    *,
    lost: Sequence[str] = (),
    missing: Sequence[int | str] = (),
    payload: Sequence[float | str] = (),
    grips: str | None = None,
    durations: Sequence[str] = (),
    robots: int | Sequence[str] | None = None,
    to: Site | int | str | None = None,
    measured: Path | str | None = None,
    criterion: Criterion | str | None = None,
    aim: str | None = None,
    limits: Sequence[Limit | Filter | str] | str = (),
    rules: Sequence[str] | str = (),
    stands: Standing | Mortar | str | None = None,
    formulation: str | None = None,
    engine: str = DEFAULT,
    mortar: Mortar | str | None = None,
    search: Search = SEARCH,
    progress: Tell | None = None,
) -> Plan:
    """Plan the rest of a build from one of its steps, after something has changed.

    Parameters
    ----------
    build : Plan, str or pathlib.Path
        The plan, or the folder that seqopt optimize --out wrote.
    at : int, optional
        Number of the last step that was done (default: 1).
    lost, missing, payload, grips, durations, robots, to : optional
        As of `optimize`: what has changed, and where the rest ends.
    measured : str or pathlib.Path, optional
        Where bricks that stand were measured, m: a CSV file (brick, x, y, z), or an assembly of
        COMPAS.
    criterion, aim, limits, rules : optional
        As of `optimize`; by default those of the plan, to whose rules others are added.
    stands, formulation, engine, mortar, search, progress : optional
        As of `optimize`.

    Returns
    -------
    Plan
        Of the rest; its ``changes`` say what is other than planned.

    Raises
    ------
    InfeasibleError
        If the build cannot go on; it says whether one more robot helps.

    Examples
    --------
    >>> plan = optimize("chain:bricks=7", FREE)
    >>> replan(plan, 4, payload=["rob1=250"]).changes["differs"] is None
    True
    """
    asked, (scene, steps, words) = locals(), _planned(build, lost=bool(lost))
    if words["direction"] and missing:
        raise StepError("missing: bricks are missing in a build; a take-down removes them anyway")
    site, done = Site.after(steps, at), tuple(step for step in steps if step.number <= at)
    built = scene
    if measured is not None:
        built = required("as_measured")(scene, Path(measured), site.bricks)
    built = find_scene(built, payload=payload, grips=grips, durations=durations, robots=robots)
    begin = _Place(site, done) if isinstance(build, Plan) else f"{build}:{at}"
    changed = {"to": to, "lost": lost, "missing": missing, "direction": words.pop("direction")}
    part, own = Part(schedule=FREE, begin=begin, **changed), ("formulation", "engine", "stands")
    every = {name: asked[name] or each for name, each in words.items()}
    every |= {name: asked[name] for name in (*own, "mortar", "search", "progress")}
    every["rules"] = (*words["rules"], *((rules,) if isinstance(rules, str) else rules))
    try:
        new = optimize(built, part, robots=robots, **every)
    except InfeasibleError as error:
        text, count = "", len(built.robots) + 1
        with suppress(InfeasibleError, NothingFoundError, StepError):
            found = optimize(with_robots(built, count), part, robots=count, **every)
            text = f"; or with one more robot that reaches every node: {found.result}"
        raise InfeasibleError(f"{error}{text}") from None
    rest = [step for step in steps if step.number > at]
    changes = REPLAN.compared(new, rest, next(_gone(scene, new, rest, lost, site), ""))
    if measured is not None:
        planned = {brick.name: brick.position for brick in scene.bricks}
        bricks = new.engine.network.scene.bricks
        off, brick = max((dist(b.position, planned[b.name]), b.name) for b in bricks)
        left = float(new.tolerances()["tolerance_mm"].min() / 1000)
        changes |= {"off_m": off, "off_brick": brick, "tolerance_left_m": left}
    return replace(new, changes=changes)


def _gone(
    scene: Scene, new: Plan, rest: Sequence[Step], lost: Sequence[str], site: Site
) -> Iterator[str]:
    """Yield which robot that is lost, or brick that is missing, steps of the old plan need."""
    there, begin = new.engine.network.scene.build_order, new.states.free_rules.begin
    for step in rest:
        if begin is not None and begin.bricks < site.bricks:
            yield f"step {step.number}: brick {there[begin.bricks]} is missing, and comes first"
        holds = zip(scene.robots, step.grips, strict=False)
        for name in (r.name for r, node in holds if node is not None and r.name in lost):
            yield f"step {step.number}: {name} is lost"
        if step.kind is StepKind.PLACE and there[: step.bricks] != scene.build_order[: step.bricks]:
            late = next(b for b in scene.build_order if b != there[scene.build_order.index(b)])
            yield f"step {step.number}: brick {late} is missing, and comes later"


def _planned(
    build: Plan | Path | str, *, lost: bool
) -> tuple[Scene, tuple[Step, ...], dict[str, Any]]:
    """Return scene and steps of a plan, or of its folder, and what it was asked."""
    summary: Any = {}
    if isinstance(build, Plan):
        scene, steps, summary = build.engine.network.scene, build.steps, build.summary()
    else:
        scene, folder = find_scene(build), Path(build)
        steps = required("read_plan")(scene, folder)
        with suppress(FileError):
            summary = parse_json(read_text(folder / "summary.json"), "summary")
    words: dict[str, Any] = REPLAN.asked_before(summary, lost=lost)
    words["criterion"] = words["criterion"] if words["criterion"] in CRITERIA else None
    return scene, steps, words
