"""Claim: the documentation's pictures of built-in scenes are those of the scenes that ship.

Method: draw `arch25` with its network; the twisting step 35 of the sequential method beside the
cantilever method at the same step; responses along all methods; printed against computed ones;
`vault338` while it grows and from above; scenes of the library's generators; the Pareto sets
of the free schedule and of the loop.
Every picture is held against the stored one before it takes its place: gray means over squares of
16 pixels, so that fonts do not count, may differ by a fifth of what tells the stored picture from a
blank one.

Inputs: the shipped scenes and tables. Command: ``python -m experiments.figures [--quick]``. Writes
``docs/figures/*.png``.
"""

from __future__ import annotations

import io
from collections.abc import Callable

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.patches import Rectangle

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.plotting import DPI, FIGURES, new_figure, save_figure
from experiments.harness.yardstick import VALUES
from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.placement.free_front import FreeFront
from seqopt.placement.free_problem import pose_free
from seqopt.placement.front import find_front
from seqopt.placement.loop_front import LoopFront
from seqopt.report.comparison import method_tables
from seqopt.report.draw import View, draw_bricks, draw_grips, draw_network, draw_responses
from seqopt.report.fronts import front_figure
from seqopt.scene.boxes import boxes
from seqopt.scene.library import DomeShape, WallShape, chain, dome, wall
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.free_rules import FreeRules
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import WORST_RATIO
from seqopt.study.published import as_printed
from seqopt.study.tables import printed_steps

VIEW = View(azimuth=35, elevation=22)
MAGNIFY = 2000.0
SQUARE, ALIKE = 16, 0.2  # pixels; share of what the stored picture shows
ROUNDED = {"F_largest": 5.0, "M_sup": 0.5, "T_max": 5.0, "D_max": 5e-7}
COLUMNS = {
    "F_rob1_N": "F_rob1 [N]",
    "M_sup_Nm": "M_sup [N m]",
    "F_max_N": "T_max [N]",
    "D_max_1e-3mm": "D_max [1e-3 mm]",
}
TABLES = {
    "sequential": ("o", "A.1, sequential"),
    "cantilever": ("x", "A.2, cantilever"),
    "published": ("+", "B.1, three-robot plan\n(took no part)"),
}


def twisting_step(engine: Engine) -> Figure:
    """Draw the arch, 18 bricks held off their line, and the same held on a brick along it."""
    net = engine.network
    figure = new_figure(10, 4.2)
    whole, twist, calm = figure.subplots(1, 3)
    draw_bricks(whole, net, 25, VIEW)
    whole.set_title("25 bricks", fontsize=9)
    for axes, node, name in (
        (twist, 35, "sequential, step 35"),
        (calm, 31, "cantilever, step 35"),
    ):
        fields = engine.solve(18, [[node]], Want.ALL)
        draw_bricks(axes, net, 18, VIEW, alpha=0.1)
        draw_bricks(axes, net, 18, VIEW, twist=fields.brick_twist[0], magnify=MAGNIFY)
        draw_grips(axes, net, (None, node, None), VIEW)
        axes.set_title(f"{name}, motion x {MAGNIFY:g}", fontsize=9)
    return figure


def network_picture(engine: Engine) -> Figure:
    net = engine.network
    figure = new_figure(8, 6)
    axes = figure.subplots()
    draw_bricks(axes, net, 25, VIEW, alpha=0.15)
    draw_network(axes, net, 25, VIEW, numbers=True)
    return figure


def axial_forces(engine: Engine) -> Figure:
    """Draw the edges of two states, red in tension, blue in compression."""
    net = engine.network
    figure = new_figure(9, 4.2)
    axes = figure.subplots(1, 2)
    for panel, (bricks, grips) in zip(
        axes, ((12, (None, 19, None)), (17, (33, 31, None))), strict=True
    ):
        held = [[g for g in grips if g is not None]]
        draw_bricks(panel, net, bricks, VIEW, alpha=0.1)
        draw_network(panel, net, bricks, VIEW, edge_force=engine.solve(bricks, held).edge_force[0])
        draw_grips(panel, net, grips, VIEW)
        panel.set_title(f"{bricks} bricks", fontsize=9)
    return figure


def tables_as_printed(engine: Engine) -> dict[str, pd.DataFrame]:
    """Return the responses of every method with the support that the paper prints."""
    scene = engine.network.scene
    return {name: as_printed(scene, table) for name, table in method_tables(engine)[0].items()}


def responses_along_the_build(engine: Engine) -> Figure:
    figure = new_figure(8, 8)
    axes = figure.subplots(len(COLUMNS), 1, sharex=True)
    draw_responses(axes, tables_as_printed(engine), COLUMNS)
    axes[-1].set(yscale="log", ylim=(0.1, 500))
    return figure


def printed_against_computed(engine: Engine) -> Figure:
    tables = tables_as_printed(engine)
    figure = new_figure(9, 6.5)
    panels = figure.subplots(3, 4).ravel()
    for panel, column in zip(panels, VALUES, strict=False):
        for name, (marker, label) in TABLES.items():
            want = printed_steps(name)[column].abs()
            panel.plot(want, tables[name][column].abs(), marker, ms=3, mfc="none", label=label)
        low, high = panel.get_xlim()
        panel.plot([low, high], [low, high], "k:", lw=0.6)
        if column.startswith("D_"):  # the twisting steps move a thousand times as far as others
            panel.set(xscale="log", yscale="log", xlim=(0.05, 2 * high), ylim=(0.05, 2 * high))
        panel.set_title(column, fontsize=8)
        panel.tick_params(labelsize=6)
    handles, labels = panels[0].get_legend_handles_labels()
    panels[-1].set_axis_off()
    panels[-1].legend(handles, labels, frameon=False, fontsize=8, loc="center")
    figure.supxlabel("printed", fontsize=9)
    figure.supylabel("computed", fontsize=9)
    return figure


