"""Posture tables for people: which robot reaches which node, and every posture with its joints."""

from __future__ import annotations

import numpy as np
import pandas as pd

from seqopt.arms.reach import find_postures, permits
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
    table, allowed = _table(scene), permits(scene)
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


def posture_table(scene: Scene) -> pd.DataFrame:
    """Return every posture that is kept: joints, flange, and the bricks that the arm hits in it.

    Parameters
    ----------
    scene : Scene
        With a robot that has an arm.

    Returns
    -------
    pandas.DataFrame
        A row for every posture: ``robot``, ``node``; ``joint_1`` and so on, rad or m; ``flange_x``
        and so on, where the flange is, m; ``toward_x`` and so on, where the tool points;
        ``hits``, names of bricks with semicolons between.

    Raises
    ------
    SceneError
        If no robot has an arm.
    """
    table = _table(scene)
    columns: dict[str, object] = {
        "robot": [table.robots[r] for r in table.robot],
        "node": [table.nodes[n] for n in table.node],
    }
    columns |= {f"joint_{k}": joint for k, joint in enumerate(table.joints.T, start=1)}
    columns |= {f"flange_{name}": table.place[:, i] for i, name in enumerate("xyz")}
    columns |= {f"toward_{name}": table.axes[:, i, 2] for i, name in enumerate("xyz")}
    names = np.array(table.bricks)
    columns["hits"] = [";".join(map(str, names[hit].tolist())) for hit in table.hits]
    return pd.DataFrame(columns)


def _table(scene: Scene) -> PostureTable:
    found = find_postures(scene)
    if found is None:
        raise SceneError(f"scene {scene.name}: no robot has an arm; give one in its scene file")
    return found
