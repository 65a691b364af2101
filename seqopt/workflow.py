"""From a scene to a plan in one call."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seqopt._registry import Later, required
from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import DEFAULT, make_engine
from seqopt.errors import ProblemError, did_you_mean
from seqopt.graph.formulation import Formulation, Run, as_formulation
from seqopt.network.network import Network, build_network
from seqopt.plan.plan import Plan
from seqopt.plan.solve import _solve_run, default_formulation, pose
from seqopt.problem.amounts import parse_goals
from seqopt.problem.criteria import WORST_OVER_METHODS, Criterion
from seqopt.problem.problem import WORST_PEAK, Orders, Problem, RobustAim
from seqopt.problem.requirements import (
    LARGEST,
    UNITS,
    Filter,
    Limit,
    number_word,
    parse_limits,
    split_word,
)
from seqopt.responses._grip_sets import Resources
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene, find_postures
from seqopt.scene.scene_file import find_scene
from seqopt.sequence.part import Part, _find_place, find_schedule, without
from seqopt.sequence.rules import FREE, Direction, FreeRules, parse_rules
from seqopt.sequence.schedule import Schedule, thin
from seqopt.stability.standing import Standing
from seqopt.study import EQUATIONS, find_criterion
from seqopt.work import Clock, Tell

if TYPE_CHECKING:
    from seqopt.scene.scenarios import Scenarios

SCENARIOS = Later("seqopt.scene.scenarios")  # where there are some
SPREADS = ("stiffness", "density", "position", "grips")
SEARCH = "search"  # the order that is sought
SIZE = re.compile(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?) *((?:[kmgt]i?)?b?)", re.IGNORECASE)


DEFAULTS: dict[str, tuple[Criterion, str]] = {
    FREE: (WORST_OVER_METHODS, "minmax"),
    "any other": (EQUATIONS, ""),
}
"""Criterion and aim, in Python and on the command line, by schedule; of those with open grips the
loop of three robots, or of two without a third."""


@dataclass(frozen=True, kw_only=True)
class Search:
    """Settings of a search, and its resources.

    Parameters
    ----------
    options : mapping or sequence of str, optional
        Options of the formulation, as width=10; in Python also a mapping.
    proof : bool, optional
        If not, with cascade or rank_search, compute only the responses that the search meets, about
        a fifth; how far the choice is from the optimum stays unknown.
    time_limit : float, optional
        Seconds that posing, choosing and proof may take; the best choice by then has a lower bound;
        without proof, where choosing and computing are one, the moves that were chosen by then.
    workers : int, optional
        Processes to share the work among; up to 338 bricks two search as long as one; what
        stands of large plans commands prove in 0.7 of the time (default: 1).
    executor : concurrent.futures.Executor, optional
        Who does the work in place of workers, as ``client.get_executor()`` of dask.
    cache : str or pathlib.Path, optional
        Where robots have arms: keep their postures there, and use what is there.
    max_memory : float or str, optional
        What responses and costs may take, bytes, or as 500MB or 2GB (default: four fifths of what
        is free); of a free schedule states and moves, with a bound where it ends.

    Examples
    --------
    >>> Search(time_limit=60, workers=2).workers
    2
    """

    options: Mapping[str, Any] | Sequence[str] = field(default_factory=dict)
    proof: bool = True
    time_limit: float = math.inf
    workers: int = 1
    executor: Executor | None = None
    cache: Path | str | None = None
    max_memory: float | str | None = None

    def parse_options(self, formulation: Formulation) -> dict[str, Any]:
        """Return the options of a formulation, and the memory if it takes one."""
        out = formulation.parse_options(self.options)
        if self.max_memory is not None and "max_memory" in formulation.options:
            out["max_memory"] = self.memory
        return out

    @property
    def memory(self) -> float | None:
        """The memory that it may take, bytes; sizes are as ``2GB``, ``500 MB`` or ``1.5GiB``.

        >>> Search(max_memory="1.5GB").memory
        1500000000.0
        """
        if not isinstance(text := self.max_memory, str):
            return text
        found = SIZE.fullmatch(text.strip())
        if found is None or not 0 < float(found[1]) < LARGEST:
            raise ProblemError(f"--max-memory {text}: give a size, as 500MB or 2GB")
        unit = found[2].upper()
        power = "BKMGT".find(unit[:1] or "B")
        return float(found[1]) * float(1024 if "I" in unit else 1000) ** power


def parse_numbers(
    where: str, texts: Iterable[str], known: Sequence[str], *, zero: bool = False
) -> dict[str, float]:
    """Parse positive numbers from ``NAME=VALUE``, by name."""
    out: dict[str, float] = {}
    for text in texts:
        name, value = split_word(text)
        if name not in known:
            hint, names = did_you_mean(name, known), ", ".join(known)
            raise ProblemError(f"{where} {text} does not exist{hint}; give one of {names}")
        unit = UNITS.get(name) or UNITS.get(name[0], "")
        out[name] = number_word(value, f"{where} {text}", unit, zero=zero)
    return out


@dataclass(frozen=True, kw_only=True)
class Robust:
    """Scenarios for a robust plan, and what counts of them.

    Parameters
    ----------
    measure : RobustAim or str, optional
        What is to be as small as possible over all scenarios, in place of ``formulation``:
        worst-peak (the largest cost of any step; default, also where only samples are described),
        worst-total (the largest total), or cvar=0.9 (the mean total of the worst tenth).
    count : int, optional
        How many samples of the scene are drawn (default: 30).
    seed : int, optional
        Which samples are drawn (default: 0).
    vary : mapping of str to float or sequence of str, optional
        How far samples are from the scene: stiffness=3 (of each joint, by a factor up to it, up or
        down), density=0.1 (of each brick, up to this share), position=0.002 (of each brick and
        joint, up to so many m); these are the defaults; grips=2 (of grips that are not rigid, by a
        factor up to it).
    scenes : Scenarios or sequence of Scene, optional
        Scenarios in place of drawn ones.

    Examples
    --------
    >>> scene = find_scene("arch25")
    >>> Robust(vary={"stiffness": 2}, count=3).draw(scene).settings["stiffness"]
    [0.5, 2.0]
    """

    measure: RobustAim | str = WORST_PEAK
    count: int = 30
    seed: int = 0
    vary: Mapping[str, float] | Sequence[str] = field(default_factory=dict)
    scenes: Scenarios | Sequence[Scene] = ()

    def draw(self, scene: Scene) -> Scenarios:
        """Draw the samples of a scene."""
        vary = self.vary
        if not isinstance(vary, Mapping):
            vary = parse_numbers("vary", vary, SPREADS, zero=True)
        spread: dict[str, Any] = {"stiffness": 3.0, "grips": 1.0, **vary}
        factor, grips = spread["stiffness"], spread["grips"]
        for name, each in (("stiffness", factor), ("grips", grips)):
            if each < 1:
                raise ProblemError(f"vary {name}={each:g}: give a factor from 1")
        if grips > 1 and scene.grip_kinds.rigid:
            raise ProblemError(
                f"vary grips={grips:g}: they are rigid; say how stiff with --grips or with_grips"
            )
        spread |= {"stiffness": (1 / factor, factor), "grips": (1 / grips, grips)}
        drawn: Scenarios = SCENARIOS.scenarios(scene, count=self.count, seed=self.seed, **spread)
        return drawn


def optimize(  # noqa: PLR0913  # every question is a word of its own
    scene: Scene | str | Path,
    schedule: Schedule | Part | Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = DEFAULT,
    *,
    aim: str | None = None,
    limits: Sequence[Limit | Filter | str] | str = (),
    budgets: Sequence[str] | str = (),
    stands: Standing | Mortar | str | None = None,
    robust: Robust | None = None,
    order: str | Sequence[int] | None = None,
    mortar: Mortar | str | None = None,
    robots: int | Sequence[str] | None = None,
    candidates: str | None = None,
    rules: FreeRules | Sequence[str] | str = (),
    search: Search = Search(),  # it is frozen
    progress: Tell | None = None,
) -> Plan:
    """Choose where robots hold over a whole build, or every step of a free schedule.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        The scene, the name of a built-in scene, a few words, a scene file, or a plan's folder.
    schedule : Schedule, Part, pathlib.Path or str, optional
        The schedule, its file, a name in `seqopt.sequence.methods.SCHEDULES`, or ``"free"``; a
        `Part` says where the build begins and ends.
    criterion : Criterion or str, optional
        What a step costs: equations-2-3 (of Bruun et al.), worst-ratio (over the least worst of
        fixed methods), or responses to rank with weights, as T_max,M_sup=2,F_move; by default
        equations-2-3, with --aim, --stands or --schedule free worst-ratio.
    formulation : str, optional
        Which mathematical program chooses (default: overlap_dp, which is exact and the fastest,
        labels with budgets, minimax with worst-peak over scenarios; schedule_search with an aim,
        ``stands`` or a free schedule, makespan_labels where a makespan counts, order_search where
        the order is sought).
    engine : str
        What computes responses (default: auto): compliance: exactly rigid bricks, fast; frame:
        stiff bars, a slow independent check; discrete: joints that open and slip; auto: compliance,
        and discrete where that is not enough.
    aim : str, optional
        What is to be as small as possible, the most important first: minmax (the worst step), sum,
        steps, regrips, travel, makespan (time), a response, as T_max, and others; these are bond,
        friction, tilt, and sum(RESPONSE); the worst step is by the criterion, by default
        worst-ratio, and a makespan needs durations (default: minmax of a free schedule; of others
        the total of what their moves cost); with ``order="search"`` the best order of the bricks is
        found too.
    limits : sequence of Limit, Filter or str
        What no step may exceed: payload (of every robot), or RESPONSE=VALUE in SI units, as
        F_largest=300, of lengths with their unit too, as D_max=20um; also where no grip is open.
        Plans keep the linear range wherever one does: linear_range=any lifts that, 0.5 asks for
        half of it in every step.
    budgets : sequence of str
        Cap on a total over the build, with the formulations labels, lagrangian, overlap_mip and
        overlap_lp: travel=0.8 (of what the optimum without budgets travels), travel=3.5m,
        steps_over:F_largest=250:10 (at most 10 steps over 250 N), robot_use:rob1=100:5 (at most 5
        in which rob1 carries over 100 N); with an aim or a free schedule: steps=N, regrips=N,
        travel=3.5m, makespan=600s or sum(RESPONSE)=VALUE.
    stands : Standing, Mortar or str, optional
        What every state must be proven to stand with: ``"dry"``, ``"epoxy"``, a strength.
    robust : Robust, optional
        Over which scenarios, and what counts of them.
    order : str or sequence of int, optional
        In which order bricks are placed, if not in the scene's own: reversed, ends (from all ground
        ends at once), the names of all bricks, as 1..12,25..13, or search for the best.
    mortar : Mortar or str, optional
        What holds the joints, in verdicts and in the engines auto and discrete: epoxy, that of
        Bruun et al. (default), dry, nothing, or bond=STRENGTH (Pa).
    robots : int or sequence of str, optional
        How many robots there are (those of the scene first, further ones reach every node), or the
        names of those that take part where the steps leave that open; in the order in which they
        place their first bricks (default: the first of the scene whose reach allows the build).
    candidates : str, optional
        Look at fewer nodes per move: near:12 for those at most 12 joints from the newest bricks;
        makes any formulation a heuristic (free: of grips on bricks that stand; what is proven holds
        among these).
    rules : FreeRules, str or sequence of str, optional
        What robots of a free schedule may do: least_grips=N (2, or 1 of two robots, from the second
        brick on), newest=either|placing|free (where the newest brick is held), regrips=N|any
        (between two bricks), placers=NAME,NAME|any, payload=kept|ignored,
        ending=held|released|one-by-one (how robots leave the finished structure),
        candidates=near:JOINTS|all.
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
    asked, start = locals(), time.perf_counter()  # all of its parameters
    clock = Clock(search.time_limit)
    with clock.needed("posing the problem"):
        problem = pose_build(asked)
        found = as_formulation(formulation or default_formulation(problem))
        options = search.parse_options(found)
    run = Run(search.time_limit, progress, search.proof, options, clock=clock)
    assemble = time.perf_counter() - start
    plan = _solve_run(problem, found, run)
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def pose_build(asked: Mapping[str, Any]) -> Problem:
    """Return the problem that `optimize` solves, of the values of all of its parameters."""
    given, robots, order = asked["schedule"], asked["robots"], asked["order"]
    stands, robust, search = asked["stands"], asked["robust"], asked["search"]
    if isinstance(asked["aim"], str):
        parse_goals(asked["aim"])  # an unknown name is said before what a scene lacks
    part = given if isinstance(given, Part) else Part(schedule=given)
    free, sought = part.schedule == FREE, order == SEARCH
    scene = find_scene(asked["scene"], order=None if sought else order, robots=robots)
    robots = None if isinstance(robots, int) else robots
    if part.direction == Direction.TAKE_DOWN.value and not free:
        raise ProblemError(f"direction {part.direction}: it goes with schedule={FREE!r}")
    place = part.find_begin(scene)
    begin = place.site
    if begin and place.done and isinstance(stands, Standing) and stands.curing is not None:
        begin = replace(begin, ages=required("mortar_ages")(scene, place.done, stands))
    if begin is not None and (part.lost or part.missing):
        scene, begin = without(scene, begin, part.lost, [*map(int, part.missing)])
    if part.lost:
        robots = [robot.name for robot in scene.robots if robot.name not in part.lost]
    end = _find_place(part.to, "to", scene).site
    find_postures(scene, search.cache, asked["progress"])
    own = make_engine(asked["engine"], build_network(scene), asked["mortar"])
    moves = _find_moves(own.network, part, robots, asked["candidates"], asked["rules"])
    if begin is not None or end is not None:
        moves = replace(moves.free(), begin=begin, finish=end)
    limits: Sequence[Any] = parse_limits(asked["limits"], scene)
    states = asked["aim"] or stands or sought or not moves.has_pairs
    states = states or any(isinstance(each, Filter) for each in limits)
    over: RobustAim | str = WORST_PEAK if robust is None else robust.measure
    usual, minimized = DEFAULTS[FREE if states else "any other"]
    minimized = minimized if str(over) == str(WORST_PEAK) else ""  # totals are of sums
    return pose(
        own,
        moves,
        find_criterion(asked["criterion"] or usual),
        asked["aim"] or minimized or (),
        limits,
        budgets=asked["budgets"],
        stands=stands,
        scenarios=() if robust is None else robust.scenes or robust.draw(scene),
        over=over,
        orders=Orders.TIED if sought else None,
        resources=Resources(search.workers, search.executor, None if states else asked["progress"]),
    )


def _find_moves(
    network: Network,
    part: Part,
    robots: int | Sequence[str] | None,
    candidates: str | None,
    rules: FreeRules | Sequence[str] | str,
) -> Schedule | FreeRules:
    """Return a schedule with open grips, or the rules of the free one, from words or values."""
    if isinstance(part.schedule, str) and part.schedule == FREE:
        given = {"robots": robots, "candidates": candidates, "direction": part.direction}
        given = {name: each for name, each in given.items() if each is not None}
        return replace(parse_rules(rules), **dict[str, Any](given))
    if rules:
        raise ProblemError(f"rules: only the free schedule has them; give schedule={FREE!r}")
    if isinstance(robots, str) or not isinstance(robots, Sequence | None):
        raise ProblemError(f"robots {short(robots)}: give names, as ['rob1', 'rob2']")
    opened = find_schedule(network, part.schedule, robots or ())
    return opened if candidates is None else thin(opened, candidates)
