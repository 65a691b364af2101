"""Inputs and outputs of commands: given steps, tables, and what is said of folders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from seqopt._cli.signatures import Call
from seqopt._files import PAGE, write_file
from seqopt.engines.registry import find_engine
from seqopt.exchange._files import csv_text
from seqopt.plan.build import GivenSequence
from seqopt.questions import Given, find_steps
from seqopt.scene.scene_file import plan_folder
from seqopt.sequence.methods import METHODS
from seqopt.work import Tell

ALWAYS = ("plan.csv", "summary.json", "scene.json", PAGE)  # names in the folder of any plan


def put_table(
    path: Path | None, table: pd.DataFrame | Sequence[Mapping[str, object]], said: str
) -> dict[str, Any]:
    """Write a table, and return the entries of its answer; without a file the table is the text."""
    if path is None:
        return {"data": csv_text(table)}
    write_file(path, csv_text(table))
    return {"text": f"{said} written to {path}", "written": (path,)}


def written_to(
    folder: Path | None, *, tables: str = "the plan, its tables", what: str = "it step by step"
) -> str:
    """Describe the folder and its page, or how to request one; ``what``: that the page shows."""
    if folder is None:
        return f"--out DIR writes {tables} and a page that shows {what}"
    return f"written to {folder}; {folder / PAGE} shows {what}"


def read_steps(words: Mapping[str, Any], tell: Tell) -> tuple[Given, tuple[str, ...]]:
    """Return the steps that words of a command name, and a note if they are not among them."""
    folder = plan_folder(words.get("scene"))
    given = bool({"method", "plan"} & {*words})
    own = {} if given or folder is None else {"plan": folder}
    found: Given = Call(find_steps, {**words, **own})(progress=tell)
    if given or own:
        return found, ()
    if found.title not in METHODS:
        return found, (f"steps: of the best free schedule, {found.result}",)
    others = "--method, --plan or a plan's folder in place of SCENE names others"
    return found, (f"steps: of the {found.title} method; {others}",)


def read_build(words: Mapping[str, Any], tell: Tell) -> tuple[GivenSequence, tuple[str, ...]]:
    """Return the build of these steps, and the note."""
    found, note = read_steps(words, tell)
    engine = find_engine(found.network, words.get("engine"), words.get("mortar"))
    return GivenSequence(engine, found.steps, found.title, result=found.result), note
