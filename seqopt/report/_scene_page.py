"""The page of a scene: bricks by name in their order, nodes, ground, and what robots reach."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import cycle

import numpy as np
import pandas as pd

from seqopt.arms._permits import reach_table
from seqopt.arms._urdf import shape_notes
from seqopt.arms.reach import find_postures
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ExtraError, SceneError
from seqopt.network.build import build_network
from seqopt.report._robots import ROBOT_COLORS, Cell, _known_arms
from seqopt.report.page import (
    Build,
    _as_json,
    _build_data,
    _filled,
    _part,
    _rounded,
    _structure_data,
)
from seqopt.responses.table import force_column
from seqopt.scene.parts import Side, Sphere
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind

EVERY = "#222222"  # of a node that several robots reach
ORDER = "build order"


def scene_page(scene: Scene) -> str:
    """Return the page of a scene, as HTML that needs nothing else: one step a brick."""
    network = build_network(scene)
    nobody = (None,) * len(scene.robots)
    steps = [Step(k + 1, StepKind.PLACE, k + 1, nobody) for k in range(len(scene.placed))]
    empty = {n: np.nan for r in scene.robots for n in (f"{r.name}_node", force_column(r))}
    counts = [step.number for step in steps]
    table = pd.DataFrame({"step": counts, "type": "place", "bricks": counts} | empty)
    arms = _known_arms(scene, steps)
    build = Build(ORDER, steps, table, order=scene.build_order, arms=arms)
    whole = {"tasks": None, "sentence": "", "decides": len(steps) - 1}  # it opens with all bricks
    data = {
        "structure": _structure_data(network) | {"marks": _marks(scene)},
        "builds": [_build_data(make_engine(USUAL, network), build, fields=False) | whole],
        "responses": {},
        "scatter": None,
        "note": "Bricks appear in the order in which they are placed; a plan says who holds.",
    }
    ends, robots = f"{len(scene.grounds)} ground ends", f"{len(scene.robots)} robots"
    doubts = [f"Of {note}." for note in shape_notes(scene)]
    trouble = _trouble(scene)
    doubts += [f"What arms reach is not known: {trouble}."] if trouble else []
    tables = {"Robots": _robots(scene), "Bricks, in the order of the build": _bricks(scene)}
    return _filled(
        title=escape(scene.name),
        sentence=f"{len(scene.bricks)} bricks, {ends}, {robots}. seqopt optimize looks for a plan."
        + "".join(f" {escape(doubt)}" for doubt in doubts),
        tables="".join(_part(caption, part) for caption, part in tables.items()),
        data=_as_json(data),
    )


def _reaching(scene: Scene) -> dict[int, list[int]]:
    """Return which robots reach every node that is not blocked, with arms if they have any."""
    every = (node for brick in scene.placed for node in brick.nodes)
    found: dict[int, list[int]] = {node: [] for node in every if node not in scene.blocked_nodes}
    by_arm = _by_arms(scene)
    for k, robot in enumerate(scene.robots):
        for node in (node for nodes in scene.within_reach(robot) for node in nodes):
            if robot.arm is None or node in by_arm.get(robot.name, ()):
                found[node].append(k)
    return found


def _trouble(scene: Scene) -> str:
    """Return why it cannot be computed what arms reach, if so."""
    try:
        find_postures(scene)
    except (ExtraError, SceneError) as error:
        return str(error)
    return ""


def _by_arms(scene: Scene) -> dict[str, set[int]]:
    """Return the nodes that arms reach, by robot; nothing where it cannot be computed here."""
    if not scene.has_arms or _trouble(scene):
        return {}
    table = reach_table(scene)
    able = table[table["to_bricks"] > 0]
    return {str(name): {*map(int, rows["node"])} for name, rows in able.groupby("robot")}


def _marks(scene: Scene) -> dict[str, object]:
    """Return nodes by who reaches them, and reaches, ready for JSON."""
    colors = dict(zip(range(len(scene.robots)), cycle(ROBOT_COLORS), strict=False))
    rank = {brick.name: k for k, brick in enumerate(scene.placed)}
    nodes = [
        {
            "at": _rounded(scene.node_position(node)),
            "brick": rank[scene.brick_of_node[node].name],
            "color": "" if not able else colors[able[0]] if len(able) == 1 else EVERY,
        }
        for node, able in _reaching(scene).items()
    ]
    reaches = [each | {"color": colors[k]} for k, each in _reaches(scene)]
    return {"nodes": nodes, "reaches": reaches}


def _reaches(scene: Scene) -> Iterator[tuple[int, dict[str, object]]]:
    """Yield spheres, and squares of the planes that bound what robots beside it reach."""
    cell = Cell(scene)
    for k, robot in enumerate(scene.robots):
        if isinstance(robot.reach, Sphere):
            yield k, {"center": [*robot.reach.center], "radius": robot.reach.radius}
        elif isinstance(robot.reach, Side):
            out = np.array(robot.reach.toward)
            first = np.cross(out, cell.up)
            if not first.any():
                first = np.eye(3)[int(np.abs(out).argmin())]
            first = first / np.linalg.norm(first)
            middle = cell.corners.mean(axis=0)
            middle = middle - ((middle - np.array(robot.reach.point)) @ out) * out
            sides = 0.6 * cell.size * np.array([first, np.cross(out, first)])
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
            square = middle + corners @ sides
            yield k, {"plane": _rounded(square)}


def _robots(scene: Scene) -> pd.DataFrame:
    """Return a row for every robot: what it may carry, and what it reaches."""
    able, unknown = _reaching(scene), bool(_trouble(scene))
    rows = []
    for k, robot in enumerate(scene.robots):
        reached = sum(k in who for who in able.values())
        arm = "" if robot.arm is None else "({:g}, {:g}, {:g})".format(*robot.arm.position)
        rows.append(
            {
                "robot": robot.name,
                "payload, N": f"{robot.payload:g}",
                "reach": str(robot.reach) if robot.arm is None else "that of its arm",
                "base of its arm, m": arm,
                "nodes it reaches": "not known" if arm and unknown else f"{reached} of {len(able)}",
            }
        )
    table = pd.DataFrame(rows)
    return table if scene.has_arms else table.drop(columns="base of its arm, m")


def _bricks(scene: Scene) -> pd.DataFrame:
    """Return a row for every brick: what it is joined to, its nodes, and who reaches these."""
    able = _reaching(scene)
    grounds = {ground.brick for ground in scene.grounds}
    joined: dict[int, list[str]] = {brick.name: [] for brick in scene.bricks}
    for a, b in (joint.bricks for joint in scene.joints):
        joined[a].append(str(b))
        joined[b].append(str(a))
    rows = []
    for place, brick in enumerate(scene.placed, start=1):
        own = ["ground"] * (brick.name in grounds) + joined[brick.name]
        nodes = {
            node: ", ".join(scene.robots[k].name for k in able[node]) or "nobody"
            for node in brick.nodes
            if node in able
        }
        rows.append(
            {
                "placed": str(place),
                "brick": str(brick.name),
                "joined to": ", ".join(own),
                "nodes, and who reaches them": "; ".join(f"{n}: {who}" for n, who in nodes.items()),
                "mass, kg": f"{brick.mass:.3g}",
            }
        )
    return pd.DataFrame(rows)
