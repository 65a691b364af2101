"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

from dataclasses import field, replace
from pathlib import Path

from seqopt._cli import inputs, options, outputs
from seqopt._cli.answer import Answer
from seqopt._files import require_folder, write_folder, write_text
from seqopt._showing import PAGE
from seqopt.network.build import build_network
from seqopt.report._pages import folder_builds, folder_page


class Report(options.Written, options.Postures, options.Judged, options.Built):
    """What is built, and by whom?

    folder : DIR
        folder that holds plans as CSV; in place of it a scene, whose usual steps are shown

    What is written and printed?
    out : FILE
        page to write (default: report.html in DIR, of a scene its name with .html)
    figures : FOLDER
        also write figures there as PNG and SVG: steps, who holds what when, and responses along the
        build (needs matplotlib)
    """

    folder: options.BuiltFrom = field(kw_only=False, metadata={"place": True})
    figures: options.File | None = None
    scene: options.BuiltFrom = options.word("arch25", place=True)


def run(asked: Report) -> Answer:
    """Write a page with a step viewer of the plans in a folder.

    It shows the structure in three dimensions, who holds what, axial forces, displacements, and
    responses along the build. It is one file and needs no network. If the folder has a scene.json,
    that is the scene.

    Examples
    --------
    seqopt report best
    seqopt report my.json plans --out plans.html
    seqopt report best --figures pictures
    """
    figures = None if asked.figures is None else Path(asked.figures)
    folder, taken = inputs.plan_folder(asked, asked.folder)
    if (folder / "scene.json").is_file():  # plans go with the scene that stands beside them
        asked = replace(asked, scene=folder / "scene.json")
    scene = inputs.find_scene(asked)
    path = asked.path or _page(asked, folder, scene.name)
    outputs.keep_apart(asked, path)
    if figures is not None:
        require_folder(figures)
    trouble = inputs.posture_trouble(asked, scene)
    asked.tell("analyzing plans and writing the page")
    engine = inputs.find_engine(asked, build_network(scene))
    prover = inputs.find_prover(asked, engine.network)
    write_text(path, folder_page(engine, folder, prover))
    written, left = [path], outputs.figure_notes(figures)
    if figures is not None and not left:
        asked.tell("drawing figures")
        write_folder(
            figures, outputs.CHARTS.plan_figures(engine, folder_builds(engine, folder, prover))
        )
        written.append(figures)
    text = f"written to {' and '.join(map(str, written))}"
    drawn = (f"arms: drawn without postures; {trouble}",) if trouble else ()
    notes = (*taken, *drawn, *left)
    return Answer({}, text, scene=scene, written=(*written,), value=(*written,), notes=notes)


def _page(asked: Report, folder: Path, name: str) -> Path:
    """Return where the page goes by default: into the folder, or beside a scene."""
    if not isinstance(asked.folder, str | Path):
        return inputs.file_name(name, ".html")
    own = folder == Path(asked.folder)
    return folder / PAGE if own else inputs.file_name(asked.folder, ".html")
