"""The page of a scene: bricks by name in their order, nodes, ground, and what robots reach."""

from __future__ import annotations

from html import escape
from itertools import cycle, islice

import numpy as np
import pandas as pd

from seqopt.arms._permits import reach_table
from seqopt.arms._urdf import shape_notes
from seqopt.arms.reach import find_postures
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import ExtraError, SceneError
from seqopt.network.build import build_network
from seqopt.report._robots import ROBOT_COLORS, Cell, _known_arms
from seqopt.report.page import Build, _build_data, _filled, _part, _rounded, _structure_data
from seqopt.responses.table import force_column
from seqopt.scene.parts import Side, Sphere
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind

EVERY = "#222222"  # of a node that several robots reach
ORDER = "build order"
Reaching = dict[int, list[int]]  # robots by the nodes that they reach


def scene_page(scene: Scene) -> str:
    """Return the page of a scene, as HTML that needs nothing else: one step a brick."""
    network, count = build_network(scene), len(scene.placed)
    nobody = (None,) * len(scene.robots)
    steps = [Step(k + 1, StepKind.PLACE, k + 1, nobody) for k in range(count)]
    empty = {n: np.nan for r in scene.robots for n in (f"{r.name}_node", force_column(r))}
    counts = [step.number for step in steps]
    table = pd.DataFrame({"step": counts, "type": "place", "bricks": counts} | empty)
    arms = _known_arms(scene, steps)
    build = Build(ORDER, steps, table, order=scene.build_order, arms=arms)
    whole = {"tasks": None, "sentence": "", "decides": count - 1}  # it opens with all bricks
    reaching, trouble = _reaching(scene)
    data = {
        "structure": _structure_data(network) | {"marks": _marks(scene, reaching)},
        "builds": [_build_data(make_engine(USUAL, network), build, fields=False) | whole],
        "responses": {},
        "scatter": None,
        "note": "Bricks appear in the order in which they are placed; a plan says who holds.",
    }
    sentence = (
        f"{len(scene.bricks)} bricks, {len(scene.grounds)} ground ends, {len(scene.robots)} "
        "robots. seqopt optimize looks for a plan."
    )
    doubts = [f" Of {note}." for note in shape_notes(scene)]
    doubts += [f" What arms reach is not known: {trouble}."] if trouble else []
    tables = {
        "Robots": _robots(scene, reaching, trouble),
        "Bricks, in the order of the build": _bricks(scene, reaching),
    }
    return _filled(
        title=escape(scene.name),
        sentence=sentence + escape("".join(doubts)),
        tables="".join(_part(caption, part) for caption, part in tables.items()),
        data=data,
    )


def _reaching(scene: Scene) -> tuple[Reaching, str]:
    """Return which robots reach every node that is not blocked, with arms if they have any.

    Also why it cannot be computed what arms reach, if so.
    """
    by_arm, trouble = set[tuple[str, int]](), ""
    try:
        if find_postures(scene) is not None:
            table = reach_table(scene)
            able = table[table["to_bricks"] > 0]
            by_arm = {*zip(able["robot"], able["node"], strict=True)}
    except (ExtraError, SceneError) as error:
        trouble = str(error)
    every = (node for brick in scene.placed for node in brick.nodes)
    found: Reaching = {node: [] for node in every if node not in scene.blocked_nodes}
    for k, robot in enumerate(scene.robots):
        for node in (node for nodes in scene.within_reach(robot) for node in nodes):
            if robot.arm is None or (robot.name, node) in by_arm:
                found[node].append(k)
    return found, trouble


def _marks(scene: Scene, reaching: Reaching) -> dict[str, object]:
    """Return nodes by who reaches them, and reaches, ready for JSON.

    These are spheres, and squares of the planes that bound what robots beside it reach.
    """
    colors, cell = [*islice(cycle(ROBOT_COLORS), len(scene.robots))], Cell(scene)
    rank = {brick.name: k for k, brick in enumerate(scene.placed)}
    nodes = [
        {
            "at": _rounded(scene.node_position(node)),
            "brick": rank[scene.brick_of_node[node].name],
            "color": "" if not able else colors[able[0]] if len(able) == 1 else EVERY,
        }
        for node, able in reaching.items()
    ]
    reaches: list[dict[str, object]] = []
    for robot, color in zip(scene.robots, colors, strict=True):
        reach = robot.reach
        if isinstance(reach, Sphere):
            ball = {"center": [*reach.center], "radius": reach.radius}
            reaches.append({**ball, "color": color})
        elif isinstance(reach, Side):
            out, middle = np.array(reach.toward), cell.corners.mean(axis=0)
            first = np.cross(out, cell.up)
            if not first.any():
                first = np.eye(3)[int(np.abs(out).argmin())]
            first = first / np.linalg.norm(first)
            middle = middle - ((middle - np.array(reach.point)) @ out) * out
            sides = 0.6 * cell.size * np.array([first, np.cross(out, first)])
            square = middle + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) @ sides
            reaches.append({"plane": _rounded(square), "color": color})
    return {"nodes": nodes, "reaches": reaches}


def _robots(scene: Scene, reaching: Reaching, trouble: str) -> pd.DataFrame:
    """Return a row for every robot: its payload and reach."""
    rows = []
    for k, robot in enumerate(scene.robots):
        reached = f"{sum(k in who for who in reaching.values())} of {len(reaching)}"
        base = "" if robot.arm is None else "({:g}, {:g}, {:g})".format(*robot.arm.position)
        rows.append(
            {
                "robot": robot.name,
                "payload, N": f"{robot.payload:g}",
                "reach": str(robot.reach) if robot.arm is None else "that of its arm",
                "base of its arm, m": base,
                "nodes it reaches": "not known" if base and trouble else reached,
            }
        )
    table = pd.DataFrame(rows)
    return table if scene.has_arms else table.drop(columns="base of its arm, m")


def _bricks(scene: Scene, reaching: Reaching) -> pd.DataFrame:
    """Return a row for every brick: its joints, its nodes, and who reaches these."""
    joined: dict[int, list[str]] = {brick.name: [] for brick in scene.bricks}
    for ground in scene.grounds:
        joined[ground.brick] = ["ground"]
    for a, b in (joint.bricks for joint in scene.joints):
        joined[a].append(str(b))
        joined[b].append(str(a))
    rows = []
    for place, brick in enumerate(scene.placed, start=1):
        nodes = {
            node: ", ".join(scene.robots[k].name for k in reaching[node]) or "nobody"
            for node in brick.nodes
            if node in reaching
        }
        rows.append(
            {
                "placed": str(place),
                "brick": str(brick.name),
                "joined to": ", ".join(joined[brick.name]),
                "nodes, and who reaches them": "; ".join(f"{n}: {who}" for n, who in nodes.items()),
                "mass, kg": f"{brick.mass:.3g}",
            }
        )
    return pd.DataFrame(rows)
