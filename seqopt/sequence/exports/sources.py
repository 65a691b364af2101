"""The file from which a scene was imported: what it calls the bricks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from seqopt.errors import StepError
from seqopt.files import read_text
from seqopt.scene.imports.building import block_numbers
from seqopt.scene.imports.compas_data import by_guid, kind, payload
from seqopt.scene.imports.formats import read_content, sniffed
from seqopt.scene.imports.json_reading import parse_json
from seqopt.scene.scene import Scene


@dataclass(frozen=True)
class Source:
    """A file from which a scene was imported.

    Attributes
    ----------
    names : dict of int to str
        What it calls bricks, by their names: identifiers of elements of a COMPAS model, else keys.
    graph : object
        Its document if it is a graph of compas_assembly, else None.
    """

    names: Mapping[int, str]
    graph: Any = None


def read_source(scene: Scene, path: Path) -> Source:
    """Return the file from which a scene was imported, in any format that ``import`` knows.

    Raises
    ------
    FileError
        If it cannot be read.
    SceneError
        If it is no such file.
    StepError
        If it lacks a brick of the scene.
    """
    content, graph = read_content(path), None
    keys = names = [block.key for block in content.blocks]
    if path.suffix.lower() == ".json":
        document = parse_json(read_text(path), str(path))
        form = sniffed(document, str(path))
        graph = document if form == "compas_assembly" and isinstance(document, dict) else None
        if form in ("compas_dem", "compas_timber"):
            held = payload(document)
            held = payload(held["model"]) if "model" in held else held
            rows = [*by_guid(f"{path}: element", held["elements"])]
            if form == "compas_timber":  # its blocks are counted among its beams
                rows = [(guid, item) for guid, item in rows if kind(item) == "beam"]
            names = [rows[int(key)][0] for key in keys]
    found = dict(zip(block_numbers(keys), names, strict=True))
    lost = [brick.name for brick in scene.bricks if brick.name not in found]
    if lost:
        raise StepError(f"the source has no block {lost[0]}; give the file that was imported")
    return Source(found, graph)
