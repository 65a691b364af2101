"""The figure of `experiments.stability.dry_grips`: sets that stand, and sets that were solved."""

from __future__ import annotations

import pandas as pd

from experiments.harness.plotting import new_figure, save_figure

COLORS = ("#2166ac", "#1b7837", "#b2182b")


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(9.5, 3.6)
    share, work = figure.subplots(1, 2)
    for (name, rows), color in zip(table.groupby("case", sort=False), COLORS, strict=False):
        style = {"color": color, "lw": 1.3, "marker": ".", "label": str(name)}
        share.plot(rows["bricks"], 100 * rows["stand"] / rows["sets"], **style)
        work.semilogy(rows["bricks"], rows["solved"].clip(lower=1), **style)
    sets = table.drop_duplicates("bricks")
    work.semilogy(sets["bricks"], sets["sets"], "k:", lw=1.2, label="grip sets")
    share.set(xlabel="bricks placed", ylabel="grip sets that stand [%]", ylim=(0, 103))
    work.set(xlabel="bricks placed", ylabel="linear programs solved")
    for axes in (share, work):
        axes.grid(visible=True, lw=0.2)
        axes.spines[["top", "right"]].set_visible(False)
    work.legend(frameon=False, fontsize=8)
    save_figure(figure, "dry_grips.png")
