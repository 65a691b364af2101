"""Pictures of a partial structure: bricks, network, grips, and how they move (extra ``plot``).

Bricks are drawn from the farthest to the nearest. Sorting faces by depth fails where a long one
lies beside a short one. Of two convex bodies that a plane parts, the one on the viewer's side of it
is drawn last; among the bodies that hide each other in the picture this gives an order, unless they
do so in a circle. Where several planes part two bodies and disagree, neither hides the other:
bricks that are corbelled touch along an edge, where any of the planes alone could name the wrong
one.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.patheffects import withStroke

from seqopt._registry import Later
from seqopt.arms._model import PosedArm
from seqopt.arrays import Floats, Ints
from seqopt.network.network import Network, PartKind
from seqopt.report._robots import ROBOT_COLORS, Cell
from seqopt.report._style import BLUE, SMALL, VERMILION
from seqopt.scene.boxes import box_corners, vertices_of
from seqopt.scene.scene import Scene
from seqopt.scene.shape import normal_of

spatial = Later("scipy.spatial")  # slow to import

HALO = (withStroke(linewidth=2.5, foreground="white"),)
POINTS = 9.0  # from a mark up to the middle of its number
EDGES = ((0, 4), (0, 2), (0, 1))  # corners of a box along its length, width and thickness
PAIRS = ((0, 1), (0, 2), (1, 2))  # of these
EVEN = 1e-9  # share of a direction toward the viewer that is none
TOUCH = 1e-6  # share of a box's size up to which boxes that touch are parted
INK, TENSION, COMPRESSION = "#2b2b2b", VERMILION, BLUE
THIN, THICK = 1.2, 7.0  # points: edges without force, and with the largest
SPARE = 0.3  # share of a node's area where the colors of edges count
CLAY = np.array([0.80, 0.52, 0.38])
MARKED = np.array([0.46, 0.63, 0.76])
ROBOT_MARKERS = "XPDs"
GROUND, ARM = "#efece6", 3.2  # color; width of an arm, points
PALE, THROUGH = 0.55, 0.6  # of the color of an arm's bodies; opacity of those before bricks
PROP = "#8a8478"
PROP_MARK: dict[str, Any] = {"marker": "^", "color": PROP, "mec": "white", "ls": "none"}
LINE = 11.0  # points from one line of text to the next
NEAR = (0.3, 0.08)  # share of a picture within which labels are neighbors, aside and up


@dataclass(frozen=True)
class View:
    """A parallel projection, from an azimuth (-y towards +x) and an elevation in degrees."""

    azimuth: float = 25.0
    elevation: float = 15.0

    def axes(self) -> Floats:
        """Return the unit vectors to the right, up and towards the viewer, (3, 3)."""
        a, e = np.radians([self.azimuth, self.elevation])
        right = np.array([np.cos(a), np.sin(a), 0.0])
        toward = np.array([np.sin(a) * np.cos(e), -np.cos(a) * np.cos(e), np.sin(e)])
        return np.stack([right, np.cross(toward, right), toward])


def _frame(axes: Axes) -> None:
    """Fit axes to a picture, which has none."""
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()


def _drawing_order(corners: Floats, toward: Floats) -> list[int]:
    """Return the indices of boxes with corners (n, 8, 3) from the farthest to the nearest.

    ``toward`` has unit vectors to the right, up and toward the viewer (3, 3). Boxes that hide each
    other in a circle, or share room, stand in the order of their middles.
    """
    seen = corners @ toward.T
    low, high = seen[..., :2].min(axis=1), seen[..., :2].max(axis=1)
    over = (low[:, None] < high[None]).all(axis=2)  # rectangles around them in the picture
    pairs = np.argwhere(np.triu(over & over.T, 1)).astype(np.int64)
    behind: list[set[int]] = [set() for _ in corners]
    for pair, side in zip(pairs.tolist(), _in_front(seen, pairs).tolist(), strict=True):
        if side:
            far, near = pair[::side]
            behind[near].add(far)
    left: list[int] = np.argsort(seen[..., 2].mean(axis=1), kind="stable").tolist()
    order = []
    while left:  # the farthest with none of the rest behind it, or, in a circle, of all
        i = next((k for k in left if not behind[k]), left[0])
        left.remove(i)
        order.append(i)
        for waits in behind:
            waits.discard(i)
    return order


def _in_front(seen: Floats, pairs: Ints) -> Ints:
    """Return 1 where the second box of a pair lies in front of the first, -1 behind it, else 0."""
    a, b = pairs.T
    edges = np.stack([seen[:, j] - seen[:, i] for i, j in EDGES], axis=1)
    normals = np.stack([np.cross(edges[:, i], edges[:, j]) for i, j in PAIRS], axis=1)
    across = np.cross(edges[a][:, :, None], edges[b][:, None]).reshape(-1, 9, 3)
    axes = np.concatenate([normals[a], normals[b], across], axis=1)
    size = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = np.divide(axes, size, out=np.zeros_like(axes), where=size > EVEN * size.max(initial=1.0))
    first, second = (axes @ seen[which].transpose(0, 2, 1) for which in (a, b))
    ahead = second.min(axis=2) - first.max(axis=2)  # how far the second lies along each axis
    behind = first.min(axis=2) - second.max(axis=2)
    known = np.linalg.norm(axes, axis=2) > 0.5  # not the product of edges that are parallel
    apart = np.where(known, np.maximum(ahead, behind), -np.inf)
    touch = TOUCH * np.linalg.norm(edges[a], axis=2).max(axis=1, keepdims=True)
    parts = apart >= np.minimum(apart.max(axis=1, keepdims=True), -touch)
    sign = np.where(ahead >= behind, 1, -1)
    facing = np.where(np.abs(axes[..., 2]) > EVEN, sign * np.sign(axes[..., 2]), 0)
    nearest = np.where(parts, facing, 2).min(axis=1)
    farthest = np.where(parts, facing, -2).max(axis=1)
    return np.asarray(np.where(nearest == farthest, nearest, 0).astype(np.int64))


def draw_network(
    axes: Axes,
    network: Network,
    bricks: int,
    view: View,
    *,
    edge_force: Floats | None = None,
    largest_force: float | None = None,
    numbers: bool = False,
) -> None:
    """Draw nodes and edges of the first bricks.

    The axial force of every edge (E,), N, tension positive, colors it and sets its width, of which
    the largest force is the widest, as `force_key` says. Numbers are those of the nodes that robots
    may hold.
    """
    nodes, edges = network.count_nodes(bricks), network.count_edges(bricks)
    seen = network.node_position[:nodes] @ view.axes()[:2].T
    segments = list(seen[network.edge_nodes[:edges]])
    look: Any = {"colors": INK, "linewidths": THIN}
    if edge_force is not None:
        size = largest_force or np.abs(edge_force).max() or 1.0
        look["colors"] = [TENSION if force > 0 else COMPRESSION for force in edge_force]
        look["linewidths"] = (THIN + (THICK - THIN) * np.abs(edge_force) / size).tolist()
    axes.add_collection(LineCollection(segments, **look))
    kind = network.node_kind[:nodes]
    for which, marker, size, face in (
        (PartKind.INNER, "o", 9, INK),
        (PartKind.JOINT, "o", 12, "white"),
        (PartKind.BASE, "s", 36, INK),
    ):
        area = size * (1.0 if edge_force is None else SPARE)
        mark: Any = {"marker": marker, "c": face, "edgecolors": INK, "linewidths": 0.7}
        x, y = seen[kind == which].T
        axes.scatter(x, y, area, zorder=3, **mark)
    if numbers:
        inner = np.flatnonzero(kind == PartKind.INNER.value)
        for i in inner:
            _write(axes, str(network.node_name[i]), seen[i], (0, POINTS), ha="center", zorder=4)
    _frame(axes)


def _write(axes: Axes, text: str, at: Any, shift: tuple[float, float], **how: Any) -> None:
    """Write text beside a point, shifted by points, with a halo."""
    beside: Any = {"textcoords": "offset points", "va": "center", "fontsize": SMALL}
    axes.annotate(text, at, shift, path_effects=HALO, **beside, **how)


def force_key(largest_force: float) -> list[Line2D]:
    """Return entries of a legend for color and width of edges, up to the force drawn widest, N."""
    entries = [(TENSION, THICK / 2, "tension"), (COMPRESSION, THICK / 2, "compression")]
    for share in (0.1, 0.5, 1.0):
        entries.append((INK, THIN + (THICK - THIN) * share, f"{share * largest_force:.0f} N"))
    return [Line2D([], [], color=color, lw=width, label=text) for color, width, text in entries]


def draw_bricks(  # what is drawn, and how, each by its name
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

    The twist of every brick (b, 6), m and rad, is drawn so many times larger; bricks of marked
    names have another color.
    """
    placed, toward = network.scene.placed[:bricks], view.axes()
    motion = np.zeros((bricks, 6)) if twist is None else magnify * twist

    def moved(b: int, points: Floats) -> Floats:
        shift, turn = np.split(motion[b], 2)
        return np.asarray(points + shift + np.cross(turn, points - placed[b].position))

    boxed = np.array([moved(b, corners) for b, corners in enumerate(box_corners(placed))])
    polygons, colors = [], []
    for b in _drawing_order(boxed, toward):
        brick, (points, faces) = placed[b], vertices_of(placed[b])
        points = moved(b, points)
        seen = points @ toward.T
        for face in sorted(map(list, faces), key=lambda face: float(seen[face, 2].mean())):
            if brick.shape is not None and normal_of(seen[face])[2] <= 0:  # turned away
                continue
            polygons.append(seen[face, :2])
            normal = normal_of(points[face])  # whose direction says how bright a face is
            light = 0.55 + 0.45 * abs(normal @ [0.3, -0.5, 0.8]) / np.linalg.norm(normal)
            colors.append((*(light * (MARKED if brick.name in marked else CLAY)), alpha))
    rim = (0.25, 0.15, 0.1, alpha)
    drawn: Any = {"facecolors": colors, "edgecolors": [rim], "linewidths": 0.4}
    axes.add_collection(PolyCollection(polygons, **drawn))
    _frame(axes)


