"""What arms allow in the build order of a scene: who reaches which node, and who together.

Of a state it is asked whether there are postures that go together; with one posture of every robot
at every node this is the one that a robot keeps while it holds. An arm with compliant joints holds
a node in one posture, the same in all build orders and plans, so that the compliance of its grip is
known. It is chosen by the bricks that it hits, by how often it is in the way of those of other
arms, and, where that leaves a choice, by how stiff it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from seqopt.arms._arm import HeldPostures
from seqopt.arms.reach import find_postures
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, frozen
from seqopt.errors import SceneError
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import find_scene
from seqopt.work import Tell

if TYPE_CHECKING:
    from seqopt.arms._tables import PostureTable

_SCENES = 32  # of which it is kept, the last ones that were asked for
_WAYS = 8_000_000  # of holding that are looked at together


@dataclass(frozen=True, eq=False, repr=False)
class Permits(FrozenValue):
    """What the postures of a table allow in the build order of a scene.

    Robots are those of the scene; nodes are places in build order from 1, brick by brick, and 0 is
    that of a robot that holds nothing, or has no arm. ``rows`` (R, 2B + 1, K): the postures with
    which plans are made, as rows of the table, the best first; -1 for none. ``ends`` (P + 1,): by
    row, from which brick count on something stands that is hit in it; infinite for never, and zero,
    as the last one, for no posture. ``collide`` (P + 1, P + 1): which rows are in each other's way;
    no posture is in no one's. ``armed``: the robots that have arms.
    """

    rows: Ints
    ends: Floats
    collide: Bools
    armed: tuple[int, ...]

    @cached_property
    def until(self) -> Floats:
        """From which brick count on each robot cannot hold each node, (R, 2B + 1)."""
        out = self.ends[self.rows].max(axis=2)
        out[:, 0] = np.inf
        out[[r for r in range(len(out)) if r not in self.armed]] = np.inf
        return frozen(out)

    def allowed(self, bricks: int, held: Ints) -> Bools:
        """Return which states have postures that go together, (n,).

        ``held`` (n, R): places that robots hold, a column each; none above 0 is a free robot.
        """
        rows = held.clip(min=0)
        out = np.ones(len(rows), dtype=bool)
        for robot in self.armed:
            out &= self.until[robot, rows[:, robot]] > bricks
        step = max(1, _WAYS // self.rows.shape[2] ** len(self.armed))
        able = np.flatnonzero(out)
        for start in range(0, len(able), step):
            block = able[start : start + step]
            out[block] = self._together(bricks, rows[block])
        return out

    def _together(self, bricks: int, held: Ints) -> Bools:
        """Return which states have postures that go together, of those with some for each."""
        ways = np.ones((len(held), 1), dtype=bool)
        earlier: list[Ints] = []
        for robot in self.armed:
            rows = self.rows[robot, held[:, robot]]
            free = held[:, robot] == 0
            rows[free, 0] = -1
            usable = self.ends[rows] > bricks
            usable[free, 0] = True
            longer = ways[:, :, None] & usable[:, None, :]
            for k, before in enumerate(earlier):
                after = before.shape[1] ** (len(earlier) - 1 - k)
                apart = ~self.collide[before[:, :, None], rows[:, None, :]]
                spread = np.repeat(apart, after, axis=1)
                longer &= np.tile(spread, (1, longer.shape[1] // spread.shape[1], 1))
            ways = longer.reshape(len(held), -1)
            earlier.append(rows)
        return np.asarray(ways.any(axis=1))


@lru_cache(maxsize=_SCENES)
def permits(scene: Scene) -> Permits:
    """Return the permits of arms in the build order of a scene in which a robot has one."""
    table = find_table(scene)
    nodes = scene.placed_nodes
    place = {node: i for i, node in enumerate(nodes, start=1)}
    since = np.array([scene.since[name] for name in table.bricks], dtype=float)
    ends = np.where(table.hits, since, np.inf).min(axis=1, initial=np.inf)
    at = np.array([place[node] for node in table.nodes])[table.node]
    number = [r for r, robot in enumerate(scene.robots) if robot.arm is not None]
    collide = np.pad(table.collide, ((0, 1), (0, 1)))
    most = max(r.arm.choices for r in scene.robots if r.arm is not None)
    rows = np.full((len(scene.robots), len(nodes) + 1, most), -1)
    best, held = _chosen(table, at, ends, len(nodes)), scene.held_postures
    for own, r in enumerate(number):
        arm = scene.robots[r].arm
        assert arm is not None
        for p in np.unique(at[table.robot == own]).tolist():
            some = np.flatnonzero((table.robot == own) & (at == p))
            first = None if held is None else held.row(r, nodes[p - 1])
            first = best[own, p] if first is None else first
            order = np.lexsort((-ends[some], some != first))[: arm.choices]
            rows[r, p, : len(order)] = some[order]
    return Permits(rows, np.append(ends, 0.0), collide, tuple(number))


def _chosen(table: PostureTable, at: Ints, ends: Floats, nodes: int) -> Ints:
    """Return the posture of every robot of a table at every place, (R, nodes + 1).

    ``at`` (P,): places of postures; ``ends`` (P,): from which brick count on they hit something.
    """
    from seqopt.arms._tables import choose  # noqa: PLC0415  # few scenes have arms

    first = (at + 1) // 2  # the count at which the brick of a place is placed
    last = nodes // 2 + 1
    usable = (np.minimum(ends, last) - first).clip(min=0) / (last - first)
    count = (np.arange(nodes + 1) + 1) // 2
    together = 1.0 / (1.0 + np.abs(count[:, None] - count))
    whose = (table.robot, at)
    return choose(whose, usable, table.collide, together, len(table.robots))


def reach(
    scene: Scene | Path | str, *, cache: Path | str | None = None, progress: Tell | None = None
) -> pd.DataFrame:
    """Return which robot reaches which node, with how many postures, and how long.

    Parameters
    ----------
    scene, cache, progress : optional
        As of `optimize`.

    Returns
    -------
    pandas.DataFrame
        A row for every robot with an arm and every node, in build order: ``robot``, ``brick``,
        ``node``; ``postures``, how many were found that touch neither ground, bases, the arm itself
        nor the brick that it grips; ``from_bricks``, with how many bricks that of the node is
        placed; ``to_bricks``, up to how many a posture hits none of them, zero if there is none;
        ``clear``, how many of the kept postures hit no brick of the finished structure; ``why``,
        what is in the way where ``to_bricks`` is zero.

    Raises
    ------
    SceneError
        If no robot has an arm.

    Examples
    --------
    >>> reach("wall:columns=2,courses=2")
    Traceback (most recent call last):
    seqopt.errors.SceneError: scene wall 2 x 2: no robot has an arm; give one in its scene file
    """
    scene = find_scene(scene)
    find_postures(scene, cache, progress)
    table, allowed = find_table(scene), permits(scene)
    rows = []
    for r, name in enumerate(table.robots):
        own = next(i for i, robot in enumerate(scene.robots) if robot.name == name)
        for place, node in enumerate(scene.placed_nodes):
            mine, used = table.rows(name, node), allowed.rows[own, place + 1]
            last = min(len(scene.bricks), allowed.until[own, place + 1] - 1)
            standing = np.isin(table.bricks, scene.build_order[: place // 2 + 1])
            reached = last > place // 2
            why = "" if reached else table.why_not(name, node, used[used >= 0], standing)
            rows.append(
                {
                    "robot": name,
                    "brick": scene.brick_of_node[node].name,
                    "node": node,
                    "postures": int(table.found[r, table.nodes.index(node)]),
                    "from_bricks": place // 2 + 1,
                    "to_bricks": int(last) if reached else 0,
                    "clear": int((~table.hits[mine].any(axis=1)).sum()),
                    "why": why,
                }
            )
    return pd.DataFrame(rows)


def find_table(scene: Scene) -> PostureTable:
    """Return the posture table of a scene in which a robot has an arm."""
    found = find_postures(scene)
    if found is None:
        raise SceneError(f"scene {scene.name}: no robot has an arm; give one in its scene file")
    return found


def reach_described(scene: Scene, table: pd.DataFrame) -> Iterator[str]:
    """Yield what each robot reaches, in words."""
    free = [node for node in table["node"].unique() if node not in scene.blocked_nodes]
    last = len(scene.bricks)
    for name, rows in table[table["node"].isin(free)].groupby("robot", sort=False):
        able = rows[rows["to_bricks"] > 0]
        to_end = able[able["to_bricks"] == last]
        yield (
            f"{name}: reaches {len(able)} of {len(free)} nodes when their bricks are placed, "
            f"{len(to_end)} of them up to the last brick; "
            f"{able['postures'].median() if len(able) else 0:g} postures at a node, by the median"
        )
        for why, lacking in rows[rows["to_bricks"] == 0].groupby("why", sort=False):
            yield f"  never: {_listed([*map(str, lacking['node'])])} ({why})"
        early = able[able["to_bricks"] < last]
        if len(early):
            pairs = zip(early["node"], early["to_bricks"], strict=True)
            yield f"  up to fewer bricks: {_listed([f'{n} ({to})' for n, to in pairs])}"


def reached_by_region(scene: Scene) -> tuple[pd.DataFrame, list[str]]:
    """Return the nodes that robots without arms reach, a row each, and a line for each robot."""
    if not scene.robots:
        raise SceneError(f"scene {scene.name}: it has no robots; give at least one")
    rows, lines = list[dict[str, Any]](), list[str]()
    barred = {*scene.blocked_nodes, *(prop.node for prop in scene.props)}
    free = [node for node in scene.placed_nodes if node not in barred]
    for robot in (each for each in scene.robots if each.arm is None):
        pairs = zip(scene.placed, scene.within_reach(robot), strict=True)
        nodes = [(brick.name, node) for brick, own in pairs for node in own]
        rows += [{"robot": robot.name, "brick": brick, "node": node} for brick, node in nodes]
        able = {node for _, node in nodes}
        lines.append(f"{robot.name}: reaches {len(able)} of {len(free)} nodes ({robot.reach})")
        if able and len(able) < len(free):
            lines.append(f"  reached: {_listed([str(n) for n in free if n in able])}")
            lines.append(f"  never: {_listed([str(n) for n in free if n not in able])}")
    return pd.DataFrame(rows, columns=["robot", "brick", "node"]), lines


def _listed(names: list[str], most: int = 30) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def compute_held_postures(scene: Scene) -> HeldPostures:
    """Return the postures in which arms with compliant joints hold."""
    from seqopt.arms._reached import Site  # noqa: PLC0415  # few scenes have arms
    from seqopt.arms._tables import held_by  # noqa: PLC0415

    table = find_postures(scene)
    assert table is not None
    return held_by(Site.of(scene), table, tuple((r.name, r.arm) for r in scene.robots))


def hold_alike(nominal: Scene, scene: Scene) -> Scene:
    """Return a variation of a scene in which robots hold in the postures of the nominal one.

    It is as it was where it has other arms: joints may have other stiffnesses.
    """
    arms = [  # what determines postures, and whether joints are compliant
        [
            arm and (replace(arm, postures=1, joint_stiffness=()), bool(arm.joint_stiffness))
            for arm in (robot.arm for robot in each.robots)
        ]
        for each in (nominal, scene)
    ]
    alike = arms[0] == arms[1] and {*nominal.brick_of_node} == {*scene.brick_of_node}
    held = nominal.held_postures if alike else None
    return scene if held is None else scene.holding(held)
