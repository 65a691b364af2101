"""Pictures that scenes, networks and plans draw of themselves (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.report.draw import ROBOT_COLORS, View, draw_bricks, draw_grips, draw_network
from seqopt.report.picture import new_picture
from seqopt.scene.boxes import boxes
from seqopt.scene.checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind

VIEW = View(azimuth=25, elevation=18)
FRAMES = 6  # pictures of a build, where no steps are named
MOST = 24
MARKS = "XPDsv"  # of robots, beside their colors
WIDTH = 8.0  # of a figure, inches
NUMBERED = 30  # bricks up to which the nodes of a network are numbered
TITLE = 9  # size of letters, points


def scene_picture(scene: Scene, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a scene, or of its first bricks.

    Parameters
    ----------
    scene : Scene
    bricks : int, optional
        How many, in build order; all by default. The others are drawn pale.
    width : float, optional
        Of the figure, inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    network = build_network(scene)
    count = _bricks(scene, bricks)
    figure, (axes,) = _panels(scene, 1, width)
    if count < len(scene.bricks):
        draw_bricks(axes, network, len(scene.bricks), VIEW, alpha=0.15)
    draw_bricks(axes, network, count, VIEW)
    axes.set_title(f"{scene.name}: {count} of {len(scene.bricks)} bricks", fontsize=TITLE)
    return figure


def network_picture(network: Network, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a network, or of its part of the first bricks.

    Parameters
    ----------
    network : Network
    bricks : int, optional
        How many, in build order; all by default.
    width : float, optional
        Of the figure, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Nodes that robots may hold carry their numbers where there are few.
    """
    count = _bricks(network.scene, bricks)
    figure, (axes,) = _panels(network.scene, 1, width)
    draw_network(axes, network, count, VIEW, numbers=count <= NUMBERED and width >= WIDTH)
    axes.set_title(
        f"network of {network.scene.name}, {count} bricks\n"
        "filled circles can be held, open ones are joints, squares are supports",
        fontsize=TITLE,
    )
    return figure


def steps_picture(
    engine: Engine,
    steps: Sequence[Step],
    chosen: int | Sequence[int] | None = None,
    *,
    forces: bool = False,
    magnify: float = 0.0,
) -> Figure:
    """Return a picture of steps of a build.

    Parameters
    ----------
    engine : Engine
        Computes forces and displacements, if these are drawn.
    steps : sequence of Step
    chosen : int or sequence of int, optional
        Numbers of those that are drawn; by default `FRAMES` of them, spread over the build.
    forces : bool, optional
        Whether to draw the network, colored by axial force.
    magnify : float, optional
        How many times larger displacements are drawn.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    StepError
        If there is no such step, or too many are asked for.
    """
    picked = _picked(steps, chosen)
    scene = engine.network.scene
    figure, panels = _panels(scene, len(picked))
    for axes, step in zip(panels, picked, strict=True):
        draw_step(axes, engine, step, forces=forces, magnify=magnify)
        if len(picked) == 1:
            draw_grips(axes, engine.network, step.grips, VIEW)
        else:
            mark_grips(axes, scene, step.grips)
        axes.set_title(caption(scene, step, len(steps)), fontsize=TITLE)
        low, high = seen_box(scene)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    if len(picked) > 1:
        add_key(figure, scene, picked)
    return figure


def mark_grips(axes: Axes, scene: Scene, grips: Grips) -> None:
    """Mark the nodes that robots hold, a color and a shape for each robot.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    scene : Scene
    grips : tuple of (int or None)
        Node that each of the scene's robots holds.
    """
    for i, node in enumerate(grips):
        if node is not None:
            x, y = VIEW.axes()[:2] @ np.array(scene.node_position(node))
            axes.plot([x], [y], **_mark(i), gid=f"{scene.robots[i].name} at {node}")


def add_key(figure: Figure, scene: Scene, steps: Sequence[Step]) -> None:
    """Say below a figure which mark is which robot's.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    scene : Scene
    steps : sequence of Step
        What is drawn: robots that hold nothing in them are left out.
    """
    handles = [
        Line2D([], [], **_mark(i), label=f"{robot.name} holds")
        for i, robot in enumerate(scene.robots)
        if any(step.grips[i] is not None for step in steps)
    ]
    if handles:
        figure.legend(
            handles=handles, loc="outside lower center", ncols=5, frameon=False, fontsize=TITLE
        )


def _mark(robot: int) -> dict[str, Any]:
    """Return how the grip of a robot is drawn."""
    return {
        "marker": MARKS[robot % len(MARKS)],
        "color": ROBOT_COLORS[robot % len(ROBOT_COLORS)],
        "ms": 9,
        "mec": "white",
        "ls": "none",
        "zorder": 5,
    }


