"""Scenes by name, in words, ``wall:columns=6,courses=4``, or as versioned JSON.

A file has the fields of `Scene` and of its parts, which check their values themselves; values that
are possible but probably wrong, such as mixed-up units, are warned of.
"""

from __future__ import annotations

import inspect
import json
import os
import shlex
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, fields, is_dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import parse_json, read_text, write_file
from seqopt._registry import Later, offered, required
from seqopt.arrays import Vector
from seqopt.errors import FileError, SceneError, SceneWarning, did_you_mean
from seqopt.scene._checks import Reader, in_words, one_of, rows, short
from seqopt.scene.parts import Anywhere, Brick, Ground, Joint, Reach, Side, Sphere
from seqopt.scene.scene import _KINDS, Scene, in_order, with_robots
from seqopt.scene.shape import Polyhedron

BOXES = Later("seqopt.scene.boxes")  # where a file is checked
_LEVEL = 1e-12  # slope of a line to a face, beyond which it meets it
_SHOWN = 3  # pairs of bricks that interpenetrate; more are counted


def warn_of(scene: Scene, name: str, *, made: bool = False) -> None:
    """Give a `SceneWarning` for each thing that looks wrong in a scene.

    ``made``: whether it was made of words, so that only its units can be wrong. What looks wrong is
    known to `seqopt.exchange`.
    """
    find = offered("find_doubts")
    for doubt in find(scene, made=made) if find else ():
        warnings.warn(f"scene {name}: {doubt}", SceneWarning, stacklevel=3)


def _find_overlapping(scene: Scene, *, across_joints: bool = False) -> Iterator[str]:
    """Yield a line on each pair of bricks that interpenetrate by more than `TOLERATED`.

    Bricks of arches may run into each other at the corners of a joint without a face: how deep they
    do counts on its own line, ``across_joints``, where verdicts refuse it too. Beams do by intent:
    bricks with a shape and such joints.
    """
    springs: tuple[Joint | Ground, ...] = (*scene.joints, *scene.grounds)
    faceless = [spring.ends for spring in springs if spring.face is None]
    checked, beams = {*map(frozenset, faceless)}, {end for ends in faceless for end in ends}
    solid = [b for b in scene.bricks if b.shape is None or b.name not in beams]
    found = [each for each in BOXES.overlapping(solid) if frozenset(each[:2]) not in checked]
    boxes = {brick.name: brick for brick in solid if brick.shape is None}
    for joint in scene.joints if across_joints else ():
        if joint.face is None and {*joint.bricks} <= {*boxes}:
            pair = [boxes[name] for name in joint.bricks]
            depth = _depth_along(pair, joint.position, joint.along)
            if depth > BOXES.TOLERATED * min(min(brick.dimensions) for brick in pair):
                found.append((*joint.bricks, depth))
    lines = [
        f"bricks {a} and {b} interpenetrate by {1e3 * depth:.3g} mm; move them apart"
        for a, b, depth in found
    ]
    yield from lines[:_SHOWN]
    if len(lines) > _SHOWN:
        yield f"{len(lines) - _SHOWN} more pairs of bricks interpenetrate"


def _depth_along(boxes: Sequence[Brick], point: Vector, axis: Vector) -> float:
    """Return how long a line through a point is in both boxes, m; negative where they are apart."""
    first, last = -np.inf, np.inf
    for box in boxes:
        at, slope = box.frame @ np.subtract(point, box.position), box.frame @ np.array(axis)
        slope = np.where(np.abs(slope) < _LEVEL, _LEVEL, slope)  # along a face
        ends = (np.array([[-0.5], [0.5]]) * box.dimensions - at) / slope
        first, last = max(first, ends.min(axis=0).max()), min(last, ends.max(axis=0).min())
    return float(last - first)


_HEADER = {"format": "seqopt-scene", "version": 1}
_SAID = ("blocked_nodes", "gravity", "provenance", "closes_with")  # in files by default as well
_REACHES: dict[str, type[Reach]] = {"anywhere": Anywhere, "side": Side, "sphere": Sphere}
_OFFERED = {"arm": "Arm", "durations": "Durations"}  # parts that outer rooms describe
_DATA = resources.files("seqopt").joinpath("data")


