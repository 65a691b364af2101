"""How integer programs of different shape close in on their optimum."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.harness.plotting import new_figure, save_figure

TITLES = {"sum": "least sum of costs", "peak": "smallest worst cost"}
FIRST = 0.02  # s, where the time axis begins


def chart(table: pd.DataFrame, traces: pd.DataFrame) -> None:
    """Draw choices and bounds over time, as shares of the optimum, a panel per problem."""
    figure = new_figure(9, 4)
    panels = figure.subplots(1, 2)
    for panel, (aim, rows) in zip(panels, table.groupby("aim", sort=False), strict=True):
        for color, (_, row) in enumerate(rows.iterrows()):
            trace = traces[traces["formulation"] == row["formulation"]]
            end = pd.DataFrame([row[["seconds", "value", "bound"]].tolist()])
            own = trace[["seconds", "objective", "bound"]].set_axis([0, 1, 2], axis=1)
            points = pd.concat([own, end], ignore_index=True).to_numpy(float)
            for column, style, label in ((1, "-", row["formulation"]), (2, "--", None)):
                known = np.isfinite(points[:, column])
                panel.step(
                    np.maximum(points[known, 0], FIRST),
                    points[known, column] / row["optimum"],
                    style,
                    where="post",
                    color=f"C{color}",
                    label=label,
                )
            panel.plot(FIRST, row["relaxed"] / row["optimum"], "o", mfc="none", color=f"C{color}")
        panel.axhline(1.0, color="0.6", lw=0.8, zorder=0)
        panel.set(xscale="log", xlabel="time [s]", title=TITLES[aim])
        panel.set(xlim=(0.8 * FIRST, 1.2 * table["limit"].max()))
        panel.grid(visible=True, lw=0.2)
        panel.legend(frameon=False, fontsize=8, loc="lower right")
    panels[0].set_ylim(0.72, 1.08)
    panels[1].set_ylim(-0.05, 1.4)
    panels[0].set_ylabel(
        "over the optimum: choices drawn through,\nbounds dashed, relaxation as a ring"
    )
    save_figure(figure, "program_shapes.png")
