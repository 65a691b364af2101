"""Pictures of the counterparts: printed values beside ours, with the agreement as a caption."""

from __future__ import annotations

import textwrap
from collections.abc import Callable

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from experiments.calibration.parts.barrel_vaults import Vault, chain, vaults
from experiments.discrete.parts.pad_readings import STEPS
from experiments.harness.plotting import new_figure, save_figure
from experiments.study.parts.counterpart_axes import OFF, OURS, STUDY, number, of, pair, tidy
from experiments.study.parts.counterpart_models import (
    Ours,
    arch_corners,
    bed_of_springs,
    node_displacements,
)
from experiments.study.parts.counterpart_page import NEAR, TITLES, caption
from experiments.study.parts.counterpart_rows import LOOP, RESPONSES, plan_rows
from seqopt.engines.interface import Want
from seqopt.report.draw import ROBOT_COLORS, View, draw_bricks, draw_grips
from seqopt.study.tables import printed

VIEW = View(azimuth=35, elevation=22)
Draw = Callable[[Figure, pd.DataFrame, Ours], None]


def geometry(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    side, plan = figure.subplots(1, 2, width_ratios=[1.2, 1])
    net = own.engine.network
    draw_bricks(side, net, 25, View(azimuth=0, elevation=0))
    draw_bricks(plan, net, 25, View(azimuth=0, elevation=90))
    corners = arch_corners(own.scene)
    low, high = corners.min(axis=0), corners.max(axis=0)
    rows = of(table, "fig:arch_vault").set_index("quantity")
    text = {
        name: f"{name.split(' ')[0]}: printed {rows.loc[name, 'printed']:.0f} mm, "
        f"here {rows.loc[name, 'ours']:.0f} mm"
        for name in ("span [mm]", "height [mm]")
    }
    arrow = {"arrowstyle": "<->", "color": STUDY, "lw": 0.9}
    side.annotate("", (low[0], -0.1), (high[0], -0.1), arrowprops=arrow)
    side.text(low[[0]].mean() + 1.0, -0.2, text["span [mm]"], ha="center", fontsize=9)
    side.annotate("", (2.2, low[2]), (2.2, high[2]), arrowprops=arrow)
    side.text(2.25, 0.95, text["height [mm]"], rotation=90, va="center", fontsize=9)
    side.set(xlim=(-0.15, 2.5), ylim=(-0.3, 2.0))
    side.set_title("side", fontsize=9)
    plan.set_title("plan", fontsize=9)


def vault_tests(figure: Figure, table: pd.DataFrame, _own: Ours) -> None:
    outline, secants, bars = figure.subplots(1, 3, width_ratios=[1, 0.8, 1.2])
    shapes: dict[tuple[float, ...], list[Vault]] = {}
    for vault in vaults():
        shapes.setdefault((vault.span, vault.rise, vault.thickness), []).append(vault)
    for alike in shapes.values():
        made = chain(alike[0])
        x, y = made.points[:, 0] - made.points[:, 0].mean(), made.points[:, 1]
        name = ", ".join(str(vault.test) for vault in alike)
        (drawn,) = outline.plot(x, y, ".-", ms=2, lw=0.6, label=name)
        at = float(made.loads[0] - made.points[:, 0].mean())
        outline.plot(at, np.interp(at, x, y), "v", color=drawn.get_color(), ms=6)
    outline.set_ylim(-0.1, 3.2)
    outline.set_aspect("equal")
    outline.set(xlabel="m", title="Joints and load of the eight tests")
    study = printed("arch_stiffness")
    slopes = {"measured": study["k_e_kN_mm"][0], "paper": study["k_m_kN_mm"][0]}
    slopes["here"] = of(table, "fig:secant_stiff")["ours"].iloc[0]
    marks = {"measured": ("k", "-", 2.5), "paper": ("0.5", "--", 1.5), "here": (OURS, ":", 2)}
    for name, slope in slopes.items():
        color, style, width = marks[name]
        label = f"{name}: {slope:.1f} kN/mm"
        secants.plot([0, 0.5], [0, 0.5 * slope], color=color, ls=style, lw=width, label=label)
    secants.set(xlabel="displacement [mm]", ylabel="load [kN]", title="Secants of test 1")
    at = study["test"].to_numpy(float)
    shown = {"measured": study["k_e_kN_mm"], "paper": study["k_m_kN_mm"], "here": bed_of_springs()}
    for i, (name, values) in enumerate(shown.items()):
        bars.bar(at + 0.27 * (i - 1), values, 0.25, color=("k", "0.6", OURS)[i], label=name)
    bars.set(yscale="log", xlabel="test", ylabel="stiffness [kN/mm]", title="Stiffness")
    ticks = [50, 100, 200, 500]
    bars.set_yticks(ticks, [str(tick) for tick in ticks])
    bars.minorticks_off()
    for axes in (outline, secants, bars):
        tidy(axes)
        axes.title.set_fontsize(9)
        axes.legend(frameon=False, fontsize=7)


def discrete(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    panels = figure.subplots(1, 5)
    for axes, (bricks, step) in zip(panels, STEPS.items(), strict=False):
        moved = node_displacements(own, step)
        for name, values in moved.items():
            axes.plot(values.index, values, ".-", ms=3, lw=0.7, label=name)
        axes.set(yscale="log", xlabel="node", title=f"{bricks} bricks, {len(values)} nodes")
    panels[0].set_ylabel("displacement [1e-3 mm]")
    panels[0].legend(frameon=False, fontsize=7)
    rows = of(table, "table:validation_results")
    pair(panels[4], number(rows).astype(str), rows)
    panels[4].axhline(0, color="k", lw=0.6)
    panels[4].legend(frameon=False, fontsize=7)
    panels[4].set(xlabel="bricks", title="Mean error [%]")
    for axes in panels:
        tidy(axes)
        axes.title.set_fontsize(9)


def text_of(value: float) -> str:
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
        axes.text(x, y, text, ha="center", va="center", fontsize=7, color=color)
        if row["printed"] > 1000:
            axes.axhspan(y - 0.5, y + 0.5, (x + 0.1) / len(columns), (x + 0.9) / len(columns),
                         color="#cfe8f5", zorder=0)  # fmt: skip
    names = [name.removeprefix("node of ") for name in columns]
    axes.set_xticks(range(len(columns)), names, fontsize=7)
    axes.set_yticks(range(len(lines)), lines, fontsize=7)
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylim=(len(lines) - 0.5, -0.5))
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.spines[:].set_visible(False)
    axes.set_title(title, fontsize=9)


def sequences(figure: Figure, table: pd.DataFrame, _own: Ours) -> None:
    left, right = figure.subfigures(1, 2)
    first, second = left.subplots(2, 1, height_ratios=[12, 9])
    both = of(table, "fig:2rob_methods")
    grid(first, both[both["quantity"] != "steps shared [%]"], "Figure 9: two robots")
    grid(second, of(table, "table:optimization1"), "Table 8: modified sequential")
    grid(right.subplots(), of(table, "table:optimization2"), "Table 9: cascade")


def plan(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    """Draw the grips of the published plan above its responses."""
    above, below = figure.subfigures(2, 1, height_ratios=[1, 2.4])
    grips_of_plan(above.subplots(), of(table, "table:experimental_data3"), own)
    along_steps("table:experimental_data3")(below, table, own)


def grips_of_plan(axes: Axes, rows: pd.DataFrame, own: Ours) -> None:
    """Draw which node every robot holds, printed and ours, and where grips are optimized."""
    moves = {(move.robot, move.step) for move in own.problem.schedule.moves}
    for i, color in enumerate(ROBOT_COLORS[:3], start=1):
        part = rows[(rows["quantity"] == f"node of rob{i}")].reset_index(drop=True)
        step = number(part)
        free = part["printed"] < 0
        axes.plot(step, part["ours"].mask(free), "-", color=color, lw=2, label=f"rob{i} here")
        axes.plot(step, part["printed"].mask(free), "o", ms=4, mfc="none", color=color)
        taken = [s for s in step if (f"rob{i}", s) in moves]
        axes.plot(taken, part["ours"][[s - 1 for s in taken]], "*", color=color, ms=9)
    axes.plot([], [], "o", ms=4, mfc="none", color="k", label="printed")
    axes.plot([], [], "*", color="k", ms=9, label="optimized grip taken")
    axes.legend(frameon=False, fontsize=7, ncols=5)
    axes.set(xlabel="step", ylabel="node", ylim=(0, 60))
    tidy(axes)


def twisting(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    grid_of = figure.subplots(2, 3)
    names = ("M_sup [N m]", "D_max [1e-3 mm]", "T_max [N]")
    for axes, name in zip(grid_of[0], names, strict=True):
        for side, color, method in (("S", OFF, "sequential "), ("C", OURS, "cantilever ")):
            rows = of(table, "table:cantilever_compare", f"{name}, {side}")
            pair(axes, number(rows).astype(str), rows, color, method)
        axes.set(yscale="log", title=f"Table 5: {name}")
    grid_of[0, 0].legend(frameon=False, fontsize=7)
    forces, arm, shape = grid_of[1]
    for name, color in (("F_rob1 [N]", OFF), ("F_rob2 [N]", OURS), ("F_sup [N]", "#444444")):
        rows = of(table, "table:sequential_twist", name)
        pair(forces, number(rows), rows, color, f"{name.split(' ')[0]} ")
    forces.set(title="Table 4: forces [N]", xlabel="step")
    rows = of(table, "fig:sequential_twist", "lever arm [mm]")
    arm.axhspan(120, 150, color="0.9", label="printed: 135 ± 15")
    arm.plot(number(rows).astype(str), rows["ours"], "o", color=OURS, label="here")
    arm.set(title="Figure 10: lever arm [mm]", xlabel="step", ylim=(0, 180))
    for axes in (forces, arm):
        axes.legend(frameon=False, fontsize=7)
    fields = own.engine.solve(18, [[35]], Want.ALL)
    draw_bricks(shape, own.engine.network, 18, VIEW, alpha=0.1)
    draw_bricks(shape, own.engine.network, 18, VIEW, twist=fields.brick_twist[0], magnify=2000)
    draw_grips(shape, own.engine.network, (None, 35, None), VIEW)
    shape.set_title("Figure 10: step 35, motion x 2000", fontsize=9)
    for axes in (*grid_of[0], forces, arm):
        tidy(axes)
        axes.title.set_fontsize(9)


def maxima(figure: Figure, table: pd.DataFrame, _own: Ours) -> None:
    labels = {
        "table:2robot_tension": "Table 6",
        "table:2robot_forces": "Table 7",
        "table:optimization_results": "Table 10",
    }
    heights = [len(of(table, label)) for label in labels]
    panels = figure.subplots(3, 1, height_ratios=heights, sharex=True)
    for axes, (label, title) in zip(panels, labels.items(), strict=True):
        rows = of(table, label)
        ratio = rows["ours"] / rows["printed"]
        colors = [OFF if error > NEAR else OURS for error in rows["error_pct"]]
        axes.axvspan(0.95, 1.05, color="0.93")
        axes.axvline(1, color="k", lw=0.6)
        axes.scatter(ratio, range(len(rows)), c=colors, s=22, zorder=3)
        texts = [
            f"{row['quantity'].removeprefix('largest ')}, {row['at']}: "
            f"printed {row['printed']:g}, here {row['ours']:.1f}"
            for row in rows.to_dict("records")
        ]
        axes.set_yticks(range(len(rows)), texts)
        axes.set(ylim=(len(rows) - 0.5, -0.5), title=title)
        tidy(axes)
        axes.title.set_fontsize(9)
    panels[-1].set_xlabel("here over printed (gray: within 5 %)", fontsize=8)


def loop(figure: Figure, table: pd.DataFrame, own: Ours) -> None:
    _, steps, _ = plan_rows(own)
    rows = of(table, "fig:3rob_sequence")
    for axes, step in zip(figure.subplots(1, 4), LOOP, strict=True):
        state = steps[step - 1]
        draw_bricks(axes, own.engine.network, state.bricks, VIEW, alpha=0.6)
        draw_grips(axes, own.engine.network, state.grips, VIEW)
        at = rows[(rows["at"] == f"step {step}") & rows["quantity"].str.startswith("node")]
        held = ", ".join(text_of(value) for value in at["printed"])
        axes.set_title(f"step {step}: printed {held}", fontsize=9)


def along_steps(label: str) -> Draw:
    """Return the drawing of every response of a table over its steps."""

    def draw(figure: Figure | SubFigure, table: pd.DataFrame, _own: Ours) -> None:
        names = [name for name in RESPONSES.values() if len(of(table, label, name))]
        panels = figure.subplots(3, 4 + (len(names) > 11)).ravel()
        for axes, name in zip(panels, names, strict=False):
            rows = of(table, label, name)
            step, off = number(rows), rows["error_pct"] > NEAR
            axes.plot(step, rows["ours"], "-", color=OURS, lw=1.2, label="here")
            axes.plot(step, rows["printed"], "o", ms=3, mfc="none", mew=0.6, color=STUDY,
                      label="printed")  # fmt: skip
            axes.plot(step[off], rows["ours"][off], "o", ms=9, mfc="none", color=OFF,
                      label="off by more than 5 %")  # fmt: skip
            axes.set_title(name, fontsize=8)
            tidy(axes)
        handles, texts = panels[0].get_legend_handles_labels()
        for axes in panels[len(names) :]:
            axes.set_axis_off()
        panels[-1].legend(handles, texts, frameon=False, fontsize=8, loc="center")

    return draw


PICTURES: dict[str, tuple[Draw, tuple[float, float]]] = {
    "geometry": (geometry, (9, 4.6)),
    "vaults": (vault_tests, (11, 4.6)),
    "discrete": (discrete, (12, 4)),
    "sequences": (sequences, (9, 7.5)),
    "twisting": (twisting, (11, 7.5)),
    "maxima": (maxima, (8, 7.5)),
    "loop": (loop, (12, 4.2)),
    "sequential": (along_steps("table:experimental_data1"), (11, 7.5)),
    "cantilever": (along_steps("table:experimental_data2"), (11, 7.5)),
    "plan": (plan, (12, 10)),
}


def draw_all(table: pd.DataFrame, own: Ours) -> None:
    """Draw and store every picture of `TITLES` with its caption."""
    for name in TITLES:
        draw, size = PICTURES[name]
        figure = new_figure(*size)
        draw(figure, table, own)
        text = textwrap.fill(caption(name, table), int(15 * size[0]), break_on_hyphens=False)
        figure.supxlabel(text, fontsize=8, x=0.01, ha="left", linespacing=1.4)
        save_figure(figure, f"counterpart_{name}.png")
