"""How integer programs of different shape close in on their optimum."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from seqopt.report.style import GRAY, Look, dress, look, new_figure, plain, styled
from seqopt.report.wording import in_words

TITLES = {"sum": "least sum of costs", "peak": "smallest worst cost"}
FIRST = 0.02  # s, where the time axis begins


@styled
def chart(table: pd.DataFrame, traces: pd.DataFrame) -> Figure:
    """Draw choices and bounds over time, as shares of the optimum, a panel per problem."""
    figure = new_figure(4.4)
    panels = figure.subplots(1, 2)
    for panel, (aim, rows) in zip(panels, table.groupby("aim", sort=False), strict=True):
        for number, (_, row) in enumerate(rows.iterrows()):
            _drawn(panel, row, traces[traces["formulation"] == row["formulation"]], look(number))
        panel.axhline(1.0, color=GRAY, lw=0.8, zorder=0)
        panel.set(xscale="log", xlabel="time [s]", title=TITLES[aim])
        panel.set(xlim=(0.8 * FIRST, 1.2 * table["limit"].max()))
        dress(panel)
        plain(panel.xaxis)
        panel.legend(loc="lower right")
    panels[0].set_ylim(0.72, 1.08)
    panels[1].set_ylim(-0.05, 1.4)
    panels[0].set_ylabel("value over the optimum")
    kinds = {
        "choice found": {"ls": "-"},
        "bound proven": {"ls": ":"},
        "bound of the program without integers": {"ls": "none", "marker": "D", "mfc": "white"},
    }
    keys = [Line2D([], [], color="k", label=text, **style) for text, style in kinds.items()]
    figure.legend(handles=keys, loc="outside lower center", ncols=3)
    return figure


def _drawn(panel: Axes, row: pd.Series, trace: pd.DataFrame, style: Look) -> None:
    """Draw what one program knew at which time."""
    end = pd.DataFrame([row[["seconds", "value", "bound"]].tolist()])
    own = trace[["seconds", "objective", "bound"]].set_axis([0, 1, 2], axis=1)
    points = pd.concat([own, end], ignore_index=True).to_numpy(float)
    for column, more in (
        (1, {"ls": "-", "label": in_words(row["formulation"])}),
        (2, {"ls": ":"}),
    ):
        known = np.isfinite(points[:, column])
        panel.step(
            np.maximum(points[known, 0], FIRST),
            points[known, column] / row["optimum"],
            where="post",
            color=style.color,
            marker=style.marker,
            markevery=max(1, known.sum() // 4),
            mfc="white" if column == 2 else style.color,
            **more,
        )
    relaxed = row["relaxed"] / row["optimum"]
    panel.plot(FIRST, relaxed, "D", ms=7, mfc="white", color=style.color, clip_on=False)
