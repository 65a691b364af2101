"""Pictures of scenes, networks, the steps of builds and their grips (``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Want
from seqopt.errors import StepError
from seqopt.network.network import Network, build_network
from seqopt.report._robots import Arms, Cell, _known_arms
from seqopt.report._style import WIDTH, new_picture, styled
from seqopt.report.draw import (
    PROP_MARK,
    View,
    _draw_props,
    _draw_robots,
    draw_bricks,
    draw_grips,
    draw_network,
    force_key,
)
from seqopt.responses.table import step_fields
from seqopt.scene._checks import short
from seqopt.scene.boxes import box_corners
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind

VIEW = View(azimuth=25, elevation=18)
NUMBERED = 30  # bricks up to which the nodes of a network are numbered
FRAMES, MOST = 6, 24  # pictures of a build where no steps are named, and at most
NEARBY = 0.4  # how far beside the structure robots are in the picture, over its size there
Box = tuple[Floats, Floats]  # corners (2,) of what is seen, m


def _panels(box: Box, count: int, width: float, room: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels of a box's shape, in rows of three with room for titles."""
    columns = min(count, 3)
    rows = -(-count // columns)
    (left, low), (right, high) = box
    ratio = min(max((high - low) / (right - left), 0.25), 1.6)
    figure = new_picture(width, rows * (width / columns * ratio + room))
    panels = [figure.add_subplot(rows, columns, i + 1) for i in range(count)]
    for axes in panels:
        axes.set_axis_off()
    return figure, panels


def _seen_box(scene: Scene) -> Box:
    """Return the view of a structure, with a margin."""
    seen = box_corners(scene.placed).reshape(-1, 3) @ VIEW.axes()[:2].T
    room = 0.06 * np.ptp(seen, axis=0).max()
    return np.asarray(seen.min(axis=0) - room), np.asarray(seen.max(axis=0) + room)


@styled
def structure_picture(
    shown: Scene | Network, bricks: int | None = None, width: float = WIDTH
) -> Figure:
    """Return a picture of a scene, or of a network, up to some brick in build order.

    Bricks of a scene that come later are pale.
    """
    network = shown if isinstance(shown, Network) else build_network(shown)
    scene, most = network.scene, len(network.scene.bricks)
    count = most if bricks is None else bricks
    if not isinstance(count, Integral) or not 1 <= count <= most:
        raise StepError(f"{short(bricks)} bricks: scene {scene.name} has 1 to {most}")
    figure, (axes,) = _panels(_seen_box(scene), 1, width, 0.5 if network is shown else 0.35)
    if network is shown:
        draw_network(axes, network, count, VIEW, numbers=count <= NUMBERED and width >= WIDTH)
        axes.set_title(
            f"network of {scene.name}, {count} bricks\n"
            "filled circles can be held, open ones are joints, squares are supports"
        )
        return figure
    if count < most:
        draw_bricks(axes, network, most, VIEW, alpha=0.15)
    _draw_props(axes, network.scene, count, held=True, view=VIEW)
    draw_bricks(axes, network, count, VIEW)
    axes.set_title(f"{scene.name}: {count} of {most} bricks")
    return figure


def _build_box(cell: Cell) -> Box:
    """Return what is seen of a build: robots too, as far as they are near, and known arms whole."""
    low, high = _seen_box(cell.scene)
    stands, known = (points @ VIEW.axes()[:2].T for points in (cell.stands, cell.known))
    most, room = NEARBY * (high - low).max(), 0.05 * (high - low).max()
    low = np.maximum(np.vstack([low, stands - room]).min(axis=0), low - most)
    high = np.minimum(np.vstack([high, stands + room]).max(axis=0), high + most)
    low = np.vstack([low, known - room]).min(axis=0)
    return low, np.vstack([high, known + room]).max(axis=0)


@styled
def steps_picture(
    engine: Engine,
    steps: Sequence[Step],
    chosen: int | Sequence[int] | None = None,
    *,
    forces: bool = False,
    magnify: float = 0.0,
    arms: Arms | None = None,
) -> Figure:
    """Return a picture of steps of a build, by their numbers from 1, all of one size.

    By default `FRAMES`, spread over the build. ``forces``: the network by axial force, not bricks
    and robots; or ``magnify``: times that displacements are drawn larger; ``arms``: as known.
    """
    if forces and magnify:
        raise StepError("forces, magnify: a picture shows one of them; give one")
    picked, scene = _picked(steps, chosen), engine.network.scene
    arms = arms if arms is not None or forces else _known_arms(scene, steps)
    cell = Cell(scene, arms)
    low, high = box = _build_box(cell)
    figure, panels = _panels(box, len(picked), WIDTH, 0.35)
    asked = picked if forces or magnify else []
    fields = {at: step_fields(engine, steps[at], Want.EDGES | Want.BRICKS) for at in asked}
    peaks = (float(np.abs(each.edge_force).max(initial=0.0)) for each in fields.values())
    largest = max(peaks, default=0.0)  # of any edge in these steps, N
    key: dict[int, Line2D] = {}
    for axes, at in zip(panels, picked, strict=True):
        step, drawn = steps[at], (axes, engine.network, steps[at].bricks, VIEW)
        if forces:
            draw_network(*drawn, edge_force=fields[at].edge_force[0], largest_force=largest)
        else:
            _draw_robots(axes, cell, cell.arms(step, at, arms or {}), VIEW)
            _draw_props(axes, scene, step.bricks, held=bool(step.held), view=VIEW)
            draw_bricks(*drawn, alpha=0.15 if magnify else 1.0)
            if magnify:
                draw_bricks(*drawn, twist=fields[at].brick_twist[0], magnify=magnify)
        axes.set_title(_describe(scene, step, steps[-1].number), loc="center")
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        key |= draw_grips(axes, engine.network, step.grips, VIEW, named=len(picked) == 1)
    handles = [key[robot] for robot in sorted(key) if len(picked) > 1]
    handles += [Line2D([], [], **PROP_MARK, ms=8, label="prop holds")] if scene.props else []
    handles += force_key(largest) if forces else []
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _describe(scene: Scene, step: Step, last: int) -> str:
    """Return the title of the picture of a step."""
    newest = scene.placed[step.bricks - (step.kind is not StepKind.REMOVE)].name
    what = {
        StepKind.REMOVE: f"brick {newest} is removed",
        StepKind.PLACE: f"brick {newest} is placed",
        StepKind.RELEASE: "a robot lets go",
        StepKind.REPOSITION: "a robot takes a grip",
    }
    return f"step {step.number} of {last}: {what[step.kind]}"


def _picked(steps: Sequence[Step], chosen: int | Sequence[int] | None) -> list[int]:
    """Return the places of steps by their numbers, from 1; by default spread over the build.

    These are some that place, of a take-down that remove, and the last one.
    """
    first, last = steps[0].number, steps[-1].number
    if chosen is None:
        kinds = (StepKind.PLACE, StepKind.REMOVE)
        placing = [step.number for step in steps if step.kind in kinds] or [last]
        spread = {placing[round(k * (len(placing) - 1) / FRAMES)] for k in range(1, FRAMES)}
        chosen = sorted({*spread, last})
    numbers: list[Any] = [*chosen] if isinstance(chosen, tuple | list | range) else [chosen]
    if not 1 <= len(numbers) <= MOST:
        raise StepError(f"{len(numbers)} steps to draw: give 1 to {MOST}")
    for number in numbers:
        if not isinstance(number, Integral) or not first <= int(number) <= last:
            raise StepError(f"step {short(number)}: the build has steps {first} to {last}")
    return [int(number) - first for number in numbers]