def vault(_: Engine) -> Figure:
    """Draw the vault in three phases, and its plan with the sides of the rectangle around it."""
    net = build_network(load_scene("vault338"))
    arch = range(1, 26)
    figure = new_figure(10, 7.4)
    panels = figure.subplots(2, 2).ravel()
    for panel, bricks in zip(panels, (25, 120, 338), strict=False):
        draw_bricks(panel, net, bricks, VIEW, marked=arch)
        panel.set_title(f"{bricks} bricks", fontsize=9)
    draw_bricks(panels[-1], net, 338, View(azimuth=0, elevation=90), marked=arch)
    panels[-1].set_title("plan, mm", fontsize=9)
    corner = boxes(net.scene.bricks).corners().reshape(-1, 3)
    (left, front, _), (right, back, _) = corner.min(axis=0), corner.max(axis=0)
    panels[-1].add_patch(Rectangle((left, front), right - left, back - front, fill=False, ls=":"))
    text = {"fontsize": 8, "ha": "center", "va": "center"}
    panels[-1].text((left + right) / 2, front - 0.15, f"{1e3 * (right - left):.0f}", **text)
    panels[-1].text(
        left - 0.15, (front + back) / 2, f"{1e3 * (back - front):.0f}", **text, rotation=90
    )
    return figure


def library(_: Engine) -> Figure:
    """Draw a chain, a wall, and a dome in either bond."""
    figure = new_figure(10, 7.4)
    scenes = (
        chain(50),
        wall(WallShape(columns=6, courses=8, gap=0.01)),
        load_scene("dome163"),
        dome(DomeShape(courses=10, around=24, bond="herringbone", thickness=0.06)),
    )
    for panel, scene in zip(figure.subplots(2, 2).ravel(), scenes, strict=True):
        draw_bricks(panel, build_network(scene), len(scene.bricks), VIEW)
        panel.set_title(scene.name, fontsize=9)
    return figure


WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=2,rise=1.2,curve=catenary,pattern=VLR",
    "arch:span=2,rise=1.3,curve=pointed,dimensions=0.12x0.1x0.06",
    "barrel:test=2",
    "wall:columns=6,courses=8,corbel=-0.03,gap=0.005",
    "dome:courses=6,around=16,rise=0.8,thickness=0.06",
)


def scenes_in_words(_: Engine) -> Figure:
    """Draw scenes that a few words describe."""
    figure = new_figure(10, 6.4)
    for panel, words in zip(figure.subplots(2, 3).ravel(), WORDS, strict=True):
        scene = load_scene(words)
        draw_bricks(panel, build_network(scene), len(scene.bricks), VIEW)
        panel.set_title(words.replace(",curve", ",\ncurve"), fontsize=8)
    return figure


def free_front(engine: Engine) -> Figure:
    """Draw the Pareto sets of the free schedule and of the loop, and the methods of the paper."""
    names = [*ROUNDED]
    free = pose_free(engine, FreeRules(), WORST_RATIO, ",".join(names))
    fronts = [
        find_front(problem)
        for problem in (
            FreeFront(free, ROUNDED),
            LoopFront(engine, three_robot_loop(engine.network), names, rounding=ROUNDED),
        )
    ]
    methods = method_tables(engine)[0]
    return front_figure(fronts[0], methods, {"three-robot loop": fronts[1].table})


PICTURES: dict[str, Callable[[Engine], Figure]] = {
    "twisting_step.png": twisting_step,
    "network.png": network_picture,
    "axial_forces.png": axial_forces,
    "responses.png": responses_along_the_build,
    "agreement.png": printed_against_computed,
    "vault338.png": vault,
    "library.png": library,
    "words.png": scenes_in_words,
    "free_front.png": free_front,
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


def rendered(figure: Figure) -> Floats:
    """Return a figure as it would be stored: rows, columns, channels, each from 0 to 1."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=DPI, format="png")
    buffer.seek(0)
    return np.asarray(imread(buffer, format="png"), dtype=float)


def differing(engine: Engine, *, store: bool) -> dict[str, float]:
    """Return how far every picture differs from the stored one, which it then may replace."""
    out = {}
    for name, draw in PICTURES.items():
        figure, path = draw(engine), FIGURES / name
        drawn = rendered(figure)
        out[name] = unlike(drawn, np.asarray(imread(path))) if path.exists() else float("inf")
        if store:
            save_figure(figure, name)
    return out


def experiment(options: Options) -> Finding:
    engine = ComplianceEngine(build_network(load_scene("arch25")))
    far = differing(engine, store=not options.quick)
    for name, share in far.items():
        print(f"{name:20} differs from the stored one by {share:.3f} of what it shows")
    return Finding(max(far.values()) <= ALIKE)


CLAIM = Claim(experiment, quick="all pictures, nothing written")

if __name__ == "__main__":
    CLAIM.main()
