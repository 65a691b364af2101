"""Budgets: bounds on totals over the build. They couple all moves."""

from __future__ import annotations

import math
from itertools import chain

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.layers import Layers
from seqopt.responses.quantities import robot_response
from seqopt.sequence.schedule import OpenGrip


def steps_over(problem: Layers, response: str, level: float, bound: float) -> Budget:
    """Return a bound on the number of open steps in which a response exceeds a level.

    ``problem``: whose choices the budget is for; ``response``: among those that the problem
    evaluates (``also`` of `seqopt.pose`); ``level``: SI units; ``bound``: how many steps may exceed
    it. Result: each choice, and each pair, takes the number of its steps that exceed the level.
    Raises `ProblemError` if the problem does not evaluate the response.
    """
    single, shared = _empty(problem)
    for choices in chain.from_iterable(problem.evaluation.levels()):
        if response not in choices.responses:
            raise ProblemError(
                f"budget on {response}: step {choices.step.number} has only "
                f"{', '.join(choices.responses)}; name it in `also` when the problem is posed"
            )
        target = single if len(choices.moves) == 1 else shared
        target[choices.moves[-1]] += choices.responses[response] > level
    return Budget(f"steps with {response} over {level:g}", tuple(single), tuple(shared), bound)


def robot_use(problem: Layers, robot: str, force: float, bound: float) -> Budget:
    """Return a bound on the number of open steps in which a robot carries more than a force.

    ``problem``: whose choices the budget is for; it evaluates the robot's force; ``robot``: name of
    the robot; ``force``: n; ``bound``: how many steps there may be. Result: as of `steps_over`.
    Raises `ProblemError` if the problem does not evaluate the force of this robot.
    """
    return steps_over(problem, robot_response(robot), force, bound)


def travel(problem: Layers, bound: float) -> Budget:
    """Return a bound on the distance that robots travel to chosen grips and on to their next ones.

    ``problem``: whose choices the budget is for; ``bound``: m. Result: each choice takes straight
    lines between its node and the given nodes that its robot holds before and after, each pair the
    line between its two nodes; m.
    """
    single, shared = _empty(problem)
    schedule = problem.schedule
    for k, move in enumerate(schedule.moves):
        robot = [r.name for r in schedule.scene.robots].index(move.robot)
        grips = [step.grips[robot] for step in schedule.steps]
        steps = range(len(grips))
        mine = [i for i in steps if grips[i] == OpenGrip(k)]
        before = next((grips[i] for i in reversed(steps[: mine[0]]) if grips[i] is not None), None)
        after = next((grips[i] for i in steps[mine[-1] + 1 :] if grips[i] is not None), None)
        for other in (before, after):
            if isinstance(other, int):
                single[k] += _distances(problem, move.candidates, (other,))[:, 0]
        if before == OpenGrip(k - 1):
            shared[k] += _distances(problem, schedule.moves[k - 1].candidates, move.candidates)
    return Budget("robot travel [m]", tuple(single), tuple(shared), bound)


def _empty(problem: Layers) -> tuple[list[Floats], list[Floats]]:
    sizes = problem.sums.sizes
    pairs = zip((1, *sizes[:-1]), sizes, strict=True)
    return [np.zeros(size) for size in sizes], [np.zeros(pair) for pair in pairs]


def _distances(problem: Layers, first: tuple[int, ...], second: tuple[int, ...]) -> Floats:
    at = problem.schedule.scene.node_position
    return np.array([[math.dist(at(a), at(b)) for b in second] for a in first])
