"""The figure of `experiments.stability.failing_steps`: by bricks placed, and as arches grow."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seqopt.contact.mortar import EPOXY
from seqopt.report.style import GRAY, SMALL, dress, looks, name_panels, new_figure, plain, styled

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
def chart(steps: pd.DataFrame, scale: pd.DataFrame) -> Figure:
    figure = new_figure(6.6)
    (bond, shift), (force, size) = figure.subplots(2, 2)
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
    shift.set(ylabel="largest displacement D_max [1e-3 mm]", ylim=(2e-3, 2e3))
    shift.set_title("displacement, bonded bricks")
    force.set(ylabel="largest robot force [N]", ylim=(0, 460), title="robot force, bonded bricks")
    for axes in (bond, shift, force):
        axes.set_xlabel("bricks placed")
    plain(shift.yaxis)
    _grow(size, scale)
    dress(bond, shift, force, size)
    name_panels(bond, shift, force, size)
    figure.legend(*bond.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


def _limit(axes: Axes, value: float, text: str, at: float = 0.01, up: float = 2) -> None:
    """Draw a limit with its name."""
    axes.axhline(value, color=GRAY, lw=1, ls="-")
    axes.annotate(
        text, (at, value), (0, up), xycoords=("axes fraction", "data"),
        textcoords="offset points", fontsize=SMALL,
    )  # fmt: skip


def _grow(axes: Axes, scale: pd.DataFrame) -> None:
    """Draw the bond that every method needs as arches grow."""
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
