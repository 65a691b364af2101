"""The figure of `experiments.stability.dry_grips`: sets that stand, and sets that were solved."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from seqopt.report.style import GRAY, dress, looks, name_panels, new_figure, plain, styled


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure = new_figure(3.4)
    share, work = figure.subplots(1, 2)
    for name, style in looks(table["case"].unique()).items():
        rows = table[table["case"] == name]
        line = style.line() | {"lw": 1.1, "ms": 4, "label": name}
        share.plot(rows["bricks"], 100 * rows["stand"] / rows["sets"], **line)
        work.semilogy(rows["bricks"], rows["solved"].clip(lower=1), **line)
    sets = table.drop_duplicates("bricks")
    work.semilogy(sets["bricks"], sets["sets"], color=GRAY, lw=2, label="all sets of grips")
    share.set(xlabel="bricks placed", title="sets of grips that stand [%]", ylim=(0, 104))
    work.set(xlabel="bricks placed", title="linear programs solved")
    plain(work.yaxis)
    dress(share, work)
    name_panels(share, work)
    figure.legend(*work.get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure
