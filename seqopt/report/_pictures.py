"""Pictures of scenes, networks, the steps of builds and their grips (extra ``plot``)."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.report._robots import Arms, Cell, _known_arms, _require_arms
from seqopt.report._style import SMALL, WIDTH, new_figure, new_picture, styled
from seqopt.report.draw import (
    PROP_MARK,
    View,
    _draw_props,
    _draw_robots,
    draw_bricks,
    draw_grips,
    draw_network,
    force_key,
    grip_mark,
)
from seqopt.responses.table import force_column, step_fields
from seqopt.scene._checks import short
from seqopt.scene.boxes import boxes
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import AnyStep, Grips, Step, StepKind


@styled
def reach_picture(table: pd.DataFrame) -> Figure:
    """Return a picture of a table of `seqopt.arms.reach_table`: a row a robot, a column a node.

    Shades say how many postures there are; a cross marks a node that is never reached.
    """
    robots = [*dict.fromkeys(table["robot"])]
    nodes = [*dict.fromkeys(table["node"])]
    counts = table.pivot_table(index="robot", columns="node", values="postures", sort=False)
    possible = table.pivot_table(index="robot", columns="node", values="to_bricks", sort=False) > 0
    grid = np.where(possible, counts, 0)
    figure = new_figure(1.1 + 0.3 * len(robots))
    axes = figure.subplots()
    shown = axes.imshow(np.sqrt(grid), aspect="auto", cmap="Blues", vmin=0, interpolation="nearest")
    rows, columns = np.nonzero(grid == 0)
    axes.plot(columns, rows, "x", color="black", ms=4)
    step = max(1, len(nodes) // 25)
    axes.set_xticks(range(0, len(nodes), step), [str(node) for node in nodes[::step]])
    axes.set_yticks(range(len(robots)), robots)
    axes.set_xlabel("node, in build order")
    axes.spines[:].set_visible(False)
    most = int(grid.max(initial=0))
    ticks = sorted({0, 1, most // 4, most})
    bar = figure.colorbar(shown, ax=axes, ticks=np.sqrt(ticks), pad=0.01)
    bar.ax.set_yticklabels([str(tick) for tick in ticks])
    bar.set_label("postures")
    return figure


VIEW = View(azimuth=25, elevation=18)
NUMBERED = 30  # bricks up to which the nodes of a network are numbered
FRAMES, MOST = 6, 24  # pictures of a build where no steps are named, and at most
SHADES = "YlGnBu"
PALE = "#f2efe9"  # of a grip whose force is not known
DARK = "#222222"
NEARBY = 0.4  # how far beside the structure robots are in the picture, over its size there
LANE = 0.74  # height of a bar, of a lane's
PER_STEP, NARROWEST, WIDEST = 0.13, 6.0, 30.0  # inches
LETTER = 0.06  # width of one, inches


def _panels(
    box: tuple[Floats, Floats], count: int, width: float = WIDTH, room: float = 0.35
) -> tuple[Figure, list[Axes]]:
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


def _seen_box(scene: Scene) -> tuple[Floats, Floats]:
    """Return the corners (2,) of what is seen of a structure, with some room around it, m."""
    seen = boxes(scene.placed).corners().reshape(-1, 3) @ VIEW.axes()[:2].T
    room = 0.06 * np.ptp(seen, axis=0).max()
    return np.asarray(seen.min(axis=0) - room), np.asarray(seen.max(axis=0) + room)


def _build_box(cell: Cell) -> tuple[Floats, Floats]:
    """Return the corners (2,) of what is seen of a build: robots too, as far as they are near.

    Arms whose postures are known are seen whole.
    """
    low, high = _seen_box(cell.scene)
    stands, known = (points @ VIEW.axes()[:2].T for points in (cell.stands, cell.known))
    most, room = NEARBY * (high - low).max(), 0.05 * (high - low).max()
    low = np.maximum(np.vstack([low, stands - room]).min(axis=0), low - most)
    high = np.minimum(np.vstack([high, stands + room]).max(axis=0), high + most)
    low = np.vstack([low, known - room]).min(axis=0)
    return low, np.vstack([high, known + room]).max(axis=0)


@styled
def scene_picture(scene: Scene, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a scene, or of its first bricks in build order, the others pale."""
    network, most, count = build_network(scene), len(scene.bricks), _bricks(scene, bricks)
    figure, (axes,) = _panels(_seen_box(scene), 1, width)
    if count < most:
        draw_bricks(axes, network, most, VIEW, alpha=0.15)
    _draw_props(axes, network.scene, count, held=True, view=VIEW)
    draw_bricks(axes, network, count, VIEW)
    axes.set_title(f"{scene.name}: {count} of {most} bricks")
    return figure