ABOUT = {
    "arch25": "the central arch of Bruun et al., identified from their printed tables",
    "dome163": "a dome in running bond, 2.0 m wide and 0.7 m high, generated",
    "vault338": "a herringbone vault around arch25 over 2670 x 4350 mm, our reconstruction",
}

KINDS = {
    "arch": "an arch by span and rise: arch:span=2,rise=0.7,curve=catenary",
    "chain": "an arch of any number of bricks that turn evenly: chain:bricks=40",
    "vault": "a barrel vault in running bond: vault:span=2,rise=0.8,columns=3",
    "wall": "a wall in running bond: wall:columns=6,courses=4,corbel=0.02",
}
"""What each kind of scene is, with an example."""


def _vector(text: str) -> Vector:
    x, y, z = map(float, text.split("x"))
    return x, y, z


ORDER = "order"  # of any kind: in which bricks are placed
_WHOLE, _NUMBER = (int, "a whole number, as 12"), (float, "a number alone, as 0.5")
_READ: dict[Any, Reader] = {
    int: _WHOLE,
    int | None: _WHOLE,
    float: _NUMBER,
    float | None: _NUMBER,
    str: (str, "a word"),
    Vector: (_vector, "it as 0.2x0.1x0.06"),
}  # by what a number is


def _scene_by_words(words: str) -> Scene:
    """Return the scene of a key of `KINDS`, a colon, and ``name=value`` parted by commas.

    Three lengths are ``0.2x0.1x0.06``; lengths in m, angles in rad, densities in kg/m³.
    """
    from seqopt.scene.library import MAKERS  # noqa: PLC0415  # a scene from a file needs none

    name, _, rest = words.partition(":")
    make: Callable[..., Scene]
    make, shape = MAKERS[name]
    takes = inspect.signature(shape or make, eval_str=True).parameters
    numbers = {key: number for key, number in takes.items() if number.annotation in _READ}
    known = {key: _READ[number.annotation] for key, number in numbers.items()}
    parts = filter(None, rest.split(","))
    given = in_words(f"scene {words}", parts, {**known, ORDER: _READ[str]})
    needed = {key for key, number in numbers.items() if number.default is number.empty}
    if lacking := ", ".join(needed - given.keys()):
        raise SceneError(f"scene {words}: {lacking} is missing; {KINDS[name]}")
    order = given.pop(ORDER, None)
    try:
        scene = make(shape(**given)) if shape else make(**given)
    except OverflowError as error:
        raise SceneError(f"scene {words}: its numbers are too large; give smaller ones") from error
    made = in_order(scene, order)
    return replace(made, provenance=f"{scene.provenance} In words: {words}.")


def builtin_scenes() -> tuple[str, ...]:
    """Return the names of the scenes that ship with the package, in alphabetical order."""
    stored = _DATA.joinpath("scenes").iterdir()
    return tuple(sorted(item.name.removesuffix(".json") for item in stored))


def load_scene(name: str | Path) -> Scene:
    """Return a built-in scene by name, the scene of a JSON file, or one from a few words.

    Parameters
    ----------
    name : str or pathlib.Path
        A name in `builtin_scenes`, the path of a file, or a few words that
        `_scene_by_words` reads, such as ``arch:span=2,rise=0.7``.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError, FileError
        If there is no such scene, or the file does not describe one or cannot be read.

    Warns
    -----
    SceneWarning
        If something in a file is probably a mistake.

    Examples
    --------
    >>> load_scene("arch25")
    <Scene arch25: 25 bricks, 24 joints, 2 ground ends, 3 robots>
    """
    if not isinstance(name, str | Path):
        raise SceneError(f"a {type(name).__name__} is not a name of a scene; give text or a path")
    name = str(name)
    if name in builtin_scenes():
        return _parse_scene(_DATA.joinpath("scenes", f"{name}.json").read_text("utf-8"), name)
    kind, colon, _ = name.partition(":")
    if colon and kind in KINDS:
        scene = _scene_by_words(name)
        warn_of(scene, name, made=True)
        return scene
    path = Path(name)
    if (not path.suffix or "=" in name) and not os.path.lexists(path):
        hint = did_you_mean(kind, KINDS) if colon else did_you_mean(name, builtin_scenes())
        raise SceneError(
            f"scene {name}: no such built-in scene or file{hint}; "
            f"built in: {', '.join(builtin_scenes())}; or in words, as arch:span=2,rise=0.7"
        )
    if path.is_file() and path.suffix.lower() == ".obj":
        out = shlex.quote(f"{path.resolve().stem}.json")
        words = f"{shlex.quote(str(path))} --unit m --density 2400 --out {out}"
        raise SceneError(
            f"scene {path}: a mesh; seqopt import {words} makes a scene of it, with its own "
            "unit and density"
        )
    scene = _with_models(_parse_scene(read_text(path), name), path.parent.joinpath)
    warn_of(scene, name)
    return scene


