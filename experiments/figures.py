"""Claim: the documentation's pictures of built-in scenes are those of the scenes that ship.

Method: draw `arch25` with its network; responses along all methods; printed against computed
ones; `vault338` while it grows and from above; scenes in words; the Pareto sets
of the free schedule and of the loop.
Every picture is held against the stored one before it takes its place: gray means over squares of
16 pixels, so that fonts do not count, may differ by a fifth of what tells the stored picture from a
blank one.
"""

import io
import textwrap
from collections.abc import Callable

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import FIGURES, save_figure
from experiments.harness.yardstick import VALUES
from seqopt import FreeRules, build_network, load_scene, pose, three_robot_loop
from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.plan.front import find_front
from seqopt.report._style import BLUE, DPI, GRAY, GREEN, VERMILION, plain, styled
from seqopt.report.charts import draw_responses, front_figure
from seqopt.report.comparison import method_tables
from seqopt.report.draw import View, draw_bricks, draw_grips, draw_network, force_key
from seqopt.scene.boxes import box_corners
from seqopt.study import WORST_RATIO, as_printed, printed_steps

VIEW = View(azimuth=35, elevation=22)
WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=2,rise=1.2,curve=catenary,pattern=VLR",
    "arch:span=2,rise=1,dimensions=0.12x0.1x0.06",
    "vault:span=2,rise=0.8,columns=4",
    "wall:columns=6,courses=8,corbel=-0.03,gap=0.005",
    "dome163",
)


@styled
def vault(_: Engine) -> Figure:
    net = build_network(load_scene("vault338"))
    arch = range(1, 26)
    figure, panels = subplots(6.4, 2, 2)
    *parts, plan = panels.ravel()
    names = {25: "the central arch, 25 bricks", 120: "120 bricks", 338: "338 bricks"}
    for panel, (bricks, name) in zip(parts, names.items(), strict=True):
        draw_bricks(panel, net, bricks, VIEW, marked=arch)
        panel.set_title(name, loc="center")
    draw_bricks(plan, net, 338, View(azimuth=0, elevation=90), marked=arch)
    plan.set_title("from above, in mm", loc="center")
    corner = box_corners(net.scene.bricks).reshape(-1, 3)
    (left, front, _), (right, back, _) = corner.min(axis=0), corner.max(axis=0)
    plan.add_patch(Rectangle((left, front), right - left, back - front, fill=False, ls=":"))
    text = {"ha": "center", "va": "center"}
    plan.text((left + right) / 2, front - 0.25, f"{1e3 * (right - left):,.0f}", **text)
    plan.text(left - 0.25, (front + back) / 2, f"{1e3 * (back - front):,.0f}", **text, rotation=90)
    return figure


@styled
def scenes_in_words(_: Engine) -> Figure:
    figure, panels = subplots(7.6, 3, 2)
    for panel, words in zip(panels.ravel(), WORDS, strict=True):
        scene = load_scene(words)
        draw_bricks(panel, build_network(scene), len(scene.bricks), VIEW)
        lines = textwrap.wrap(words.replace(",", ", "), 40)
        panel.set_title("\n".join(lines).replace(", ", ","), loc="center")
    return figure


FROM_ASIDE = View(azimuth=20, elevation=14)  # nodes stand apart
SQUARE, ALIKE = 16, 0.2  # pixels; share of what the stored picture shows
ROUNDED = {"F_largest": 5.0, "M_sup": 0.5, "T_max": 5.0, "D_max": 5e-7}
COLUMNS = {
    "F_rob1_N": "force of robot 1\nF_rob1 [N]",
    "M_sup_Nm": "support moment\nM_sup [N m]",
    "F_max_N": "largest tension\nT_max [N]",
    "D_max_1e-3mm": "largest displacement\nD_max [1e-3 mm]",
}
PRINTED = {
    **{f"F_rob{i}_N": f"force of robot {i} [N]" for i in (1, 2, 3)},
    "F_sup_N": "force of support [N]",
    "M_sup_Nm": "support moment [N m]",
    "F_min_N": "compression C_max [N]",
    "F_max_N": "tension T_max [N]",
    "F_avg_N": "mean axial force [N]",
    "D_max_1e-3mm": "D_max [1e-3 mm]",
    "D_avg_1e-3mm": "mean displacement [1e-3 mm]",
    "D_std_1e-3mm": "its deviation [1e-3 mm]",
}
TABLES = {
    "sequential": ("o", BLUE, "Table A.1: sequential method"),
    "cantilever": ("x", VERMILION, "Table A.2: cantilever method"),
    "published": ("+", GREEN, "Table B.1: three-robot plan\n(not used to identify the arch)"),
}


@styled
def network_picture(engine: Engine) -> Figure:
    net = engine.network
    figure, axes = subplots(7.2)
    draw_bricks(axes, net, 25, FROM_ASIDE, alpha=0.12)
    draw_network(axes, net, 25, FROM_ASIDE, numbers=True)
    keys = [
        Line2D([], [], marker="o", color="k", ms=4, ls="none", label="node that a robot may hold"),
        Line2D([], [], marker="o", color="k", mfc="w", ms=5, ls="none", label="joint of bricks"),
        Line2D([], [], marker="s", color="k", ms=6, ls="none", label="end on the ground"),
        Line2D([], [], color="k", lw=1.2, label="edge"),
    ]
    axes.legend(handles=keys, loc="center")
    return figure


