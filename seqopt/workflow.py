"""The shortest way: from a scene to a plan in one call."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, overload

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ProblemError
from seqopt.graph.layers.layers import Layers, candidate_layers
from seqopt.graph.states.states import States, build_states, within
from seqopt.network.build import build_network
from seqopt.plan.free_plan import FreePlan
from seqopt.plan.plan import Plan
from seqopt.plan.shares import with_budgets
from seqopt.plan.solving import solve
from seqopt.problem.budgets import parse_budgets, parse_caps
from seqopt.problem.criteria import WORST_OVER_METHODS
from seqopt.problem.requirements import Criterion, Limit
from seqopt.problem.standing import Standing
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.checks import short
from seqopt.scene.orders import in_order
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.free_rules import FREE, FreeRules, with_robots
from seqopt.sequence.schedule import Schedule, thin
from seqopt.sequence.schedule_file import find_schedule
from seqopt.study.presets import EQUATIONS, find_criterion

RULES = tuple(field.name for field in fields(FreeRules) if field.name != "robots")
FREE_WORDS = ("rules", *(name for name in RULES if name != "candidates"))
"""Options that the free schedule alone has."""
STATE_WORDS = ("aim", "stands")
"""Options with which states of a build are chosen, of whatever schedule, and no candidates."""
SHARING = ("workers", "executor", "cache")
"""Options of `seqopt.responses.Resources` that no formulation of states has."""


@dataclass(frozen=True)
class Defaults:
    """What is taken where nothing is asked for, in Python and on the command line alike.

    ``criterion``: what a step costs; ``formulation``, ``with_budgets``: what chooses, without and
    with budgets; ``engine``: what computes responses; ``aim``: what a free schedule is to make as
    small as possible.
    """

    criterion: Criterion
    formulation: str
    with_budgets: str = ""
    engine: str = USUAL
    aim: str = "minmax"

    def chosen_by(self, budgets: object) -> str:
        """Return the formulation, which has to take budgets where there are any."""
        return self.with_budgets if budgets else self.formulation


DEFAULTS = {
    FREE: Defaults(WORST_OVER_METHODS, "schedule_search"),
    "any other": Defaults(EQUATIONS, "overlap_dp", "labels"),
}
"""By schedule; of those with open grips the loop of three robots, or of two without a third."""


@overload
def optimize(
    scene: Scene | str | Path,
    schedule: Literal["free"],
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = Defaults.engine,
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> FreePlan: ...


@overload
def optimize(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = Defaults.engine,
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> Plan: ...


def optimize(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = Defaults.engine,
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> Plan | FreePlan:
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
        A name in `seqopt.engines.registry.ENGINES`; ``"auto"`` uses the simplest sufficient model.
    limits : sequence of Limit
        Bounds that no step may exceed, whether or not a grip is open in it.
    **options
        Of `seqopt.solve`, the formulation, `seqopt.responses.Resources`, if free of `FreeRules`;
        ``aim`` and ``stands`` of `build_states` with every schedule; ``order``, ``mortar``,
        ``robots``; ``budgets``, ``candidates`` in words.

    Returns
    -------
    Plan or FreePlan

    Raises
    ------
    SeqoptError
        With one line that says what to change.

    Examples
    --------
    >>> optimize("arch25", "free", "worst-ratio-published", aim="minmax,steps")
    FreePlan('arch25', 50 steps, minmax 0.840088, steps 50, optimal)
    """
    kind = FREE if any(word in options for word in STATE_WORDS) else _kind(schedule)
    usual = DEFAULTS[kind].chosen_by(options.get("budgets") if kind != FREE else None)
    problem, assemble = _pose(scene, schedule, (criterion, engine), limits, options)
    plan = solve(problem, formulation or usual, **options)
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def _kind(schedule: object) -> str:
    """Return which of `DEFAULTS` are those of a schedule."""
    return FREE if isinstance(schedule, str) and schedule == FREE else "any other"


