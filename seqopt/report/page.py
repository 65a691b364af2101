"""A page that shows builds: one file, offline, with a step viewer in three dimensions.

The viewer gets the structure once, and every step of one or more builds, as numbers. Fields are
kept as whole numbers of a step's largest value over 32,767: three digits more than a picture can
show. Numbers that are read are those of the tables, digit by digit.
"""

from __future__ import annotations

import gzip
import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from html import escape
from importlib import resources
from itertools import compress, cycle

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from seqopt.arms._model import shape_notes
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import ProblemError
from seqopt.exchange._files import csv_text
from seqopt.network.network import Network
from seqopt.problem.requirements import _prop_faults, overloads
from seqopt.report._robots import ROBOT_COLORS, Arms, Cell, arm_data
from seqopt.report.text import _deciding_step, _in_a_sentence, _robot_words
from seqopt.responses.quantities import _number_text
from seqopt.responses.table import OUTSIDE, Departure, _distinct, _each_fields, force_column
from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Brick
from seqopt.scene.scene import Order, Scene
from seqopt.scene.shape import normal_of
from seqopt.sequence.steps import Grips, Step
from seqopt.stability.failure_map import WORDS, BuildVerdicts

LARGEST = 32767
FIELDS = ("twist", "edge", "push", "turn")  # packed, a row for every step
RESPONSES = {
    "F_largest": "largest grip force, N",
    "M_sup_Nm": "largest support moment, N m",
    "F_max_N": "largest tension in an edge, N",
    "D_max_1e-3mm": "largest displacement, µm",
}
PARTS = {"style": "viewer.css", "three": "three.js", "charts": "charts.js", "viewer": "viewer.js"}
_WANT = Want.EDGES | Want.BRICKS | Want.SUPPORT
MOST = 6_000_000  # numbers of fields in a page: about 8 MB
LEFT_OUT = "Displacements and axial forces of some builds are left out"


@dataclass(frozen=True, eq=False)
class Build:
    """A build that is shown step by step, with the responses of its steps.

    ``verdicts`` say which steps stand, where that was asked, with the mortar of the scene last;
    ``bounds`` are limits by column of the table, or ``F_largest``, that are drawn beside the
    responses; ``order`` names the bricks as they are placed, where that is not the scene's own;
    ``arms``: of robots whose postures are known, by name (of others a simple arm is drawn);
    ``faults``: in which steps arms cannot be, in words.
    """

    name: str
    steps: Sequence[Step]
    table: pd.DataFrame
    verdicts: Sequence[BuildVerdicts] = ()
    bounds: Mapping[str, float] = field(default_factory=dict)
    departures: Sequence[Departure] = ()
    order: Order = ()
    arms: Arms = field(default_factory=dict)
    faults: Sequence[str] = ()

    def sentence(self, scene: Scene) -> str:
        """Describe it in one sentence."""
        return _in_a_sentence(scene, self.table, self.verdicts, self.departures, self.faults)


def _structure_data(network: Network, cell: Cell) -> dict[str, object]:
    """Return a structure as lists, ready for JSON.

    Edges end with their brick count; ``carried`` are the bricks that every node moves with.
    """
    scene, graph = network.scene, network.graph.to_undirected(as_view=True)
    moving = ({data["brick"] for *_, data in graph.edges(n, data=True)} for n in network.node_name)
    return {
        "name": scene.name,
        "bricks": [
            {"name": brick.name, "center": _rounded(center), **_solid(brick)}
            for brick, center in zip(scene.placed, network.centroid, strict=True)
        ],
        "nodes": {
            str(node): {"at": _rounded(scene.node_position(node)), "brick": i}
            for i, brick in enumerate(scene.placed)
            for node in brick.nodes
        },
        "points": _rounded(network.node_position),
        "carried": [sorted(bricks - {-1}) for bricks in moving],
        "edges": np.column_stack([network.edge_nodes, network.edge_since]).tolist(),
        "grounds": [
            {"at": _rounded(ground.anchor), "brick": ground.brick} for ground in scene.grounds
        ],
        "robots": [
            {
                "name": robot.name,
                "words": _robot_words(robot.name),
                "payload": robot.payload,
                "color": color,
                "reach": cell.reach(robot),
            }
            for robot, color in zip(scene.robots, cycle(ROBOT_COLORS), strict=False)
        ],
        "props": [{"line": _rounded(cell.prop(prop)), "node": prop.node} for prop in scene.props],
        "up": list(scene.up),
        "level": cell.level,
    }


