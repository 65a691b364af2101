"""Plans whose robots keep their postures while they hold.

A graph of choices asks of every state whether there are postures of arms that go together, and does
not remember them. So those of its plan are searched afterwards: if there are some that are kept
while robots hold, no plan is better. If not, plans are made with fewer postures at each node, down
to one, with which every plan keeps them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from seqopt.arms._plan_postures import PlanPostures, plan_postures
from seqopt.arrays import Terse
from seqopt.engines.registry import engine_for, recipe_of
from seqopt.errors import NothingFoundError, ProblemError, TimeUpError
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.responses.quantities import _steps_in_words
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

_FEWER = (4, 2, 1)  # postures at each node, where plans with more of them do not keep theirs
_SAME = 1e-9  # over the size of a value


@dataclass(frozen=True, repr=False)
class KeptPostures(Terse):
    """The postures of a plan, and lower bounds with other postures.

    ``asked``, ``most``: how many postures at each node were looked at, and with how many the plan
    was made. ``bounds``: lower bounds with any posture looked at, by goal, in display units; empty
    without proof. ``best``: whether it is proven optimal.
    """

    postures: PlanPostures
    asked: int
    most: int
    bounds: dict[str, float]
    best: bool

    @property
    def faults(self) -> tuple[str, ...]:
        """Why arms cannot be in steps, each reason with its steps."""
        return faults_in_words(self.postures)

    def described(self) -> dict[str, object]:
        """Return the entries of a plan's summary about arms, ready for JSON."""
        found = {
            "said": str(self),
            "cannot": [*self.faults],
            "postures_at_a_node": self.most,
            "of": self.asked,
            "bound": self.bounds,
            "best_of_table": self.best,
        }
        return {"arms": found}

    def __str__(self) -> str:
        if self.faults:
            return "; ".join(self.faults)
        kept = "all postures are kept while robots hold"
        if self.best:
            return f"{kept}; no plan is better with {_up_to(self.asked)} at a node"
        at = f"{kept}; made with {_up_to(self.most)} at a node"
        bound = ", ".join(f"{name} {value:.6g}" for name, value in self.bounds.items())
        return f"{at}, with {_up_to(self.asked)} no plan is below {bound}" if bound else at


def faults_in_words(found: PlanPostures) -> tuple[str, ...]:
    """Return why arms cannot be in steps, each reason with its steps."""
    steps = defaultdict[str, list[int]](list)
    for each in found.unreached:
        steps[each.why].append(each.step)
    return tuple(f"{why} ({_steps_in_words(numbers)})" for why, numbers in steps.items())


def arm_faults(scene: Scene, steps: Sequence[Step]) -> tuple[str, ...]:
    """Return why arms cannot be in steps of a build, a line for each reason; none without arms."""
    found = plan_postures(scene, steps)
    return () if found is None else faults_in_words(found)


def with_postures(problem: Problem, plan: Plan, solved: Callable[[Problem], Plan]) -> Plan:
    """Return a plan with its postures, or one that keeps them; ``solved``: solves a problem."""
    first = plan_postures(plan.engine.network.scene, plan.steps)
    assert first is not None  # some robot has an arm
    most = max(robot.arm.choices for robot in problem.scene.robots if robot.arm is not None)
    bounds = {}
    if plan.certificate is not None and plan.gap is not None:
        bounds = plan.graph.in_display_units(plan.certificate.bounds[: len(plan.goals)])
    if not first.unreached or recipe_of(problem.engine) is None:
        best = bool(bounds) and not first.unreached
        return replace(plan, arms=KeptPostures(first, most, most, bounds, best))
    for fewer in (count for count in _FEWER if count < most):
        try:
            other = solved(_with_fewer(problem, plan, fewer))
        except (ProblemError, NothingFoundError):
            continue
        except TimeUpError:
            break
        found = plan_postures(other.engine.network.scene, other.steps)
        if found is not None and not found.unreached:
            pairs = [(v, bounds[name]) for name, v in other.objective.items() if name in bounds]
            none_below = all(v <= low + _SAME * max(abs(v), abs(low)) for v, low in pairs)
            best = bool(bounds) and none_below
            return replace(other, arms=KeptPostures(found, most, fewer, bounds, best))
    return replace(plan, arms=KeptPostures(first, most, most, bounds, best=False))


def _with_fewer(problem: Problem, plan: Plan, postures: int) -> Problem:
    """Return a problem with fewer postures at each node, and the criterion of its plan, scaled."""

    def fewer(scene: Scene) -> Scene:
        robots = [
            replace(r, arm=r.arm and replace(r.arm, postures=min(postures, r.arm.postures)))
            for r in scene.robots
        ]
        return scene.with_robots(*robots)

    scene = fewer(problem.scene)
    return replace(
        problem,
        engine=engine_for(problem.engine, scene),
        moves=problem.moves.in_scene(scene),
        criterion=plan.states.criterion,
        scenarios=tuple(map(fewer, problem.scenarios)),
    )


def _up_to(count: int) -> str:
    return f"up to {count} postures" if count > 1 else "one posture"
