"""The chart of speed against accuracy: gap and error of responses over time (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from seqopt.arrays import Floats
from seqopt.report._speed._table import CUT, DONE, FAILED, SpeedTable, error_text, seconds_text
from seqopt.report._style import (
    GRAY,
    GREEN,
    INK,
    SMALL,
    WIDTH,
    dress,
    look,
    name_panels,
    new_figure,
    plain,
    styled,
)
from seqopt.report.text import in_words

RADII = (7, 12, 20, 30, 42, 56, 72, 90)  # points, from a point to its words
DEGREES = (0, 45, 90, 315, 135, 270, 180, 225, 20, 70, 340, 290, 110, 160, 250, 200)
SPOTS = np.array(
    [(r * np.cos(angle), r * np.sin(angle)) for r in RADII for angle in np.radians(DEGREES)]
)  # the nearest and those beside first
FAR = 16  # from where on a line leads to them
ROOM = 4.0  # half of the size of a point, in points
AIR = 1.5  # points between two texts
SIDES: tuple[Any, ...] = (("left", "center", "right"), ("bottom", "center", "top"))


@dataclass(frozen=True)
class Label:
    """Words for a point; those that are not ``needed`` are left out where there is no room."""

    axes: Axes
    at: tuple[float, float]
    words: str
    needed: bool


def place(
    figure: Figure, labels: Sequence[Label], taken: Sequence[tuple[Axes, float, float]]
) -> None:
    """Write labels around points that are taken, the needed ones first.

    Each stands at the first spot that is free; where none is, needed words go where they cover
    least, others nowhere.
    """
    FigureCanvasAgg(figure).draw()  # type: ignore[no-untyped-call]  # which settles where everything is
    scale = figure.dpi / 72
    points = np.array([axes.transData.transform((x, y)) for axes, x, y in taken]).reshape(-1, 2)
    texts = [text.get_window_extent().extents for axes in figure.axes for text in axes.texts]
    boxes = np.vstack([np.hstack([points - ROOM * scale, points + ROOM * scale]), *texts])
    for label in sorted(labels, key=lambda each: not each.needed):
        beside: Any = {"textcoords": "offset points", "fontsize": SMALL, "linespacing": 1.0}
        color = INK if label.needed else GRAY
        text = label.axes.annotate(label.words, label.at, (0, 0), color=color, **beside)
        text.set_in_layout(False)
        size = np.array(text.get_window_extent().size)
        before = np.select([SPOTS > 1, SPOTS < -1], [0.0, 1.0], 0.5)  # share before the anchor
        low = label.axes.transData.transform(label.at) + SPOTS * scale - size * before
        spots, air = np.hstack([low, low + size]), AIR * scale * np.array([-1, -1, 1, 1])
        inside = np.array([label.axes.get_window_extent().extents])
        outside = (spots[:, 2:] - spots[:, :2]).prod(axis=1) - _shared(spots, inside)
        covered = outside + _shared(spots + air, boxes)
        best = int(covered.argmin())
        if covered[best] > 0 and not label.needed:
            text.remove()
            continue
        dx, dy = SPOTS[best].tolist()
        text.set_position((dx, dy))
        ha, va = (names[int(2 * share)] for names, share in zip(SIDES, before[best], strict=True))
        text.set(ha=ha, va=va)
        if float(np.hypot(dx, dy)) > FAR:
            line = {"arrowstyle": "-", "lw": 0.5, "color": GRAY, "shrinkA": 0, "shrinkB": 4}
            how: Any = {"textcoords": "offset points", "arrowprops": line}
            label.axes.annotate("", label.at, (dx, dy), **how).set_in_layout(False)
        boxes = np.vstack([boxes, spots[best]])


def _shared(boxes: Floats, others: Floats) -> Floats:
    """Return how much of boxes (n, 4) others (m, 4) cover, each by itself, pixels squared, (n,)."""
    low = np.maximum(boxes[:, None, :2], others[:, :2])
    high = np.minimum(boxes[:, None, 2:], others[:, 2:])
    return np.asarray((high - low).clip(min=0.0).prod(axis=2).sum(axis=1))


ENGINES = ("compliance", "frame", "auto", "discrete", "planar")  # in the order of their looks
PALE = 0.28
NONE = 1e-9  # where an error of zero is drawn
LOST = {CUT: (">", "stopped"), FAILED: ("x", "failed"), DONE: ("^", "not allowed")}  # no point
LINE = 22  # letters of a line beside a point
NEAR = 1.35  # times of points that share words differ by less
LETTER = 0.072  # inches of a letter of a title
CORNER = 0.16  # share of a panel


@styled
def speed_chart(*speeds: SpeedTable, width: float = WIDTH) -> Figure:
    """Return the chart of one problem or of several, side by side: above gaps, below errors."""
    narrow, alone = int((width - 0.7) / len(speeds) / LETTER), len(speeds) == 1
    titles = []
    for speed in speeds:
        took = speed.take
        words = f"take {took['engine']} with {_words(took)}: {seconds_text(took['seconds'])}"
        lines = textwrap.wrap(speed.sentence if alone else words, narrow, break_on_hyphens=False)
        titles.append("\n".join([f"{speed.scene}, {speed.bricks} bricks", *lines]))
    most = max(title.count("\n") for title in titles)
    figure = new_figure(4.6 + 0.15 * most + 0.7 * (width < WIDTH), width)
    panels = figure.subplots(
        2, len(speeds), sharex="col", sharey="row", squeeze=False, height_ratios=[3, 2]
    )
    labels, taken = list[Label](), list[tuple[Axes, float, float]]()
    for speed, title, (gaps, errors) in zip(speeds, titles, panels.T, strict=True):
        gaps.set_title(title, fontsize=None if alone else SMALL)
        errors.set_xlabel("time from scene to plan [s]")
        table: pd.DataFrame = speed.table.assign(kept=speed.kept)
        heights = (100 * table["gap"], table["error"].clip(lower=NONE))  # none is at the foot
        for axes, height in zip((gaps, errors), heights, strict=True):
            seen: pd.DataFrame = table.assign(height=height)[np.isfinite(height.to_numpy(float))]
            taken += _points(axes, speed, seen)
            labels += _named(axes, seen, speed.take.name, engines=axes is errors)
        _limits(speed, gaps, errors)
    _scales(panels, speeds)
    dress(*panels.ravel())
    if not alone:
        name_panels(*panels[0])
    _legend(figure, speeds, across=2 if width < WIDTH else 6)
    place(figure, labels, taken)
    return figure


def _words(row: pd.Series[float]) -> str:
    words = in_words(str(row["formulation"])).replace("_", " ")
    return words if row["proof"] else f"{words}, no proof"


def _look(engine: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled)


def _points(
    axes: Axes, speed: SpeedTable, seen: pd.DataFrame
) -> Iterator[tuple[Axes, float, float]]:
    """Draw a point for every plan, those that are dominated pale; yield where they are."""
    ranked = seen.sort_values("kept")
    spots = pd.DataFrame({"x": np.log10(ranked["seconds"]).round(2), "y": ranked["height"]})
    spots = spots.join(ranked[["engine", "exact", "kept"]])  # one pale point on another is not pale
    for _, row in ranked[~spots.duplicated()].iterrows():
        mark = _look(str(row["engine"]), filled=bool(row["exact"]))
        how: Any = {"ms": 5.5, "alpha": PALE, "zorder": 2, "clip_on": False, **mark}
        how |= {"ms": 6.5, "alpha": 1.0, "zorder": 3} if row["kept"] else {}
        at = float(row["seconds"]), float(row["height"])
        axes.plot(*at, **how)
        yield axes, *at
    name: Any = speed.take.name  # of the row to take
    took: pd.Series[float] = seen.loc[name]
    at = float(took["seconds"]), float(took["height"])
    axes.plot(*at, "o", ms=14, mfc="none", mec=INK, mew=1.1, zorder=4, clip_on=False)


def _named(axes: Axes, seen: pd.DataFrame, took: Any, *, engines: bool) -> Iterator[Label]:
    """Yield words for points: formulations, each once a level, or engines; ``took`` is first."""
    named = set[str]()
    for height, rows in seen.sort_values("seconds").groupby("height"):
        level = rows.sort_values("kept", ascending=False, kind="stable")
        times, kept = level["seconds"].to_numpy(float), level["kept"].to_numpy(bool)
        apart = (times[1:] > NEAR * times[:-1]) | (kept[1:] != kept[:-1])
        ends = np.flatnonzero(apart & (not engines)) + 1  # of those close in time and alike
        said = set[str]()
        for places in np.split(np.arange(len(times)), ends):
            own = level.iloc[places]
            first: pd.Series[float] = own.loc[took] if took in own.index else own.iloc[0]
            if engines:
                worst = float(own["error"].max())
                names = ", ".join(dict.fromkeys([str(first["engine"]), *own["engine"]]))
                words = textwrap.fill(names + (f": {error_text(worst)}" if worst else ""), LINE)
                new = [] if words in named else [words]
                named.add(words)
            else:
                every = dict.fromkeys([_words(first), *(_words(row) for _, row in own.iterrows())])
                new = [each for each in every if each not in said]
                said |= {*every}
            if new:
                more = f"\nand {len(new) - 1} more" if len(new) > 1 else ""
                at = float(first["seconds"]), float(str(height))
                yield Label(axes, at, new[0] + more, bool(first["kept"]))


def _limits(speed: SpeedTable, gaps: Axes, errors: Axes) -> None:
    """Draw the end of the time that each had, and say who has no point, and why."""
    table = speed.table[~np.isfinite(speed.table["gap"].to_numpy(float))]
    known = speed.table.drop(table.index)["seconds"]
    late = bool((table["status"] == CUT).any())
    high = max(float(known.max()), speed.limit * late)
    gaps.set(xscale="log", xlim=(float(known.min()) / 2.5, 2.2 * high))
    plain(gaps.xaxis)
    for axes in (gaps, errors) if late else ():
        axes.axvline(speed.limit, color=GRAY, lw=0.8, ls=":")
    across = gaps.get_xaxis_transform()
    for row, ((engine, status), own) in enumerate(table.groupby(["engine", "status"], sort=False)):
        at = (high, 0.95 - 0.085 * row)
        mark: dict[str, Any] = {**_look(str(engine), filled=False), "ms": 6}
        gaps.plot(*at, transform=across, clip_on=False, **mark | {"marker": LOST[str(status)][0]})
        words = f"{engine}: {len(own)} way{'s' * (len(own) > 1)} {LOST[str(status)][1]}"
        beside: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "va": "center"}
        gaps.annotate(words, at, (-7, 0), across, fontsize=SMALL, color=GRAY, **beside)


def _scales(panels: np.ndarray, speeds: Sequence[SpeedTable]) -> None:
    """Let gaps begin at none, errors too, and mark the corner where both are best."""
    gaps = [100 * s.table["gap"].replace(np.inf, np.nan).max() for s in speeds]
    top = 1.45 * max(0.5, np.nanmax(gaps))
    errors = max(1e-2, *(float(s.table["error"].max()) for s in speeds))
    panels[0, 0].set(ylim=(-0.13 * top, top), ylabel="above the proven optimum [%]")
    panels[1, 0].set(yscale="log", ylim=(NONE / 30, 30 * errors), ylabel="error of responses")
    ticks = [10.0**power for power in range(-7, int(np.log10(errors)) + 1, 2)]
    panels[1, 0].set_yticks([NONE, *ticks], ["none", *(error_text(tick) for tick in ticks)])
    panels[1, 0].set_yticks([], minor=True)
    for axes in panels.ravel():
        size: dict[str, Any] = {"width": 2 * CORNER, "height": 2 * 1.4 * CORNER}
        size["transform"] = axes.transAxes
        axes.add_patch(Ellipse((0, 0), **size, fc=GREEN, alpha=0.16, lw=0, zorder=0))


def _legend(figure: Figure, speeds: Sequence[SpeedTable], across: int) -> None:
    """Name the engines, and say what marks mean."""
    present = dict.fromkeys(name for speed in speeds for name in speed.table["engine"])
    marks = [Line2D([], [], label=name, **_look(name)) for name in present]
    plain_mark: dict[str, Any] = {"marker": "o", "ls": "none", "color": INK}
    marks += [
        Line2D([], [], **plain_mark, label="proves its plan"),
        Line2D([], [], **plain_mark, mfc="white", label="heuristic"),
        Line2D([], [], **plain_mark, alpha=PALE, label="dominated"),
        Line2D([], [], **plain_mark | {"mfc": "none", "ms": 11}, label="take this"),
        Line2D([], [], marker="s", ls="none", ms=9, color=GREEN, alpha=0.2, label="best corner"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
