"""The chart of speed against accuracy: gap and error of responses over time (extra ``plot``)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse

from seqopt.report._speed._labels import Label, place
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
    narrow = int((width - 0.7) / len(speeds) / LETTER)
    titles = [_title(speed, narrow, full=len(speeds) == 1) for speed in speeds]
    lines = max(title.count("\n") for title in titles)
    figure = new_figure(4.6 + 0.15 * lines + 0.7 * (width < WIDTH), width)
    panels = figure.subplots(
        2, len(speeds), sharex="col", sharey="row", squeeze=False, height_ratios=[3, 2]
    )
    labels, taken = list[Label](), list[tuple[Axes, float, float]]()
    for speed, title, (gaps, errors) in zip(speeds, titles, panels.T, strict=True):
        gaps.set_title(title, fontsize=SMALL if len(speeds) > 1 else None)
        errors.set_xlabel("time from scene to plan [s]")
        for axes, name in ((gaps, "gap"), (errors, "error")):
            taken += _points(axes, speed, name)
            labels += _named(axes, speed, name)
        _limits(speed, gaps, errors)
    _scales(panels, speeds)
    dress(*panels.ravel())
    if len(speeds) > 1:
        name_panels(*panels[0])
    _legend(figure, speeds, across=2 if width < WIDTH else 6)
    place(figure, labels, taken)
    return figure


def _title(speed: SpeedTable, width: int, *, full: bool) -> str:
    """Return what is built, and what to take, as lines."""
    took = speed.take
    what = f"{speed.scene}, {speed.bricks} bricks"
    if full:
        return "\n".join([what, *textwrap.wrap(speed.sentence, width, break_on_hyphens=False)])
    words = f"take {took['engine']} with {_words(took)}: {seconds_text(took['seconds'])}"
    return "\n".join([what, *textwrap.wrap(words, width, break_on_hyphens=False)])


def _words(row: pd.Series[float]) -> str:
    words = in_words(str(row["formulation"])).replace("_", " ")
    return words if row["proof"] else f"{words}, no proof"


def _look(engine: str, *, filled: bool = True) -> dict[str, Any]:
    known = ENGINES.index(engine) if engine in ENGINES else len(ENGINES)
    return look(known).mark(filled=filled)


def _height(name: str, values: pd.Series[float]) -> pd.Series[float]:
    """Return where gaps or errors are drawn: gaps in percent, no error at the foot of the axis."""
    return 100 * values if name == "gap" else values.clip(lower=NONE)


def _seen(speed: SpeedTable, name: str) -> pd.DataFrame:
    """Return the rows with a point, where it is, and whether another one beats it."""
    every: pd.DataFrame = speed.table.assign(kept=speed.kept)
    table = every[np.isfinite(every[name].to_numpy(float))]
    found: pd.DataFrame = table.assign(height=_height(name, table[name]))
    return found


def _points(axes: Axes, speed: SpeedTable, name: str) -> Iterator[tuple[Axes, float, float]]:
    """Draw a point for every plan, those that another one beats pale; yield where they are."""
    seen = _seen(speed, name).sort_values("kept")
    spots = pd.DataFrame({"x": np.log10(seen["seconds"]).round(2), "y": seen["height"]})
    spots = spots.join(seen[["engine", "exact", "kept"]])  # one pale point on another is not pale
    for _, row in seen[~spots.duplicated()].iterrows():
        alpha, size = (1.0, 6.5) if row["kept"] else (PALE, 5.5)
        mark = _look(str(row["engine"]), filled=bool(row["exact"]))
        at = float(row["seconds"]), float(row["height"])
        axes.plot(*at, **mark, ms=size, alpha=alpha, zorder=3 if row["kept"] else 2, clip_on=False)
        yield axes, *at
    took = speed.take
    at = float(took["seconds"]), float(_height(name, pd.Series([took[name]]))[0])
    axes.plot(*at, "o", ms=14, mfc="none", mec=INK, mew=1.1, zorder=4, clip_on=False)


def _named(axes: Axes, speed: SpeedTable, name: str) -> Iterator[Label]:
    """Yield words for points: above for formulations, each once a level; below for engines."""
    seen, took, named = _seen(speed, name).sort_values("seconds"), _index(speed), set[str]()
    for height, level in seen.groupby("height"):
        level = level.sort_values("kept", ascending=False, kind="stable")  # noqa: PLW2901
        if name == "error":
            first: pd.Series[float] = level.loc[took] if took in level.index else level.iloc[0]
            engines = _engines(level, str(first["engine"]))
            if engines not in named:
                yield Label(axes, _at(first, height), engines, bool(first["kept"]))
            named.add(engines)
        else:
            yield from _named_once(axes, level, height, took)


def _index(speed: SpeedTable) -> Any:
    """Return where in the table the row to take is."""
    return speed.take.name


def _at(row: pd.Series[float], height: object) -> tuple[float, float]:
    return float(row["seconds"]), float(str(height))


def _named_once(axes: Axes, level: pd.DataFrame, height: object, took: Any) -> Iterator[Label]:
    """Yield words for the formulations of one height, none of which is named twice."""
    said = set[str]()
    for own in _neighbors(level):
        first: pd.Series[float] = own.loc[took] if took in own.index else own.iloc[0]
        words = dict.fromkeys([_words(first), *(_words(row) for _, row in own.iterrows())])
        new = [each for each in words if each not in said]
        said |= {*words}
        if new:
            more = f"\nand {len(new) - 1} more" if len(new) > 1 else ""
            yield Label(axes, _at(first, height), new[0] + more, bool(first["kept"]))


def _engines(level: pd.DataFrame, first: str) -> str:
    worst = float(level["error"].max())
    names = dict.fromkeys([first, *level["engine"]])
    said = ", ".join(names) + (f": {error_text(worst)}" if worst else "")
    return textwrap.fill(said, LINE)


def _neighbors(level: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """Yield rows in groups: those close in time, of which another one beats all or none."""
    times, kept = level["seconds"].to_numpy(float), level["kept"].to_numpy(bool)
    apart = (times[1:] > NEAR * times[:-1]) | (kept[1:] != kept[:-1])
    for at in np.split(np.arange(len(times)), np.flatnonzero(apart) + 1):
        yield level.iloc[at]


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
        size: dict[str, Any] = {
            "width": 2 * CORNER,
            "height": 2 * 1.4 * CORNER,
            "transform": axes.transAxes,
        }
        axes.add_patch(Ellipse((0, 0), **size, fc=GREEN, alpha=0.16, lw=0, zorder=0))


def _legend(figure: Figure, speeds: Sequence[SpeedTable], across: int) -> None:
    """Name the engines, and say what marks mean."""
    present = dict.fromkeys(name for speed in speeds for name in speed.table["engine"])
    marks = [Line2D([], [], label=name, **_look(name)) for name in present]
    plain_mark: dict[str, Any] = {"marker": "o", "ls": "none", "color": INK}
    marks += [
        Line2D([], [], **plain_mark, label="proves its plan"),
        Line2D([], [], **plain_mark, mfc="white", label="heuristic"),
        Line2D([], [], **plain_mark, alpha=PALE, label="beaten by another"),
        Line2D([], [], **plain_mark | {"mfc": "none", "ms": 11}, label="take this"),
        Line2D([], [], marker="s", ls="none", ms=9, color=GREEN, alpha=0.2, label="best corner"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=across)