def draw_step(
    axes: Axes, engine: Engine, step: Step, *, forces: bool = False, magnify: float = 0.0
) -> None:
    """Draw one step: bricks or axial forces.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    engine : Engine
    step : Step
    forces : bool, optional
        Whether to draw the network, colored by axial force.
    magnify : float, optional
        How many times larger displacements are drawn.
    """
    network, bricks = engine.network, step.bricks
    fields = _fields(engine, step) if forces or magnify else None
    if fields is not None and forces:
        draw_network(
            axes,
            network,
            bricks,
            VIEW,
            displacement=fields.displacement[0] if magnify else None,
            magnify=magnify,
            edge_force=fields.edge_force[0],
        )
    else:
        if magnify:
            draw_bricks(axes, network, bricks, VIEW, alpha=0.15)
        twist = None if fields is None else fields.brick_twist[0]
        draw_bricks(axes, network, bricks, VIEW, twist=twist, magnify=magnify or 1.0)


def caption(scene: Scene, step: Step, count: int) -> str:
    """Return what happens in a step, in words.

    Parameters
    ----------
    scene : Scene
    step : Step
    count : int
        How many steps the build has.

    Returns
    -------
    str
    """
    newest = scene.placed[step.bricks - 1].name
    what = {
        StepKind.PLACE: f"brick {newest} is placed",
        StepKind.RELEASE: "a robot lets go",
        StepKind.REPOSITION: "a robot takes a grip",
    }[step.kind]
    return f"step {step.number} of {count}: {what}"


def _fields(engine: Engine, step: Step) -> Fields:
    held = np.array([step.held], dtype=np.int64).reshape(1, -1)
    return engine.solve(step.bricks, held, Want.EDGES | Want.DISPLACEMENTS | Want.BRICKS)


def _bricks(scene: Scene, bricks: int | None) -> int:
    """Return how many bricks are drawn, if there are as many."""
    most = len(scene.bricks)
    if bricks is None:
        return most
    if not isinstance(bricks, Integral) or not 1 <= bricks <= most:
        raise StepError(f"{short(bricks)} bricks: scene {scene.name} has 1 to {most}")
    return bricks


def _picked(steps: Sequence[Step], chosen: int | Sequence[int] | None) -> list[Step]:
    """Return the steps of some numbers, from 1."""
    count = len(steps)
    numbers: list[object]
    if chosen is None:
        numbers = [*spread_steps(steps, FRAMES)]
    else:
        numbers = [*chosen] if isinstance(chosen, tuple | list | range) else [chosen]
    if not 1 <= len(numbers) <= MOST:
        raise StepError(f"{len(numbers)} steps to draw: give 1 to {MOST}")
    picked = []
    for number in numbers:
        if not isinstance(number, Integral) or not 1 <= int(number) <= count:
            raise StepError(f"step {short(number)}: the build has steps 1 to {count}")
        picked.append(steps[int(number) - 1])
    return picked


def _panels(scene: Scene, count: int, width: float = WIDTH) -> tuple[Figure, list[Axes]]:
    """Return a figure with as many panels, each of the shape of the whole structure."""
    columns = min(count, 3)
    rows = -(-count // columns)
    low, high = seen_box(scene)
    across, up = high - low
    ratio = min(max(up / across, 0.25), 1.6)
    size = width / columns
    figure = new_picture(width, rows * (size * ratio + 0.35))
    panels = [figure.add_subplot(rows, columns, i + 1) for i in range(count)]
    for axes in panels:
        axes.set_axis_off()
    return figure, panels


def spread_steps(steps: Sequence[Step], most: int) -> tuple[int, ...]:
    """Return numbers of steps that are spread over a build: those that place, and the last one.

    Parameters
    ----------
    steps : sequence of Step
    most : int
        How many, from 2.

    Returns
    -------
    tuple of int
        Ascending, from 1.
    """
    placing = [i + 1 for i, step in enumerate(steps) if step.kind is StepKind.PLACE]
    parts = range(1, most if placing else 1)
    picked = {placing[round(k * (len(placing) - 1) / most)] for k in parts}
    return tuple(sorted({*picked, len(steps)}))


def seen_box(scene: Scene) -> tuple[Floats, Floats]:
    """Return the lower left and the upper right corner of a structure as it is seen, and some room.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    low, high : (2,) float
        m.
    """
    seen = boxes(scene.placed).corners().reshape(-1, 3) @ VIEW.axes()[:2].T
    room = 0.06 * np.ptp(seen, axis=0).max()
    return np.asarray(seen.min(axis=0) - room), np.asarray(seen.max(axis=0) + room)
