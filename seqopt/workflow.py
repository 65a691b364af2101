"""From a scene to a plan in one call."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import DEFAULT, make_engine
from seqopt.errors import ProblemError
from seqopt.graph.formulation import find_formulation
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.plan import Plan
from seqopt.plan.pose import in_layers, pose
from seqopt.plan.solve import solve
from seqopt.problem.criteria import WORST_OVER_METHODS
from seqopt.problem.filters import Filter, parse_limits
from seqopt.problem.problem import WORST_PEAK, Orders, Problem, RobustAim
from seqopt.problem.requirements import Criterion, Limit
from seqopt.problem.standing import Standing
from seqopt.responses.resources import Resources
from seqopt.scene._armed import find_postures
from seqopt.scene._checks import short
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scenarios import scenarios as sample
from seqopt.scene.scene import Scene, in_order
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.rules import FREE, FreeRules, parse_rules, with_robots
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.schedule_file import find_schedule
from seqopt.study.published import EQUATIONS, find_criterion
from seqopt.work.progress import Tell

SEARCH = "search"  # the order that is sought


@dataclass(frozen=True)
class Defaults:
    """Defaults of criterion, aims and engine, in Python and on the command line."""

    criterion: Criterion
    aim: str = ""
    engine: str = DEFAULT


DEFAULTS = {FREE: Defaults(WORST_OVER_METHODS, "minmax"), "any other": Defaults(EQUATIONS)}
"""By schedule; of those with open grips the loop of three robots, or of two without a third."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """Settings of a search, and its resources.

    Parameters
    ----------
    proof, lazy : bool, optional
        As of `seqopt.solve`.
    time_limit : float, optional
        Seconds of choosing; the best choice by then has a lower bound.
    workers, executor, max_memory : optional
        As of `seqopt.responses.Resources`.
    cache : str or pathlib.Path, optional
        A folder that keeps the postures of arms.
    options : mapping of str to object, optional
        What the formulation has options for, as ``{"width": 10}``.

    Examples
    --------
    >>> Search(time_limit=60, workers=2).workers
    2
    """

    proof: bool = True
    lazy: bool = False
    time_limit: float = math.inf
    workers: int = 1
    executor: Executor | None = None
    cache: Path | str | None = None
    max_memory: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Robust:
    """Scenarios for a robust plan, and its aim over them.

    Parameters
    ----------
    aim : RobustAim or str, optional
        ``"worst-peak"``, ``"worst-total"`` or as ``"cvar=0.9"``.
    vary : mapping of str to float, optional
        How far samples are from the scene: ``stiffness`` of joints and ``grips`` of robots by a
        factor, ``density`` by a share, ``position`` by m.
    count, seed : int, optional
        How many samples are drawn, and which.
    scenes : Scenarios or sequence of Scene, optional
        Scenarios in place of drawn ones.

    Examples
    --------
    >>> Robust(vary={"stiffness": 2}, count=3).draw(load_scene("arch25")).settings["stiffness"]
    [0.5, 2.0]
    """

    aim: RobustAim | str = WORST_PEAK
    vary: Mapping[str, float] = field(default_factory=dict)
    count: int = 30
    seed: int = 0
    scenes: Scenarios | Sequence[Scene] = ()

    def draw(self, scene: Scene) -> Scenarios:
        """Draw the samples of a scene."""
        spread = {"stiffness": 3.0, "grips": 1.0, **self.vary}
        factor, grips = spread.pop("stiffness"), spread.pop("grips")
        for name, each in (("stiffness", factor), ("grips", grips)):
            if each < 1:
                raise ProblemError(f"vary {name}={each:g}: give a factor from 1")
        if grips > 1 and scene.grip_kinds.rigid:
            raise ProblemError(
                f"vary grips={grips:g}: they are rigid; say how stiff with --grips or with_grips"
            )
        factors = (1 / factor, factor)
        drawn = sample(scene, stiffness=factors, count=self.count, seed=self.seed, **spread)
        return drawn if grips == 1 else drawn.with_grips((1 / grips, grips))


def optimize(  # noqa: PLR0913  # every question is a word of its own
    scene: Scene | str | Path,
    schedule: Schedule | Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = DEFAULT,
    *,
    aim: str | None = None,
    limits: Sequence[Limit | Filter | str] | str = (),
    budgets: Sequence[str] | str = (),
    stands: Standing | Mortar | str | None = None,
    also: Sequence[str] = (),
    robust: Robust | None = None,
    order: str | Sequence[int] | None = None,
    mortar: Mortar | str | None = None,
    robots: int | Sequence[str] | None = None,
    candidates: str | None = None,
    rules: FreeRules | Sequence[str] | str | None = None,
    search: Search = Search(),  # it is frozen
    progress: Tell | None = None,
) -> Plan:
    """Choose where robots hold over a whole build, or every step of a free schedule.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        The scene, the name of a built-in scene, a few words, or a scene file.
    schedule : Schedule, pathlib.Path or str, optional
        The schedule, its file, a name in `seqopt.sequence.methods.SCHEDULES`, or ``"free"``.
    criterion : Criterion or str, optional
        What a step costs, or a name in `seqopt.CRITERIA`.
    formulation : str, optional
        A name in `seqopt.formulations`; here and above, `DEFAULTS` say what is taken otherwise.
    engine : str
        A name in `seqopt.engines.registry.ENGINES`; ``"auto"`` uses the simplest level (`pose`).
    aim : str, optional
        Minimized goals, the most important first: ``"minmax,steps"``.
    limits : sequence of Limit, Filter or str
        Bounds that no step may exceed: ``"payload"``, ``"F_largest=300"``, ``"linear_range=any"``;
        and filters, by the names by which they were registered.
    budgets, stands, also : optional
        As of `seqopt.pose`: ``"travel=3.5m"``, ``"dry"``.
    robust : Robust, optional
        Over which scenarios, and what counts of them.
    order : str or sequence of int, optional
        In which order bricks are placed: ``"ends"``, all names, or ``"search"``.
    mortar : Mortar or str, optional
        What holds the joints, for engines that ask.
    robots : int or sequence of str, optional
        Who takes part; of a free schedule also how many.
    candidates : str, optional
        Nodes to look at: ``"near:12"``.
    rules : FreeRules, str or sequence of str, optional
        Of a free schedule: ``"least_grips=1"``.
    search : Search, optional
        How it is searched, and what that may use.
    progress : callable, optional
        Called with the progress.

    Returns
    -------
    Plan

    Raises
    ------
    SeqoptError
        With one line that says what to change.

    Examples
    --------
    >>> optimize("arch25", "free", "worst-ratio-published", aim="minmax,steps")
    Plan('arch25', 'free', by schedule_search: 50 steps, minmax 0.840088, steps 50, optimal)
    """
    start = time.perf_counter()
    found = load_scene(scene) if isinstance(scene, str | Path) else scene
    sought = isinstance(order, str) and order == SEARCH
    found = in_order(found, None if sought else order)
    free = isinstance(schedule, str) and schedule == FREE
    if free and isinstance(robots, int):
        found, robots = with_robots(found, robots), None
    find_postures(found, search.cache, progress)
    own = make_engine(engine, build_network(found), mortar)
    moves = _find_moves(own.network, schedule, robots, candidates, rules)
    shared = Resources(search.workers, search.executor)
    options, tell = dict(search.options), progress
    asked = parse_limits(limits, own.network.scene)
    states = _chooses_states(moves, formulation, asked, (aim, stands, sought))
    if not states:
        shared, tell = replace(shared, max_memory=search.max_memory, progress=progress), None
    elif search.max_memory is not None:
        options["max_memory"] = search.max_memory
    words: dict[str, Any] = {"limits": asked, "budgets": budgets, "stands": stands, "also": also}
    words |= {"sought": sought, "resources": shared}
    if robust is not None:
        words |= {"scenarios": robust.scenes or robust.draw(found), "over": robust.aim}
    problem = _pose_words(own, moves, criterion, aim, states=states, **words)
    assemble = time.perf_counter() - start
    plan = solve(
        problem,
        formulation,
        proof=search.proof,
        lazy=search.lazy,
        time_limit=search.time_limit,
        progress=tell,
        **options,
    )
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def _pose_words(
    engine: Engine,
    moves: Schedule | FreeRules,
    criterion: Criterion | str | None,
    aim: str | None,
    *,
    states: bool,
    sought: bool,
    over: RobustAim | str = WORST_PEAK,
    **words: Any,
) -> Problem:
    """Pose a problem, by default with the usual criterion and aims of states or of candidates.

    ``sought``: whether the best order of the bricks is; ``words``: as of `pose`.
    """
    usual = DEFAULTS[FREE if states else "any other"]
    of_totals = str(over) != str(WORST_PEAK)  # they are of sums
    goals = aim or (not of_totals and usual.aim) or ()
    orders = Orders.TIED if sought else None
    found = find_criterion(criterion or usual.criterion)
    return pose(engine, moves, found, goals, over=over, orders=orders, **words)


def _chooses_states(
    moves: Any, formulation: str | None, limits: Sequence[object], others: Sequence[object]
) -> bool:
    """Return whether states are chosen, not candidates.

    ``moves``: a schedule or rules, or their name; ``others``: options that need states.
    """
    filtered = any(isinstance(each, Filter) for each in limits)
    if any(others) or filtered or moves == FREE or not in_layers(moves):
        return True
    return formulation is not None and find_formulation(formulation).of_states


def _find_moves(
    network: Network,
    schedule: Schedule | Path | str | None,
    robots: int | Sequence[str] | None,
    candidates: str | None,
    rules: FreeRules | Sequence[str] | str | None,
    where: str = "rules",
) -> Schedule | FreeRules:
    """Return a schedule with open grips, or the rules of the free one, from words or values.

    ``where``: rules, for messages.
    """
    if isinstance(schedule, str) and schedule == FREE:
        found = parse_rules(() if rules is None else rules, where=where)
        given: dict[str, Any] = {"robots": robots, "candidates": candidates}
        return replace(found, **{name: each for name, each in given.items() if each is not None})
    if rules is not None:
        give = f"--schedule {FREE}" if where.startswith("-") else f"schedule={FREE!r}"
        raise ProblemError(f"{where}: only the free schedule has them; give {give}")
    if isinstance(robots, str) or not isinstance(robots, Sequence | None):
        raise ProblemError(f"robots {short(robots)}: give names, as ['rob1', 'rob2']")
    opened = find_schedule(network, schedule, robots or ())
    return opened if candidates is None else thin(opened, candidates)
