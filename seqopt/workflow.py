"""The shortest way: from a scene to a plan in one call."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal, overload

from seqopt.engines.registry import make_engine
from seqopt.errors import ProblemError, did_you_mean
from seqopt.network.build import build_network
from seqopt.placement.criteria import WORST_OVER_METHODS
from seqopt.placement.free_plan import FreePlan
from seqopt.placement.free_problem import FreeProblem, pose_free
from seqopt.placement.plan import Plan
from seqopt.placement.problem import pose
from seqopt.placement.requirements import Criterion, Limit
from seqopt.placement.solving import solve
from seqopt.responses.resources import Resources
from seqopt.scene.checks import short
from seqopt.scene.orders import in_order
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.free_rules import FREE, FreeRules, with_robots
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.schedule_file import find_schedule
from seqopt.study.presets import CRITERIA, EQUATIONS

RULES = tuple(field.name for field in fields(FreeRules) if field.name != "robots")
FREE_WORDS = ("aim", "rules", "robots", "stands", *RULES)
"""Options that the free schedule alone has.

``robots`` are names, or how many take part: further ones than the scene's are mobile.
"""
DEFAULTS: dict[str, tuple[Criterion, str]] = {
    FREE: (WORST_OVER_METHODS, "schedule_search"),
    "any other": (EQUATIONS, "overlap_dp"),
}
"""Criterion and formulation by schedule, where none is given."""
Asked = tuple[Criterion | str | None, str | None, str]  # criterion, formulation, engine


@overload
def optimize(
    scene: Scene | str | Path,
    schedule: Literal["free"],
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = "auto",
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> FreePlan: ...


@overload
def optimize(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str = "three-robot",
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = "auto",
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> Plan: ...


def optimize(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str = "three-robot",
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = "auto",
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> Plan | FreePlan:
    """Choose where robots hold over a whole build, or every step of a free schedule.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        The scene, the name of a built-in scene, a few words, or a scene file.
    schedule : Schedule, pathlib.Path or str
        The schedule, its file, a name in `seqopt.sequence.three_robots.SCHEDULES`, or ``"free"``.
    criterion : Criterion or str, optional
        What a step costs, or a name in `seqopt.CRITERIA`; by default that of `DEFAULTS`.
    formulation : str, optional
        A name in `seqopt.formulations`, or for the free schedule; by default that of `DEFAULTS`.
    engine : str
        A name in `seqopt.engines.registry.ENGINES`; ``"auto"`` uses the simplest sufficient model.
    limits : sequence of Limit
        Bounds that no step with an open grip may exceed; in the free schedule, no step at all.
    **options
        Options of `seqopt.solve`, the formulation and `seqopt.responses.Resources` (``workers=2``);
        an ``order``; if free, ``robots``, and options of `seqopt.FreeRules`, `seqopt.pose_free`.

    Returns
    -------
    Plan or FreePlan

    Raises
    ------
    SeqoptError
        With one line that says what to change; see `seqopt.errors`.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.optimize("arch25", "free", "worst-ratio-published", aim="minmax,steps")
    FreePlan('arch25', 50 steps, minmax 0.840088, steps 50, optimal)
    """
    found = load_scene(scene) if isinstance(scene, str | Path) else scene
    made = in_order(found, options.pop("order", None))
    if isinstance(schedule, str) and schedule == FREE:
        return _optimize_free(made, (criterion, formulation, engine), limits, options)
    return _optimize(made, schedule, (criterion, formulation, engine), limits, options)


def _optimize(
    scene: Scene,
    schedule: Schedule | Path | str,
    asked: Asked,
    limits: Sequence[Limit],
    options: dict[str, Any],
) -> Plan:
    """Return the plan of a schedule with open grips."""
    start, (criterion, formulation) = time.perf_counter(), DEFAULTS["any other"]
    _refuse(options, FREE_WORDS, f"only the free schedule has it; give schedule={FREE!r}")
    network = build_network(scene)
    engine, found = make_engine(asked[2], network), find_schedule(network, schedule)
    chosen, resources = find_criterion(asked[0] or criterion), _resources(options)
    problem = pose(engine, found, chosen, limits, (), resources)
    assemble = time.perf_counter() - start
    plan = solve(problem, asked[1] or formulation, **options)
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def _optimize_free(
    scene: Scene, asked: Asked, limits: Sequence[Limit], options: dict[str, Any]
) -> FreePlan:
    """Return the plan of the free schedule."""
    start, (criterion, formulation) = time.perf_counter(), DEFAULTS[FREE]
    problem = _pose_free(scene, (asked[0] or criterion, asked[2]), limits, options)
    assemble = time.perf_counter() - start
    plan = solve(problem, asked[1] or formulation, **options)
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def _pose_free(
    scene: Scene,
    asked: tuple[Criterion | str, str],
    limits: Sequence[Limit],
    options: dict[str, Any],
) -> FreeProblem:
    """Return the problem of a free schedule; what options say of it is taken out of them."""
    own = [field.name for field in fields(Resources) if field.name != "max_memory"]
    _refuse(options, own, "the free schedule has no such option; leave it out")
    aim, stands = options.pop("aim", "minmax"), options.pop("stands", None)
    rules, robots = _rules(options), options.pop("robots", ())
    if isinstance(robots, int):
        scene = with_robots(scene, robots)
    elif robots:
        rules = replace(rules, robots=robots)
    engine = make_engine(asked[1], build_network(scene))
    return pose_free(engine, rules, find_criterion(asked[0]), aim, limits, stands)


def _rules(options: dict[str, Any]) -> FreeRules:
    """Take out of options what they say of the rules of a free schedule."""
    rules = options.pop("rules", FreeRules())
    if not isinstance(rules, FreeRules):
        raise ProblemError(f"rules {short(rules)}: give a seqopt.FreeRules")
    return replace(rules, **{name: options.pop(name) for name in RULES if name in options})


def _refuse(options: dict[str, Any], names: Sequence[str], why: str) -> None:
    """Raise an error if an option is given that does not go with the schedule."""
    for name in names:
        if name in options:
            raise ProblemError(f"option {name}: {why}")


def _resources(options: dict[str, Any]) -> Resources:
    """Take out of options what they say of resources."""
    given = {field.name for field in fields(Resources)} & options.keys()
    return Resources(**{name: options.pop(name) for name in given})


def find_criterion(criterion: Criterion | str) -> Criterion:
    """Return a criterion, by name or itself.

    Parameters
    ----------
    criterion : Criterion or str
        A criterion, or a name of `seqopt.CRITERIA`.

    Returns
    -------
    Criterion

    Raises
    ------
    ProblemError
        If there is none of that name.
    """
    if not isinstance(criterion, str):
        return criterion
    if criterion not in CRITERIA:
        raise ProblemError(
            f"criterion {criterion!r} does not exist{did_you_mean(criterion, CRITERIA)}; give "
            f"one of {', '.join(CRITERIA)}"
        )
    return CRITERIA[criterion]