def _rounded(values: ArrayLike) -> object:
    return np.asarray(values).round(6).tolist()


def _solid(brick: Brick) -> dict[str, object]:
    """Return corners (k, 3) and faces of a brick, each from a vertex that sees all of it, if any.

    The viewer draws a face as a fan.
    """
    points, faces = vertices_of(brick)
    fans = []
    for face in faces:
        fan, normal = tuple(face), normal_of(points[list(face)])
        for k in range(len(face)):
            turned = (*face[k:], *face[:k])
            spokes = points[list(turned[1:])] - points[turned[0]]
            if (np.cross(spokes[:-1], spokes[1:]) @ normal >= 0).all():
                fan = turned
                break
        fans.append(fan)
    return {"corners": _rounded(points), "faces": fans}


def _build_data(
    engine: Engine,
    build: Build,
    cell: Cell,
    known: Mapping[tuple[int, Grips], Fields],
    *,
    fields: bool,
) -> dict[str, object]:
    """Return the steps of a build as lists, ready for JSON.

    Rows of the table of responses are text; ``stands`` says whether every step stands with every
    mortar, ``marks`` what is wrong with it; the packed fields ``twist``, ``edge``, ``push`` and
    ``turn`` (force and moment of every ground end) have the ``scale`` of each step, or are None.
    ``known``: fields by state.
    """
    lines = [line.split(",") for line in csv_text(build.table).splitlines()]
    scene = engine.network.scene
    stands = [[f"{WORDS[v]} {each.how}" for v in each.verdicts] for each in build.verdicts]
    return {
        "name": build.name,
        "bounds": dict(build.bounds),
        "rank": [build.order.index(n) for n in scene.build_order] if build.order else None,
        "stands": [" and ".join(each) for each in zip(*stands, strict=True)],
        "marks": _marks(scene, build),
        "verdicts": [
            {"how": each.how, "of": [WORDS[verdict] for verdict in each.verdicts]}
            for each in build.verdicts
        ],
        "decides": _deciding_step(scene, build.table, build.verdicts, build.departures),
        "sentence": build.sentence(scene),
        "arms": arm_data(cell, build.steps, build.arms),
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
        "forces": [force_column(robot) for robot in scene.robots],
        **(_fields(engine.network, build, known) if fields else dict.fromkeys(FIELDS)),
    }


def _marks(scene: Scene, build: Build) -> list[str]:
    """Return payloads that every step exceeds, and the linear range that it leaves, in words."""
    over, props, out = overloads(scene, build.table), _prop_faults(scene, build.table), []
    for step in build.steps:
        lines = [
            f"{_robot_words(each.robot)} exceeds its payload"
            for each in over
            if step.number in each.steps
        ]
        lines += ["a prop bears more than it may" for each in props if step.number in each.steps]
        left = [each.what for each in build.departures if step.number in each.steps]
        lines += [f"{OUTSIDE}: {', '.join(left)}"] if left else []
        lines += [f"falls {each.how}" for each in build.verdicts[-1:] if each.falls(step.number)]
        out.append("; ".join(lines))
    return out


def _fields(
    network: Network, build: Build, known: Mapping[tuple[int, Grips], Fields]
) -> dict[str, object]:
    """Return twists (steps, B, 6), edge forces (steps, E) and reactions, packed."""
    count = len(build.steps)
    twist = np.zeros((count, len(network.inner), 6))
    edge = np.zeros((count, len(network.edge_nodes)))
    support = np.zeros((count, len(network.springs.support), 6))
    for i, step in enumerate(build.steps):
        found = known[step.bricks, step.grips]
        twist[i, : step.bricks] = found.brick_twist[0]
        edge[i, : found.edge_force.shape[1]] = found.edge_force[0]
        support[i] = found.support[0]
    parts = (twist, edge, support[..., :3], support[..., 3:])
    out = dict[str, object]()
    for name, part in zip(FIELDS, parts, strict=True):  # whole numbers, of a unit in each step
        flat = part.reshape(count, -1)
        size = np.abs(flat).max(axis=1, initial=0.0)
        scale = np.where(size > 0, size / LARGEST, 1.0)
        packed = gzip.compress(np.round(flat / scale[:, None]).astype("<i2").tobytes(), 9, mtime=0)
        units, data = [float(f"{s:.6g}") for s in scale], b64encode(packed).decode("ascii")
        out[name] = {"scale": units, "width": flat.shape[1], "data": data}
    return out


