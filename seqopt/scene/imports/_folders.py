"""A folder of meshes, a block in each file, as published assemblies are stored."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from seqopt.errors import FileError, SceneError
from seqopt.scene._checks import cut
from seqopt.scene.imports._content import MOST_BLOCKS, Content, FileBlock
from seqopt.scene.imports._mesh_files import counted
from seqopt.scene.imports._meshes import join_pieces

_MESHES = ("obj", "off", "stl", "ply", "glb", "3mf", "3dm")
_IN_JSON = "compas_meshes"
_Read = Callable[[Path, str | None], Content]


def read_folder(path: Path, form: str | None, suffixes: Mapping[str, str], read: _Read) -> Content:
    """Return the blocks of a folder, named as its files are.

    ``form``: of its files, by default that of the meshes in it; ``suffixes``: formats by suffix;
    ``read``: reads a file. Raises `SceneError` if it has none, those of several formats, or a file
    that is not one block.
    """
    try:
        inside = [file for file in path.iterdir() if not file.name.startswith(".")]
    except OSError as error:
        raise FileError(f"cannot read {path}: {error.strerror}") from error
    forms = {file: suffixes.get(file.suffix.lower()[1:]) for file in inside if file.is_file()}
    form = form or _form_of(path, {*forms.values()})
    files = [file for file, own in forms.items() if (own or _IN_JSON) == form]
    files.sort(key=lambda file: (counted(file.stem), file.name))
    if not 0 < len(files) <= MOST_BLOCKS:
        raise SceneError(f"{path}: it has {len(files)} files of {form}; give 1 to {MOST_BLOCKS}")
    contents = [read(file, form) for file in files]
    units = {content.unit for content in contents}
    if len(units) > 1:
        known = ", ".join(sorted(str(unit) for unit in units))
        raise SceneError(f"{path}: its files are in different units, {known}; save all in one")
    left = sorted(file.name for file in {*inside} - {*files})
    said = [f"a folder of {len(files)} files of {form}, a block each: no supports, faces or order"]
    if left:
        said.append(f"{len(left)} other files are left out: {cut(', '.join(left), 80)}")
    pairs = zip(files, contents, strict=True)
    blocks = tuple(_one_block(file, content, said) for file, content in pairs)
    return replace(contents[0], blocks=blocks, said=tuple(said))


def _form_of(path: Path, forms: set[str | None]) -> str:
    """Return the format of the meshes in a folder."""
    found = [form for form in _MESHES if form in forms]
    if len(found) > 1:
        raise SceneError(f"{path}: it has meshes in {' and '.join(found)}; choose one (--format)")
    if not found and "" not in forms:
        raise SceneError(
            f"{path}: a folder without meshes; give one with a block in each file, in "
            f"{', '.join(_MESHES)} or JSON of COMPAS"
        )
    return found[0] if found else _IN_JSON


def _one_block(file: Path, content: Content, said: list[str]) -> FileBlock:
    """Return the one block of a file. ``said``: gets how it was made of several pieces."""
    if len(content.blocks) == 1:
        return replace(content.blocks[0], key=file.stem)
    try:
        block, how = join_pieces(content.blocks, file.stem)
    except SceneError as error:
        raise SceneError(f"{file}: {error}") from None
    said.append(how)
    return block
