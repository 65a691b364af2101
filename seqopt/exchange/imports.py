"""Scenes of files that other programs wrote, and measured places."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from seqopt._files import read_text
from seqopt.errors import SceneError, SceneWarning, StepError
from seqopt.exchange._building import build_scene
from seqopt.exchange._content import Given
from seqopt.exchange._files import read_table
from seqopt.exchange._formats import read_file
from seqopt.responses.quantities import length_text
from seqopt.scene._checks import LARGEST_NUMBER, printable, short
from seqopt.scene.scenarios import _moved
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import warn_of

SAME = 1e-9  # m; closer than this a brick is where it was planned
_LYING = 3  # blocks on the ground from which on it is odd if most are there


def import_scene(path: str | Path, form: str | None = None, given: Given | None = None) -> Scene:
    r"""Return the scene of a file that another program wrote.

    Parameters
    ----------
    path
        The file.
    form
        The name of a format; by default what the file looks like.
    given
        What the file does not say: a unit of length, a density and more.

    Returns
    -------
    Scene
        Its provenance says what was read and what was assumed.

    Raises
    ------
    FileError
        If the file cannot be read, or what reads it is not installed.
    SceneError
        If it is no such file, or lacks what is not given.

    Warns
    -----
    SceneWarning
        If something is probably a mistake; see `seqopt.scene.scene_file`.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "two.csv")
    ...     _ = path.write_text("x,y,z,length,width,height\n0,0,1,2,1,2\n0,0,2.5,2,1,1\n")
    ...     import_scene(path, given=Given(unit="m", density=2000.0))
    <Scene two: 2 bricks, 1 joints, 1 ground ends, 3 robots>
    """
    if not isinstance(path, str | Path):
        raise SceneError(f"a {type(path).__name__} is not a file; give a path")
    if not isinstance(given, Given | None):
        raise SceneError(f"given is {short(given)}; give Given(unit=..., density=...)")
    where = Path(path)
    content = read_file(where, form)
    scene = build_scene(content, given or Given(), printable("file", where.stem or "file"))
    warn_of(scene, scene.name)
    low = {ground.brick for ground in scene.grounds}
    silent = given is None or (given.supports is None and given.up is None)
    if silent and len(low) >= _LYING and 2 * len(low) > len(scene.bricks):
        warnings.warn(
            f"scene {scene.name}: {len(low)} of {len(scene.bricks)} blocks rest on the ground; if "
            "y is up in the file, say so (--up y)",
            SceneWarning,
            stacklevel=2,
        )
    return scene


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
        if not all(abs(v) <= LARGEST_NUMBER for v in values) or values[0] % 1:
            raise StepError(f"{path}, line {number}: give numbers for {', '.join(columns)}")
        out[int(values[0])] = tuple(values[1:])
    return out


def measured_said(off: float, brick: int) -> str:
    """Say how far the brick is off, m, that is farthest from where it was planned."""
    which = "every brick is" if off <= SAME else f"brick {brick} is {length_text(off)} from"
    return f"as built, {which} where it was planned"


def as_built(scene: Scene, measured: Mapping[int, Sequence[float]]) -> Scene:
    """Return a scene whose bricks are where they were measured, m, all others as planned.

    A brick takes its nodes and loads with it. A joint goes half as far as its two bricks together,
    the end of a brick on the ground half as far as the brick; what is fixed to the ground stays.
    Raises `SceneError` if there is no such brick, or it was measured farther off than it is long.
    """
    known = {brick.name: brick for brick in scene.bricks}
    steps = {name: np.zeros(3) for name in known}
    for name, position in measured.items():
        if name not in known:
            raise SceneError(f"measured brick {name}: scene {scene.name} has no such brick")
        steps[name] = np.subtract(position, known[name].position)
        off, most = float(np.linalg.norm(steps[name])), max(known[name].dimensions)
        if not off <= most:
            raise SceneError(
                f"measured brick {name}: it is {off:.3g} m from where it was planned, more "
                f"than its {most:.3g} m; give positions of centroids in the frame of the scene, m"
            )
    joints = (_moved(j, 0.5 * (steps[j.bricks[0]] + steps[j.bricks[1]])) for j in scene.joints)
    return replace(
        scene,
        bricks=tuple(_moved(brick, steps[brick.name]) for brick in scene.bricks),
        joints=tuple(joints),
        grounds=tuple(_moved(ground, 0.5 * steps[ground.brick]) for ground in scene.grounds),
        loads=tuple(_moved(load, steps[load.brick]) for load in scene.loads),
    )


def as_measured(scene: Scene, path: Path, standing: int) -> Scene:
    """Return a scene whose first ``standing`` bricks are where a file says, as of `as_built`."""
    where = read_measured(scene, path)
    if early := [n for n in where if n in scene.build_order[standing:]]:
        text = f"brick {early[0]} does not stand yet; leave it out"
        raise StepError(f"measured {path}: {text}")
    return as_built(scene, where)