def draw_grips(
    axes: Axes, network: Network, grips: Sequence[int | None], view: View, *, named: bool = True
) -> dict[int, Line2D]:
    """Mark the nodes that the scene's robots hold, each beside its name if ``named``.

    Results: entries of a legend by the index of the robot.
    """
    scene, key = network.scene, dict[int, Line2D]()
    held = {i: node for i, node in enumerate(grips) if node is not None}
    at = {i: view.axes()[:2] @ np.array(scene.node_position(node)) for i, node in held.items()}
    beside, above = (share * max(axes.dataLim.width, axes.dataLim.height, 0.0) for share in NEAR)
    for i, (x, y) in at.items():
        robot = scene.robots[i].name
        name = f"{robot} at {grips[i]}"
        rim: Any = {"ms": 10.5, "mec": "white", "mew": 0.8}
        mark = _grip_mark(i) | rim | {"ls": "none", "zorder": 5}
        axes.plot([x], [y], **mark, gid=name)
        key[i] = Line2D([], [], **mark, label=f"{robot} holds")
        if named:  # labels of neighbors stand in lines, one above the other
            near = [j for j, (u, v) in at.items() if abs(v - y) <= above and abs(u - x) <= beside]
            line = sorted(near, key=lambda j: float(at[j][1])).index(i) - (len(near) - 1) / 2
            _write(axes, name, (x, y), (10, LINE * line), color=mark["color"], zorder=6)
    return key


