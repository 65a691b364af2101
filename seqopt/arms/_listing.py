"""Which robot reaches which node with how many postures, as a table for people."""

from __future__ import annotations

import pandas as pd

from seqopt.arms._permits import permits
from seqopt.arms.reach import find_postures
from seqopt.arms.table import PostureTable
from seqopt.errors import SceneError
from seqopt.scene.scene import Scene


def reach_table(scene: Scene) -> pd.DataFrame:
    """Return which robot reaches which node, with how many postures, and how long.

    Parameters
    ----------
    scene : Scene
        With a robot that has an arm.

    Returns
    -------
    pandas.DataFrame
        A row for every robot with an arm and every node, in build order: ``robot``, ``brick``,
        ``node``; ``postures``, how many were found that touch neither ground, bases, the arm itself
        nor the brick that it grips; ``from_bricks``, with how many bricks that of the node is
        placed; ``to_bricks``, up to how many a posture hits none of them, zero if there is none;
        ``clear``, how many of the kept postures hit no brick of the finished structure.

    Raises
    ------
    SceneError
        If no robot has an arm.
    """
    table, allowed = find_table(scene), permits(scene)
    assert allowed is not None
    rows = []
    for r, name in enumerate(table.robots):
        own = next(i for i, robot in enumerate(scene.robots) if robot.name == name)
        for place, node in enumerate(n for brick in scene.placed for n in brick.nodes):
            mine = table.rows(name, node)
            last = min(len(scene.bricks), allowed.until[own, place + 1] - 1)
            rows.append(
                {
                    "robot": name,
                    "brick": scene.brick_of_node[node].name,
                    "node": node,
                    "postures": int(table.found[r, table.nodes.index(node)]),
                    "from_bricks": place // 2 + 1,
                    "to_bricks": int(last) if last > place // 2 else 0,
                    "clear": int((~table.hits[mine].any(axis=1)).sum()),
                }
            )
    return pd.DataFrame(rows)


def find_table(scene: Scene) -> PostureTable:
    """Return the posture table of a scene in which a robot has an arm."""
    found = find_postures(scene)
    if found is None:
        raise SceneError(f"scene {scene.name}: no robot has an arm; give one in its scene file")
    return found