def _pose(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str | None,
    asked: tuple[Criterion | str | None, str],
    limits: Sequence[Limit],
    options: dict[str, Any],
) -> tuple[Layers | States, float]:
    """Return the problem, and the seconds to it; what options say of it is taken out of them."""
    start = time.perf_counter()
    found = load_scene(scene) if isinstance(scene, str | Path) else scene
    made, free = in_order(found, options.pop("order", None)), _kind(schedule) == FREE
    states = free or any(word in options for word in STATE_WORDS)
    if free and isinstance(options.get("robots"), int):
        made = with_robots(made, options.pop("robots"))
    if not free:
        _refuse(options, FREE_WORDS, f"only the free schedule has it; give schedule={FREE!r}")
    engine = make_engine(asked[1], build_network(made), options.pop("mortar", None))
    problem: Layers | States
    if states:
        rules = _free_rules(options) if free else _open(engine, schedule, options)
        words = {name: options.pop(name, None) for name in STATE_WORDS}
        problem = posed_free(engine, asked[0], limits=limits, rules=rules, **words)
        problem = replace(problem, resources=_resources(options, SHARING))
        if caps := parse_caps(options.pop("budgets", ())):
            problem = within(problem, caps)
    else:
        opened = _open(engine, schedule, options)
        problem = posed(engine, opened, asked[0], limits, *_means(options))
    return problem, time.perf_counter() - start


def posed(
    engine: Engine,
    schedule: Schedule,
    criterion: Criterion | str | None = None,
    limits: Sequence[Limit] = (),
    budgets: Sequence[str] = (),
    resources: Resources = HERE,
) -> Layers:
    """Return the problem of a schedule with open grips, by what people say of it.

    ``engine``: what computes responses; it has the scene. ``schedule``: with the grips that are
    open. ``criterion``: as of `optimize`. ``limits``: as of `seqopt.pose`. ``budgets``: caps on
    totals over the build, as of `seqopt.problem.budgets.parse_budgets`. ``resources``: what
    the computation may use.
    """
    asked = parse_budgets(budgets)
    chosen = find_criterion(criterion or DEFAULTS["any other"].criterion)
    counted = [budget.response for budget in asked if budget.response]
    return with_budgets(
        candidate_layers(engine, schedule, chosen, limits, counted, resources), asked
    )


def posed_free(
    engine: Engine,
    criterion: Criterion | str | None = None,
    aim: str | None = None,
    *,
    rules: FreeRules | Schedule | None = None,
    limits: Sequence[Limit] = (),
    stands: Standing | Mortar | str | None = None,
) -> States:
    """Return the problem of a free schedule, or of states of another, by what people say of it.

    ``engine``: what computes responses; it has the scene. ``criterion``: as of `optimize`. ``aim``:
    what is to be as small as possible. ``limits``, ``stands``: as of `seqopt.pose_free`.
    """
    usual = DEFAULTS[FREE]
    chosen = find_criterion(criterion or usual.criterion)
    return build_states(engine, rules or FreeRules(), chosen, aim or usual.aim, limits, stands)


def _open(
    engine: Engine, schedule: Schedule | Path | str | None, options: dict[str, Any]
) -> Schedule:
    """Return the schedule with open grips; take out of options what they say of it."""
    robots, rule = options.pop("robots", None) or (), options.pop("candidates", None)
    if isinstance(robots, str) or not isinstance(robots, Sequence):
        raise ProblemError(f"robots {short(robots)}: give names, as ['rob1', 'rob2']")
    found = find_schedule(engine.network, schedule, robots)
    return found if rule is None else thin(found, rule)


def _means(options: dict[str, Any]) -> tuple[Sequence[str], Resources]:
    """Take out of options what they say of budgets and resources."""
    names = [field.name for field in fields(Resources)]
    return options.pop("budgets", ()), _resources(options, names)


def _resources(options: dict[str, Any], names: Sequence[str]) -> Resources:
    """Take out of options what they say of resources."""
    return Resources(**{name: options.pop(name) for name in names if name in options})


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
