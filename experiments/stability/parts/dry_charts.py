"""Figures of `experiments.stability.dry_map`: what stands, is built dry, and needs which bond."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from experiments.harness.charts import note, subplots
from seqopt.contact.mortar import EPOXY
from seqopt.report._style import GRAY, SMALL, dress, looks, name_panels, plain, styled

DARK = 0.52  # from where figures are white
LARGEST = 0.7  # payload over the arch's weight at the end of the scale


@styled
def map_chart(table: pd.DataFrame) -> Figure:
    thicknesses, robots = (sorted(table[c].unique()) for c in ("thickness_m", "robots"))
    look = {"sharex": True, "sharey": True, "squeeze": False}
    figure, axes = subplots(6.6, len(thicknesses), len(robots), **look)
    for row, thickness in zip(axes, thicknesses, strict=True):
        for axis, count in zip(row, robots, strict=True):
            part = table[(table["thickness_m"] == thickness) & (table["robots"] == count)]
            cells = part.pivot_table(index="friction", columns="bricks", values="least_payload")
            least = np.ma.masked_invalid(cells.to_numpy())
            image = axis.imshow(least, origin="lower", vmin=0.2, vmax=LARGEST, cmap="viridis_r")
            axis.set_facecolor("0.85")
            for i, j in np.ndindex(*cells.shape):
                value = cells.iloc[i, j]
                text = f"{value:.2f}" if np.isfinite(value) else "–"
                ink = "white" if DARK < value < np.inf else "black"
                axis.text(j, i, text, ha="center", va="center", fontsize=SMALL, color=ink)
            axis.set_xticks(range(cells.shape[1]), [str(n) for n in cells.columns])
            axis.set_yticks(range(cells.shape[0]), [f"{f:g}" for f in cells.index])
            if axis in axes[0]:
                axis.set_title(f"{count} robots")
            if axis in axes[-1]:
                axis.set_xlabel("bricks of the arch")
        row[0].set_ylabel(f"{1e3 * thickness:g} mm thick\ncoefficient of friction")
    figure.colorbar(image, ax=axes, label="least payload over the weight of the arch", shrink=0.6)
    none = Patch(color="0.85", label="no payload up to four times the weight is enough")
    figure.legend(handles=[none], loc="outside lower right")
    return figure


ORDINARY = 0.10e6  # Pa: flexural bond of general-purpose mortar, EN 1996-1-1, 3.6.4
LIMITS = {"D_max_1e-3mm": 100.0, "M_sup_Nm": 30.0, "F_largest_N": 392.4}
NONE = 100.0  # Pa: less than any bond that a step needs, drawn for none
SIZES = (1, 2, 4, 8)
NAMES = {
    "sequential": "sequential",
    "cantilever": "cantilever",
    "three-robot, published": "three robots, published plan",
    "three-robot, optimized": "three robots, optimized plan",
}
LOOKS = looks(NAMES)


@styled
def failing_chart(steps: pd.DataFrame, scale: pd.DataFrame) -> Figure:
    figure, ((bond, shift), (force, size)) = subplots(6.6, 2, 2)
    for name, style in LOOKS.items():
        table = steps[steps["method"] == name]
        worst = table.groupby("bricks")[["bond_needed_Pa", "D_max_1e-3mm", "F_largest_N"]].max()
        line = style.line() | {"lw": 1.2, "ms": 4, "markevery": 2, "label": NAMES[name]}
        bond.semilogy(worst["bond_needed_Pa"].clip(lower=NONE) / 1e3, **line)
        shift.semilogy(worst["D_max_1e-3mm"], **line)
        force.plot(worst["F_largest_N"], **line)
    for axes, at, up in ((bond, 0.01, 2), (size, 0.66, -9)):
        _limit(axes, EPOXY.tensile_strength / 1e3, "epoxy, 3 MPa", 0.01)
        _limit(axes, ORDINARY / 1e3, "mortar, 0.1 MPa", at, up)
    _limit(shift, LIMITS["D_max_1e-3mm"], "limit of Bruun et al.")
    _limit(force, LIMITS["F_largest_N"], "payload")
    bond.set(ylabel="bond needed [kPa]", ylim=(0.7 * NONE / 1e3, 2e4), title="bond")
    ticks = [NONE / 1e3, 1.0, 10.0, 100.0, 1e3]
    bond.set_yticks(ticks, ["none", *(f"{tick:,g}" for tick in ticks[1:])])
    shift.set(ylabel="largest displacement D_max [1e-3 mm]", title="displacement, bonded bricks")
    force.set(ylabel="largest robot force [N]", ylim=(0, 460), title="robot force, bonded bricks")
    shift.set_ylim(2e-3, 2e3)
    for axes in (bond, shift, force):
        axes.set_xlabel("bricks placed")
    plain(shift.yaxis)
    _grow(size, scale)
    dress(bond, shift, force, size)
    name_panels(bond, shift, force, size)
    figure.legend(*bond.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _limit(axes: Axes, value: float, text: str, at: float = 0.01, up: float = 2) -> None:
    axes.axhline(value, color=GRAY, lw=1, ls="-")
    note(axes, text, (at, value), (0, up), xycoords=("axes fraction", "data"))


def _grow(axes: Axes, scale: pd.DataFrame) -> None:
    for (name, label), table in scale.groupby(["method", "scaling"], sort=False):
        if label == "heavier" or str(name) not in LOOKS:
            continue
        longer = label == "longer"
        line = LOOKS[str(name)].line() | {"ls": "-" if longer else ":", "ms": 4.5, "lw": 1.2}
        face = {"mfc": None if longer else "white"}
        axes.loglog(table["times"], table["bond_needed_Pa"] / 1e3, **line, **face)
    axes.plot([], [], "o-", color=GRAY, lw=1.2, label="longer: more of the same bricks")
    axes.plot([], [], "o:", color=GRAY, mfc="white", lw=1.2, label="larger or heavier bricks")
    axes.set(xlabel="times the reference arch", ylabel="bond needed [kPa]", ylim=(8, 1e6))
    axes.set_xticks(SIZES, [f"{n}×" for n in SIZES])
    plain(axes.yaxis)
    axes.minorticks_off()
    axes.set_title("bond, larger arches")
    axes.legend(loc="upper left")
