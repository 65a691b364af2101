"""Blocks alone, as a table of boxes or as meshes: who reads them finds faces and supports anew."""

from __future__ import annotations

import csv
import io
import warnings

import numpy as np

from seqopt.scene.boxes import vertices_of
from seqopt.scene.scene import Scene


def boxes_csv(scene: Scene) -> str:
    """Return bricks as the table of boxes that ``import`` reads, in m and degrees.

    A brick of another shape is as long, wide and high as it extends.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    turns, sizes = ("roll", "pitch", "yaw"), ("length", "width", "height")
    writer.writerow(["name", "x", "y", "z", *sizes, *turns, "density", "course"])
    for brick in scene.bricks:
        from scipy.spatial.transform import Rotation  # noqa: PLC0415  # slow to import

        turn = Rotation.from_matrix(brick.frame.T)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of many angles for a turn one is enough
            angles = turn.as_euler("xyz", degrees=True).tolist()
        numbers = [*brick.position, *brick.dimensions, *angles, brick.density]
        writer.writerow([brick.name, *map(repr, numbers), scene.since[brick.name]])
    return out.getvalue()


def blocks_obj(scene: Scene) -> str:
    """Return bricks as a mesh each, in m: objects of an OBJ file, called as the bricks are."""
    lines, first = list[str](), 1
    for brick in scene.bricks:
        points, faces = vertices_of(brick)
        lines.append(f"o {brick.name}")
        lines += ["v " + " ".join(map(repr, row)) for row in np.asarray(points).tolist()]
        lines += ["f " + " ".join(str(first + i) for i in face) for face in faces]
        first += len(points)
    return "\n".join(lines) + "\n"
