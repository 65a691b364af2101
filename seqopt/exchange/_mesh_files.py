"""Files of meshes: OBJ, with its polygons and the names of its objects."""

from __future__ import annotations

import numpy as np

from seqopt.errors import SceneError
from seqopt.exchange._content import LARGEST, Content
from seqopt.exchange._meshes import mesh_content
from seqopt.scene._checks import short
from seqopt.scene.boxes import vertices_of
from seqopt.scene.scene import Scene


def read_obj(text: str, source: str) -> Content:
    """Return the blocks of a Wavefront OBJ file, named as objects, or groups if they are more."""
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    named = {"o": "", "g": ""}
    names: dict[str, list[str]] = {"o": [], "g": []}
    for i, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if words and words[0] == "v":
            vertices.append(_numbers(f"{source}, line {i}", words[1:4]))
        elif words and words[0] == "f":
            face = [_place(f"{source}, line {i}", w, len(vertices)) for w in words[1:]]
            if len(face) < 3:
                raise SceneError(f"{source}, line {i}: a face has three vertices or more")
            faces.append(face)
            for kind, name in named.items():
                names[kind].append(name)
        elif words and words[0] in named:
            named[words[0]] = " ".join(words[1:])
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    return mesh_content(points, faces, source, max(names.values(), key=lambda own: len(set(own))))


def _numbers(where: str, words: list[str]) -> list[float]:
    try:
        row = [float(word) for word in words]
    except ValueError:
        row = []
    if len(row) != 3 or not (np.abs(row) <= LARGEST).all():
        raise SceneError(f"{where}: a vertex is {short(' '.join(words))}; give three numbers")
    return row


def _place(where: str, word: str, count: int) -> int:
    """Return which vertex a word names: from 1, or back from the last."""
    try:
        named = int(word.split("/", 1)[0])
    except ValueError:
        named = 0
    place = named - 1 if named > 0 else count + named
    if named == 0 or not 0 <= place < count:
        raise SceneError(f"{where}: there is no vertex {short(word)}; {count} stand before")
    return place


def write_obj(scene: Scene) -> str:
    """Return bricks as a mesh each, in m: objects of an OBJ file, called as the bricks are."""
    lines, first = list[str](), 1
    for brick in scene.bricks:
        points, faces = vertices_of(brick)
        lines.append(f"o {brick.name}")
        lines += ["v " + " ".join(map(repr, row)) for row in np.asarray(points).tolist()]
        lines += ["f " + " ".join(str(first + i) for i in face) for face in faces]
        first += len(points)
    return "\n".join(lines) + "\n"
