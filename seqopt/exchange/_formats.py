"""File formats: who reads and who writes each of them, and how a file is recognized."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from seqopt._files import read_text
from seqopt._registry import Part, registered
from seqopt.errors import FileError, SceneError
from seqopt.exchange._boxes import read_boxes
from seqopt.exchange._compas_models import (
    assembly_with_plan,
    is_meshes,
    read_assembly,
    read_meshes,
    read_model,
)
from seqopt.exchange._compas_shapes import kind, payload
from seqopt.exchange._content import Content, assembly_json
from seqopt.exchange._meshes import read_obj, write_obj
from seqopt.exchange._tasks import tasks_csv, tasks_in_postures, tasks_json
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

_NEVER = ("nodes", "joints", "ground ends", "robots", "loads")  # what files of blocks are without
_INSTEAD = {  # how to save as .obj, every block a closed mesh with a name, what is not read
    "dwg dxf step stp iges igs sat x_t fcstd": "open it in Rhino or FreeCAD, and export",
    "3dm gh ghx": "bake and mesh it in Rhino, and export",
    "ifc rvt": "convert it (IfcConvert a.ifc a.obj, of IfcOpenShell), or export",
    "ply stl": "open it in Rhino or Blender, and export",
    "skp blend fbx dae max c4d usd usdz glb gltf off 3mf": "export",
}
_REFUSED = {  # kinds of COMPAS, and what to save in their place
    "scene": "save its meshes as a list (compas.json_dump)",
    "timbermodel": "save the meshes of its beams as a list (compas.json_dump)",
}
DOCUMENTS: dict[str, Callable[[Any, str], Content]] = {
    "compas_assembly": read_assembly,
    "compas_model": read_model,
    "compas_dem": read_model,
    "compas_meshes": read_meshes,
}


@dataclass(frozen=True, repr=False)
class Format(Part):
    r"""A file format of blocks or of plans.

    Parameters
    ----------
    name : str
        By which it is asked for.
    endings : tuple of str
        Of the names of its files, by which it is recognized.
    read : callable, optional
        Takes the path of a file; returns its `Content`.
    write : callable, optional
        Takes a scene, the steps of a plan, and by name what the format ``takes``; returns the text
        of a file.
    takes : tuple of str
        Of ``source`` and ``distance``, see `export`.
    lost : tuple of str
        What a scene is without, once it was written and read again.

    Examples
    --------
    >>> Format("places", write=lambda scene, steps: "".join(f"{s.bricks}\n" for s in steps))
    Format('places')
    """

    name: str
    endings: tuple[str, ...] = ()
    read: Callable[[Path], Content] | None = field(default=None, compare=False)
    write: Callable[..., str] | None = field(default=None, compare=False)
    takes: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"Format({self.name!r})"


def _document(form: str | None, path: Path) -> Content:
    """Return the content of a JSON document, by default of the format that it looks like."""
    source = str(path)
    document = assembly_json(read_text(path), source)
    return DOCUMENTS[form or sniffed(document, source)](document, source)


def sniffed(document: Any, source: str) -> str:
    """Return which of `DOCUMENTS` a JSON document is."""
    if kind(document) in ("blockmodel", "problem"):
        return "compas_dem"
    if kind(document) in _REFUSED:
        raise SceneError(f"{source}: a {kind(document)} cannot be read; {_REFUSED[kind(document)]}")
    held = payload(document)
    inner = {*held} if isinstance(held, dict) else {*()}
    if {"elements", "tree"} <= inner:
        return "compas_model"
    keys = {*document} if isinstance(document, dict) else {*()}
    if document and isinstance(document, dict) and document.get("format") == "seqopt-scene":
        raise SceneError(f"{source}: it is a scene of seqopt already; give it as such")
    if is_meshes(document):
        return "compas_meshes"
    if keys & {"graph", "node", "blocks", "assembly", "data"}:
        return "compas_assembly"
    raise SceneError(f"{source}: no assembly that is known; give one of {', '.join(readable())}")


def _tasks(
    text: Callable[..., str], scene: Scene, steps: Sequence[Step], distance: float | None = None
) -> str:
    return text(scene, tasks_in_postures(scene, steps, distance))


JSON = Format("", ("json",), partial(_document, None))  # of COMPAS, whichever it is
BUILT_IN = {
    each.name: each
    for each in (
        Format("tasks", write=partial(_tasks, tasks_json), takes=("distance",)),
        Format(
            "tasks_csv",
            write=partial(_tasks, lambda _, tasks: tasks_csv(tasks)),
            takes=("distance",),
        ),
        Format(
            "compas_assembly",
            read=partial(_document, "compas_assembly"),
            write=assembly_with_plan,
            takes=("source",),
        ),
        *(Format(n, read=partial(_document, n)) for n in [*DOCUMENTS][1:]),
        Format("boxes", ("csv",), lambda path: read_boxes(read_text(path), str(path))),
        Format(
            "obj",
            ("obj",),
            lambda path: read_obj(read_text(path), str(path)),
            lambda scene, _: write_obj(scene),
            lost=("densities", "the order", *_NEVER, "steps"),
        ),
    )
}
Format.built_in = BUILT_IN


def formats() -> dict[str, Format]:
    """Return all formats by name: those that are always there, and those that are registered."""
    return {**BUILT_IN, **registered(Format)}


def readable() -> list[str]:
    """Return the names of the formats that can be read."""
    return [name for name, each in formats().items() if each.read]


def writable() -> list[str]:
    """Return the names of the formats that can be written."""
    return [name for name, each in formats().items() if each.write]


def read_file(path: Path, form: str | None = None) -> Content:
    """Return the content of a file, in the format of a name; by default in that of its ending."""
    if path.is_dir():
        raise FileError(f"{path} is a folder; give a file with all blocks, as .obj")
    suffix, known = path.suffix.lower().removeprefix("."), formats()
    fitting = (each for each in (*known.values(), JSON) if each.read and suffix in each.endings)
    found = next(fitting, None) if form is None else known.get(form)
    if found is None or found.read is None:
        remedies = (text for endings, text in _INSTEAD.items() if suffix in endings.split())
        if form is None and (remedy := next(remedies, "")):
            as_obj = "closed meshes with a name each as .obj"
            raise SceneError(f"{path}: a .{suffix} cannot be read; {remedy} {as_obj}")
        what = f"format is {short(form)}" if form else f"{path}: its format is not known"
        raise SceneError(f"{what}; give one of {', '.join(readable())}")
    content: object = found.read(path)
    if not isinstance(content, Content):
        raise SceneError(f"format {found.name}: it reads {short(content)}; return a Content")
    return content
