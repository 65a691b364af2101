"""Scenes as versioned JSON, checked against the published schema ``data/scene.schema.json``."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

from seqopt.errors import SceneError, did_you_mean
from seqopt.files import read_text, write_text
from seqopt.scene.doubts import warn_of
from seqopt.scene.library.builtin import ABOUT, GENERATED
from seqopt.scene.library.by_words import KINDS, scene_by_words
from seqopt.scene.parts import Brick, Ground, Joint, Robot
from seqopt.scene.reach import Anywhere, Reach, Side, Sphere
from seqopt.scene.scene import Scene
from seqopt.scene.shape import with_shape

VERSION = 1
UNSAID = ("thickness", "face", "shape", "node_offsets")  # left out of a file where there is none
REACHES: dict[str, type[Anywhere] | type[Side] | type[Sphere]] = {
    "anywhere": Anywhere,
    "side": Side,
    "sphere": Sphere,
}


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a scene file."""
    text = resources.files("seqopt").joinpath("data/scene.schema.json").read_text(encoding="utf-8")
    document: dict[str, Any] = json.loads(text)
    return document


def builtin_scenes() -> tuple[str, ...]:
    """Return the names of the scenes that ship with the package.

    Returns
    -------
    tuple of str
        In alphabetical order.
    """
    return tuple(sorted({*_stored(), *GENERATED}))


def about(name: str) -> str:
    """Return what a built-in scene is.

    Parameters
    ----------
    name : str
        One of `builtin_scenes`.

    Returns
    -------
    str
        A line.
    """
    return ABOUT[name]


def _stored() -> tuple[str, ...]:
    """Return the names of the scenes that ship as files."""
    folder = resources.files("seqopt").joinpath("data/scenes")
    return tuple(item.name.removesuffix(".json") for item in folder.iterdir())


def _load_stored(name: str) -> Scene:
    """Return a scene that ships as a file."""
    source = resources.files("seqopt").joinpath(f"data/scenes/{name}.json")
    return parse_scene(source.read_text(encoding="utf-8"), name)


def load_scene(name: str | Path) -> Scene:
    """Return a built-in scene by name, the scene of a JSON file, or one from a few words.

    Parameters
    ----------
    name : str or pathlib.Path
        A name in `builtin_scenes`, the path of a file, or a few words that
        `seqopt.scene.library.by_words.scene_by_words` reads, such as ``arch:span=2,rise=0.7``.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        If there is no such scene or the file does not describe one.
    FileError
        If the file cannot be read.

    Warns
    -----
    SceneWarning
        If something in a file is probably a mistake; see `seqopt.scene.doubts`.

    Examples
    --------
    >>> load_scene("arch25")
    <Scene arch25: 25 bricks, 24 joints, 2 ground ends, 3 robots>
    """
    if not isinstance(name, str | Path):
        raise SceneError(f"a {type(name).__name__} is not a name of a scene; give text or a path")
    name = str(name)
    if name in GENERATED:
        return GENERATED[name](_load_stored)
    if name in _stored():
        return _load_stored(name)
    if ":" in name and name.partition(":")[0] in KINDS:
        return scene_by_words(name)
    path = Path(name)
    if not path.suffix and not os.path.lexists(path):
        raise SceneError(_no_such(name))
    scene = parse_scene(read_text(path), name)
    warn_of(scene, name)
    return scene


def _no_such(name: str) -> str:
    """Return what there is to say of a name that stands for no scene."""
    kind, colon, _ = name.partition(":")
    hint = did_you_mean(kind, KINDS) if colon else did_you_mean(name, builtin_scenes())
    return (
        f"scene {name}: no such built-in scene or file{hint}; "
        f"built in: {', '.join(builtin_scenes())}; or in words, as arch:span=2,rise=0.7"
    )


