"""Pictures and films of scenes, networks and the steps of builds (extra ``plot``)."""

from __future__ import annotations

import tempfile
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import FileError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.report.draw import (
    ROBOT_COLORS,
    ROBOT_MARKERS,
    View,
    draw_bricks,
    draw_grips,
    draw_network,
    force_key,
)
from seqopt.report.style import BLUE, WIDTH, new_picture, styled
from seqopt.scene.boxes import boxes
from seqopt.scene.checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind
from seqopt.stability.assessment import Stability

VIEW = View(azimuth=25, elevation=18)
NUMBERED = 30  # bricks up to which the nodes of a network are numbered
FRAMES, MOST = 6, 24  # pictures of a build where no steps are named, and at most
FILM_DPI, FILM_WIDTH = 80, 6.0  # inches


def _panels(
    scene: Scene, count: int, width: float = WIDTH, room: float = 0.35
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels of the shape of the whole structure, in rows of three.

    Over every row there is room for a title; width and room are inches.
    """
    columns = min(count, 3)
    rows = -(-count // columns)
    low, high = _seen_box(scene)
    across, up = high - low
    ratio = min(max(up / across, 0.25), 1.6)
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


@styled
def scene_picture(scene: Scene, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a scene, or of its first bricks in build order, the others pale."""
    network = build_network(scene)
    count = _bricks(scene, bricks)
    figure, (axes,) = _panels(scene, 1, width)
    if count < len(scene.bricks):
        draw_bricks(axes, network, len(scene.bricks), VIEW, alpha=0.15)
    draw_bricks(axes, network, count, VIEW)
    axes.set_title(f"{scene.name}: {count} of {len(scene.bricks)} bricks")
    return figure


@styled
def network_picture(network: Network, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a network, or of its part of the first bricks in build order.

    Nodes that robots may hold carry their numbers where there are few.
    """
    count = _bricks(network.scene, bricks)
    figure, (axes,) = _panels(network.scene, 1, width, 0.5)
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
) -> Figure:
    """Return a picture of steps of a build, by their numbers from 1.

    By default `FRAMES` of them, spread over the build. With ``forces`` the network is drawn,
    colored by axial force, instead of the bricks.
    """
    picked, scene = _picked(steps, chosen), engine.network.scene
    figure, panels = _panels(scene, len(picked))
    largest = _largest_force(engine, picked) if forces else None
    for axes, step in zip(panels, picked, strict=True):
        _draw_step(axes, engine, step, forces=forces, magnify=magnify, largest_force=largest)
        if len(picked) == 1:
            draw_grips(axes, engine.network, step.grips, VIEW)
        else:
            _mark_grips(axes, scene, step.grips)
        _frame(axes, scene, step, len(steps))
    key = []
    if len(picked) > 1:
        key = [
            Line2D([], [], **_mark(i), label=f"{robot.name} holds")
            for i, robot in enumerate(scene.robots)
            if any(step.grips[i] is not None for step in picked)
        ]
    key += [] if largest is None else force_key(largest)
    if key:
        figure.legend(handles=key, loc="outside lower center", ncols=4)
    return figure


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
    if fields is not None and forces:
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


def _mark_grips(axes: Axes, scene: Scene, grips: Grips) -> None:
    """Mark the nodes that robots hold, a color and a shape for each robot."""
    for i, node in enumerate(grips):
        if node is not None:
            x, y = VIEW.axes()[:2] @ np.array(scene.node_position(node))
            axes.plot([x], [y], **_mark(i), gid=f"{scene.robots[i].name} at {node}")


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


def _frame(axes: Axes, scene: Scene, step: Step, count: int) -> None:
    """Say above a picture which of how many steps it shows, and give it the size of all."""
    newest = scene.placed[step.bricks - 1].name
    what = {
        StepKind.PLACE: f"brick {newest} is placed",
        StepKind.RELEASE: "a robot lets go",
        StepKind.REPOSITION: "a robot takes a grip",
    }[step.kind]
    axes.set_title(f"step {step.number} of {count}: {what}", loc="center")
    low, high = _seen_box(scene)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def spread_steps(steps: Sequence[Step], most: int) -> tuple[int, ...]:
    """Return numbers of steps spread over a build, ascending: some that place, and the last one."""
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


@dataclass(frozen=True, eq=False, repr=False)
class Film:
    """A build as a film: a notebook plays it, `save` writes it.

    Each step is shown for some seconds; with ``forces`` the network, colored by axial force.
    """

    engine: Engine
    steps: Sequence[Step]
    forces: bool = False
    magnify: float = 0.0
    seconds: float = 0.4

    def __repr__(self) -> str:
        name, count = self.engine.network.scene.name, len(self.steps)
        return f"<Film of {name}: {count} steps; save('build.gif') writes it>"

    def _repr_html_(self) -> str:
        """Return the film as an animated GIF: it plays without scripts, and without a network."""
        with tempfile.TemporaryDirectory() as folder:
            film = self.save(Path(folder) / "film.gif").read_bytes()
        source = f"data:image/gif;base64,{b64encode(film).decode()}"
        return f'<img alt="{len(self.steps)} steps of a build" src="{source}">'

    def save(self, path: str | Path) -> Path:
        """Write the film to a file that ends in ``.gif``."""
        path = Path(path)
        if path.suffix != ".gif":
            raise FileError(f"film {path}: give a name that ends in .gif")
        try:
            self._write(path)
        except OSError as error:
            raise FileError(f"cannot write {path}: {error.strerror}; name another") from error
        return path

    @styled
    def _write(self, path: Path) -> None:
        """Draw every step and hand it to the writer."""
        scene = self.engine.network.scene
        low, high = _seen_box(scene)
        width, height = high - low
        figure = new_picture(
            FILM_WIDTH, max(FILM_WIDTH * height / width, 2.0) + 0.5, constrained=False
        )
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.88))
        rate: Any = 1.0 / self.seconds  # the writer takes fractions
        writer = PillowWriter(fps=rate)
        with writer.saving(figure, path, FILM_DPI):
            for step in self.steps:
                axes.clear()
                _draw_step(axes, self.engine, step, forces=self.forces, magnify=self.magnify)
                draw_grips(axes, self.engine.network, step.grips, VIEW)
                _frame(axes, scene, step, len(self.steps))
                writer.grab_frame()


@styled
def tilt_picture(value: Stability) -> Figure:
    """Return the tilt that a step which stands survives in every direction."""
    figure = new_picture(3.0, 3.0)
    axes = figure.add_subplot(projection="polar")
    angles = 2 * np.pi * np.arange(len(value.pull) + 1) / len(value.pull)
    tilts = np.degrees(np.arctan(value.pull))
    axes.plot(angles, [*tilts, tilts[0]], "o-", color=BLUE, ms=4)
    axes.fill(angles, [*tilts, tilts[0]], color=BLUE, alpha=0.15)
    axes.set_title("tilt survived, degrees", loc="center")
    axes.set_yticks([float(f"{np.nanmax(tilts) / 2:.2g}"), float(f"{np.nanmax(tilts):.2g}")])
    return figure
