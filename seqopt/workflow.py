"""The shortest way: from a scene to a plan in one call."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from seqopt.engines.interface import Engine
from seqopt.engines.registry import DEFAULT, make_engine
from seqopt.errors import ProblemError
from seqopt.graph.formulation import On, find_formulation
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.plan import Plan
from seqopt.plan.solving import in_layers, pose, solve
from seqopt.problem.criteria import WORST_OVER_METHODS
from seqopt.problem.problem import WORST_PEAK, Orders, Problem
from seqopt.problem.requirements import Criterion, Limit
from seqopt.responses.resources import Resources
from seqopt.scene._armed import find_postures
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene, in_order
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.rules import FREE, FreeRules, with_robots
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.schedule_file import find_schedule
from seqopt.study.published import EQUATIONS, find_criterion

SEARCH = "search"  # the order that is sought
RULES = tuple(field.name for field in fields(FreeRules) if field.name != "robots")
FREE_WORDS = ("rules", *(name for name in RULES if name != "candidates"))
"""Options that the free schedule alone has."""
STATE_WORDS = ("aim", "stands")
"""Options with which states of a build are chosen, of whatever schedule, and no candidates."""
ASKED = ("stands", "budgets", "scenarios", "over", "also")
"""Options of `seqopt.pose`, as words or values."""
SHARING = ("workers", "executor", "cache")
"""Options of `seqopt.responses.Resources` that no formulation of states has."""


@dataclass(frozen=True)
class Defaults:
    """What is taken where nothing is asked for, in Python and on the command line alike."""

    criterion: Criterion
    aim: str = ""
    engine: str = DEFAULT


DEFAULTS = {FREE: Defaults(WORST_OVER_METHODS, "minmax"), "any other": Defaults(EQUATIONS)}
"""By schedule; of those with open grips the loop of three robots, or of two without a third."""


def optimize(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = DEFAULT,
    *,
    limits: Sequence[Limit | str] | str = (),
    **options: Any,
) -> Plan:
    """Choose where robots hold over a whole build, or every step of a free schedule.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        The scene, the name of a built-in scene, a few words, or a scene file.
    schedule : Schedule, pathlib.Path or str, optional
        The schedule, its file, a name in `seqopt.sequence.three_robots.SCHEDULES`, or ``"free"``.
    criterion : Criterion or str, optional
        What a step costs, or a name in `seqopt.CRITERIA`.
    formulation : str, optional
        A name in `seqopt.formulations`; here and above, `DEFAULTS` say what is taken otherwise.
    engine : str
        A name in `seqopt.engines.registry.ENGINES`; ``"auto"`` uses the simplest level (`pose`).
    limits : sequence of Limit or str
        Bounds that no step may exceed: ``"payload"``, ``"F_largest=300"``, ``"linear_range=any"``.
    **options
        ``aim``, ``stands``, ``budgets``, ``scenarios`` and ``over`` of `seqopt.pose`, in words;
        ``order``, which may be ``"search"``; ``mortar``, ``robots``, ``candidates``; of
        `seqopt.solve`, the formulation, `seqopt.responses.Resources`, if free of `FreeRules`.

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
    problem = _asked(scene, schedule, (criterion, engine, formulation), limits, options)
    assemble = time.perf_counter() - start
    plan = solve(problem, formulation, **options)
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def _asked(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str | None,
    given: tuple[Criterion | str | None, str, str | None],
    limits: Sequence[Limit | str] | str,
    options: dict[str, Any],
) -> Problem:
    """Return the problem; what options say of it is taken out of them."""
    found = load_scene(scene) if isinstance(scene, str | Path) else scene
    order = options.pop("order", None)
    sought = isinstance(order, str) and order == SEARCH
    made = in_order(found, None if sought else order)
    free = isinstance(schedule, str) and schedule == FREE
    if free and isinstance(options.get("robots"), int):
        made = with_robots(made, options.pop("robots"))
    if not free:
        _refuse(options, FREE_WORDS, f"only the free schedule has it; give schedule={FREE!r}")
    find_postures(made, options.get("cache"), options.get("progress"))
    criterion, name, formulation = given
    engine = make_engine(name, build_network(made), options.pop("mortar", None))
    moves = _free_rules(options) if free else _open(engine.network, schedule, options)
    asked = {name: options.pop(name) for name in ASKED if name in options}
    asked |= {"orders": Orders.TIED} if sought else {}
    states = _of_states(moves, {**options, **asked}, formulation)
    names = SHARING if states else [field.name for field in fields(Resources)]
    resources = Resources(**{name: options.pop(name) for name in names if name in options})
    aim = options.pop("aim", None)
    how = {"limits": limits, "formulation": formulation, "resources": resources, **asked}
    return posed(engine, moves, criterion, aim, **how)


def posed(
    engine: Engine,
    moves: Schedule | FreeRules,
    criterion: Criterion | str | None = None,
    aim: str | None = None,
    *,
    formulation: str | None = None,
    **asked: Any,
) -> Problem:
    """Return the problem of a build, by what people say of it: as of `optimize`, `seqopt.pose`."""
    states = _of_states(moves, {**asked, "aim": aim}, formulation)
    usual = DEFAULTS[FREE if states else "any other"]
    chosen = find_criterion(criterion or usual.criterion)
    of_totals = str(asked.get("over", WORST_PEAK)) != str(WORST_PEAK)  # they are of sums
    return pose(engine, moves, chosen, aim or (not of_totals and usual.aim) or (), **asked)


def _of_states(moves: Schedule | FreeRules, asked: dict[str, Any], formulation: str | None) -> bool:
    """Return whether states are chosen, and not candidates of moves."""
    said = any(asked.get(name) for name in (*STATE_WORDS, "orders"))
    if said or not in_layers(moves) or formulation is None:
        return said or not in_layers(moves)
    return find_formulation(formulation).on in (On.STATES, On.TIMES)


def _open(
    network: Network, schedule: Schedule | Path | str | None, options: dict[str, Any]
) -> Schedule:
    """Return the schedule with open grips; take out of options what they say of it."""
    robots, rule = options.pop("robots", None) or (), options.pop("candidates", None)
    if isinstance(robots, str) or not isinstance(robots, Sequence):
        raise ProblemError(f"robots {short(robots)}: give names, as ['rob1', 'rob2']")
    found = find_schedule(network, schedule, robots)
    return found if rule is None else thin(found, rule)


def _free_rules(options: dict[str, Any]) -> FreeRules:
    """Take out of options what they say of the rules of a free schedule."""
    rules = options.pop("rules", FreeRules())
    if not isinstance(rules, FreeRules):
        raise ProblemError(f"rules {short(rules)}: give a seqopt.FreeRules")
    given = {name: options.pop(name) for name in ("robots", *RULES) if name in options}
    return replace(rules, **given)


def _refuse(options: dict[str, Any], names: Sequence[str], why: str) -> None:
    """Raise an error if an option is given that does not go with the schedule."""
    for name in names:
        if name in options:
            raise ProblemError(f"option {name}: {why}")
