"""Posture tables in a folder, by the content of what they depend on."""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import make_folder, read_bytes, write_bytes
from seqopt.arms._model import UP, model_path
from seqopt.arms._reached import Site
from seqopt.arms.table import PostureTable

_VERSION = 1  # of what is computed: tables of another one are not taken
_NAMES = ("robots", "nodes", "bricks")
_MESH = re.compile(rb'filename="(?:package://|file://)?([^"]+)"')


def stored_table(folder: Path, site: Site, compute: Callable[[], PostureTable]) -> PostureTable:
    """Return the table of a site from a folder, or compute it and keep it there."""
    make_folder(folder)
    path = folder / f"postures-{_key(site)}.npz"
    if path.exists() and (found := _read(path)) is not None:
        return found
    table = compute()
    write_bytes(path, _content(table))
    return table


def _key(site: Site) -> str:
    """Return the content that postures depend on, condensed: robots, bricks, models, meshes."""
    found = hashlib.sha256(repr((_VERSION, site.up, site.blocked)).encode())
    for brick in site.bricks:
        shape = None if brick.shape is None else brick.shape.vertices
        own = (brick.name, brick.position, brick.length_axis, brick.width_axis, brick.dimensions)
        found.update(repr((*own, brick.nodes, brick.node_offsets, shape)).encode())
    for robot in site.robots:
        arm = robot.arm
        assert arm is not None
        own = tuple(getattr(arm, each.name) for each in fields(arm) if each.name != "urdf")
        found.update(repr((robot.name, robot.reach, own)).encode())
        for content in _model(model_path(arm)):
            found.update(hashlib.sha256(content).digest())
    return found.hexdigest()[:32]


def _model(path: Path) -> Iterator[bytes]:
    """Yield the content of a URDF and of the meshes that it names, as far as they are found."""
    text = read_bytes(path)
    yield text
    folders = [*path.resolve().parents][:UP]
    for name in sorted({*_MESH.findall(text)}):
        for each in folders:
            mesh = each / name.decode("utf-8", "replace")
            if mesh.is_file():
                yield read_bytes(mesh)
                break


def _content(table: PostureTable) -> bytes:
    """Return a table as the bytes of a NumPy archive."""
    out = io.BytesIO()
    arrays = {each.name: np.asarray(getattr(table, each.name)) for each in fields(table)}
    np.savez_compressed(out, **arrays)  # type: ignore[arg-type]
    return out.getvalue()


def _read(path: Path) -> PostureTable | None:
    """Return the table of a file; None if it is none, or damaged."""
    try:
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as archive:
            content: dict[str, Any] = {n.name: archive[n.name] for n in fields(PostureTable)}
    except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile):
        return None
    return PostureTable(**content | {name: tuple(content[name].tolist()) for name in _NAMES})
