"""File formats of other programs, how they are recognized, and reading them as scenes."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from seqopt.errors import SceneError, SceneWarning
from seqopt.files import read_bytes, read_text
from seqopt.scene.checks import printable, short
from seqopt.scene.imports.boxes_csv import read_boxes
from seqopt.scene.imports.building import build_scene
from seqopt.scene.imports.compas_data import kind, parse_json
from seqopt.scene.imports.compas_models import read_assembly, read_model, read_timber
from seqopt.scene.imports.content import Content, Given
from seqopt.scene.imports.frames import read_frame
from seqopt.scene.imports.meshes import read_mesh, read_obj
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import warn_of

_DOCUMENTS: dict[str, Callable[[Any, str], Content]] = {
    "compas_assembly": read_assembly,
    "compas_dem": read_model,
    "compas_timber": read_timber,
    "frame": read_frame,
}
_SUFFIXES = {".csv": "boxes", ".obj": "obj", ".ply": "ply", ".stl": "stl", ".json": ""}
_LYING = 3  # blocks on the ground from which on it is odd if most are there
FORMATS = (*_DOCUMENTS, "boxes", "obj", "ply", "stl")


def import_scene(path: str | Path, form: str | None = None, given: Given | None = None) -> Scene:
    r"""Return the scene of a file that another program wrote.

    ``form``: one of `FORMATS`; by default what the file looks like. ``given``: what the file does
    not say: a unit of length, a density and more. Result: its provenance says what was read and
    what was assumed. Raises `FileError` if the file cannot be read, or what reads it is not
    installed; `SceneError` if it is no such file, or lacks what is not given.

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
    content = read_content(where, form)
    scene = build_scene(content, given or Given(), printable("file", where.stem or "file"))
    warn_of(scene, scene.name)
    if given is None or (given.supports is None and given.up == "z"):
        _warn_of_lying(scene)
    return scene


def _warn_of_lying(scene: Scene) -> None:
    """Warn if most blocks rest on the ground, as they do where y is up and nobody says so."""
    low = {ground.brick for ground in scene.grounds}
    if len(low) >= _LYING and 2 * len(low) > len(scene.bricks):
        warnings.warn(
            f"scene {scene.name}: {len(low)} of {len(scene.bricks)} blocks rest on the ground; if "
            "y is up in the file, say so (--up y)",
            SceneWarning,
            stacklevel=3,
        )


def read_content(path: Path, form: str | None = None) -> Content:
    """Return what a file of others says.

    ``form``: one of `FORMATS`; by default what the file looks like. Raises `FileError` if the file
    cannot be read, or what reads it is not installed.
    """
    source = str(path)
    named = _SUFFIXES.get(path.suffix.lower()) if form is None else form
    if named is None or (form is not None and form not in FORMATS):
        what = f"format is {short(form)}" if form else f"{source}: its format is not known"
        raise SceneError(f"{what}; give one of {', '.join(FORMATS)}")
    if named in ("ply", "stl"):
        return read_mesh(read_bytes(path), source, named)
    text = read_text(path)
    if named in ("boxes", "obj"):
        return (read_boxes if named == "boxes" else read_obj)(text, source)
    document = parse_json(text, source)
    return _DOCUMENTS[named or sniffed(document, source)](document, source)


def sniffed(document: Any, source: str) -> str:
    """Return which format a JSON document has.

    Result: one of `_DOCUMENTS`. Raises `SceneError` if it has none of them.
    """
    by_kind = {"blockmodel": "compas_dem", "problem": "compas_dem", "timbermodel": "compas_timber"}
    if kind(document) in by_kind:
        return by_kind[kind(document)]
    keys = set(document) if isinstance(document, dict) else set()
    if document and isinstance(document, dict) and document.get("format") == "seqopt-scene":
        raise SceneError(f"{source}: it is a scene of seqopt already; give it as such")
    if {"nodes", "elements"} <= keys:
        return "frame"
    if isinstance(document, list) or keys & {"graph", "node", "blocks", "assembly", "data"}:
        return "compas_assembly"
    raise SceneError(f"{source}: no assembly that is known; give one of {', '.join(FORMATS)}")
