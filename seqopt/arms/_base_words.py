"""Words that say where bases of arms may stand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from seqopt._files import read_table, read_text
from seqopt.arms._bases import Base, facing, grid, level_axis
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem._limit_words import number_word
from seqopt.scene._checks import LARGEST_NUMBER
from seqopt.scene.scene import Scene

_COLUMNS = ("robot", "x", "y", "z", "heading_deg")


def asked_places(scene: Scene, words: str) -> dict[str, tuple[Base, ...]]:
    """Return the places by robot: of ``grid``, ``grid:METERS``, or a CSV file."""
    if not scene.has_arms:
        raise ProblemError(f"--bases {words}: no robot of scene {scene.name} has an arm; give one")
    name, colon, spacing = words.partition(":")
    if name == "grid":
        step = number_word(spacing, f"--bases {words}") if colon else None
        found = grid(scene, step)
        for robot, places in found.items():
            if not places:
                raise ProblemError(f"--bases {words}: no place for {robot}; give a finer grid")
        return found
    return _read(scene, Path(words))


def _read(scene: Scene, path: Path) -> dict[str, tuple[Base, ...]]:
    """Return the places of a CSV file: robot, x, y, and if they are given z and heading_deg."""
    names, rows = read_table(read_text(path), str(path), ProblemError)
    if not rows or not {"robot", "x", "y"} <= {*names} or {*names} - {*_COLUMNS}:
        raise ProblemError(f"{path}: give a CSV file with columns {', '.join(_COLUMNS)}")
    arms = {robot.name: robot.arm for robot in scene.robots if robot.arm is not None}
    out: dict[str, list[Base]] = {}
    for line, row in rows:
        where, name = f"{path}, line {line}", row["robot"]
        if name not in arms:
            known = ", ".join(arms)
            raise ProblemError(
                f"{where}: no robot {name!r} has an arm{did_you_mean(name, arms)}; give {known}"
            )
        own = dict(zip("xyz", arms[name].position, strict=True))
        at = [_number(row[key], f"{where}: {key}") if row.get(key) else own[key] for key in "xyz"]
        base = facing(scene, (at[0], at[1], at[2]))
        if row.get("heading_deg"):
            degrees = _number(row["heading_deg"], f"{where}: heading_deg")
            base = _turned(scene, base, math.radians(degrees))
        out.setdefault(name, []).append(base)
    return {name: tuple(bases) for name, bases in out.items()}


def _number(text: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST_NUMBER:  # NaN is none
        raise ProblemError(f"{where}: {text!r} is not a number")
    return value


def _turned(scene: Scene, base: Base, heading: float) -> Base:
    """Return an upright base whose x is turned about the vertical, from the scene's own x."""
    up = np.array(scene.up)
    x = level_axis(up)
    x = math.cos(heading) * x + math.sin(heading) * np.cross(up, x)
    y = np.cross(up, x)
    return Base(base.position, (x[0], x[1], x[2]), (y[0], y[1], y[2]))
