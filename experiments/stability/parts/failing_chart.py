"""The figure of `experiments.stability.failing_steps`: by bricks placed, and as arches grow."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes

from experiments.harness.plotting import new_figure, save_figure
from seqopt.contact.mortar import EPOXY

ORDINARY = 0.10e6  # Pa: flexural bond of general-purpose mortar, EN 1996-1-1, 3.6.4
LIMITS = {"D_max_1e-3mm": 100.0, "M_sup_Nm": 30.0, "F_largest_N": 392.4}
NONE = 100.0  # Pa: less than any bond that a step needs, drawn for none
SIZES = (1, 2, 4, 8)
COLORS = {
    "sequential": "#b2182b",
    "cantilever": "#ef8a62",
    "modified sequential": "#999999",
    "three-robot, published": "#67a9cf",
    "three-robot, optimized": "#2166ac",
    "three-robot, minimax": "#1b7837",
}


def chart(steps: pd.DataFrame, scale: pd.DataFrame) -> None:
    figure = new_figure(10, 7)
    (bond, shift), (force, size) = figure.subplots(2, 2)
    for name, table in steps.groupby("method", sort=False):
        if name in ("modified sequential", "three-robot, minimax"):
            continue
        worst = table.groupby("bricks")[["bond_needed_Pa", "D_max_1e-3mm", "F_largest_N"]].max()
        style = {"color": COLORS[str(name)], "lw": 1.4, "marker": ".", "ms": 5, "label": name}
        bond.semilogy(worst["bond_needed_Pa"].clip(lower=NONE) / 1e3, **style)
        shift.semilogy(worst["D_max_1e-3mm"], **style)
        force.plot(worst["F_largest_N"], **style)
    for value, text in ((EPOXY.tensile_strength, "epoxy, 3 MPa"), (ORDINARY, "mortar, 0.1 MPa")):
        for axes in (bond, size):
            axes.axhline(value / 1e3, color="k", lw=0.8, ls=":")
            high = axes is bond or value > ORDINARY
            axes.text(1 if high else 5, (1.1 if high else 0.7) * value / 1e3, text, fontsize=8)
    shift.axhline(LIMITS["D_max_1e-3mm"], color="k", lw=0.8, ls=":")
    shift.text(1, LIMITS["D_max_1e-3mm"] * 1.1, "the paper's limit", fontsize=8)
    force.axhline(LIMITS["F_largest_N"], color="k", lw=0.8, ls=":")
    force.text(1, LIMITS["F_largest_N"] * 1.02, "payload", fontsize=8)
    bond.set(xlabel="bricks placed", ylabel="bond needed [kPa]", ylim=(0.7 * NONE / 1e3, 8e3))
    ticks = [NONE / 1e3, 1.0, 10.0, 100.0, 1e3]
    bond.set_yticks(ticks, ["none", *(f"{tick:g}" for tick in ticks[1:])])
    shift.set(xlabel="bricks placed", ylabel="Δ_max [1e-3 mm]")
    force.set(xlabel="bricks placed", ylabel="largest robot force, elastic [N]")
    figure.legend(*bond.get_legend_handles_labels(), loc="outside upper center", ncols=4)
    _grow(size, scale)
    for axes in (bond, shift, force, size):
        axes.grid(visible=True, lw=0.2)
        axes.spines[["top", "right"]].set_visible(False)
    save_figure(figure, "failing_steps.png")


def _grow(axes: Axes, scale: pd.DataFrame) -> None:
    """Draw the bond that every method needs as arches grow."""
    for (name, label), table in scale.groupby(["method", "scaling"], sort=False):
        if label == "heavier" or str(name) not in COLORS:
            continue
        axes.loglog(
            table["times"],
            table["bond_needed_Pa"] / 1e3,
            color=COLORS[str(name)],
            ls="-" if label == "longer" else "--",
            marker="o",
            ms=3,
            lw=1.2,
        )
    axes.plot([], [], "k-", lw=1.2, label="longer: more of the same bricks")
    axes.plot([], [], "k--", lw=1.2, label="larger, or as much heavier bricks")
    axes.set(xlabel="times the reference arch", ylabel="bond needed [kPa]", ylim=(8, 5e4))
    axes.set_xticks(SIZES, [f"{n}×" for n in SIZES])
    axes.minorticks_off()
    axes.legend(frameon=False, fontsize=8, loc="upper left")