@styled
def network_picture(network: Network, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a network, or of its part of the first bricks in build order."""
    count = _bricks(network.scene, bricks)
    figure, (axes,) = _panels(_seen_box(network.scene), 1, width, 0.5)
    draw_network(axes, network, count, VIEW, numbers=count <= NUMBERED and width >= WIDTH)
    axes.set_title(
        f"network of {network.scene.name}, {count} bricks\n"
        "filled circles can be held, open ones are joints, squares are supports"
    )
    return figure


def _bricks(scene: Scene, bricks: int | None) -> int:
    """Return how many bricks are drawn, if there are as many."""
    most = len(scene.bricks)
    if bricks is None:
        return most
    if not isinstance(bricks, Integral) or not 1 <= bricks <= most:
        raise StepError(f"{short(bricks)} bricks: scene {scene.name} has 1 to {most}")
    return bricks


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
    """Return a picture of steps of a build, by their numbers from 1.

    By default `FRAMES` of them, spread over the build. With ``forces`` the network is drawn,
    colored by axial force, instead of the bricks and the robots. ``arms``: what is known of them
    in all steps; by default their postures, where robots of the scene have arms.
    """
    picked, cell = _picked(steps, chosen), _cell(engine, steps, arms, forces=forces)
    scene, box = cell.scene, _build_box(cell)
    figure, panels = _panels(box, len(picked))
    largest = None
    if forces:  # of any edge in these steps, N
        each = (_fields(engine, steps[at]).edge_force for at in picked)
        largest = max(float(np.abs(force).max(initial=0.0)) for force in each)
    key: dict[int, Line2D] = {}
    for axes, at in zip(panels, picked, strict=True):
        step = steps[at]
        if not forces:
            _draw_robots(axes, cell, cell.arms(step, at), VIEW)
        _draw_step(axes, engine, step, forces=forces, magnify=magnify, largest_force=largest)
        if len(picked) == 1:
            draw_grips(axes, engine.network, step.grips, VIEW)
        else:
            key |= _mark_grips(axes, scene, step.grips)
        _frame(axes, scene, step, steps[-1].number, box)
    handles = [key[robot] for robot in sorted(key)]
    handles += [Line2D([], [], **PROP_MARK, ms=8, label="prop holds")] if scene.props else []
    handles += [] if largest is None else force_key(largest)
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _mark_grips(axes: Axes, scene: Scene, grips: Grips) -> dict[int, Line2D]:
    """Mark the nodes that robots hold; return the entry of a legend of each, by its index."""
    key = {}
    for i, node in enumerate(grips):
        if node is not None:
            mark: Any = {**grip_mark(i), "ms": 9, "mec": "white", "ls": "none", "zorder": 5}
            x, y = VIEW.axes()[:2] @ np.array(scene.node_position(node))
            axes.plot([x], [y], **mark, gid=f"{scene.robots[i].name} at {node}")
            key[i] = Line2D([], [], **mark, label=f"{scene.robots[i].name} holds")
    return key


def _draw_step(
    axes: Axes,
    engine: Engine,
    step: Step,
    *,
    forces: bool,
    magnify: float,
    largest_force: float | None = None,
) -> None:
    """Draw one step: bricks or axial forces, of which the largest one (N) is drawn widest."""
    network, bricks = engine.network, step.bricks
    fields = _fields(engine, step) if forces or magnify else None
    how: dict[str, Any] = {"magnify": magnify or 1.0}
    if fields is not None and forces:
        how |= {"displacement": fields.displacement[0]} if magnify else {}
        how |= {"edge_force": fields.edge_force[0], "largest_force": largest_force}
        draw_network(axes, network, bricks, VIEW, **how)
        return
    _draw_props(axes, network.scene, bricks, held=bool(step.held), view=VIEW)
    if fields is not None:
        draw_bricks(axes, network, bricks, VIEW, alpha=0.15)
        how["twist"] = fields.brick_twist[0]
    draw_bricks(axes, network, bricks, VIEW, **how)


def _cell(engine: Engine, steps: Sequence[Step], given: Arms | None, *, forces: bool) -> Cell:
    """Return where robots stand, with the arms that are given or, by default, known."""
    scene = engine.network.scene
    if given is not None:
        _require_arms(scene, steps, given)
        return Cell(scene, given)
    return Cell(scene, {} if forces else _known_arms(scene, steps))


def _frame(axes: Axes, scene: Scene, step: Step, count: int, box: tuple[Floats, Floats]) -> None:
    """Say above a picture which of how many steps it shows, and give it the size of all."""
    removes = step.kind is StepKind.REMOVE
    newest = scene.placed[step.bricks - (not removes)].name
    what = {
        StepKind.REMOVE: f"brick {newest} is removed",
        StepKind.PLACE: f"brick {newest} is placed",
        StepKind.RELEASE: "a robot lets go",
        StepKind.REPOSITION: "a robot takes a grip",
    }[step.kind]
    axes.set_title(f"step {step.number} of {count}: {what}", loc="center")
    low, high = box
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def spread_steps(steps: Sequence[Step], most: int) -> tuple[int, ...]:
    """Return numbers of steps spread over a build, ascending: some that place, and the last one.

    Of a take-down some that remove.
    """
    kinds = (StepKind.PLACE, StepKind.REMOVE)
    placing = [step.number for step in steps if step.kind in kinds]
    parts = range(1, most if placing else 1)
    picked = {placing[round(k * (len(placing) - 1) / most)] for k in parts}
    return tuple(sorted({*picked, steps[-1].number}))


def _fields(engine: Engine, step: Step) -> Fields:
    return step_fields(engine, step, Want.EDGES | Want.DISPLACEMENTS | Want.BRICKS)


def _picked(steps: Sequence[Step], chosen: int | Sequence[int] | None) -> list[int]:
    """Return the places of the steps of some numbers, from 1."""
    if chosen is None:
        chosen = spread_steps(steps, FRAMES)
    numbers: list[Any] = [*chosen] if isinstance(chosen, tuple | list | range) else [chosen]
    if not 1 <= len(numbers) <= MOST:
        raise StepError(f"{len(numbers)} steps to draw: give 1 to {MOST}")
    first, last = steps[0].number, steps[-1].number
    for number in numbers:
        if not isinstance(number, Integral) or not first <= int(number) <= last:
            raise StepError(f"step {short(number)}: the build has steps {first} to {last}")
    return [int(number) - first for number in numbers]


@styled
def gantt_picture(
    scene: Scene,
    steps: Sequence[AnyStep],
    responses: pd.DataFrame | None = None,
    shown: tuple[int | None, int | None] = (None, None),
) -> Figure:
    """Return the grips of a build over its steps, a lane per robot and a bar per grip."""
    begins, ends = steps[0].number, steps[-1].number
    first = begins if shown[0] is None else shown[0]
    last = ends if shown[1] is None else shown[1]
    if not begins <= first <= last <= ends:
        raise StepError(f"steps {first} to {last}: the build has steps {begins} to {ends}")
    width = float(np.clip(PER_STEP * (last - first + 1) + 1.6, NARROWEST, WIDEST))
    figure = new_picture(width, 0.62 * len(scene.robots) + 1.2)
    axes = figure.add_subplot()
    inch = (width - 1.6) / (last - first + 1)
    forces, shade = None, None
    if responses is not None:  # N, by step and robot
        forces = responses[[force_column(robot) for robot in scene.robots]].to_numpy(float)
        most = np.nanmax(forces, initial=0.0) or 1.0
        shade = ScalarMappable(Normalize(0.0, most), colormaps[SHADES])
    for hold in holds(scene, steps):
        if hold.last >= first and hold.first <= last:
            _bar(axes, hold, forces, shade, begins)
            _label(axes, scene, hold, (hold.first - 0.5, hold.last + 0.5, inch))
    said = "step" if (first, last) == (1, ends) else f"step, {first} to {last} of {ends}"
    _lanes(axes, scene, said, (first - 0.7, last + 0.7))
    _key(figure, axes, shade, is_open=any(getattr(step, "moves", ()) for step in steps))
    return figure


def _bar(
    axes: Axes, hold: Hold, forces: Floats | None, shade: ScalarMappable | None, begins: int
) -> None:
    """Draw a grip: shaded step by step, framed as a whole, marked where it places a brick."""
    low = hold.robot - LANE / 2
    if forces is not None and shade is not None:
        for number in range(hold.first, hold.last + 1):
            color = shade.to_rgba(forces[number - begins, hold.robot])
            axes.add_patch(Rectangle((number - 0.5, low), 1, LANE, fc=color, lw=0))
    look: Any = {"fc": PALE if forces is None else "none", "ec": DARK, "lw": 0.9}
    look |= {"hatch": "//"} if hold.node is None else {}
    name = f"hold {hold.robot} {hold.first} {hold.last}"
    length = hold.last - hold.first + 1
    axes.add_patch(Rectangle((hold.first - 0.5, low), length, LANE, gid=name, **look))
    if hold.places is not None:
        axes.plot([hold.first - 0.5] * 2, [low, low + LANE], color=DARK, lw=3.2)


def _label(axes: Axes, scene: Scene, hold: Hold, span: tuple[float, float, float]) -> None:
    """Write brick and node, or the number of an open grip, into a bar as far as they fit.

    ``span``: from where to where it is, and inches per unit.
    """
    begin, end, inch = span
    room = inch * (end - begin)
    if room < 0.12:
        return
    words = f"?{(hold.move or 0) + 1}"
    if hold.node is not None:
        words = f"{scene.brick_of_node[hold.node].name} · {hold.node}"
    flat = room >= LETTER * len(words) + 0.06
    look: Any = {"ha": "center", "va": "center", "fontsize": SMALL, "color": DARK, "clip_on": True}
    look["bbox"] = {"boxstyle": "square,pad=0.1", "fc": (1, 1, 1, 0.72), "lw": 0}
    axes.annotate(words, ((begin + end) / 2, hold.robot), rotation=0 if flat else 90, **look)


def _lanes(axes: Axes, scene: Scene, said: str, shown: tuple[float, float]) -> None:
    """Set a lane for every robot, limits and names."""
    count = len(scene.robots)
    axes.set(xlabel=said, xlim=shown, ylim=(count - 0.5, -0.5), axisbelow=True)
    axes.set_yticks(range(count), [robot.name for robot in scene.robots])
    axes.tick_params(left=False)
    axes.grid(visible=True, axis="x", lw=0.3)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _key(figure: Figure, axes: Axes, shade: ScalarMappable | None, *, is_open: bool) -> None:
    """Explain the marks, the words and the shades."""
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=DARK, marker="|", ms=11, mew=3.2, lw=0, label="places the brick"),
        Patch(fc="white", ec=DARK, label="holds it (brick · node)"),
    ]
    if is_open:
        handles.append(Patch(fc=PALE, ec=DARK, hatch="//", label="still to be chosen"))
    place: Any = {"loc": "lower left", "bbox_to_anchor": (0, 1), "borderaxespad": 0.2}
    axes.legend(handles=handles, ncols=3, frameon=False, **place)
    if shade is not None:
        figure.colorbar(shade, ax=axes, label="grip force, N", pad=0.01)
