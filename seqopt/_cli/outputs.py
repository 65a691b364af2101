"""Steps that commands are given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from seqopt._cli.signatures import Call
from seqopt.engines.registry import find_engine
from seqopt.plan.build import GivenSequence
from seqopt.questions import Given, find_steps
from seqopt.scene.scene_file import plan_folder
from seqopt.sequence.methods import METHODS
from seqopt.work import Tell


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
