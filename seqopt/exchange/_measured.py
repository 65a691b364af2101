"""Where bricks were measured, from tables and files of COMPAS."""

from __future__ import annotations

import math
from pathlib import Path

from seqopt._files import read_table, read_text
from seqopt.errors import StepError
from seqopt.exchange.imports import import_scene
from seqopt.scene.scene import Scene
from seqopt.sequence._parts import SAME, _are_near


def read_measured(scene: Scene, path: Path) -> dict[int, tuple[float, ...]]:
    """Return where bricks were measured, m, from a CSV file (brick, x, y, z) or of COMPAS."""
    if path.suffix == ".json":
        found = {brick.name: brick.position for brick in import_scene(path).bricks}
        own = {brick.name: brick.position for brick in scene.bricks}
        return {n: p for n, p in found.items() if n not in own or math.dist(own[n], p) > SAME}
    names, rows = read_table(read_text(path), str(path), StepError)
    columns = ("brick", "x", "y", "z")
    if not rows or not {*columns} <= {*names}:
        raise StepError(f"{path}: give a CSV file with columns {', '.join(columns)}")
    out = {}
    for number, row in rows:
        try:
            values = [float(row[name]) for name in columns]
        except (TypeError, ValueError):
            values = [math.nan]
        if not _are_near(values) or values[0] % 1:
            raise StepError(f"{path}, line {number}: give numbers for {', '.join(columns)}")
        out[int(values[0])] = tuple(values[1:])
    return out
