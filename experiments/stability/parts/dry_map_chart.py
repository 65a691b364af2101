"""The map of arches built dry: least payload by length, thickness, friction and robots."""

from __future__ import annotations

import numpy as np
import pandas as pd

from experiments.harness.plotting import new_figure, save_figure

DARK = 0.52  # from where figures are white
LARGEST = 0.7  # payload over the arch's weight at the end of the scale


def chart(table: pd.DataFrame) -> None:
    """Write a panel per thickness and number of robots: friction over bricks.

    Parameters
    ----------
    table : pandas.DataFrame
        Of `experiments.stability.parts.dry_arches.least_payload`.
    """
    thicknesses, robots = (sorted(table[c].unique()) for c in ("thickness_m", "robots"))
    figure = new_figure(7.6, 6.4)
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
                ink = "white" if value > DARK else "black"
                axis.text(j, i, text, ha="center", va="center", fontsize=8, color=ink)
            axis.set_xticks(range(cells.shape[1]), [str(n) for n in cells.columns])
            axis.set_yticks(range(cells.shape[0]), [f"{f:g}" for f in cells.index])
            if axis in axes[0]:
                axis.set_title(f"{count} robots", fontsize=10)
            if axis in axes[-1]:
                axis.set_xlabel("bricks")
        row[0].set_ylabel(f"{1e3 * thickness:g} mm thick\nfriction")
    figure.colorbar(image, ax=axes, label="least payload over the weight of the arch", shrink=0.6)
    save_figure(figure, "dry_map.png")
