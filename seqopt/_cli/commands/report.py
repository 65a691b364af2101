"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

from dataclasses import field, replace
from pathlib import Path
from typing import Any

from seqopt._cli import inputs, options, outputs
from seqopt._cli.answer import Answer
from seqopt._files import require_folder, write_folder, write_text
from seqopt._showing import PAGE, display
from seqopt.network.build import build_network
from seqopt.plan.build import ShownBuild
from seqopt.report._pages import folder_builds, folder_page
from seqopt.stability._builds import BuildProver


class Report(options.Postures, options.Judged, options.Written):
    """What is built, and by whom?

    folder : DIR
        folder that holds plans as CSV; in place of it a scene, whose usual steps are shown

    What is written and printed?
    out : FILE
        page to write (default: report.html in DIR, of a scene its name with .html)
    film : FILE
        also write a film of the first plan, a .gif (needs matplotlib)
    figures : FOLDER
        also write figures there as PNG and SVG: steps, who holds what when, and responses along the
        build (needs matplotlib)
    """

    folder: options.BuiltFrom = field(kw_only=False, metadata={"place": True})
    film: options.File | None = None
    figures: options.File | None = None


class ReportWords(Report, options.Built):
    """Write a page with a step viewer of the plans in a folder.

    It shows the structure in three dimensions, who holds what, axial forces, displacements, and
    responses along the build. It is one file and needs no network. If the folder has a scene.json,
    that is the scene.

    Examples
    --------
    seqopt report best
    seqopt report my.json plans --out plans.html
    seqopt report best --figures pictures
    seqopt report best --film build.gif
    """

    scene: options.BuiltFrom = options.word("arch25", place=True)


def run(asked: ReportWords) -> Answer:
    """Write the page of the plans in a folder."""
    film, figures = (None if p is None else Path(p) for p in (asked.film, asked.figures))
    draws: Any = None if film is None else display(ShownBuild, "animate")
    if film is not None:
        draws.require(film)
    folder, taken = inputs.plan_folder(asked, asked.folder)
    named = isinstance(asked.folder, str | Path)
    own = folder / "scene.json"
    if own.is_file():  # plans go with the scene that stands beside them
        asked = replace(asked, scene=own)
    scene = inputs.find_scene(asked)
    path = asked.path
    if path is None and named and folder == Path(str(asked.folder)):
        path = folder / PAGE
    elif path is None:
        path = inputs.file_name(str(asked.folder) if named else scene.name, ".html")
    outputs.keep_apart(asked, path, film)
    written: tuple[Path, ...] = (path,)
    if figures is not None:
        require_folder(figures)
        written += () if outputs.figure_notes() else (figures,)
    trouble = inputs.posture_trouble(asked, scene)
    asked.tell("analyzing plans and writing the page")
    engine = inputs.find_engine(asked, build_network(scene))
    prover = inputs.find_prover(asked, engine.network)
    write_text(path, folder_page(engine, folder, prover))
    if film is not None:
        asked.tell("drawing the film")
        first = folder_builds(engine, folder, BuildProver(engine.network, {}))[0]
        written += (draws(engine, first.steps).save(film),)
    if figures is not None and figures in written:
        from seqopt.report.charts import plan_figures  # noqa: PLC0415  # needs an extra

        asked.tell("drawing figures")
        write_folder(figures, plan_figures(engine, folder_builds(engine, folder, prover)))
    return Answer(
        {},
        scene=scene,
        text=f"written to {' and '.join(map(str, written))}",
        written=written,
        value=written,
        notes=(
            *taken,
            *([f"arms: drawn without postures; {trouble}"] if trouble else ()),
            *outputs.figure_notes(figures),
        ),
    )