def _with_models(scene: Scene, found: Callable[[str], Path]) -> Scene:
    """Return a scene whose arms have their models, if they are files, where these are found."""
    robots = list(scene.robots)
    for i, robot in enumerate(robots):
        if robot.arm is not None and not robot.arm.in_package:
            robots[i] = replace(robot, arm=replace(robot.arm, urdf=str(found(robot.arm.urdf))))
    return scene if (*robots,) == scene.robots else scene.with_robots(*robots)


def _parse_scene(text: str, source: str = "text") -> Scene:
    """Return the scene that a JSON document describes."""

    def entries(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in pairs]
        if twice := [key for key in keys if keys.count(key) > 1]:
            what = f"key {twice[0]!r} stands twice in one object"
            raise SceneError(f"scene {source}: {what}; keep one")
        return dict(pairs)

    where = f"scene {source}"
    content = parse_json(text, where, SceneError, object_pairs_hook=entries)
    for key, wanted in _HEADER.items() if isinstance(content, dict) else ():
        if (given := content.pop(key, None)) != wanted:
            raise SceneError(f"{where}: {key} is {short(given)}; give {wanted!r}")
    scene: Scene = _read(Scene, content, where)
    return scene


def _read(kind: type, given: Any, where: str) -> Any:
    """Return a scene or a part of one, of a class, from its entry in a document."""
    if not isinstance(given, dict):
        raise SceneError(f"{where} is {short(given)}; give an object")
    known, own = {field.name: field for field in fields(kind)}, dict(given)
    if unknown := [key for key in given if key not in known]:
        hint = f"is not known{did_you_mean(unknown[0], known)}"
        raise SceneError(f"{where}: {short(unknown[0])} {hint}; give {', '.join(known)}")
    for name, field in known.items():
        if name not in given and field.default is field.default_factory is MISSING:
            raise SceneError(f"{where}: {name} is missing; give it")
    for name, value in given.items():
        inner = f"{where}: {name}"
        if kind is Scene and name in _KINDS:
            each = enumerate(rows(inner, value))
            own[name] = [_read(_KINDS[name], part, f"{inner}[{i}]") for i, part in each]
        elif name == "reach":
            rest = dict(value) if isinstance(value, dict) else {"kind": value}
            reach = _REACHES[one_of(f"{inner}: kind", rest.pop("kind", None), _REACHES)]
            own[name] = _read_within(reach, rest, name, where)
        elif name in ("shape", *_OFFERED) and value is not None:
            part = Polyhedron if name == "shape" else required(_OFFERED[name])
            own[name] = _read_within(part, value, name, where)
    return kind(**own)


def _read_within(kind: type, given: Any, name: str, where: str) -> Any:
    """Return a part of one, whose errors say where it is."""
    try:
        return _read(kind, given, name)
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from error


def scene_to_dict(scene: Scene) -> dict[str, Any]:
    """Return a scene as the document of a file, without defaults."""
    kinds: dict[Any, dict[str, str]] = {cls: {"kind": kind} for kind, cls in _REACHES.items()}

    def entry(value: Any) -> Any:
        if not is_dataclass(value):
            return tuple(map(entry, value)) if isinstance(value, tuple) else value
        given = [(each, getattr(value, each.name)) for each in fields(value)]
        said = [(f.name, own) for f, own in given if own != f.default or f.name in _SAID]
        return {**kinds.get(type(value), {}), **{name: entry(own) for name, own in said}}

    return {**_HEADER, **entry(scene)}