@styled
def axial_forces(engine: Engine) -> Figure:
    """Draw the edges of two states, tension and compression in two colors."""
    net = engine.network
    figure, axes = subplots(5.4, 1, 2)
    states = ((12, (None, 19, None)), (17, (33, 31, None)))
    forces = [
        engine.solve(bricks, [[g for g in grips if g is not None]]).edge_force[0]
        for bricks, grips in states
    ]
    largest = max(float(np.abs(force).max()) for force in forces)
    for panel, (bricks, grips), force in zip(axes, states, forces, strict=True):
        draw_bricks(panel, net, bricks, VIEW, alpha=0.08)
        draw_network(panel, net, bricks, VIEW, edge_force=force, largest_force=largest)
        draw_grips(panel, net, grips, VIEW)
        held = sum(grip is not None for grip in grips)
        panel.set_title(f"{bricks} bricks, {held} grip{'s' * (held > 1)}", loc="center")
    figure.legend(handles=force_key(largest), loc="outside lower center", ncols=5)
    return figure


def tables_as_printed(engine: Engine) -> dict[str, pd.DataFrame]:
    """Return the responses of every method with the support that the paper prints."""
    scene = engine.network.scene
    return {name: as_printed(scene, table) for name, table in method_tables(engine)[0].items()}


@styled
def responses_along_the_build(engine: Engine) -> Figure:
    figure, axes = subplots(7.8, len(COLUMNS), 1, sharex=True)
    tables = tables_as_printed(engine)
    draw_responses(axes, tables, COLUMNS)
    axes[0].get_legend().remove()
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    axes[-1].set(yscale="log", ylim=(0.1, 500))
    plain(axes[-1].yaxis)
    return figure


@styled
def printed_against_computed(engine: Engine) -> Figure:
    tables = tables_as_printed(engine)
    figure, panels = subplots(8.6, 4, 3)
    *panels, last = panels.ravel()
    for panel, column in zip(panels, VALUES, strict=True):
        for name, (marker, color, label) in TABLES.items():
            want = printed_steps(name)[column].abs()
            look = {"ms": 4, "mfc": "none", "color": color, "ls": "none", "label": label}
            panel.plot(want, tables[name][column].abs(), marker, **look)
        low, high = panel.get_xlim()
        panel.plot([low, high], [low, high], color=GRAY, lw=0.8, zorder=0)
        if column.startswith("D_"):  # the twisting steps move a thousand times as far as others
            panel.set(xscale="log", yscale="log", xlim=(0.05, 2 * high), ylim=(0.05, 2 * high))
            plain(panel.xaxis, panel.yaxis)
        panel.set_title(PRINTED[column])
        panel.spines[["top", "right"]].set_visible(False)
    last.set_axis_off()
    last.legend(*panels[0].get_legend_handles_labels(), loc="center")
    figure.supxlabel("printed by Bruun et al.")
    figure.supylabel("computed here")
    return figure


def free_front(engine: Engine) -> Figure:
    names = [*ROUNDED]
    rules = FreeRules(), three_robot_loop(engine.network)
    posed = [pose(engine, each, WORST_RATIO, ",".join(names)) for each in rules]
    fronts = [find_front(problem, rounding=ROUNDED) for problem in posed]
    return front_figure(fronts[0], method_tables(engine)[0], {"three-robot loop": fronts[1].table})


SEARCHED = "free_front.png"
PICTURES: dict[str, Callable[[Engine], Figure]] = {
    "network.png": network_picture,
    "axial_forces.png": axial_forces,
    "responses.png": responses_along_the_build,
    "agreement.png": printed_against_computed,
    "vault338.png": vault,
    "words.png": scenes_in_words,
    SEARCHED: free_front,
}


def coarse(image: Floats) -> Floats:
    """Return the means of gray over squares of pixels, white as one."""
    gray = image[..., :3].mean(axis=2)
    high, wide = (SQUARE * (size // SQUARE) for size in gray.shape)
    squares = gray[:high, :wide].reshape(high // SQUARE, SQUARE, wide // SQUARE, SQUARE)
    return np.asarray(squares.mean(axis=(1, 3)))


def unlike(drawn: Floats, stored: Floats) -> float:
    """Return how far pictures differ, over how far the stored one differs from a blank one."""
    if drawn.shape[:2] != stored.shape[:2]:
        return float("inf")
    own, other = coarse(drawn), coarse(stored)
    return float(np.abs(own - other).mean() / np.abs(1 - other).mean())


def differing(engine: Engine, *, store: bool) -> dict[str, float]:
    """Return how far every picture differs from the stored one, which it then may replace.

    Where nothing is stored, the picture whose search takes longer than all others is left out.
    """
    out = {}
    for name in PICTURES if store else PICTURES.keys() - {SEARCHED}:
        draw = PICTURES[name]
        figure, path, buffer = draw(engine), FIGURES / name, io.BytesIO()
        figure.savefig(buffer, dpi=DPI, format="png")
        buffer.seek(0)
        drawn = np.asarray(imread(buffer, format="png"), dtype=float)
        out[name] = unlike(drawn, np.asarray(imread(path))) if path.exists() else float("inf")
        if store:
            save_figure(figure, name)
    return out


def experiment(options: Options) -> Finding:
    far = differing(ComplianceEngine(build_network(load_scene("arch25"))), store=options.store)
    for name, share in far.items():
        print(f"{name:20} differs from the stored one by {share:.3f} of what it shows")
    return Finding(max(far.values()) <= ALIKE)


CLAIM = Claim(experiment, quick="all pictures but the Pareto sets")
