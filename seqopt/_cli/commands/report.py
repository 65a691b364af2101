"""The command ``report``: a page for the browser that shows plans step by step."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.outputs import read_build
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt._files import PAGE
from seqopt.arms._kept import posture_trouble
from seqopt.engines.registry import engine_mortar
from seqopt.exchange._files import Output
from seqopt.plan.build import ShownBuild
from seqopt.report._questions import own_engine, report
from seqopt.work import Tell


def run(
    folder: str, *, asked: Annotated[Call, ("call", report)], out: File = None, progress: Tell
) -> Answer:
    """Write a page with a step viewer of the plans in a folder.

    It shows the structure in three dimensions, who holds what, axial forces, displacements, and
    responses along the build. It is one file and needs no network. If the folder has a scene.json,
    that is the scene.

    Parameters
    ----------
    folder : str
        Folder that holds plans as CSV; in place of it a scene, whose usual steps are shown.
    out : pathlib.Path, optional
        Page to write (default: report.html in the folder, of a scene its name with .html).

    Examples
    --------
    $ seqopt report best
    $ seqopt report my.json plans --out plans.html
    """
    place, words = Path(folder), {**asked.words}
    if not place.is_dir():
        words["scene"] = folder
    elif (place / "scene.json").is_file():  # plans go with the scene that stands beside them
        words["scene"] = str(place / "scene.json")
    name = re.sub(r"\W+", "-", place.name.removesuffix(".json")).strip("-")
    path = out or (place / PAGE if place.is_dir() else Path(f"{name}.html"))
    Output(out, words.get("scene")).keep_apart(path)
    engine, cache = Call(own_engine, words)(), words.get("cache")
    trouble = posture_trouble(engine.network.scene, cache, progress)
    notes = (f"arms: drawn without postures; {trouble}",) if trouble else ()
    progress("analyzing plans and writing the page")
    shown: ShownBuild | Path = place
    if not place.is_dir():
        verdicts = words.get("stability", True)
        own = engine_mortar(words.get("engine"), words.get("mortar"), verdicts=verdicts)
        shown, taken = read_build({**words, "mortar": own}, progress)
        notes = (*taken, *notes)
    asked(folder=shown, scene=engine, progress=progress).save(path)
    return Answer(
        {}, f"written to {path}", scene=engine.network.scene, written=(path,), notes=notes
    )
