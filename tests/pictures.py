"""What is wrong with a figure, as a reader of the site would see it."""

import re
from itertools import combinations

from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text

from seqopt.graph.formulation import formulations
from seqopt.report._style import SMALL, WIDTH

CODE = re.compile(r"\w+_(N|Nm|1e-3mm|Pa|pct|s|us|MB)\b")  # columns of tables
ROUNDING = 0.01  # points
HOLLOW = ("none", "w", "white")


def texts(figure: Figure) -> list[Text]:
    """Return every text that is seen; ticks beyond the limits of their axis are not."""
    ticks = {id(text) for axes in figure.axes for text in _labels(axes, seen=False)}
    shown = {id(text) for axes in figure.axes for text in _labels(axes, seen=True)}
    return [
        text
        for text in figure.findobj(Text)
        if text.get_visible() and text.get_text().strip() and id(text) not in ticks - shown
    ]


def _labels(axes: Axes, *, seen: bool) -> list[Text]:
    """Return the labels of ticks, of all or of those that are seen."""
    out = []
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
            inside = axes.axison and low <= tick.get_loc() <= high
            out += tick.findobj(Text) if inside or not seen else []
    return out


def shown(figure: Figure, size: float) -> float:
    """Return how large type is where the site shows the figure, which is never wider than text."""
    return size * WIDTH / max(figure.get_figwidth(), WIDTH)


def flaws(figure: Figure) -> list[str]:
    """Return what a reader would trip over."""
    seen = texts(figure)
    out = [
        f"{text.get_text()!r} is shown at {shown(figure, text.get_fontsize()):.1f} points"
        for text in seen
        if shown(figure, text.get_fontsize()) < SMALL - ROUNDING
    ]
    names = {name for name in formulations() if "_" in name}
    for text in seen:
        words = re.sub(r"\(.*?\)|the same plan: .*", "", text.get_text())
        if CODE.search(words) or any(name in words for name in names):
            out.append(f"{text.get_text()!r} is a name of the code")
    legends = figure.findobj(Legend)
    named = {text.get_text() for legend in legends for text in legend.get_texts()}
    for axes in figure.axes:
        lost = {*_series(axes)} - named if len(_series(axes)) > 1 else ()
        out += [*_alike(axes), *(f"{name!r} is in no legend" for name in lost)]
    return out


def _series(axes: Axes) -> dict[str, tuple[object, ...]]:
    """Return how each named line looks without its width, by name."""
    return {
        str(line.get_label()): (
            to_hex(line.get_color()),
            str(line.get_marker()),
            str(line.get_linestyle()),
            str(line.get_markerfacecolor()),
        )
        for line in axes.get_lines()
        if not str(line.get_label()).startswith("_")
    }


def _alike(axes: Axes) -> list[str]:
    """Return the series that look alike, or do to those who see no colors."""
    drawn = _series(axes)
    return [
        f"{a!r} and {b!r} differ in color at most"
        for a, b in combinations(drawn, 2)
        if drawn[a][1:3] == drawn[b][1:3] and (drawn[a][3] in HOLLOW) == (drawn[b][3] in HOLLOW)
    ]
