"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from seqopt._cli import inputs, outputs
from seqopt._cli.answer import Answer
from seqopt._cli.signatures import door
from seqopt._cli.words import BuiltFrom, File, as_built, shown
from seqopt._files import write_text
from seqopt._showing import PAGE
from seqopt.contact.mortar import Mortar
from seqopt.network.build import build_network
from seqopt.report._pages import folder_page
from seqopt.work.progress import Tell


@door
def report(  # every option is a parameter
    folder: BuiltFrom,
    scene: BuiltFrom = "arch25",
    *,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    stability: bool = True,
    cache: Path | str | None = None,
    progress: Tell = shown,
    out: File | None = None,
) -> Answer[tuple[Path, ...]]:
    """Write a page with a step viewer of the plans in a folder.

    It shows the structure in three dimensions, who holds what, axial forces, displacements, and
    responses along the build. It is one file and needs no network. If the folder has a scene.json,
    that is the scene.

    Parameters
    ----------
    folder : pathlib.Path, ShownBuild, Scene or str
        Folder that holds plans as CSV; in place of it a scene, whose usual steps are shown.
    scene, engine, mortar, stability, cache, progress : optional
        As of `optimize`.
    out : pathlib.Path or str, optional
        Page to write (default: report.html in the folder, of a scene its name with .html).

    Returns
    -------
    tuple of pathlib.Path
        Paths of what was written.

    Examples
    --------
    $ seqopt report best
    $ seqopt report my.json plans --out plans.html
    """
    place, taken = inputs.plan_folder(folder, cache, progress)
    built = as_built(scene)
    if (place / "scene.json").is_file():  # plans go with the scene that stands beside them
        built = replace(built, scene=place / "scene.json")
    found = built.read()
    if out is not None:
        path = Path(out)
    elif not isinstance(folder, str | Path):
        path = inputs.file_name(found.name, ".html")
    else:
        own = place == Path(folder)
        path = place / PAGE if own else inputs.file_name(folder, ".html")
    outputs.Output(out, built).keep_apart(path)
    trouble = inputs.posture_trouble(found, cache, progress)
    progress("analyzing plans and writing the page")
    computed = inputs.find_engine(build_network(found), engine, mortar, verdicts=stability)
    prover = inputs.find_prover(computed.network, mortar, progress, asks=stability)
    write_text(path, folder_page(computed, place, prover))
    drawn = (f"arms: drawn without postures; {trouble}",) if trouble else ()
    text, notes = f"written to {path}", (*taken, *drawn)
    return Answer({}, text, scene=found, written=(path,), value=(path,), notes=notes)
