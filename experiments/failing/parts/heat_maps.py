"""The heat maps of numbers and of steps that fail, one figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from seqopt.report._style import SMALL, VERMILION, new_figure, styled

LIMITS = (1e-12, 1e-9, 1e-6, np.inf)  # largest error of a color
ERRORS = ("error up to 1e-12", "up to 1e-9", "up to 1e-6", "more, and stated")
SHADES = ("#e8f3fa", "#b5d9ee", "#7dbbe0", "#3f93c9")
NONE, MECHANISM, OFF = "#d9d9d9", "#f2ddc4", VERMILION  # no answer; called a mechanism; wrong
ENDS = {
    NONE: "no answer, or not asked",
    MECHANISM: "called a mechanism",
    OFF: "off by more than it says",
}
LETTERS = {"refused": "r", "failed": "f", "infeasible": "i", "mechanism": "m"}  # the first counts
NAMES = {
    "compliance, to compare": "to compare",
    "beam": "beam search",
    "labels": "label setting",
    "lagrangian": "Lagrangian bound",
    "minimax": "least worst step",
    "overlap_dp": "dynamic program",
    "overlap_lp": "linear program",
    "overlap_mip": "integer program",
    "rank_search": "rank search",
}


def color(row: pd.Series) -> int:
    """Return the color of a cell, by its place in the shades, then the ends."""
    if row["wrong"] or row["off"] > 1:
        return len(SHADES) + 2
    if row["answered"]:
        return int(np.searchsorted(LIMITS, row["error"]))
    return len(SHADES) + (1 if row["mechanism"] else 0)


def letter(row: pd.Series) -> str:
    return next((sign for end, sign in LETTERS.items() if row[end]), "")


def paint(axes: Axes, part: pd.DataFrame, labels: Sequence[str], *, upright: bool) -> None:
    """Draw the cells of an axis, methods upwards, or across where it is ``upright``."""
    part = part.assign(color=part.apply(color, axis=1), letter=part.apply(letter, axis=1))
    methods, values = ([*part[name].drop_duplicates()] for name in ("method", "value"))
    grid = [part.pivot_table(v, "method", "value", "first") for v in ("color", "letter")]
    shown, signs = (table.loc[methods, values].to_numpy() for table in grid)
    names = [NAMES.get(name, name) for name in methods]
    if upright:
        shown, signs = shown.T, signs.T
    colors = ListedColormap([*SHADES, *ENDS])
    axes.imshow(np.nan_to_num(shown.astype(float), nan=len(SHADES)), cmap=colors, vmin=-0.5,
                vmax=len(SHADES) + 2.5, aspect="auto")  # fmt: skip
    for (i, j), sign in np.ndenumerate(signs):
        if isinstance(sign, str) and sign:
            axes.text(j, i, sign, ha="center", va="center", fontsize=SMALL)
    across, up = (names, labels) if upright else (labels, names)
    axes.set_xticks(range(len(across)), across, rotation=90)
    axes.set_yticks(range(len(up)), up)
    axes.tick_params(length=0)


def short(value: str) -> str:
    """Return a power of ten as people write it, other values as they are."""
    try:
        number = float(value)
    except ValueError:
        return value
    if 1e-2 < number < 1e4:
        return f"{number:g}"
    return f"1e{round(np.log10(number))}"


def numbers(figure: Figure, table: pd.DataFrame, half: str, columns: int) -> None:
    """Draw a panel for each numeric axis of a half."""
    own = table[(table["half"] == half) & table["axis"].ne("costs and budgets")]
    own = own[own["axis"].ne("a solver says")]
    axes = [*own["axis"].drop_duplicates()]
    rows = -(-len(axes) // columns)
    panels = figure.subplots(rows, columns, squeeze=False)
    for panel in panels.ravel()[len(axes) :]:
        panel.axis("off")
    for place, (panel, axis) in enumerate(zip(panels.ravel(), axes, strict=False)):
        part = own[own["axis"] == axis]
        paint(panel, part, [short(v) for v in part["value"].drop_duplicates()], upright=False)
        panel.set_title(axis, fontsize=SMALL)
        if place % columns:
            panel.set_yticks([])


def named(figure: Figure, table: pd.DataFrame) -> None:
    """Draw what is asked of formulations by name."""
    own = table[table["axis"].isin(["costs and budgets", "a solver says"])]
    says = own["axis"] == "a solver says"
    own = own.assign(value=own["value"].where(~says, "solver says: " + own["value"]))
    panel = figure.subplots()
    paint(panel, own, [*own["value"].drop_duplicates()], upright=True)
    panel.set_title("(c) the same: ties, budgets, solvers")


def falls(figure: Figure, table: pd.DataFrame) -> None:
    """Draw how many of 100 steps fall, by build and mortar over friction and tilt."""
    rows = [*table[["bricks", "method", "mortar"]].drop_duplicates().itertuples(index=False)]
    columns = [*table[["axis", "value"]].drop_duplicates().itertuples(index=False)]
    share = table.set_index(["bricks", "method", "mortar", "axis", "value"])
    share = 100 * share["fall"] / share["steps"]
    grid = np.array([[share[(*row, *column)] for column in columns] for row in rows])
    panel = figure.subplots()
    panel.imshow(grid, cmap=ListedColormap(["white", *SHADES]), vmin=0, vmax=60, aspect="auto")
    for (i, j), value in np.ndenumerate(grid):
        panel.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize=SMALL)
    bond = {"dry": "dry", "bond=2e4": "20 kPa"}
    panel.set_yticks(range(len(rows)), [f"{n} bricks, {m}, {bond[h]}" for n, m, h in rows])
    names = {"friction": "friction {:.2g}", "tilt": "tilt {:g}°"}
    panel.set_xticks(range(len(columns)), [names[a].format(v) for a, v in columns], rotation=90)
    panel.tick_params(length=0)
    panel.set_title("(d) of 100 steps fall")


@styled
def chart(number: pd.DataFrame, step: pd.DataFrame) -> Figure:
    figure = new_figure(13.0)
    engines, costs, rest = figure.subfigures(3, 1, height_ratios=[3.6, 2.4, 6.0])
    numbers(engines, number, "engines", 4)
    engines.suptitle("(a) engines against sixty digits", x=0.01, ha="left")
    numbers(costs, number, "formulations", 3)
    costs.suptitle("(b) formulations against enumeration: sizes and scales", x=0.01, ha="left")
    left, right = rest.subfigures(1, 2, width_ratios=[1.1, 1.0])
    named(left, number)
    falls(right, step)
    key = [Patch(color=c, label=text) for c, text in zip(SHADES, ERRORS, strict=True)]
    key += [Patch(color=c, label=text) for c, text in ENDS.items()]
    key += [Patch(color="none", label="r, f, i, m: some are refused, failed,")]
    key += [Patch(color="none", label="infeasible, mechanisms")]
    figure.legend(handles=key, loc="outside lower center", ncols=3)
    return figure
