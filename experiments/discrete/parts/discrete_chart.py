"""Picture of `experiments.discrete.discrete_arches`: how far apart the models are, beside print."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from seqopt.report._style import (
    BLUE,
    GREEN,
    ORANGE,
    SMALL,
    VERMILION,
    dress,
    name_panels,
    new_figure,
    styled,
)

PANELS = {"as printed": "even", "springs at corners": "corners"}  # joints, and as LMGC90 has them
COLORS = {"node": (BLUE, "o"), "pads, width": (VERMILION, "^"), "pads, thickness": (ORANGE, "v")}
DASHES = (":", "-", "--")  # of the sizes of pads, in ascending order
NAMES = {
    "node": "node held",
    "pads, width": "pads across the width",
    "pads, thickness": "pads across the thickness",
}
LMGC90 = GREEN
TICKS = (-90, -80, -50, 0, 100, 200, 500)  # %


@styled
def chart(
    errors: pd.DataFrame,
    best: pd.DataFrame,
    study: pd.Series[float],
    seen: pd.DataFrame,
    near: float,
) -> Figure:
    """Draw the readings as stated, by joint, and those with the best pads."""
    figure = new_figure(5.6)
    first, second, third = figure.subplots(1, 3)
    for axes, joint in zip((first, second), PANELS, strict=True):
        readings(axes, errors[errors.index.get_level_values("joint") == joint].droplevel("joint"))
        witness(axes, seen[seen["spread"] == PANELS[joint]], list(study.index))
        axes.plot(study.to_numpy(), "ks", ms=6, label="printed (3DEC)", zorder=5)
        axes.set_title(f"joints {joint}" if joint == "as printed" else f"joints as {joint}")
        # the ratio of displacements is drawn evenly
        axes.set_yscale(
            "function",
            functions=(lambda e: (e / 100 + 1) ** 0.3, lambda r: 100 * (r ** (1 / 0.3) - 1)),
        )
        axes.set(ylim=(-95, 650), yticks=TICKS)
    with_best_pads(third, best)
    third.errorbar(
        range(len(study)), study, near, fmt="ks", ms=6, capsize=4, zorder=5,
        label=f"printed, ± {near:g} points",
    )  # fmt: skip
    third.set(ylim=(-30, 40))
    for axes in (first, second, third):
        tidy(axes, list(study.index))
    name_panels(first, second, third)
    first.set_ylabel("mean difference of the double-cross model\nfrom the discrete elements [%]")
    legends(figure, first, third)
    figure.suptitle(words(best, study, seen), fontsize=SMALL, x=0.01, ha="left")
    return figure


def readings(axes: Axes, errors: pd.DataFrame) -> None:
    """Draw a line per grip and size of pads."""
    sides = sorted({side for _, side in errors.index if side})
    for grip, side in errors.index:
        dashes = DASHES[sides.index(side)] if side else "-"
        name = f"{NAMES[grip]}, {side:g} mm" if side else NAMES[grip]
        color, marker = COLORS[grip]
        row = errors.loc[(grip, side)].to_numpy()
        axes.plot(row, color=color, marker=marker, mfc="white", ls=dashes, lw=1.3, label=name)


def witness(axes: Axes, seen: pd.DataFrame, bricks: list[int]) -> None:
    """Draw what LMGC90 says, a mark per arch and grip."""
    if seen.empty:
        return
    at = [bricks.index(count) for count in seen["bricks"]]
    label = f"LMGC90, pads of {seen['side_mm'].iloc[0]:g} mm"
    axes.plot(at, seen["lmgc90_error_pct"], "x", color=LMGC90, ms=8, mew=2, label=label, zorder=6)


def with_best_pads(axes: Axes, best: pd.DataFrame) -> None:
    """Draw a line per grip and joint, the best of all thick."""
    named: set[tuple[str, bool]] = set()
    for (grip, side, joint), values in zip(best.index, best.to_numpy(), strict=True):
        first = not named
        name = f"best: {NAMES[grip]}, {side:g} mm,\njoints {joint}"
        name = name if first else f"{NAMES[grip]}, other joints"
        label = None if (grip, first) in named else name
        named.add((grip, first))
        color, marker = COLORS[grip]
        look = {"color": color, "marker": marker, "ms": 4, "mfc": None if first else "white"}
        axes.plot(values, lw=2.5 if first else 0.8, label=label, **look)
    axes.set_title("best pads of 4 to 50 mm")


def tidy(axes: Axes, bricks: list[int]) -> None:
    axes.set_xlim(-0.3, len(bricks) - 0.7)
    axes.set_xticks(range(len(bricks)), [f"{count}" for count in bricks])
    axes.set_xlabel("bricks placed")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:+.0f}" if y else "0"))
    axes.axhline(0, color="0.5", lw=0.8, zorder=0)
    dress(axes)


def legends(figure: Figure, left: Axes, right: Axes) -> None:
    """Name the lines of the panels below them."""
    figure.legend(
        *left.get_legend_handles_labels(),
        loc="outside lower left", ncols=2, title="(a) and (b)", alignment="left", columnspacing=1,
    )  # fmt: skip
    figure.legend(
        *right.get_legend_handles_labels(), loc="outside lower right", title="(c)", alignment="left"
    )


def words(best: pd.DataFrame, study: pd.Series[float], seen: pd.DataFrame) -> str:
    """Return what the picture shows."""
    off = (best - study).abs().max(axis=1).min()
    text = (
        "Disagrees with print: no reading of the discrete elements gives the printed errors on all "
        f"four arches;\nthe best is {off:.1f} points off on one. "
    )
    if seen.empty:
        return text + "There is no answer from LMGC90 yet."
    same, engine = (seen[f"{name}_off_pct"].abs().max() for name in ("same_pads", "engine"))
    return text + (
        f"LMGC90 agrees: its displacements are within {same:.2g} % of the same\nsprings', and "
        f"within {engine:.1f} % of our engine's, as its pads across the width must lean."
    )
