"""Picture of `experiments.discrete.discrete_arches`: how far apart the models are, beside print."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.harness.plotting import new_figure, save_figure

PANELS = {"as printed": "even", "springs at corners": "corners"}  # joints, and as LMGC90 has them
COLORS = {"node": "#2166ac", "pads, width": "#b2182b", "pads, thickness": "#e08214"}
DASHES = (":", "-", "--")  # of the sizes of pads, in ascending order
LMGC90 = "#1a7a3c"
TICKS = (-90, -80, -50, 0, 100, 200, 500)  # %


def chart(
    errors: pd.DataFrame,
    best: pd.DataFrame,
    study: pd.Series[float],
    seen: pd.DataFrame,
    near: float,
) -> None:
    """Draw the readings as stated, by joint, and those with the best pads."""
    figure = new_figure(11, 5.6)
    first, second, third = figure.subplots(1, 3)
    for axes, joint in zip((first, second), PANELS, strict=True):
        readings(axes, errors[errors.index.get_level_values("joint") == joint].droplevel("joint"))
        witness(axes, seen[seen["spread"] == PANELS[joint]], list(study.index))
        axes.plot(study.to_numpy(), "ks", ms=6, label="printed (3DEC)", zorder=5)
        axes.set_title(f"Joints: {joint}", fontsize=10)
        # the ratio of displacements is drawn evenly
        axes.set_yscale(
            "function",
            functions=(lambda e: (e / 100 + 1) ** 0.3, lambda r: 100 * (r ** (1 / 0.3) - 1)),
        )
        axes.set(ylim=(-95, 650), yticks=TICKS)
    with_best_pads(third, best)
    third.errorbar(
        range(len(study)), study, near, fmt="ks", ms=6, capsize=4, zorder=5,
        label=f"printed, ±{near:g} points",
    )  # fmt: skip
    third.set(ylim=(-30, 40))
    for axes in (first, second, third):
        tidy(axes, list(study.index))
    first.set_ylabel("mean difference of the double-cross model\nfrom the discrete elements [%]")
    legends(figure, first, third)
    figure.suptitle(words(best, study, seen), fontsize=10)
    save_figure(figure, "discrete_arches.png")


def readings(axes: Axes, errors: pd.DataFrame) -> None:
    """Draw a line per grip and size of pads."""
    sides = sorted({side for _, side in errors.index if side})
    for grip, side in errors.index:
        dashes = DASHES[sides.index(side)] if side else "-"
        name = f"{grip}, {side:g} mm" if side else "node held"
        row = errors.loc[(grip, side)].to_numpy()
        axes.plot(row, color=COLORS[grip], ls=dashes, lw=1.3, label=name)


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
        name = f"best: {grip}, {side:g} mm, {joint}" if first else f"{grip}, other readings"
        label = None if (grip, first) in named else name
        named.add((grip, first))
        axes.plot(values, color=COLORS[grip], lw=2.5 if first else 0.8, label=label)
    axes.set_title("Best pads of 4 to 50 mm, for every joint", fontsize=10)


def tidy(axes: Axes, bricks: list[int]) -> None:
    axes.set_xlim(-0.3, len(bricks) - 0.7)
    axes.set_xticks(range(len(bricks)), [f"{count} bricks" for count in bricks], fontsize=8)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:+.0f}" if y else "0"))
    axes.tick_params(axis="y", labelsize=8)
    axes.axhline(0, color="0.5", lw=0.8, zorder=0)
    axes.grid(visible=True, lw=0.2)
    axes.spines[["top", "right"]].set_visible(False)


def legends(figure: Figure, left: Axes, right: Axes) -> None:
    """Name the lines of the panels below them."""
    looks: dict[str, Any] = {"fontsize": 8, "frameon": False}
    figure.legend(
        *left.get_legend_handles_labels(),
        loc="outside lower left", ncols=3, title="left and middle", title_fontsize=8, **looks,
    )  # fmt: skip
    figure.legend(
        *right.get_legend_handles_labels(),
        loc="outside lower right", title="right", title_fontsize=8, **looks,
    )  # fmt: skip


def words(best: pd.DataFrame, study: pd.Series[float], seen: pd.DataFrame) -> str:
    """Return what the picture shows."""
    off = (best - study).abs().max(axis=1).min()
    text = (
        "DISAGREES with print: no reading of the discrete elements gives the printed errors on all "
        f"four arches; the best is {off:.1f} points off on one.\n"
    )
    if seen.empty:
        return text + "There is no answer from LMGC90 yet."
    same, engine = (seen[f"{name}_off_pct"].abs().max() for name in ("same_pads", "engine"))
    return text + (
        f"LMGC90 AGREES: its displacements are within {same:.2g} % of the same springs', and "
        f"within {engine:.1f} % of our engine's, as its pads across the width must lean."
    )
