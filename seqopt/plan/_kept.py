"""Plans in which the arms of robots keep their postures while they hold.

A graph of choices asks of every state whether there are postures that go together. It does not
remember them. So the postures of its plan are searched afterwards: if there are some that are
kept, no plan with postures of the table is better. If not, plans are made with fewer postures at
each node, down to one, with which every plan keeps them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from seqopt.engines.registry import recipe_of
from seqopt.errors import ProblemError
from seqopt.graph.scenarios import engine_for
from seqopt.plan._status import KeptPostures
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import Criterion
from seqopt.scene.scene import Scene
from seqopt.sequence._postures import PlanPostures, plan_postures
from seqopt.sequence.schedule import Schedule

_FEWER = (4, 2, 1)  # postures at each node, where plans with more of them do not keep theirs
_SAME = 1e-9  # over the size of a value


def with_postures(problem: Problem, plan: Plan, solved: Callable[[Problem], Plan]) -> Plan:
    """Return a plan with its postures, or one that keeps them, where robots have arms."""
    scene = problem.scene
    if not scene.has_arms:
        return plan
    first = _found(plan)
    most = max(robot.arm.choices for robot in scene.robots if robot.arm is not None)
    floor, bounds = _floor(plan)
    if not first.unreached or recipe_of(problem.engine) is None:
        proven = bool(floor) and not first.unreached
        return replace(plan, arms=KeptPostures(first, most, most, floor, bounds, proven))
    for fewer in (count for count in _FEWER if count < most):
        try:
            other = solved(_narrowed(problem, plan, fewer))
        except ProblemError:
            continue
        found = _found(other)
        if not found.unreached:
            best = bool(floor) and _no_worse(other, floor)
            return replace(other, arms=KeptPostures(found, most, fewer, floor, bounds, best))
    return replace(plan, arms=KeptPostures(first, most, most, floor, bounds, best=False))


def _found(plan: Plan) -> PlanPostures:
    found = plan_postures(plan.engine.network.scene, plan.steps)
    assert found is not None
    return found


def _floor(plan: Plan) -> tuple[dict[str, float], tuple[float, ...]]:
    """Return what no plan stays below, where that is proven, as people read it and as it is."""
    proof = plan.certificate
    if proof is None or plan.gap is None:
        return {}, ()
    return plan._by_goal(proof.bounds[: len(plan.goals)]), proof.bounds


def _no_worse(plan: Plan, floor: dict[str, float]) -> bool:
    """Return whether a plan is at the floor in every goal."""
    pairs = [(value, floor[name]) for name, value in plan.objective.items() if name in floor]
    return all(value <= low + _SAME * max(abs(value), abs(low)) for value, low in pairs)


def _narrowed(problem: Problem, plan: Plan, postures: int) -> Problem:
    """Return a problem with fewer postures at each node, and the criterion of its plan."""

    def fewer(scene: Scene) -> Scene:
        return scene.with_robots(
            *(
                robot
                if robot.arm is None
                else replace(
                    robot, arm=replace(robot.arm, postures=min(postures, robot.arm.postures))
                )
                for robot in scene.robots
            )
        )

    return moved(problem, fewer(problem.scene), plan, [fewer(each) for each in problem.scenarios])


def moved(
    problem: Problem, scene: Scene, plan: Plan | None = None, scenarios: Sequence[Scene] = ()
) -> Problem:
    """Return a problem with other robots, otherwise the same; with the criterion of a plan."""
    engine, moves = engine_for(problem.engine, scene), problem.moves
    if isinstance(moves, Schedule):
        moves = replace(moves, scene=scene)
    criterion = problem.criterion if plan is None else _criterion(plan)
    return replace(
        problem, engine=engine, moves=moves, criterion=criterion, scenarios=tuple(scenarios)
    )


def _criterion(plan: Plan) -> Criterion:
    """Return the criterion of a plan, with all numbers that it takes from the scene."""
    return plan._of_scene.criterion
