"""Assemblies of compas_cra as they are built, drawn from their files."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from matplotlib.figure import Figure

from seqopt.network.build import build_network
from seqopt.report.draw import View, draw_bricks
from seqopt.report.style import new_figure, styled
from seqopt.scene.imports.content import Given
from seqopt.scene.imports.formats import import_scene

SHOWN = (("bridge", "0,1", 14), ("shelf", "0", 10), ("snake", "0", 3), ("armadillo_cra", "", 270))


@styled
def chart() -> Figure:
    """Return four assemblies, the last one after three quarters of its blocks."""
    folder = Path(import_module("compas_cra").SAMPLE)
    figure = new_figure(4.6)
    panels = figure.subplots(2, 2).ravel()
    for panel, (name, supports, bricks) in zip(panels, SHOWN, strict=True):
        keys = supports.split(",") if supports else None
        gap = 0.01 if name == "snake" else None
        given = Given(unit="m", density=2400.0, supports=keys, gap=gap)
        scene = import_scene(folder / f"{name}.json", given=given)
        draw_bricks(panel, build_network(scene), bricks, View(azimuth=35, elevation=25))
        panel.set_title(f"{name.removesuffix('_cra')}: {bricks} of {len(scene.bricks)} blocks")
    return figure
