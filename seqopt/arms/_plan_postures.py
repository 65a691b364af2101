"""Which postures the arms of robots take in the steps of any plan.

A robot keeps its posture from the step in which it takes a node to the last in which it holds it.
In every step no arm may hit a brick that stands, and no two arms each other. All postures of the
table are tried, not only those with which plans are made here; of arms with compliant joints that
one alone in which it is known how.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arms.reach import find_postures
from seqopt.arrays import Terse
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import Step

if TYPE_CHECKING:
    from seqopt.arms._postures import PostureTable

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
