"""A picture of which robot reaches which node with how many postures (extra ``plot``)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from seqopt.report._style import new_figure, styled


@styled
def reach_picture(table: pd.DataFrame) -> Figure:
    """Return a picture of a table of `seqopt.arms.reach_table`: a row a robot, a column a node.

    Shades say how many postures there are; a cross marks a node that is never reached.
    """
    robots = [*dict.fromkeys(table["robot"])]
    nodes = [*dict.fromkeys(table["node"])]
    counts = table.pivot_table(index="robot", columns="node", values="postures", sort=False)
    possible = table.pivot_table(index="robot", columns="node", values="to_bricks", sort=False) > 0
    grid = np.where(possible, counts, 0)
    figure = new_figure(1.1 + 0.3 * len(robots))
    axes = figure.subplots()
    shown = axes.imshow(np.sqrt(grid), aspect="auto", cmap="Blues", vmin=0, interpolation="nearest")
    rows, columns = np.nonzero(grid == 0)
    axes.plot(columns, rows, "x", color="black", ms=4)
    step = max(1, len(nodes) // 25)
    axes.set_xticks(range(0, len(nodes), step), [str(node) for node in nodes[::step]])
    axes.set_yticks(range(len(robots)), robots)
    axes.set_xlabel("node, in build order")
    axes.spines[:].set_visible(False)
    most = int(grid.max(initial=0))
    ticks = sorted({0, 1, most // 4, most})
    bar = figure.colorbar(shown, ax=axes, ticks=np.sqrt(ticks), pad=0.01)
    bar.ax.set_yticklabels([str(tick) for tick in ticks])
    bar.set_label("postures")
    return figure
