"""Pictures of the counterparts: printed values beside ours, with the agreement as a caption."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from experiments.calibration.parts.barrel_vaults import Vault, chain, vaults
from experiments.study.parts import counterpart_rows
from experiments.study.parts.counterpart_items import NEAR, caption
from experiments.study.parts.counterpart_rows import (
    LOOP,
    RESPONSES,
    Ours,
    arch_corners,
    bed_of_springs,
    plan_rows,
)
from seqopt.engines.interface import Want
from seqopt.report._robots import ROBOT_COLORS
from seqopt.report._style import BLUE, INK, SMALL, VERMILION, dress, look, new_figure, plain, styled
from seqopt.report.draw import View, draw_bricks, draw_grips
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


VIEW = View(azimuth=35, elevation=22)
CAPTIONS = {
    **{f"F_rob{i} [N]": f"robot {i}, F_rob{i} [N]" for i in (1, 2, 3)},
    "F_sup [N]": "support, F_sup [N]",
    "M_sup [N m]": "support, M_sup [N m]",
    "F_min [N]": "largest compression [N]",
    "T_max [N]": "largest tension T_max [N]",
    "F_avg [N]": "mean axial force [N]",
    "T_pct [%]": "edges in tension [%]",
    "D_avg [1e-3 mm]": "mean displacement [1e-3 mm]",
    "D_std [1e-3 mm]": "its deviation [1e-3 mm]",
}
Draw = Callable[[Figure, pd.DataFrame, Ours], None]


def text_of(value: float) -> str:
    """Return a grip as it is printed: a node, O3, or a dash."""
    if value < 0:
        return "–"
    return f"O{value - 1000:g}" if value > 1000 else f"{value:g}"


def grid(axes: Axes, rows: pd.DataFrame, title: str) -> None:
    """Draw a scheme as printed; where ours differs it stands beside it in red."""
    columns, lines = list(dict.fromkeys(rows["quantity"])), list(dict.fromkeys(rows["at"]))
    for row in rows.to_dict("records"):
        x, y = columns.index(row["quantity"]), lines.index(row["at"])
        same = row["printed"] == row["ours"]
        text = text_of(row["printed"]) + ("" if same else f" (here {text_of(row['ours'])})")
        color = STUDY if same else OFF
        axes.text(x, y, text, ha="center", va="center", fontsize=SMALL, color=color)
        if row["printed"] > 1000:
            axes.axhspan(y - 0.5, y + 0.5, (x + 0.1) / len(columns), (x + 0.9) / len(columns),
                         color="#cfe8f5", zorder=0)  # fmt: skip
    names = [name.removeprefix("node of ") for name in columns]
    axes.set_xticks(range(len(columns)), names, fontsize=SMALL)
    axes.set_yticks(range(len(lines)), lines, fontsize=SMALL)
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(lines) - 0.5, -0.5))
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_title(title)


def sequences(figure: Figure, table: pd.DataFrame, _own: Ours) -> None:
    """Draw the grips of schemes."""
    parts: Any = figure.subfigures(1, 2)
    left, right = parts
    first, second = left.subplots(2, 1, height_ratios=[12, 9])
    both = of(table, "fig:2rob_methods")
    grid(first, both[both["quantity"] != "steps shared [%]"], "Figure 9: two robots")
    grid(second, of(table, "table:optimization1"), "Table 8: modified sequential")
    grid(right.subplots(), of(table, "table:optimization2"), "Table 9: cascade")


def plan(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    """Draw grips and responses of the published plan."""
    parts: Any = figure.subfigures(2, 1, height_ratios=[1, 2.4])
    above, below = parts
    grips_of_plan(above.subplots(), of(table, "table:experimental_data3"), own)
    along_steps("table:experimental_data3")(below, table, own)


def grips_of_plan(axes: Axes, rows: pd.DataFrame, own: Ours) -> None:
    """Draw which node every robot holds, printed and ours, and where grips are optimized."""
    moves = {(move.robot, move.step) for move in own.problem.schedule.moves}
    for i, (color, ring) in enumerate(zip(ROBOT_COLORS, "os^", strict=False), start=1):
        part = rows[(rows["quantity"] == f"node of rob{i}")].reset_index(drop=True)
        step, free = number_of(part), part["printed"] < 0
        label = f"robot {i}: line here, marks printed"
        axes.plot(step, part["ours"].mask(free), "-", color=color, lw=2)
        axes.plot(
            step, part["printed"].mask(free), ring, ms=4, mfc="none", color=color, label=label
        )
        taken = [s for s in step if (f"rob{i}", s) in moves]
        axes.plot(taken, part["ours"][[s - 1 for s in taken]], "*", color=color, mec="k", ms=10)
    axes.plot([], [], "*", color="w", mec="k", ms=10, label="optimized grip")
    axes.legend(ncols=2, loc="upper left")
    axes.set(xlabel="step", ylabel="node", ylim=(0, 72))
    dress(axes)


def twisting(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    """Draw the twisting steps of both methods."""
    panels = figure.subplots(3, 2).ravel()
    names = ("M_sup [N m]", "D_max [1e-3 mm]", "T_max [N]")
    for axes, name in zip(panels, names, strict=False):
        for side, color, method in (("S", OFF, "sequential "), ("C", OURS, "cantilever ")):
            rows = of(table, "table:cantilever_compare", f"{name}, {side}")
            pair(axes, number_of(rows).astype(str), rows, color, method)
        axes.set(yscale="log", title=f"Table 5: {name}", xlabel="step")
        plain(axes.yaxis)
    panels[0].legend(loc="upper left")
    panels[0].set_ylim(top=2000)
    forces, arm, shape = panels[3:]
    for name, color in (("F_rob1 [N]", OFF), ("F_rob2 [N]", OURS), ("F_sup [N]", INK)):
        rows = of(table, "table:sequential_twist", name)
        pair(forces, number_of(rows), rows, color, f"{name.split(' ')[0]} ")
    forces.set(title="Table 4: forces [N]", xlabel="step", ylim=(0, 900))
    rows = of(table, "fig:sequential_twist", "lever arm [mm]")
    arm.axhspan(120, 150, color="0.9", label="printed: 135 ± 15")
    arm.plot(number_of(rows).astype(str), rows["ours"], "o", color=OURS, label="here")
    arm.set(title="Figure 10: lever arm [mm]", xlabel="step", ylim=(0, 180))
    forces.legend(ncols=2, loc="upper left")
    arm.legend()
    fields = own.engine.solve(18, [[35]], Want.ALL)
    draw_bricks(shape, own.engine.network, 18, VIEW, alpha=0.1)
    draw_bricks(shape, own.engine.network, 18, VIEW, twist=fields.brick_twist[0], magnify=2000)
    draw_grips(shape, own.engine.network, (None, 35, None), VIEW)
    shape.set_title("Figure 10: step 35, motion × 2,000")
    dress(*panels[:5])


def maxima(figure: Figure, table: pd.DataFrame, _own: Ours) -> None:
    """Draw largest and average values, ours over printed ones."""
    items = {
        "Table 6": of(table, "table:2robot_tension"),
        "Table 7": of(table, "table:2robot_forces"),
        "Table 10": of(table, "table:optimization_results"),
    }
    panels = figure.subplots(3, 1, height_ratios=[*map(len, items.values())], sharex=True)
    for axes, (title, rows) in zip(panels, items.items(), strict=True):
        ratio, far = rows["ours"] / rows["printed"], (rows["error_pct"] > NEAR).to_numpy()
        axes.axvspan(0.95, 1.05, color="0.93")
        axes.axvline(1, color="k", lw=0.6)
        for some, color, marker in ((~far, OURS, "o"), (far, OFF, "D")):
            at = np.flatnonzero(some)
            axes.scatter(ratio[some], at, 26, [color] * len(at), marker=marker, zorder=3)
        texts = [
            f"{row['quantity'].removeprefix('largest ')}, {row['at']}: "
            f"printed {row['printed']:g}, here {row['ours']:.1f}"
            for row in rows.to_dict("records")
        ]
        axes.set_yticks(range(len(rows)), texts)
        axes.set(ylim=(len(rows) - 0.5, -0.5), title=title)
        dress(axes)
    panels[-1].set_xlabel("here over printed (gray: within 5 %)")


def loop(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    """Draw the four steps of one loop."""
    _, steps, _ = plan_rows(own)
    rows = of(table, "fig:3rob_sequence")
    for axes, step in zip(figure.subplots(2, 2).ravel(), LOOP, strict=True):
        state = steps[step - 1]
        draw_bricks(axes, own.engine.network, state.bricks, VIEW, alpha=0.6)
        draw_grips(axes, own.engine.network, state.grips, VIEW)
        at = rows[(rows["at"] == f"step {step}") & rows["quantity"].str.startswith("node")]
        held = ", ".join(text_of(value) for value in at["printed"])
        axes.set_title(f"step {step}; printed nodes: {held}", loc="center")


def along_steps(label: str) -> Draw:
    """Return the drawing of every response of a table over its steps."""

    def draw(figure: Figure | SubFigure, table: pd.DataFrame, _own: Ours) -> None:
        """Draw a chart for every response."""
        names = [name for name in RESPONSES.values() if len(of(table, label, name))]
        panels = figure.subplots(-(-len(names) // 3), 3).ravel()
        for axes, name in zip(panels, names, strict=False):
            rows = of(table, label, name)
            step, off = number_of(rows), rows["error_pct"] > NEAR
            axes.plot(step, rows["ours"], "-", color=OURS, lw=1.2, label="here")
            look = {"mfc": "none", "mew": 0.6, "color": STUDY, "label": "printed"}
            axes.plot(step, rows["printed"], "o", ms=3, **look)
            look = {"mfc": "none", "color": OFF, "label": "off by more than 5 %"}
            axes.plot(step[off], rows["ours"][off], "D", ms=8, **look)
            axes.set_title(CAPTIONS.get(name, name))
            dress(axes)
        handles, texts = panels[0].get_legend_handles_labels()
        for axes in panels[len(names) :]:
            axes.set_axis_off()
        if len(names) < len(panels):
            panels[-1].legend(handles, texts, loc="center")
        else:
            figure.legend(handles, texts, loc="outside lower center", ncols=3)

    return draw


PICTURES: dict[str, tuple[Draw, float]] = {
    "geometry": (geometry, 4.2),
    "vaults": (vault_tests, 5.8),
    "discrete": (discrete, 5.4),
    "sequences": (sequences, 8.2),
    "twisting": (twisting, 8.6),
    "maxima": (maxima, 8.0),
    "loop": (loop, 6.8),
    "sequential": (along_steps("table:experimental_data1"), 8.2),
    "cantilever": (along_steps("table:experimental_data2"), 8.2),
    "plan": (plan, 11.0),
}  # and heights, inches


@styled
def drawn(name: str, table: pd.DataFrame, own: Ours) -> Figure:
    """Return a picture by name, with its caption."""
    draw, height = PICTURES[name]
    figure = new_figure(height)
    draw(figure, table, own)
    text = textwrap.fill(caption(name, table), 118, break_on_hyphens=False)
    figure.supxlabel(text, fontsize=SMALL, x=0.01, ha="left", linespacing=1.4)
    return figure