def report_page(
    engine: Engine,
    builds: Sequence[Build],
    sentence: str,
    tables: Sequence[tuple[str, pd.DataFrame | bytes]] = (),
    scatter: tuple[str, pd.DataFrame] | None = None,
    *,
    found: str = "",
) -> str:
    """Return a page that shows builds of one scene, as HTML that needs nothing else.

    The first build is shown first; a row of a table whose first cell names a build shows it. Fields
    of some builds are left out, and the page says so, where there are more than `MOST` numbers.
    ``scatter``: title and points of a chart, a row per build and a column for every quantity that
    an axis may show, in words and with its unit; the first two are shown first.
    """
    chart: dict[str, object] = {}
    if scatter is not None:
        title, points = scatter
        known = points.astype(float).replace([np.inf, -np.inf, np.nan], None)
        chart = {"title": title, "builds": [*map(str, points.index)], "axes": [*points]}
        chart["values"] = known.to_dict("list")
    data = _data(engine, builds) | {"scatter": chart or None}
    scene = engine.network.scene
    loading = f" Counted, and not drawn: {scene.loading}." if scene.loading else ""
    loading += "".join(f" Of {note}." for note in shape_notes(scene))
    return _filled(
        title=f"{escape(scene.name)}, step by step",
        sentence=escape(sentence + loading),
        found=escape(found),
        tables="".join(_part(caption, part) for caption, part in tables),
        data=data,
    )


def _filled(data: Mapping[str, object], **parts: str) -> str:
    """Return the page with its parts in their places, and the policy that lets its own run.

    No ``<`` in the ``data`` of the viewer can end the script it stands in.
    """
    parts["data"] = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    viewer = resources.files("seqopt") / "data/viewer"
    own = {part: (viewer / name).read_text(encoding="utf-8") for part, name in PARTS.items()}
    digests = (b64encode(sha256(text.encode()).digest()).decode() for text in own.values())
    style, *scripts = (f"'sha256-{digest}'" for digest in digests)
    policy = (
        f"default-src 'none'; script-src {' '.join(scripts)}; style-src {style}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    page = (viewer / "page.html").read_text(encoding="utf-8")
    for name, content in {"policy": policy, **parts, **own}.items():
        page = page.replace(f"<!-- {name} -->", content, 1)
    return page


def _data(engine: Engine, builds: Sequence[Build]) -> dict[str, object]:
    """Return the viewer's data of builds, with fields of as many as there is room for."""
    if not builds:
        raise ProblemError("a report of nothing; give at least one build")
    network, cell = engine.network, Cell(engine.network.scene)
    numbers = 6 * len(network.inner) + len(network.edge_nodes)  # of the fields of a step
    ends = np.cumsum([numbers * len(build.steps) for build in builds])
    drawn = [bool(end <= MOST) and not b.order for b, end in zip(builds, ends, strict=True)]
    states = _distinct(build.steps for build in compress(builds, drawn))
    known = dict(zip(states, _each_fields(engine, states.values(), _WANT), strict=True))
    why = "" if all(drawn) else "they place bricks in another order than the scene"
    why = "there are too many steps" if ends[-1] > MOST else why
    return {
        "structure": _structure_data(network, cell),
        "builds": [
            _build_data(engine, build, cell, known, fields=fields)
            for build, fields in zip(builds, drawn, strict=True)
        ],
        "responses": RESPONSES,
        "note": f"{LEFT_OUT}: {why}." if why else "",
    }


def _part(caption: str, part: pd.DataFrame | bytes) -> str:
    """Return a table as HTML, numbers as people write them, or a picture, PNG."""
    named = f"<figcaption>{escape(caption)}</figcaption>"
    if isinstance(part, bytes):
        source = f"data:image/png;base64,{b64encode(part).decode('ascii')}"
        return f'<figure class="drawn">{named}<img src="{source}" alt="{escape(caption)}"></figure>'
    body = part.map(_cell_text).to_html(index=False, border=0, classes="wide")
    body = body.replace(' style="text-align: right;"', "")  # as the page does itself
    return f'<figure class="table" tabindex="0">{named}{body}</figure>'


def _cell_text(value: object) -> object:
    """Return a number with four digits, or a count with separators, without powers of ten."""
    if value is None or value is pd.NA or value != value:  # noqa: PLR0124  # of NaN
        return ""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return f"{value:,}"
    if not isinstance(value, float | np.floating):
        return value
    number = float(value)
    if 1e3 <= abs(number) < 1e12:
        return f"{number:,.0f}"
    text = _number_text(number)
    return np.format_float_positional(float(text), trim="-") if "e" in text else text
