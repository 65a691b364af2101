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
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arms.reach import find_postures
from seqopt.arrays import Terse
from seqopt.engines.registry import engine_for, recipe_of
from seqopt.errors import ExtraError, NothingFoundError, ProblemError, SceneError, TimeUpError
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.responses.quantities import _steps_in_words
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import Step
from seqopt.work import Tell

if TYPE_CHECKING:
    from seqopt.arms._tables import PostureTable

_Way = tuple[int, ...]  # a posture for every hold of a step, as rows of the table
_MOST_WAYS = 20_000  # of one step that are kept


@dataclass(frozen=True)
class Unreached:
    """A step without compatible postures: its number, the grips, and the reason in words."""

    step: int
    why: str


@dataclass(frozen=True, repr=False)
class PlanPostures(Terse):
    """The postures of a plan.

    ``steps``: by step, which row of ``table`` each robot of the scene is in; None for a robot that
    holds nothing or has no arm, and for all where there is no way. ``unreached``: the steps that
    arms cannot be in, or not without changing a posture while they hold.
    """

    table: PostureTable
    steps: tuple[tuple[int | None, ...], ...]
    unreached: tuple[Unreached, ...]


def plan_postures(scene: Scene, steps: Sequence[Step]) -> PlanPostures | None:
    """Return the postures of a plan, or the steps that have none; None if no robot has an arm."""
    table = find_postures(scene)
    return None if table is None else _Search(scene, table, steps).found()


class _Search:
    """Goes through a plan with every way of holding that is possible so far.

    Where a step has none, or none that goes on from the step before, it begins anew: the steps
    that follow are judged by themselves.
    """

    def __init__(self, scene: Scene, table: PostureTable, steps: Sequence[Step]) -> None:
        self._scene, self._table, self._steps = scene, table, steps
        self._held = scene.held_postures
        self._holds = [h for h in holds(scene, steps) if scene.robots[h.robot].arm is not None]
        self._since = np.array([scene.since[name] for name in table.bricks])

    def found(self) -> PlanPostures:
        """Return what there is."""
        faults: list[Unreached] = []
        begin: dict[_Way, _Way | None] = {(): None}
        kept: list[dict[_Way, _Way | None]] = []  # by step: ways, and what each comes from
        before: tuple[Hold, ...] = ()
        for step in self._steps:
            now = tuple(h for h in self._holds if h.first <= step.number <= h.last)
            ways, why = self._ways(step, now)
            same = [(before.index(hold), i) for i, hold in enumerate(now) if hold in before]
            able: dict[_Way, _Way] = {}  # earlier ways, by the postures of holds that go on
            for way in kept[-1] if kept else begin:
                able.setdefault(tuple(way[i] for i, _ in same), way)
            pairs = ((way, able.get(tuple(way[i] for _, i in same))) for way in ways)
            onward: dict[_Way, _Way | None] = {w: s for w, s in pairs if s is not None}
            if ways and not onward:
                why = "arms would have to change postures while they hold"
            if why:
                faults.append(Unreached(step.number, why))
                onward = dict.fromkeys(ways, None)
            kept.append(onward or begin)
            before = now if onward else ()
        return PlanPostures(self._table, self._traced(kept), tuple(faults))

    def _ways(self, step: Step, now: Sequence[Hold]) -> tuple[list[_Way], str]:
        """Return all ways to hold in a step by itself; if there are none, why."""
        table, standing = self._table, self._since <= step.bricks
        options, names, ways = list[list[int]](), list[str](), list[_Way]([()])
        for hold in now:
            assert hold.node is not None
            robot = self._scene.robots[hold.robot].name
            names.append(f"{robot} at node {hold.node}")
            rows = table.rows(robot, hold.node)
            only = None if self._held is None else self._held.row(hold.robot, hold.node)
            rows = rows if only is None else rows[rows == only]
            options.append([int(row) for row in rows if not table.hits[row, standing].any()])
            if not options[-1]:
                one = self._held is not None and len(rows) == 1
                lacks = "hits a brick in its one" if one else "has no"
                why = table.why_not(robot, hold.node, rows, standing)
                return [], f"{names[-1]} {lacks} posture ({why})"
        for k, own in enumerate(options):
            longer = [(*way, row) for way in ways for row in own if self._free(way, row)]
            if not longer:  # two if two cannot hold together, else all up to this one
                apart = (
                    (names[i], names[j])
                    for i, j in combinations(range(k + 1), 2)
                    if not any(self._free((a,), b) for a in options[i] for b in options[j])
                )
                those = next(apart, (", ".join(names[:k]), names[k]))
                return [], f"{' and '.join(those)} are in each other's way"
            ways = longer[:_MOST_WAYS]
        return ways, ""

    def _free(self, way: _Way, row: int) -> bool:
        return not any(self._table.collide[row, other] for other in way)

    def _traced(
        self, kept: Sequence[dict[_Way, _Way | None]]
    ) -> tuple[tuple[int | None, ...], ...]:
        """Return one way through all steps, from the last one back."""
        out: list[tuple[int | None, ...]] = []
        wanted: _Way | None = None
        for step, ways in zip(reversed(self._steps), reversed(kept), strict=True):
            way = next(iter(ways)) if wanted is None else wanted
            wanted = ways[way]
            now = [h for h in self._holds if h.first <= step.number <= h.last]
            rows: list[int | None] = [None] * len(self._scene.robots)
            for hold, row in zip(now, way, strict=len(way) > 0):
                rows[hold.robot] = row
            out.append(tuple(rows))
        return tuple(reversed(out))


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


def posture_trouble(scene: Scene, cache: Path | None, tell: Tell) -> str:
    """Compute or load postures of arms; return the error message if there are none."""
    try:
        find_postures(scene, cache, tell)
    except (ExtraError, SceneError) as error:
        return str(error)
    return ""
