"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from seqopt._cli import outputs
from seqopt._cli.answer import Answer
from seqopt._cli.inputs import find_engine, find_prover, posture_trouble, usual_steps
from seqopt._cli.words import ARCH25, Built, File
from seqopt._files import write_text
from seqopt._showing import PAGE
from seqopt.arms.reach import find_postures
from seqopt.network.build import build_network
from seqopt.plan.build import GivenSequence
from seqopt.report._pages import folder_page, plan_page
from seqopt.work.progress import Tell


def report(
    folder: str,
    scene: Built = ARCH25,
    *,
    engine: str | None = None,
    mortar: str | None = None,
    stability: bool = True,
    cache: Path | None = None,
    progress: Tell,
    out: File = None,
) -> Answer:
    """Write a page with a step viewer of the plans in a folder.

    It shows the structure in three dimensions, who holds what, axial forces, displacements, and
    responses along the build. It is one file and needs no network. If the folder has a scene.json,
    that is the scene.

    Parameters
    ----------
    folder : str
        Folder that holds plans as CSV; in place of it a scene, whose usual steps are shown.
    scene, engine, mortar, stability, cache, progress : optional
        As of `optimize`.
    out : pathlib.Path, optional
        Page to write (default: report.html in the folder, of a scene its name with .html).

    Examples
    --------
    $ seqopt report best
    $ seqopt report my.json plans --out plans.html
    """
    place = Path(folder)
    own = place.is_dir() and (place / "scene.json").is_file()
    if own or not place.is_dir():  # plans go with the scene that stands beside them
        scene = replace(scene, scene=place / "scene.json" if own else folder)
    network = build_network(scene.parse())
    name = re.sub(r"\W+", "-", place.name.removesuffix(".json")).strip("-")
    path = out or (place / PAGE if place.is_dir() else Path(f"{name}.html"))
    outputs.Output(out, scene.scene).keep_apart(path)
    trouble = posture_trouble(network.scene, cache, progress)
    notes = (f"arms: drawn without postures; {trouble}",) if trouble else ()
    progress("analyzing plans and writing the page")
    computed = find_engine(network, engine, mortar, verdicts=stability)
    prover = find_prover(network, mortar, progress, asks=stability)
    if place.is_dir():
        page = folder_page(computed, place, prover)
    else:
        find_postures(network.scene, cache, progress)
        steps = usual_steps(network, (), progress)
        page = plan_page(GivenSequence(computed, steps.steps, steps.name), prover)
        notes = (*steps.notes, *notes)
    write_text(path, page)
    return Answer({}, f"written to {path}", scene=network.scene, written=(path,), notes=notes)