def parse_scene(text: str, source: str = "text") -> Scene:
    """Return the scene that a JSON document describes.

    Parameters
    ----------
    text : str
        The document.
    source : str, optional
        Where it comes from, for messages.

    Raises
    ------
    SceneError
        If the text is not JSON, breaks the schema or describes no scene that can be.
    """
    try:
        document = json.loads(text, object_pairs_hook=partial(_entries, source))
        _check_schema(document, source)
    except json.JSONDecodeError as error:
        raise SceneError(f"scene {source}: not JSON, line {error.lineno}: {error.msg}") from error
    except RecursionError as error:
        raise SceneError(f"scene {source}: nested too deep for a scene; give one") from error
    except SceneError:
        raise
    except ValueError as error:  # an integer of thousands of digits
        raise SceneError(f"scene {source}: a number has too many digits; give fewer") from error
    return scene_from_dict(document)


def _entries(source: str, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a document, each of whose keys stands there once."""
    out = dict(pairs)
    if len(out) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise SceneError(f"scene {source}: key {twice!r} stands twice in one object; keep one")
    return out


def scene_from_dict(document: dict[str, Any]) -> Scene:
    """Return the scene of a document that obeys the schema.

    Parameters
    ----------
    document : dict
        As of `scene_to_dict`.

    Raises
    ------
    SceneError
        If its parts do not fit together.
    """
    content = {key: value for key, value in document.items() if key not in ("format", "version")}
    content["bricks"] = [Brick(**with_shape(brick)) for brick in content["bricks"]]
    content["joints"] = [Joint(**joint) for joint in content["joints"]]
    content["grounds"] = [Ground(**ground) for ground in content["grounds"]]
    content["robots"] = [
        Robot(**{**robot, "reach": _reach(robot.get("reach", {"kind": "anywhere"}))})
        for robot in content["robots"]
    ]
    return Scene(**content)


def scene_to_dict(scene: Scene) -> dict[str, Any]:
    """Return a scene as a document that obeys the schema."""
    document = {"format": "seqopt-scene", "version": VERSION, **asdict(scene)}
    for part in (*document["bricks"], *document["joints"], *document["grounds"]):
        for key in UNSAID:
            if part.get(key, "") is None:
                del part[key]
    names = {cls: kind for kind, cls in REACHES.items()}
    for entry, robot in zip(document["robots"], scene.robots, strict=True):
        entry["reach"] = {"kind": names[type(robot.reach)], **entry["reach"]}
    return document


def dump_scene(scene: Scene) -> str:
    """Return a scene as JSON text, one brick, joint or robot a line."""
    document = scene_to_dict(scene)
    lines = []
    for key, value in document.items():
        if isinstance(value, tuple) and value and isinstance(value[0], dict):
            rows = ",\n    ".join(json.dumps(item, ensure_ascii=False) for item in value)
            lines.append(f"  {json.dumps(key)}: [\n    {rows}\n  ]")
        else:
            lines.append(f"  {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def save_scene(scene: Scene, path: Path) -> None:
    """Write a scene as a JSON file.

    Parameters
    ----------
    scene : Scene
    path : Path

    Raises
    ------
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> scene = load_scene("arch25")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_scene(scene, Path(folder, "own.json"))
    ...     load_scene(f"{folder}/own.json") == scene
    True
    """
    write_text(path, dump_scene(scene))


def _reach(entry: dict[str, Any]) -> Reach:
    return REACHES[entry["kind"]](**{key: value for key, value in entry.items() if key != "kind"})


def _check_schema(document: object, source: str) -> None:
    """Raise a `SceneError` that names the first entry where a document breaks the schema."""
    import jsonschema  # noqa: PLC0415  # slow to import, and needed for files only

    validator = jsonschema.Draft202012Validator(schema())
    error = jsonschema.exceptions.best_match(validator.iter_errors(document))
    if error is not None:
        entry = error.json_path.removeprefix("$").removeprefix(".") or "document"
        raise SceneError(f"scene {source}: {entry}: {_short(error.message)}")


def _short(text: str, limit: int = 160) -> str:
    return text if len(text) <= limit else f"{text[: limit - 1]}…"
