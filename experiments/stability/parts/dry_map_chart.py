"""The map of arches built dry: least payload by length, thickness, friction and robots."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from seqopt.report.style import SMALL, new_figure, styled

DARK = 0.52  # from where figures are white
LARGEST = 0.7  # payload over the arch's weight at the end of the scale


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw a panel per thickness and number of robots: friction over bricks.

    Parameters
    ----------
    table : pandas.DataFrame
        Of `experiments.stability.parts.dry_arches.least_payload`.
    """
    thicknesses, robots = (sorted(table[c].unique()) for c in ("thickness_m", "robots"))
    figure = new_figure(6.6)
    axes = figure.subplots(len(thicknesses), len(robots), sharex=True, sharey=True, squeeze=False)
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
