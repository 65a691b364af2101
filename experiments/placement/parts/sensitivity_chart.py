"""The figure of `experiments.placement.decision_sensitivity`: decisions, by size of change."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.placement.parts.scenarios import POSITION, STIFFNESS, WEIGHT
from seqopt.report.style import dress, looks, new_figure, styled
from seqopt.report.wording import in_words

PANELS: dict[str, tuple[tuple[str, bool, Callable[[float], float]], ...]] = {
    "stiffness, every joint\nat random|within a factor of": ((STIFFNESS, True, float),),
    "stiffness, all joints alike:\ntranslational (hollow:\nrotational)|"
    "factor (hollow: divided by)": (
        ("stiffness, translational", True, float),
        ("stiffness, rotational", False, lambda size: 1 / size),
    ),
    "both stiffnesses,\nall joints alike|factor": (("stiffness, all", True, float),),
    "weight, every brick at\nrandom (hollow: all alike)|within %": (
        (WEIGHT, True, lambda size: 100 * size),
        ("weight, all", False, lambda size: abs(100 * size)),
    ),
    "position, every brick\nand joint at random|within mm": (
        (POSITION, True, lambda size: 1000 * size),
    ),
}  # title and abscissa, and what is drawn: kind, filled or not, from size to abscissa
ROWS = {
    "changed": "moves of the exact plan\nthat change [%]",
    "changed_in_window": "first places of one move\nthat change [%]",
    "relative_regret": "what the plan made for the\nnominal arch gives up [%]",
}


def curve(table: pd.DataFrame, kind: str, change: Callable[[float], float]) -> pd.DataFrame:
    """Return the means of a kind of scenario over the abscissa, in %, the nominal one included."""
    rows = table[table["kind"] == kind]
    nominal = table[table["kind"] == "nominal"].assign(size=1.0 if "stiffness" in kind else 0.0)
    both = pd.concat([rows, nominal])
    return 100 * both.groupby(both["size"].map(change).round(6))[list(ROWS)].mean()


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw a row of panels per kind of change, and a column per measure of a decision."""
    figure = new_figure(9.4)
    axes = figure.subplots(len(PANELS), len(ROWS), sharex="row", sharey="col")
    for line, (title, drawn) in zip(axes, PANELS.items(), strict=True):
        for criterion, look in looks(table["criterion"].unique()).items():
            mine = table[table["criterion"] == criterion]
            for kind, filled, change in drawn:
                means = curve(mine, kind, change)
                style = look.line() | ({} if filled else {"mfc": "white", "lw": 0.8})
                label = in_words(criterion) if filled else None
                for panel, name in zip(line, ROWS, strict=True):
                    panel.plot(means.index, means[name], label=label, **style)
        words, abscissa = title.split("|")
        line[0].set_ylabel(words)
        line[1].set_xlabel(abscissa)
        if "factor" in abscissa:
            _factors(line[0], wide="all joints" in words)
    for panel, name in zip(axes[0], ROWS.values(), strict=True):
        panel.set_title(name)
        panel.set_ylim(bottom=-0.04 * panel.get_ylim()[1])  # a line of zeros stays in sight
    dress(*axes.ravel())
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    return figure


def _factors(panel: Axes, *, wide: bool) -> None:
    """Give a logarithmic axis of factors its ticks."""
    panel.set_xscale("log")
    ticks = {1 / 3: "1/3", 1 / 2: "1/2", 1.0: "1", 2.0: "2", 3.0: "3"}
    shown = ticks if wide else {1.0: "1", 1.5: "1.5", 2.0: "2", 3.0: "3"}
    panel.set_xticks([*shown], [*shown.values()])
    panel.set_xticks([], minor=True)
