"""The posture table of a scene, computed once, or taken from a folder."""

from __future__ import annotations

import hashlib
import io
import re
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import fields
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._files import make_folder, read_bytes, write_bytes
from seqopt.arms._model import UP, model_path
from seqopt.arms._reached import Site
from seqopt.arms.table import PostureTable, _compute_table, _with_compliance
from seqopt.scene.arm import Arm
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell

_VERSION = 1  # of what is computed: tables of another one are not taken
_NAMES = ("robots", "nodes", "bricks")
_MESH = re.compile(rb'filename="(?:package://|file://)?([^"]+)"')


def _stored_table(folder: Path, site: Site, compute: Callable[[], PostureTable]) -> PostureTable:
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


_SITES = 16  # of which tables are kept, the last ones that were asked for


def find_postures(
    scene: Scene, cache: Path | str | None = None, progress: Tell | None = None
) -> PostureTable | None:
    """Return the posture table of a scene, computed once; None if no robot has an arm.

    Parameters
    ----------
    scene : Scene
        In any build order.
    cache : pathlib.Path or str, optional
        A folder that keeps the table by content; it is made if it is not there.
    progress : callable, optional
        Told in a few words how far it is.

    Returns
    -------
    PostureTable or None

    Raises
    ------
    ExtraError
        If pinocchio and coal are not installed.
    SceneError
        If a model cannot be read, or a base stands in a brick or in another base.
    FileError
        If the folder cannot be used.
    """
    if not scene.has_arms:
        return None
    site = Site.of(scene)
    known = _known(site)
    compute = partial(_compute_table, site, progress or (lambda _: None))
    if cache is not None and Path(cache) not in known:
        known[Path(cache)] = _stored_table(Path(cache), site, lambda: known.get(None) or compute())
        known.setdefault(None, known[Path(cache)])
    if None not in known:
        known[None] = compute()
    arms = tuple((robot.name, robot.arm) for robot in scene.robots if robot.arm is not None)
    if any(arm.joint_stiffness for _, arm in arms) and arms not in known:
        known[arms] = _with_compliance(known[None], arms)
    return known.get(arms, known[None])


_Arms = tuple[tuple[str, Arm], ...]


@lru_cache(maxsize=_SITES)
def _known(site: Site) -> dict[Path | _Arms | None, PostureTable]:  # noqa: ARG001  # kept by site
    """Return the table of a site, if it is known, under the folders and soft arms that have it."""
    return {}