def _draw_robots(
    axes: Axes, cell: Cell, arms: Sequence[Floats | PosedArm | None], view: View
) -> None:
    """Draw the ground and the arms of all robots, behind the structure or before it.

    ``arms``: of every robot in a step: its bodies are drawn where its posture is known, otherwise
    the line from its foot to its grip; see `seqopt.report._robots`. Tools are dark.
    """
    right, up, toward = view.axes()
    seen = np.stack([right, up]).T
    axes.add_patch(Polygon(cell.yard @ seen, fc=GROUND, lw=0, zorder=0.1))
    for i, arm in enumerate(arms):
        if arm is None:
            continue
        points = arm.line if isinstance(arm, PosedArm) else arm
        color = _grip_mark(i)["color"]
        order = 4.0 if (points[0] - cell.middle) @ toward > 0 else 0.5
        bodies = [body @ view.axes().T for body in arm.bodies] if isinstance(arm, PosedArm) else []
        for body in sorted(bodies, key=lambda body: float(body[:, 2].mean())):  # farthest first
            tool = isinstance(arm, PosedArm) and arm.holds and body is bodies[-1]
            face = to_rgb(INK) if tool else tuple(1 - PALE * (1 - np.array(to_rgb(color))))
            fill: Any = {"fc": (*face, THROUGH if order > 1 else 1.0), "ec": color, "lw": 0.7}
            around = body[spatial.ConvexHull(body[:, :2]).vertices, :2]
            axes.add_patch(Polygon(around, joinstyle="round", zorder=order, **fill))
        if bodies:
            continue
        line, wide = points @ seen, ARM if len(points) > 2 else 0.5 * ARM
        look: Any = {"fill": False, "capstyle": "round", "zorder": order}
        for width, paint in ((wide + 1.6, "white"), (wide, color)):
            links = PathPatch(Path(line[:-1]), lw=width, ec=paint, joinstyle="round", **look)
            axes.add_patch(links)
        axes.add_patch(PathPatch(Path(line[-2:]), lw=0.6 * ARM, ec=INK, **look))  # its tool


def _draw_props(axes: Axes, scene: Scene, bricks: int, *, held: bool, view: View) -> None:
    """Draw the props that hold while so many bricks stand, behind the structure.

    ``held``: whether a robot holds any.
    """
    cell = Cell(scene)
    for prop in scene.standing_props(bricks, held=held):
        x, y = view.axes()[:2] @ cell.prop(prop).T
        axes.plot(x, y, color=PROP, lw=3.5, solid_capstyle="butt", zorder=0.4)
        axes.plot(x[:1], y[:1], **PROP_MARK, ms=7, zorder=4.5)


def _grip_mark(robot: int) -> dict[str, Any]:
    """Return color and shape of the mark of a robot's grip."""
    color, marker = (each[robot % len(each)] for each in (ROBOT_COLORS, ROBOT_MARKERS))
    return {"color": color, "marker": marker}
