"""Scenes of files and folders that other programs wrote, and measured places."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from pathlib import Path

from seqopt._files import read_table, read_text
from seqopt.errors import FileError, SceneError, SceneWarning, StepError
from seqopt.exchange._building import build_scene
from seqopt.exchange._content import MOST_BLOCKS, Content, Given
from seqopt.exchange._formats import JSON, of_ending, read_file
from seqopt.exchange._mesh_files import counted
from seqopt.exchange._meshes import without_repeats
from seqopt.scene._checks import LARGEST_NUMBER, cut, printable, short
from seqopt.scene.scenarios import SAME
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import warn_of

_LYING = 3  # blocks on the ground from which on it is odd if most are there
_IN_JSON = "compas_meshes"  # what a JSON file in a folder is


def import_scene(path: str | Path, form: str | None = None, given: Given | None = None) -> Scene:
    r"""Return the scene of a file that another program wrote, or a folder with a block a file.

    Parameters
    ----------
    path
        The file or folder.
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
    content = read_content(where, form)
    name = where.resolve().name if where.is_dir() else where.stem
    scene = build_scene(content, given or Given(), printable("file", name or "file"))
    warn_of(scene, scene.name)
    low = {ground.brick for ground in scene.grounds}
    silent = given is None or (given.supports is None and given.up is None)
    if silent and len(low) >= _LYING and 2 * len(low) > len(scene.bricks):
        up = "z" if content.up == "y" else "y"
        warnings.warn(
            f"scene {scene.name}: {len(low)} of {len(scene.bricks)} blocks rest on the ground; if "
            f"{up} is up in the file, say so (--up {up})",
            SceneWarning,
            stacklevel=2,
        )
    return scene


def read_content(path: Path, form: str | None = None) -> Content:
    """Return what a file says, in the format of a name; by default in that which it looks like.

    A folder has a block in each of its files.
    """
    return without_repeats((_read_folder if path.is_dir() else read_file)(path, form))


def _read_folder(path: Path, form: str | None) -> Content:
    """Return the blocks of a folder, named as its files are.

    ``form``: of its files, by default that of the meshes in it. Raises `SceneError` if it has none,
    those of several formats, or a file that is not one block.
    """
    try:
        inside = [file for file in path.iterdir() if not file.name.startswith(".")]
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror}") from error
    known = {file: of_ending(file) for file in inside if file.is_file()}
    forms = {file: each.name or _IN_JSON for file, each in known.items() if each is not None}
    form = form or _form_of(path, {*forms.values()} - {"boxes"})
    files = [file for file, own in forms.items() if own == form]
    files.sort(key=lambda file: (counted(file.stem), file.name))
    if not 0 < len(files) <= MOST_BLOCKS:
        raise SceneError(f"{path}: it has {len(files)} files of {form}; give 1 to {MOST_BLOCKS}")
    contents = [read_file(file, None if known[file] is JSON else form) for file in files]
    units = {content.unit for content in contents}
    if len(units) > 1:
        named = ", ".join(sorted(str(unit) for unit in units))
        raise SceneError(f"{path}: its files are in different units, {named}; save all in one")
    left = sorted(file.name for file in {*inside} - {*files})
    said = [f"a folder of {len(files)} files of {form}, a block each: no supports, faces or order"]
    if left:
        said.append(f"{len(left)} other files are left out: {cut(', '.join(left), 80)}")
    for file, content in zip(files, contents, strict=True):
        if len(content.blocks) != 1:
            raise SceneError(
                f"{file}: its mesh is {len(content.blocks)} pieces; unite them to one closed mesh, "
                "or give each a file of its own"
            )
    pairs = zip(files, contents, strict=True)
    blocks = tuple(replace(content.blocks[0], key=file.stem) for file, content in pairs)
    return replace(contents[0], blocks=blocks, said=tuple(said))


def _form_of(path: Path, forms: set[str]) -> str:
    """Return the format of the meshes in a folder; JSON only where there are no others."""
    found = sorted(forms - {_IN_JSON}) or [*forms]
    if len(found) > 1:
        raise SceneError(f"{path}: it has meshes in {' and '.join(found)}; choose one (--format)")
    if not found:
        raise SceneError(
            f"{path}: a folder without meshes; give one with a block in each file, in obj, stl, "
            "ply, glb, 3dm or JSON of COMPAS"
        )
    return found[0]


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
