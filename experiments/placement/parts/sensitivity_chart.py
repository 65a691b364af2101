"""The figure of `experiments.placement.decision_sensitivity`: decisions, by size of change."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from experiments.harness.plotting import new_figure, save_figure
from experiments.placement.parts.scenarios import POSITION, STIFFNESS, WEIGHT

PANELS: dict[str, tuple[tuple[str, str, Callable[[float], float]], ...]] = {
    "stiffness, every joint\nat random|within a factor of": ((STIFFNESS, "-", float),),
    "translational (dashed: inverse\nrotational), all joints alike|factor": (
        ("stiffness, translational", "-", float),
        ("stiffness, rotational", "--", lambda size: 1 / size),
    ),
    "both stiffnesses,\nall joints alike|factor": (("stiffness, all", "-", float),),
    "weight, every brick at random\n(dashed: all alike)|within %": (
        (WEIGHT, "-", lambda size: 100 * size),
        ("weight, all", "--", lambda size: abs(100 * size)),
    ),
    "position, every brick and\njoint at random|within mm": (
        (POSITION, "-", lambda size: 1000 * size),
    ),
}  # title and abscissa, and what is drawn: kind, style, from size to abscissa
COLORS = ("tab:blue", "tab:orange", "tab:green", "tab:red")
ROWS = {
    "changed": "exact plan:\nmoves changed [%]",
    "changed_in_window": "search of one move:\nfirst place changed [%]",
    "relative_regret": "regret of the nominal\nplan [% of the best]",
}


def curve(table: pd.DataFrame, kind: str, change: Callable[[float], float]) -> pd.DataFrame:
    """Return the means of a kind of scenario over the abscissa, in %, the nominal one included."""
    rows = table[table["kind"] == kind]
    nominal = table[table["kind"] == "nominal"].assign(size=1.0 if "stiffness" in kind else 0.0)
    both = pd.concat([rows, nominal])
    return 100 * both.groupby(both["size"].map(change).round(6))[list(ROWS)].mean()


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(12.5, 6.8)
    looks = [*zip(table["criterion"].unique(), COLORS, "osv^", strict=True)]
    axes = figure.subplots(len(ROWS), len(PANELS), sharex="col", sharey="row")
    for column, (title, drawn) in enumerate(PANELS.items()):
        for criterion, color, marker in looks:
            mine = table[table["criterion"] == criterion]
            for kind, style, change in drawn:
                means = curve(mine, kind, change)
                label = criterion if style == "-" else None
                look = {"color": color, "ls": style, "marker": marker, "ms": 4, "lw": 1.3}
                for row, name in enumerate(ROWS):
                    axes[row, column].plot(means.index, means[name], label=label, **look)
        axes[0, column].set_title(title.split("|")[0], fontsize=9)
        axes[-1, column].set_xlabel(title.split("|")[1], fontsize=9)
        if "factor" in title:
            axes[-1, column].set_xscale("log")
            ticks = [1.0, 1.5, 2.0, 3.0] if column == 0 else [1 / 3, 1 / 2, 1.0, 2.0, 3.0]
            names = ["1/3", "1/2"] if column else []
            axes[-1, column].set_xticks(ticks, names + [f"{t:g}" for t in ticks[len(names) :]])
            axes[-1, column].set_xticks([], minor=True)
    for row, name in enumerate(ROWS.values()):
        axes[row, 0].set_ylabel(name, fontsize=9)
        for one in axes[row]:
            one.grid(visible=True, lw=0.3)
            one.set_ylim(bottom=-0.03 * one.get_ylim()[1])  # a line of zeros stays in sight
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    save_figure(figure, "decision_sensitivity.png")
