"""Pictures of the steps of a build: what stands, who holds it, and what it carries (``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import StepError
from seqopt.report.canvas import VIEW, new_panels, seen_box
from seqopt.report.draw import ROBOT_COLORS, ROBOT_MARKERS, draw_bricks, draw_grips
from seqopt.report.network_picture import draw_network, force_key
from seqopt.report.style import styled
from seqopt.scene.checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind

FRAMES = 6  # pictures of a build, where no steps are named
MOST = 24


@dataclass(frozen=True)
class Drawn:
    """What of a step is drawn beside its grips.

    Attributes
    ----------
    forces : bool
        Whether the network, colored by axial force, instead of the bricks.
    magnify : float
        How many times larger displacements are drawn.
    """

    forces: bool = False
    magnify: float = 0.0


@styled
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

    Raises
    ------
    StepError
        If there is no such step, or too many are asked for.
    """
    picked, drawn, scene = _picked(steps, chosen), Drawn(forces, magnify), engine.network.scene
    figure, panels = new_panels(scene, len(picked))
    largest = _largest_force(engine, picked) if forces else None
    for axes, step in zip(panels, picked, strict=True):
        draw_step(axes, engine, step, drawn, largest)
        if len(picked) == 1:
            draw_grips(axes, engine.network, step.grips, VIEW)
        else:
            mark_grips(axes, scene, step.grips)
        axes.set_title(caption(scene, step, len(steps)), loc="center")
        low, high = seen_box(scene)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    key = _robots_key(scene, picked) if len(picked) > 1 else []
    key += [] if largest is None else force_key(largest)
    if key:
        figure.legend(handles=key, loc="outside lower center", ncols=4)
    return figure


def draw_step(
    axes: Axes, engine: Engine, step: Step, drawn: Drawn, largest_force: float | None = None
) -> None:
    """Draw one step: bricks or axial forces.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    engine : Engine
    step : Step
    drawn : Drawn
        What is drawn.
    largest_force : float, optional
        Axial force that is drawn widest, N.
    """
    network, bricks, magnify = engine.network, step.bricks, drawn.magnify
    fields = _fields(engine, step) if drawn.forces or magnify else None
    if fields is not None and drawn.forces:
        draw_network(
            axes,
            network,
            bricks,
            VIEW,
            displacement=fields.displacement[0] if magnify else None,
            magnify=magnify,
            edge_force=fields.edge_force[0],
            largest_force=largest_force,
        )
    else:
        if magnify:
            draw_bricks(axes, network, bricks, VIEW, alpha=0.15)
        twist = None if fields is None else fields.brick_twist[0]
        draw_bricks(axes, network, bricks, VIEW, twist=twist, magnify=magnify or 1.0)


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


def _robots_key(scene: Scene, steps: Sequence[Step]) -> list[Line2D]:
    """Return the entries of a legend for the robots that hold something in some of the steps."""
    return [
        Line2D([], [], **_mark(i), label=f"{robot.name} holds")
        for i, robot in enumerate(scene.robots)
        if any(step.grips[i] is not None for step in steps)
    ]


def _mark(robot: int) -> dict[str, Any]:
    """Return how the grip of a robot is drawn."""
    return {
        "marker": ROBOT_MARKERS[robot % len(ROBOT_MARKERS)],
        "color": ROBOT_COLORS[robot % len(ROBOT_COLORS)],
        "ms": 9,
        "mec": "white",
        "ls": "none",
        "zorder": 5,
    }


def caption(scene: Scene, step: Step, count: int) -> str:
    """Return what happens in a step, in words.

    Parameters
    ----------
    scene : Scene
    step : Step
    count : int
        How many steps the build has.
    """
    newest = scene.placed[step.bricks - 1].name
    what = {
        StepKind.PLACE: f"brick {newest} is placed",
        StepKind.RELEASE: "a robot lets go",
        StepKind.REPOSITION: "a robot takes a grip",
    }[step.kind]
    return f"step {step.number} of {count}: {what}"


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


def _fields(engine: Engine, step: Step) -> Fields:
    held = np.array([step.held], dtype=np.int64).reshape(1, -1)
    return engine.solve(step.bricks, held, Want.EDGES | Want.DISPLACEMENTS | Want.BRICKS)


def _largest_force(engine: Engine, steps: Sequence[Step]) -> float:
    """Return the largest axial force of any edge in some steps, N."""
    return max(float(np.abs(_fields(engine, step).edge_force).max(initial=0.0)) for step in steps)


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
