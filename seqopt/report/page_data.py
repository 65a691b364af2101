"""What the step viewer shows, as numbers: the structure once, and every step of one or more builds.

Fields are kept as whole numbers of a step's largest value over 32,767: three digits more than a
picture can show. Numbers that are read are those of the tables, digit by digit.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Want
from seqopt.files import csv_text
from seqopt.network.network import GROUND, Network, PartKind
from seqopt.placement.promises import Excess, overloads
from seqopt.responses.linear_range import OUTSIDE, Departure
from seqopt.responses.table import force_column
from seqopt.scene.blocks import vertices_of
from seqopt.scene.boxes import boxes
from seqopt.scene.scene import Scene
from seqopt.scene.shape import normal_of
from seqopt.sequence.steps import Step

LARGEST = 32767
FIELDS = ("twist", "edge", "push", "turn")  # packed, a row for every step
ROBOT_COLORS = ("#0b7a75", "#7b2d8b", "#b85c00", "#444444", "#1f5fa8")
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


@dataclass(frozen=True, eq=False)
class Build:
    """A build that is shown step by step.

    Attributes
    ----------
    name : str
        What it is called.
    steps : sequence of Step
    table : pandas.DataFrame
        Responses of these, as `seqopt.analyze` makes them.
    stands : sequence of str, optional
        Of every step, whether it stands; empty where that was not asked.
    bounds : mapping of str to float, optional
        Limits by column of the table, or ``F_largest``; drawn beside the responses.
    departures : sequence of Departure, optional
        The limits of the linear range that steps leave.
    """

    name: str
    steps: Sequence[Step]
    table: pd.DataFrame
    stands: Sequence[str] = ()
    bounds: Mapping[str, float] = field(default_factory=dict)
    departures: Sequence[Departure] = ()

    def overloads(self, scene: Scene) -> tuple[Excess, ...]:
        """Return the payloads that steps exceed."""
        return overloads(scene, self.table)


@dataclass(frozen=True, eq=False)
class Scatter:
    """A chart with a point for each of some builds.

    Attributes
    ----------
    title : str
    points : pandas.DataFrame
        A row per build, its name as index; a column for every quantity that an axis may show, in
        words and with its unit. The first two are shown first.
    logarithmic : sequence of str, optional
        The columns that are drawn on a logarithmic axis; their values are positive.
    """

    title: str
    points: pd.DataFrame
    logarithmic: Sequence[str] = ()

    def data(self) -> dict[str, object]:
        """Return it as lists, ready for JSON; what is not known is None.

        Returns
        -------
        dict
            ``title``, ``builds``, ``axes`` and ``logarithmic``, and ``values`` by axis.
        """
        known = self.points.astype(float).map(lambda value: value if np.isfinite(value) else None)
        known = known.astype(object).where(self.points.notna(), None)
        return {
            "title": self.title,
            "builds": [str(name) for name in self.points.index],
            "axes": [*self.points],
            "logarithmic": [*self.logarithmic],
            "values": {name: known[name].tolist() for name in known},
        }


def size_of(network: Network, build: Build) -> int:
    """Return how many numbers the fields of a build are."""
    return len(build.steps) * (6 * len(network.inner) + len(network.edge_nodes))


def structure_data(network: Network) -> dict[str, object]:
    """Return a structure as lists, ready for JSON.

    Returns
    -------
    dict
        ``bricks`` in build order with ``name``, ``corners``, ``faces`` and ``center``; ``nodes``
        with the place of each and its brick; ``edges`` with the points at their ends, the bricks
        that carry these, and the brick count from which they are there; ``grounds``; ``robots``.
    """
    scene = network.scene
    solids = _solids(scene)
    ends = [[int(i) for i in row] for row in network.edge_nodes]
    return {
        "name": scene.name,
        "bricks": [
            {
                "name": brick.name,
                "center": _rounded(network.centroid[i]),
                "corners": _rounded(solids[i][0]),
                "faces": solids[i][1],
            }
            for i, brick in enumerate(scene.placed)
        ],
        "nodes": {
            str(node): {"at": _rounded(np.array(scene.node_position(node))), "brick": i}
            for i, brick in enumerate(scene.placed)
            for node in brick.nodes
        },
        "points": [_rounded(point) for point in network.node_position],
        "carried": _carried(network),
        "edges": [[*ends[e], int(network.edge_since[e])] for e in range(len(network.edge_nodes))],
        "grounds": [
            {"at": _rounded(np.array(ground.anchor)), "brick": ground.brick}
            for ground in scene.grounds
        ],
        "robots": [
            {"name": robot.name, "payload": robot.payload, "color": color}
            for robot, color in zip(scene.robots, _colors(len(scene.robots)), strict=True)
        ],
        "up": list(scene.up),
    }


def _solids(scene: Scene) -> list[tuple[Floats, Sequence[Sequence[int]]]]:
    """Return corners (k, 3) and faces of all bricks; the viewer draws a face as a fan."""
    out: list[tuple[Floats, Sequence[Sequence[int]]]] = []
    for brick, corners in zip(scene.placed, boxes(scene.placed).corners(), strict=True):
        if brick.shape is None:
            out.append((corners, FACES))
            continue
        points, faces = vertices_of(brick)
        out.append((points, [_fan(points, tuple(face)) for face in faces]))
    return out


def _fan(points: Floats, face: tuple[int, ...]) -> tuple[int, ...]:
    """Return a face from a vertex that sees all of it, if it has one."""
    normal = normal_of(points[list(face)])
    for k in range(len(face)):
        turned = (*face[k:], *face[:k])
        spokes = points[list(turned[1:])] - points[turned[0]]
        if (np.cross(spokes[:-1], spokes[1:]) @ normal >= 0).all():
            return turned
    return face


def _carried(network: Network) -> list[list[int]]:
    """Return the bricks that every node moves with, none for those that are fixed."""
    out = []
    for kind, brick, spring in zip(
        network.node_kind.tolist(),
        network.node_brick.tolist(),
        network.node_spring.tolist(),
        strict=True,
    ):
        bodies = [brick] if brick >= 0 else network.springs.bodies[spring].tolist()
        fixed = kind == PartKind.BASE.value
        out.append([] if fixed else [body for body in bodies if body != GROUND])
    return out


def build_data(engine: Engine, build: Build, *, fields: bool = True) -> dict[str, object]:
    """Return the steps of a build as lists, ready for JSON.

    Parameters
    ----------
    engine : Engine
        What computes fields.
    build : Build
    fields : bool, optional
        Whether displacements and axial forces are among what is returned.

    Returns
    -------
    dict
        ``name`` and ``bounds``; ``steps`` with number, kind, bricks and the node that each robot
        holds; ``columns`` and ``rows`` of the table of responses, as text, ``forces`` the columns
        of the robots; whether each step ``stands``, and as ``marks`` what is wrong with it; packed
        fields ``twist``, ``edge``, ``push`` and ``turn`` (force and moment of every ground end)
        with the ``scale`` of each step, or None.
    """
    lines = [line.split(",") for line in csv_text(build.table).splitlines()]
    found = _fields(engine, build) if fields else dict.fromkeys(FIELDS)
    return {
        "name": build.name,
        "bounds": dict(build.bounds),
        "stands": list(build.stands),
        "marks": _marks(engine.network.scene, build),
        "steps": [
            {
                "number": step.number,
                "kind": step.kind.value,
                "bricks": step.bricks,
                "grips": [None if grip is None else int(grip) for grip in step.grips],
            }
            for step in build.steps
        ],
        "columns": lines[0],
        "rows": lines[1:],
        "forces": [force_column(robot) for robot in engine.network.scene.robots],
        **{name: None if part is None else _packed(part) for name, part in found.items()},
    }


def _marks(scene: Scene, build: Build) -> list[str]:
    """Return payloads that every step exceeds, and the linear range that it leaves, in words."""
    over, out = build.overloads(scene), []
    for step in build.steps:
        said = [f"{each.robot} exceeds its payload" for each in over if step.number in each.steps]
        left = [each.what for each in build.departures if step.number in each.steps]
        out.append("; ".join(said + ([f"{OUTSIDE}: {', '.join(left)}"] if left else [])))
    return out


def _fields(engine: Engine, build: Build) -> dict[str, Floats]:
    """Return twists (steps, B, 6), edge forces (steps, E), and what ground ends exert."""
    network = engine.network
    count = len(build.steps)
    twist = np.zeros((count, len(network.inner), 6))
    edge = np.zeros((count, len(network.edge_nodes)))
    support = np.zeros((count, len(network.springs.support), 6))
    for i, step in enumerate(build.steps):
        held = np.array([step.held], dtype=np.int64).reshape(1, -1)
        found = engine.solve(step.bricks, held, Want.EDGES | Want.BRICKS | Want.SUPPORT)
        twist[i, : step.bricks] = found.brick_twist[0]
        edge[i, : found.edge_force.shape[1]] = found.edge_force[0]
        support[i] = found.support[0]
    return dict(zip(FIELDS, (twist, edge, support[..., :3], support[..., 3:]), strict=True))


def _packed(values: Floats) -> dict[str, object]:
    """Return fields (steps, …) as compressed whole numbers, and what one is worth in each step."""
    flat = values.reshape(len(values), -1)
    size = np.abs(flat).max(axis=1, initial=0.0)
    scale = np.where(size > 0, size / LARGEST, 1.0)
    numbers = np.round(flat / scale[:, None]).astype("<i2")
    data = base64.b64encode(gzip.compress(numbers.tobytes(), 9, mtime=0)).decode("ascii")
    return {"scale": [float(f"{s:.6g}") for s in scale], "width": flat.shape[1], "data": data}


def _colors(count: int) -> list[str]:
    return [ROBOT_COLORS[i % len(ROBOT_COLORS)] for i in range(count)]


def _rounded(values: Floats) -> object:
    return np.round(values, 6).tolist()
