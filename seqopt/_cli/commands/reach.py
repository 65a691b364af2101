"""The command ``reach``: which robot reaches which node, by its region or by its arm."""

from __future__ import annotations

from typing import Annotated, Any

import pandas as pd

from seqopt._cli.answer import Answer
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import wrapped
from seqopt._cli.words import Folder
from seqopt.arms._permits import _listed, reach, reach_described
from seqopt.exchange._files import csv_text
from seqopt.scene.scene import Scene
from seqopt.work import Tell


def run(asked: Annotated[Call, ("call", reach)], *, out: Folder = None, progress: Tell) -> Answer:
    """Say which robots reach which nodes; arms with how many postures, up to how many bricks.

    Robots have a reach or an arm in the scene file; the extra arms computes postures.

    Parameters
    ----------
    out : pathlib.Path, optional
        Folder to write reach.csv to.

    Examples
    --------
    $ seqopt reach my.json --out reach
    $ seqopt reach my.json --cache postures --json
    """
    found, output = asked.values()["scene"], Output(out, asked.words.get("scene"))
    output.require()
    table, lines = _by_region(found)
    if found.has_arms:
        table = asked(scene=found, progress=progress)
        lines += reach_described(found, table)
    written = output.write(progress, lambda: {"reach.csv": csv_text(table)})
    hint = "--out DIR writes a row for every robot and node"
    lines.append(f"written to {out}: reach.csv" if written else hint)
    return Answer({"reach": table}, "\n".join(map(wrapped, lines)), scene=found, written=written)


def _by_region(scene: Scene) -> tuple[pd.DataFrame, list[str]]:
    """Return the nodes that robots without arms reach, a row each, and a line for each robot."""
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
