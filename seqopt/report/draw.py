"""Pictures of a partial structure: bricks, network, grips, and how they move."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from seqopt.arrays import Floats
from seqopt.network.network import Network
from seqopt.report.along import draw_responses
from seqopt.report.network_picture import draw_network, force_key
from seqopt.report.occlusion import drawing_order
from seqopt.report.style import SMALL
from seqopt.report.view import HALO, View, frame
from seqopt.scene.blocks import vertices_of
from seqopt.scene.boxes import boxes
from seqopt.scene.parts import Brick
from seqopt.scene.shape import normal_of

__all__ = [
    "View",
    "draw_bricks",
    "draw_grips",
    "draw_network",
    "draw_responses",
    "force_key",
]

Faces = tuple[tuple[int, ...], ...]
Color = tuple[float, float, float, float]
FACES: Faces = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
CLAY = np.array([0.80, 0.52, 0.38])
MARKED = np.array([0.46, 0.63, 0.76])
ROBOT_COLORS = ("#0b7a75", "#7b2d8b", "#b35900", "#444444")
ROBOT_MARKERS = "XPDs"
LINE = 11.0  # points from one line of text to the next
NEAR_UP, NEAR_ASIDE = 0.08, 0.3  # share of a picture within which labels are neighbors


def draw_bricks(  # noqa: PLR0913  # what is drawn, and how, each by its name
    axes: Axes,
    network: Network,
    bricks: int,
    view: View,
    *,
    twist: Floats | None = None,
    magnify: float = 1.0,
    alpha: float = 1.0,
    marked: Collection[int] = (),
) -> None:
    """Draw the first bricks, boxes or not, shaded, in place or moved.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        To draw on.
    network : Network
        Of the scene.
    bricks : int
        How many, in build order.
    view : View
        From where.
    twist : (b, 6) float, optional
        Translation and rotation of every brick, m and rad.
    magnify : float
        How many times larger the motion is drawn.
    alpha : float
        Opacity, from 0 to 1.
    marked : collection of int
        Names of bricks that are drawn in another color.
    """
    boxed = _moved(network, bricks, twist, magnify)
    polygons, colors = [], []
    for b in drawing_order(boxed, view.axes()):
        own = MARKED if (brick := network.scene.placed[b]).name in marked else CLAY
        points, faces = _solid(brick, boxed[b], None if twist is None else magnify * twist[b])
        seen = points @ view.axes().T
        for face in _in_order(faces, seen, whole=brick.shape is None):
            polygons.append(seen[list(face), :2])
            red, green, blue = (_light(points, face) * own).tolist()
            colors.append((red, green, blue, alpha))
    _fill(axes, polygons, colors, alpha)
    frame(axes)


def draw_grips(axes: Axes, network: Network, grips: Sequence[int | None], view: View) -> None:
    """Mark the nodes that robots hold.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        To draw on.
    network : Network
        Of the scene.
    grips : sequence of (int or None)
        Node that each of the scene's robots holds.
    view : View
        From where.
    """
    at = {
        i: view.axes()[:2] @ np.array(network.scene.node_position(node))
        for i, node in enumerate(grips)
        if node is not None
    }
    shifts = _apart(at, max(axes.dataLim.width, axes.dataLim.height, 0.0))
    for i, (x, y) in at.items():
        color = ROBOT_COLORS[i % len(ROBOT_COLORS)]
        marker = ROBOT_MARKERS[i % len(ROBOT_MARKERS)]
        axes.scatter([x], [y], s=90, marker=marker, c=color, edgecolors="white", zorder=5)
        axes.annotate(
            f"{network.scene.robots[i].name} at {grips[i]}",
            (x, y),
            (10, shifts[i]),
            textcoords="offset points",
            va="center",
            fontsize=SMALL,
            color=color,
            zorder=6,
            path_effects=HALO,
        )


def _apart(at: Mapping[int, Floats], size: float) -> dict[int, float]:
    """Return how far up every label goes, points, so that those of neighbors stand in lines.

    ``at`` has where marks are (2,), ``size`` how large the picture is, both m.
    """
    out = {}
    for i, (x, y) in at.items():
        near = [
            j
            for j, (u, v) in at.items()
            if abs(v - y) <= NEAR_UP * size and abs(u - x) <= NEAR_ASIDE * size
        ]
        below = sorted(near, key=lambda j: float(at[j][1]))
        out[i] = LINE * (below.index(i) - (len(near) - 1) / 2)
    return out


def _moved(network: Network, bricks: int, twist: Floats | None, magnify: float) -> Floats:
    """Return the corners of the first bricks, (b, 8, 3), m, moved by twists (b, 6) if given."""
    corners = boxes(network.scene.placed[:bricks]).corners()
    if twist is None:
        return corners
    arm = corners - corners.mean(axis=1, keepdims=True)
    turned = np.cross(twist[:bricks, None, 3:], arm)
    return np.asarray(corners + magnify * (twist[:bricks, None, :3] + turned))


def _fill(axes: Axes, polygons: list[Floats], colors: list[Color], alpha: float) -> None:
    """Draw polygons (m, 2) with an edge around each."""
    edge = (0.25, 0.15, 0.1, alpha)
    axes.add_collection(
        PolyCollection(polygons, facecolors=colors, edgecolors=edge, linewidths=0.4)
    )


def _solid(brick: Brick, corners: Floats, motion: Floats | None) -> tuple[Floats, Faces]:
    """Return vertices (V, 3), m, and faces of a brick: the corners of its box, or of its shape.

    Those of a shape are moved by a twist if given; those of a box are.
    """
    if brick.shape is None:
        return corners, FACES
    points, faces = vertices_of(brick)
    if motion is not None:
        points = points + motion[:3] + np.cross(motion[3:], points - brick.position)
    return points, tuple(map(tuple, faces))


def _in_order(faces: Faces, seen: Floats, *, whole: bool) -> list[tuple[int, ...]]:
    """Return faces, as vertices (V, 3) are seen, the farthest first; turned away ones if whole."""
    drawn = [face for face in faces if whole or normal_of(seen[list(face)])[2] > 0]
    return sorted(drawn, key=lambda face: float(seen[list(face), 2].mean()))


def _light(corners: Floats, face: tuple[int, ...]) -> float:
    """Return how bright a face of corners (V, 3) is, from 0.55 to 1."""
    normal = normal_of(corners[list(face)])
    return float(0.55 + 0.45 * abs(normal @ [0.3, -0.5, 0.8]) / np.linalg.norm(normal))
