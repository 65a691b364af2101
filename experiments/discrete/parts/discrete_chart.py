"""Picture of `experiments.discrete.discrete_arches`: how far apart the models are, beside print."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.harness.charts import subplots
from seqopt.report._style import BLUE, GREEN, ORANGE, SMALL, VERMILION, dress, name_panels, styled

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
    figure, panels = subplots(5.6, 1, 3)
    first, second, third = panels
    for axes, joint in zip((first, second), PANELS, strict=True):
        readings(axes, errors[errors.index.get_level_values("joint") == joint].droplevel("joint"))
        witness(axes, seen[seen["spread"] == PANELS[joint]], list(study.index))
        axes.plot(study.to_numpy(), "ks", ms=6, label="printed (3DEC)", zorder=5)
        axes.set_title(f"joints {joint}" if joint == "as printed" else f"joints as {joint}")
        # the ratio of displacements is drawn evenly
        even = (lambda e: (e / 100 + 1) ** 0.3, lambda r: 100 * (r ** (1 / 0.3) - 1))
        axes.set_yscale("function", functions=even)
        axes.set(ylim=(-95, 650), yticks=TICKS)
    with_best_pads(third, best)
    look = {"fmt": "ks", "ms": 6, "capsize": 4, "zorder": 5}
    third.errorbar(range(len(study)), study, near, label=f"printed, ± {near:g} points", **look)
    third.set(ylim=(-30, 40))
    for axes in panels:
        tidy(axes, list(study.index))
    dress(*panels)
    name_panels(*panels)
    first.set_ylabel("mean difference of the double-cross model\nfrom the discrete elements [%]")
    look = {"loc": "outside lower left", "title": "(a) and (b)", "ncols": 2, "columnspacing": 1}
    figure.legend(*first.get_legend_handles_labels(), alignment="left", **look)
    look = {"loc": "outside lower right", "title": "(c)", "alignment": "left"}
    figure.legend(*third.get_legend_handles_labels(), **look)
    figure.suptitle(words(best, study, seen), fontsize=SMALL, x=0.01, ha="left")
    return figure


def readings(axes: Axes, errors: pd.DataFrame) -> None:
    sides = sorted({side for _, side in errors.index if side})
    for grip, side in errors.index:
        dashes = DASHES[sides.index(side)] if side else "-"
        name = f"{NAMES[grip]}, {side:g} mm" if side else NAMES[grip]
        color, marker = COLORS[grip]
        row = errors.loc[(grip, side)].to_numpy()
        axes.plot(row, color=color, marker=marker, mfc="white", ls=dashes, lw=1.3, label=name)


def witness(axes: Axes, seen: pd.DataFrame, bricks: list[int]) -> None:
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


def words(best: pd.DataFrame, study: pd.Series[float], seen: pd.DataFrame) -> str:
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
