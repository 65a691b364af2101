"""Pictures of what the model rests on: geometry, vault tests and discrete elements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from seqopt._paper import rows as counterpart_rows
from seqopt._paper.rows import Ours, arch_corners, bed_of_springs
from seqopt.report._style import BLUE, INK, VERMILION, dress, look, plain
from seqopt.report.draw import View, draw_bricks
from seqopt.study._barrel_vaults import Vault, chain, vaults
from seqopt.study.published import printed

OURS, STUDY, OFF = BLUE, "#222222", VERMILION
BOTH = ["printed", "ours"]


def of(table: pd.DataFrame, label: str, quantity: str = "") -> pd.DataFrame:
    """Return the rows of an item, or of one of its quantities."""
    rows = table[table["id"] == label]
    return rows[rows["quantity"] == quantity] if quantity else rows


def number_of(rows: pd.DataFrame) -> pd.Series:
    """Return the numbers at the end of where the rows are: steps, tests, bricks."""
    return rows["at"].str.extract(r"(\d+)")[0].astype(int)


def pair(axes: Axes, x: Any, rows: pd.DataFrame, color: str = OURS, name: str = "") -> None:
    """Draw our values filled and printed ones around them; marks differ by color."""
    ours, ring = {OFF: ("^", "^"), INK: ("s", "s")}.get(color, (".", "o"))
    axes.plot(x, rows["ours"], ours, ms=4, color=color, ls="none", label=f"{name}here")
    axes.plot(x, rows["printed"], ring, ms=8, mfc="none", mew=1, color=color, ls="none",
              label=f"{name}printed")  # fmt: skip


BARS: tuple[dict[str, Any], ...] = (
    {"color": "k"},
    {"color": "0.65"},
    {"fc": "w", "ec": OURS, "hatch": "/////"},
)


def geometry(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    """Draw the arch with its span and height."""
    side, plan = figure.subplots(1, 2, width_ratios=[1.2, 1])
    net = own.engine.network
    draw_bricks(side, net, 25, View(azimuth=0, elevation=0))
    draw_bricks(plan, net, 25, View(azimuth=0, elevation=90))
    corners = arch_corners(own.scene)
    low, high = corners.min(axis=0), corners.max(axis=0)
    rows = of(table, "fig:arch_vault").set_index("quantity")
    span, height = (
        "{}: printed {:.0f} mm, here {:.0f} mm".format(name, *rows.loc[f"{name} [mm]", BOTH])
        for name in ("span", "height")
    )
    arrow = {"arrowstyle": "<->", "color": STUDY, "lw": 0.9}
    side.annotate("", (low[0], -0.1), (high[0], -0.1), arrowprops=arrow)
    side.text(low[0] + 1.0, -0.2, span, ha="center")
    side.annotate("", (2.2, low[2]), (2.2, high[2]), arrowprops=arrow)
    side.text(2.25, 0.95, height, rotation=90, va="center")
    side.set(xlim=(-0.15, 2.5), ylim=(-0.3, 2.0), title="from the side")
    plan.set_title("from above")


def vault_tests(figure: Figure, _table: pd.DataFrame, _own: Ours) -> None:
    """Draw outlines, secants and stiffness of the vault tests."""
    panels = figure.subplot_mosaic([["outline", "outline"], ["secants", "bars"]])
    outline, secants, bars = panels["outline"], panels["secants"], panels["bars"]
    _outlines(outline)
    study = printed("arch_stiffness")
    at = study["test"].to_numpy(float)
    shown: dict[str, tuple[Any, dict[str, Any]]] = {
        "measured": (study["k_e_kN_mm"], {"color": "k", "ls": "-", "lw": 2.5}),
        "Bruun et al.": (study["k_m_kN_mm"], {"color": "0.5", "ls": "--", "lw": 1.5}),
        "here": (bed_of_springs(), {"color": OURS, "ls": ":", "lw": 2}),
    }
    for i, (name, (values, line)) in enumerate(shown.items()):
        label = f"{name}: {values[0]:.1f} kN/mm"
        secants.plot([0, 0.5], [0, 0.5 * values[0]], label=label, **line)
        bars.bar(at + 0.27 * (i - 1), values, 0.25, label=name, **BARS[i])
    secants.set(xlabel="displacement [mm]", ylabel="load [kN]", title="secants of test 1")
    bars.set(yscale="log", xlabel="test", ylabel="stiffness [kN/mm]", title="stiffness")
    bars.set_ylim(top=3000)
    bars.set_xticks(at)
    shown_ticks = [50, 100, 200, 500]
    bars.yaxis.set_ticks(shown_ticks, [f"{tick:g}" for tick in shown_ticks])
    bars.yaxis.set_ticks([], minor=True)
    dress(outline, secants, bars)
    outline.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    secants.legend()
    bars.legend(ncols=2)


def _outlines(outline: Axes) -> None:
    shapes: dict[tuple[float, ...], list[Vault]] = {}
    for vault in vaults():
        shapes.setdefault((vault.span, vault.rise, vault.thickness), []).append(vault)
    for number, alike in enumerate(shapes.values()):
        style = look(number)
        made = chain(alike[0])
        x, y = made.points[:, 0] - made.points[:, 0].mean(), made.points[:, 1]
        tests = ", ".join(str(vault.test) for vault in alike)
        name = f"test{'s' * (len(alike) > 1)} {tests}"
        line = style.line() | {"lw": 1.2, "markevery": max(1, len(x) // 6), "mfc": "white"}
        outline.plot(x, y, label=name, **line)
        at = float(made.loads[0] - made.points[:, 0].mean())
        outline.plot(at, np.interp(at, x, y), "v", color=style.color, ms=9, zorder=3)
    title = "lines of the joints of the eight tests; triangle: load"
    outline.set(xlabel="m", ylabel="m", title=title, aspect="equal")


def discrete(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    """Draw displacements by both models, and their mean error."""
    panels = figure.subplots(2, 3).ravel()
    for axes, step in zip(panels, counterpart_rows.arches(own), strict=False):
        moved = counterpart_rows.node_displacements(own, step)
        for number, (name, values) in enumerate(moved.items()):
            style = look(number).line() | {"ms": 3.5, "lw": 0.9, "markevery": 3}
            axes.plot(values.index, values, label=name, **style)
        axes.set(yscale="log", xlabel="node", title=f"{step.bricks} bricks, {len(values)} nodes")
        plain(axes.yaxis)
    for axes in panels[[0, 3]]:
        axes.set_ylabel("displacement [1e-3 mm]")
    rows, errors = of(table, "table:validation_results"), panels[4]
    pair(errors, number_of(rows).astype(str), rows)
    errors.axhline(0, color="k", lw=0.6)
    errors.legend()
    errors.set(xlabel="bricks", title="mean error [%]")
    dress(*panels)
    panels[5].set_axis_off()
    panels[5].legend(*panels[0].get_legend_handles_labels(), loc="center left", title="models")
