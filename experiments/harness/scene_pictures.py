"""Pictures of the scenes that ship, and of those that generators make."""

from __future__ import annotations

import textwrap

from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from seqopt.engines.interface import Engine
from seqopt.network.build import build_network
from seqopt.report.draw import View, draw_bricks
from seqopt.report.style import new_figure, styled
from seqopt.scene.boxes import boxes
from seqopt.scene.library import DomeShape, WallShape, chain, dome, wall
from seqopt.scene.scene_file import load_scene

VIEW = View(azimuth=35, elevation=22)
WORDS = (
    "arch:span=2,rise=0.8",
    "arch:span=2,rise=1.2,curve=catenary,pattern=VLR",
    "arch:span=2,rise=1.3,curve=pointed,dimensions=0.12x0.1x0.06",
    "barrel:test=2",
    "wall:columns=6,courses=8,corbel=-0.03,gap=0.005",
    "dome:courses=6,around=16,rise=0.8,thickness=0.06",
)


@styled
def vault(_: Engine) -> Figure:
    """Draw the vault in three phases, and its plan with the sides of the rectangle around it."""
    net = build_network(load_scene("vault338"))
    arch = range(1, 26)
    figure = new_figure(6.4)
    panels = figure.subplots(2, 2).ravel()
    names = {25: "the central arch, 25 bricks", 120: "120 bricks", 338: "338 bricks"}
    for panel, (bricks, name) in zip(panels, names.items(), strict=False):
        draw_bricks(panel, net, bricks, VIEW, marked=arch)
        panel.set_title(name, loc="center")
    plan = panels[-1]
    draw_bricks(plan, net, 338, View(azimuth=0, elevation=90), marked=arch)
    plan.set_title("from above, in mm", loc="center")
    corner = boxes(net.scene.bricks).corners().reshape(-1, 3)
    (left, front, _), (right, back, _) = corner.min(axis=0), corner.max(axis=0)
    plan.add_patch(Rectangle((left, front), right - left, back - front, fill=False, ls=":"))
    text = {"ha": "center", "va": "center"}
    plan.text((left + right) / 2, front - 0.25, f"{1e3 * (right - left):,.0f}", **text)
    plan.text(left - 0.25, (front + back) / 2, f"{1e3 * (back - front):,.0f}", **text, rotation=90)
    return figure


@styled
def library(_: Engine) -> Figure:
    """Draw a chain, a wall, and a dome in either bond."""
    figure = new_figure(5.6)
    scenes = {
        "chain of 50 bricks": chain(50),
        "wall in running bond": wall(WallShape(columns=6, courses=8, gap=0.01)),
        "dome in running bond": load_scene("dome163"),
        "dome in herringbone": dome(
            DomeShape(courses=10, around=24, bond="herringbone", thickness=0.06)
        ),
    }
    for panel, (name, scene) in zip(figure.subplots(2, 2).ravel(), scenes.items(), strict=True):
        draw_bricks(panel, build_network(scene), len(scene.bricks), VIEW)
        panel.set_title(
            name if "of" in name else f"{name}, {len(scene.bricks)} bricks", loc="center"
        )
    return figure


@styled
def scenes_in_words(_: Engine) -> Figure:
    """Draw scenes that a few words describe."""
    figure = new_figure(7.6)
    for panel, words in zip(figure.subplots(3, 2).ravel(), WORDS, strict=True):
        scene = load_scene(words)
        draw_bricks(panel, build_network(scene), len(scene.bricks), VIEW)
        lines = textwrap.wrap(words.replace(",", ", "), 40)
        panel.set_title("\n".join(lines).replace(", ", ","), loc="center")
    return figure
