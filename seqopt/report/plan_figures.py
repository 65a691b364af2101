"""Figures of plans as files: steps, grips over time, and responses along the build."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt.engines.interface import Engine
from seqopt.report.charts import responses_figure
from seqopt.report.gantt import gantt_picture
from seqopt.report.page_data import Build
from seqopt.report.step_pictures import steps_picture
from seqopt.report.style import picture_files


def plan_figures(engine: Engine, builds: Sequence[Build]) -> dict[str, bytes]:
    """Return the figures of plans as PNG and SVG, by file name.

    Parameters
    ----------
    engine : Engine
        Of their scene.
    builds : sequence of Build

    Returns
    -------
    dict of str to bytes
        ``NAME_steps`` and ``NAME_grips`` of every plan, and ``responses`` of all.
    """
    scene = engine.network.scene
    files: dict[str, bytes] = {}
    for build in builds:
        files |= picture_files(f"{build.name}_steps", steps_picture(engine, build.steps))
        grips = gantt_picture(scene, build.steps, build.table)
        files |= picture_files(f"{build.name}_grips", grips)
    tables = {build.name: build.table for build in builds}
    return files | picture_files("responses", responses_figure(tables))
