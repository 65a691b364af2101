"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from seqopt._cli.answer import Answer
from seqopt._cli.asked import asked_engine, asked_prover, asked_scene, posture_trouble, scene_facts
from seqopt._cli.options import (
    BUILT,
    POSTURES,
    WRITTEN,
    declare,
    engine_options,
    form_options,
    scene_options,
)
from seqopt._cli.outputs import figure_notes, keep_apart
from seqopt._cli.screens import question
from seqopt._cli.words.given import file_name, plan_folder
from seqopt._files import require_folder, write_folder, write_text
from seqopt._showing import PAGE, display
from seqopt.network.build import build_network
from seqopt.report._pages import folder_builds, folder_page
from seqopt.stability._builds import BuildProver

DESCRIPTION = (
    "Write a page with a step viewer of the plans in a folder: the structure in three dimensions, "
    "who holds what, axial forces, displacements, and responses along the build. It is one file "
    "and needs no network. If the folder has a scene.json, that is the scene."
)
EXAMPLES = (
    "seqopt report best",
    "seqopt report my.json plans --out plans.html",
    "seqopt report best --figures pictures",
    "seqopt report best --film build.mp4",
)


FOLDER = {
    "folder DIR": "folder that holds plans as CSV; in place of it a scene, whose usual steps "
    "are shown"
}
SHOWN = {
    "--out FILE": f"page to write (default: {PAGE} in DIR, of a scene its name with .html)",
    "--film FILE": "also write a film of the first plan: .gif, or .mp4 or .webm of 1920 x 1080, "
    "which need ffmpeg (needs matplotlib)",
    "--figures FOLDER": "also write figures there as PNG and SVG: steps, who holds what when, and "
    "responses along the build (needs matplotlib)",
}


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``report``."""
    basic = question(command, BUILT)
    scene_options(basic)
    declare(basic, FOLDER)
    declare(engine_options(command), POSTURES)
    declare(question(command, WRITTEN), SHOWN)
    form_options(command, builds=True)


def run(options: argparse.Namespace) -> Answer:
    """Write the page of the plans in a folder."""
    film: Any = None if options.film is None else display("Film")
    if film is not None:
        film.require(options.film)
    usual = Path(options.folder, PAGE)
    if not Path(options.folder).is_dir():
        options.folder = plan_folder(options, asked := options.folder)
        usual = file_name(asked, ".html")
    own = options.folder / "scene.json"
    if own.is_file():  # plans go with the scene that stands beside them
        options.scene = str(own)
    scene = asked_scene(options)
    path = usual if options.out is None else options.out
    keep_apart(options, path, options.film)
    written: tuple[Path, ...] = (path,)
    if options.figures is not None:
        require_folder(options.figures)
        written += () if figure_notes() else (options.figures,)
    trouble = posture_trouble(options, scene)
    options.tell("analyzing plans and writing the page")
    engine = asked_engine(options, build_network(scene))
    prover = asked_prover(options, engine.network)
    write_text(path, folder_page(engine, options.folder, prover))
    if film is not None:
        options.tell("drawing the film")
        first = folder_builds(engine, options.folder, BuildProver(engine.network, {}))[0]
        written += (film(engine, first.steps).save(options.film),)
    if options.figures in written:
        from seqopt.report.charts import plan_figures  # noqa: PLC0415  # needs an extra

        options.tell("drawing figures")
        write_folder(
            options.figures, plan_figures(engine, folder_builds(engine, options.folder, prover))
        )
    return Answer(
        facts={"scene": scene_facts(scene)},
        text=f"written to {' and '.join(map(str, written))}",
        written=written,
        notes=(
            *([f"arms: drawn without postures; {trouble}"] if trouble else ()),
            *(() if options.figures is None else figure_notes()),
        ),
    )
