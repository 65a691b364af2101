"""Pose the problem of a command line, also over scenarios."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from seqopt._cli import grammar, inputs, options
from seqopt.arms.reach import find_postures
from seqopt.errors import ProblemError, StepError
from seqopt.network.build import build_network
from seqopt.problem.filters import parse_limits
from seqopt.problem.problem import Problem, parse_robust
from seqopt.problem.standing import Standing
from seqopt.responses.resources import Resources
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE, Direction, FreeRules
from seqopt.sequence.steps import StepKind
from seqopt.times._curing import CuringBuilds
from seqopt.times._steps import step_times
from seqopt.workflow import DEFAULTS, SEARCH, Robust, _chooses_states, _find_moves, _pose_words

ALONE = ("scenarios", "seed", "vary")  # options that mean something with --robust alone
SPREADS = ("stiffness", "density", "position", "grips")

# the last is who takes part
Change: TypeAlias = Callable[[Scene, inputs.Place], tuple[Scene, inputs.Place, str]]


@dataclass(frozen=True, eq=False, repr=False)
class PosedProblem:
    """The problem of a command, and its scenarios."""

    problem: Problem
    robust: Robust | None = None
    known: Scenarios | None = None


def pose_problem(asked: options.Moves, change: Change | None = None) -> PosedProblem:
    """Return the problem of the command ``optimize`` or ``pareto``.

    ``change``: applied to scene and start. Raises `ProblemError` or `StepError` that names an
    option if options are incompatible.
    """
    choice = asked if isinstance(asked, options.Chosen) else options.Chosen()  # of a Pareto set
    sought, aim = asked.order == SEARCH, str(asked.aim or "")
    _require_known(asked, choice)
    scene = inputs.find_scene(replace(asked, order=None) if sought else asked)
    stands = grammar.parse_standing(asked)
    scene, begin, end, robots = _ends(asked, inputs.in_seconds(choice, scene), stands, change)
    find_postures(scene, choice.cache, asked.tell)
    limits = parse_limits(asked.limits, scene, "--limit")
    most = None if choice.max_memory is None else grammar.parse_size(choice.max_memory)
    robust, known = _scenarios(choice, scene)
    engine = inputs.find_engine(asked, build_network(scene))
    named, rules = grammar.parse_robots(robots) or None, asked.rules or None
    every = _find_moves(engine.network, asked.schedule, named, choice.candidates, rules, "--rule")
    if isinstance(every, FreeRules) and asked.direction is not None:
        every = replace(every, **dict[str, Any](direction=asked.direction))
    moves = inputs.between(every, begin, end)
    states = _chooses_states(moves, choice.formulation, limits, (aim, stands, sought))
    usual = DEFAULTS[FREE if states else "any other"].criterion
    criterion = grammar.parse_criterion(choice, usual)
    words: dict[str, Any] = {"limits": limits, "budgets": choice.budgets, "stands": stands}
    words |= {"sought": sought}
    words["resources"] = Resources(choice.workers, None, most, None if states else asked.tell)
    if robust is not None:
        words |= {"scenarios": known, "over": robust.aim}
    problem = _pose_words(engine, moves, criterion, aim, states=states, **words)
    return PosedProblem(problem, robust, known)


def _aged(scene: Scene, begin: inputs.Place, standing: Standing | None) -> inputs.Place:
    """Return the start of a build, with curing mortar including the ages of bricks in the plan."""
    if begin.site is None or not begin.done or standing is None or standing.curing is None:
        return begin
    waits = CuringBuilds(build_network(scene), standing.mortar, standing.curing).waits
    try:
        times = step_times(scene, begin.done, waits)
    except StepError as error:
        raise StepError(f"{error}; or give a STATE.json with the ages of its bricks") from None
    ends = [t.end for t, s in zip(times, begin.done, strict=True) if s.kind is StepKind.PLACE]
    ages = tuple(times[-1].end - end for end in ends)
    return replace(begin, site=replace(begin.site, ages=ages))


def _ends(
    asked: options.Moves, scene: Scene, standing: Standing | None, change: Change | None
) -> tuple[Scene, inputs.Place, inputs.Place, int | options.Words | None]:
    """Return scene after the changes, start, end, and participating robots of a build."""
    scene, begin = inputs.find_place(asked.begin, "from", scene)
    begin, robots = _aged(scene, begin, standing), asked.robots
    if change is not None:
        scene, begin, robots = change(scene, begin)
    found, end = inputs.find_place(asked.to, "to", scene)
    if found != scene:
        raise StepError(f"--to {asked.to}: its bricks are not those that follow in this order")
    return scene, begin, end, robots


def _require_known(asked: options.Moves, choice: options.Chosen) -> None:
    """Raise a `ProblemError` for options that go with another one alone."""
    down = Direction.TAKE_DOWN.value
    for name in ALONE:
        if choice.robust is None and getattr(choice, name):
            raise ProblemError(
                f"--{name}: plans over scenarios alone have it; give --robust worst-peak, "
                "worst-total or as cvar=0.9"
            )
    if asked.direction == down and asked.schedule != FREE:
        raise ProblemError(f"--direction {down}: it goes with --schedule {FREE}")


def _scenarios(asked: options.Chosen, scene: Scene) -> tuple[Robust | None, Scenarios | None]:
    """Return the robust aim, and the scenarios."""
    if asked.robust is None:
        return None, None
    vary = grammar.parse_numbers(
        "--vary", asked.vary, SPREADS, zero=True, advice=", as stiffness=3"
    )
    try:
        aim = parse_robust(asked.robust)
    except ProblemError as error:
        raise ProblemError(f"--robust: {error}") from error
    robust = Robust(aim=aim, vary=vary, count=asked.scenarios or Robust.count, seed=asked.seed)
    try:
        return robust, robust.draw(scene)
    except ProblemError as error:
        raise ProblemError(f"--{error}") from None