def dump_scene(scene: Scene, folder: Path | None = None) -> str:
    """Return a scene as JSON text, one brick, joint or robot a line.

    ``folder``: where it will be, from which models of arms in it are named; others, and all where
    it is not known, are named from the root.
    """

    def near(model: str) -> Path:
        place = Path(os.path.abspath(model))  # noqa: PTH100
        within = folder is not None and place.is_relative_to(folder)
        return place.relative_to(folder) if within and folder else place

    lines = []
    for key, value in scene_to_dict(_with_models(scene, near)).items():
        if isinstance(value, tuple) and value and isinstance(value[0], dict):
            rows = ",\n    ".join(json.dumps(item, ensure_ascii=False) for item in value)
            lines.append(f"  {json.dumps(key)}: [\n    {rows}\n  ]")
        else:
            lines.append(f"  {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def save_scene(scene: Scene, path: Path) -> None:
    """Write a scene as a JSON file; raises `FileError` if it cannot be written.

    Parameters
    ----------
    scene : Scene
    path : Path

    Examples
    --------
    >>> import tempfile
    >>> scene = load_scene("arch25")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_scene(scene, Path(folder, "own.json"))
    ...     load_scene(f"{folder}/own.json") == scene
    True
    """
    folder = Path(os.path.abspath(path)).parent  # noqa: PTH100  # links are not followed
    write_file(path, dump_scene(scene, folder))


def plan_folder(scene: object) -> Path | None:
    """Return the folder of a plan that stands for its scene; None of another scene."""
    if not isinstance(scene, str | Path) or not (path := Path(scene)).is_dir():
        return None
    for name in ("scene.json", "plan.csv"):
        if not (path / name).is_file():
            raise FileError(f"{path}: it has no {name}; give a folder of seqopt optimize --out")
    return path


def find_scene(
    scene: Scene | Path | str,
    *,
    order: str | Sequence[int] | None = None,
    grips: str | None = None,
    props: str | None = None,
    payload: Sequence[float | str] = (),
    durations: Sequence[str] = (),
    robots: int | Sequence[str] | None = None,
) -> Scene:
    """Return a scene by its name, words, file or a plan's folder, with what is other than it says.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        A built-in scene, a JSON file, a plan's folder, or words as arch:span=2,rise=0.8 (default:
        arch25); seqopt scene --list shows all.
    order : str or sequence of int, optional
        In which order bricks are placed, if not in the scene's own: reversed, ends (from all ground
        ends at once), or the names of all bricks, as 1..12,25..13.
    grips : str, optional
        How stiff the grips of all robots are, if not as the scene says: rigid, or N/m, as 1e6, or
        three along its axes, as 1e6x1e6x5e5; turning=N m/rad after a comma keeps held bricks from
        turning.
    props : str, optional
        Nodes that props hold beside the robots, if not as the scene says, until the finished
        structure is let go: as 13,27, or every, one at each brick as centering has; N/m after a
        colon if they are not rigid, as every:1e6; then push for such as only push up, and
        capacity=N.
    payload : sequence of float or str, optional
        What every robot may carry, N, if not as the scene says; of one robot with its name before,
        as rob1=250.
    durations : sequence of str, optional
        How long robots take, s: fetch=30,place=10,approach=10,grip=5,release=5 or speed=0.2 (m/s,
        of ways between grips); that is to bring the next brick, to place it, to come to one that
        stands, to grip it, to let go; who is free fetches and approaches while others act; of one
        robot with its name before, as rob3:fetch=75 (default: as the scene says).
    robots : int or sequence of str, optional
        How many there are: those of the scene first, further ones reach every node.
    """
    if not isinstance(scene, Scene):
        folder = plan_folder(scene)
        scene = load_scene(scene if folder is None else folder / "scene.json")
    scene = in_order(scene, order)
    scene = scene.with_payloads(*payload) if payload else scene
    scene = with_robots(scene, robots) if isinstance(robots, int) else scene
    scene = scene if props is None else scene.with_props(props)
    scene = scene if grips is None else scene.with_grips(grips)
    return scene.with_durations(*durations) if durations else scene
