"""Pictures of scenes, networks, the steps of builds and their grips, and films (``plot``)."""

from __future__ import annotations

import io
import tempfile
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image  # comes with matplotlib

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import FileError, StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.report._robots import Arms, Cell, _known_arms, _require_arms
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
    grip_mark,
)
from seqopt.responses.table import step_fields
from seqopt.scene._checks import short
from seqopt.scene.boxes import boxes
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, StepKind

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
    """Return what is seen of a structure, with some room around it."""
    seen = boxes(scene.placed).corners().reshape(-1, 3) @ VIEW.axes()[:2].T
    room = 0.06 * np.ptp(seen, axis=0).max()
    return np.asarray(seen.min(axis=0) - room), np.asarray(seen.max(axis=0) + room)


@styled
def scene_picture(scene: Scene, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a scene, or of its first bricks in build order, the others pale."""
    network, most, count = build_network(scene), len(scene.bricks), _bricks(scene, bricks)
    figure, (axes,) = _panels(_seen_box(scene), 1, width, 0.35)
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


class Stage:
    """Draws steps of a build, all of the same size: the one of `steps_picture` and of films.

    ``forces``: the network, colored by axial force, instead of bricks and robots; ``magnify``: how
    many times larger displacements are drawn, 0 for not at all; ``arms``: what is known of them in
    all steps; by default their postures, where robots of the scene have arms.
    """

    def __init__(
        self,
        engine: Engine,
        steps: Sequence[Step],
        *,
        forces: bool,
        magnify: float,
        arms: Arms | None,
    ) -> None:
        scene = engine.network.scene
        if arms is None:
            arms = {} if forces else _known_arms(scene, steps)
        _require_arms(scene, steps, arms)
        self.engine, self.steps, self._forces, self._magnify = engine, steps, forces, magnify
        self.cell = Cell(scene, arms)
        self.box = _build_box(self.cell)

    def fields(self, at: int) -> Fields:
        """Return forces and displacements of a step, by its place."""
        want = Want.EDGES | Want.DISPLACEMENTS | Want.BRICKS
        return step_fields(self.engine, self.steps[at], want)

    def draw(self, axes: Axes, at: int, largest_force: float | None = None) -> None:
        """Draw a step, by its place; the largest force, N, is drawn widest."""
        step, network = self.steps[at], self.engine.network
        fields = self.fields(at) if self._forces or self._magnify else None
        how: dict[str, Any] = {"magnify": self._magnify or 1.0}
        if fields is not None and self._forces:
            how |= {"displacement": fields.displacement[0]} if self._magnify else {}
            how |= {"edge_force": fields.edge_force[0], "largest_force": largest_force}
            draw_network(axes, network, step.bricks, VIEW, **how)
        else:
            _draw_robots(axes, self.cell, self.cell.arms(step, at), VIEW)
            _draw_props(axes, network.scene, step.bricks, held=bool(step.held), view=VIEW)
            if fields is not None:
                draw_bricks(axes, network, step.bricks, VIEW, alpha=0.15)
                how["twist"] = fields.brick_twist[0]
            draw_bricks(axes, network, step.bricks, VIEW, **how)
        newest = network.scene.placed[step.bricks - (step.kind is not StepKind.REMOVE)].name
        what = {
            StepKind.REMOVE: f"brick {newest} is removed",
            StepKind.PLACE: f"brick {newest} is placed",
            StepKind.RELEASE: "a robot lets go",
            StepKind.REPOSITION: "a robot takes a grip",
        }[step.kind]
        axes.set_title(f"step {step.number} of {self.steps[-1].number}: {what}", loc="center")
        axes.set(xlim=(self.box[0][0], self.box[1][0]), ylim=(self.box[0][1], self.box[1][1]))


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
    """Return a picture of steps of a build, by their numbers from 1; how, see `Stage`.

    By default `FRAMES` of them, spread over the build.
    """
    picked, scene = _picked(steps, chosen), engine.network.scene
    stage = Stage(engine, steps, forces=forces, magnify=magnify, arms=arms)
    figure, panels = _panels(stage.box, len(picked), WIDTH, 0.35)
    largest = None
    if forces:  # of any edge in these steps, N
        each = (stage.fields(at).edge_force for at in picked)
        largest = max(float(np.abs(force).max(initial=0.0)) for force in each)
    key: dict[int, Line2D] = {}
    for axes, at in zip(panels, picked, strict=True):
        stage.draw(axes, at, largest)
        if len(picked) == 1:
            draw_grips(axes, engine.network, steps[at].grips, VIEW)
        else:
            key |= _mark_grips(axes, scene, steps[at].grips)
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


def spread_steps(steps: Sequence[Step], most: int) -> tuple[int, ...]:
    """Return numbers of steps spread over a build, ascending: some that place, and the last one.

    Of a take-down some that remove.
    """
    kinds = (StepKind.PLACE, StepKind.REMOVE)
    placing = [step.number for step in steps if step.kind in kinds]
    parts = range(1, most if placing else 1)
    picked = {placing[round(k * (len(placing) - 1) / most)] for k in parts}
    return tuple(sorted({*picked, steps[-1].number}))


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


_DPI, _WIDTH, _COLORS = 80, 6.0, 128  # of a GIF; inches


@dataclass(frozen=True, eq=False, repr=False)
class Film:
    """A build as a film: a notebook plays it, `save` writes it; see `steps_picture`."""

    engine: Engine
    steps: Sequence[Step]
    forces: bool = False
    magnify: float = 0.0
    seconds: float = 0.4
    arms: Arms | None = None

    def __repr__(self) -> str:
        name, count = self.engine.network.scene.name, len(self.steps)
        return f"<Film of {name}: {count} steps; save('build.gif') writes it>"

    def _repr_html_(self) -> str:
        """Return the film as an animated GIF: it plays without scripts, and without a network."""
        with tempfile.TemporaryDirectory() as folder:
            film = self.save(Path(folder) / "film.gif").read_bytes()
        source = f"data:image/gif;base64,{b64encode(film).decode()}"
        return f'<img alt="{len(self.steps)} steps of a build" src="{source}">'

    @styled
    def save(self, path: str | Path) -> Path:
        """Write the film to a file that ends in ``.gif``. Raises `FileError` if it cannot."""
        path = Path(path)
        self.require(path)
        try:
            path.write_bytes(_gif(self._figures(), self.seconds))
        except OSError as error:
            raise FileError(f"cannot write {path}: {error.strerror}; name another") from error
        return path

    @staticmethod
    def require(path: Path) -> None:
        """Raise what `save` would, as far as it is known before anything is drawn."""
        if path.suffix != ".gif":
            raise FileError(f"film {path}: give a name that ends in .gif")
        if not path.parent.is_dir():
            raise FileError(f"cannot write {path}: there is no folder {path.parent}; name another")

    def _figures(self) -> Iterator[Figure]:
        """Yield a figure for every step: the same one, drawn anew."""
        how: Any = {"forces": self.forces, "magnify": self.magnify, "arms": self.arms}
        stage = Stage(self.engine, self.steps, **how)
        wide, tall = stage.box[1] - stage.box[0]
        figure = new_picture(_WIDTH, max(_WIDTH * tall / wide, 2.0) + 0.5, "none")
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.88))
        for at, step in enumerate(self.steps):
            axes.clear()
            stage.draw(axes, at)
            draw_grips(axes, self.engine.network, step.grips, VIEW)
            yield figure


def _gif(figures: Iterator[Figure], seconds: float) -> bytes:
    """Return figures as a GIF of few colors, those of the middle one: less than half the bytes."""
    frames = []
    for figure in figures:
        shown = io.BytesIO()
        figure.savefig(shown, format="png", dpi=_DPI)
        frames.append(Image.open(shown).convert("RGB"))
    colors = frames[len(frames) // 2].quantize(_COLORS, Image.Quantize.FASTOCTREE)
    palette = np.array(colors.getpalette()).reshape(-1, 3)
    palette[palette.sum(axis=1).argmax()] = 255  # the background stays white
    colors.putpalette(palette.ravel().tolist())
    first, *more = (frame.quantize(palette=colors, dither=Image.Dither.NONE) for frame in frames)
    out = io.BytesIO()
    how: Any = {"save_all": True, "append_images": more, "loop": 0, "optimize": True}
    first.save(out, format="GIF", duration=round(1000 * seconds), **how)
    return out.getvalue()
