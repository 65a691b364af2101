"""The command ``instance``: write the graph of a problem, for any solver."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from seqopt._cli.answer import Answer
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt.engines.registry import engine_mortar
from seqopt.errors import ProblemError
from seqopt.instances._files import WRITTEN, save_instance
from seqopt.instances.compiled import instance
from seqopt.instances.model import Instance
from seqopt.work import Tell

OUTPUT = re.compile(r" (--(quiet|json|out[= ]('[^']*'|\S+))|'--out=[^']*')(?= |$)")


def run(
    asked: Annotated[Call, ("call", instance)],
    *,
    out: File = None,
    made_by: Sequence[str] = (),
    progress: Tell,
) -> Answer:
    """Write the graph of a problem: its nodes and arcs, what they take, what is small and capped.

    Reading it needs no scene. The options are those of optimize; what concerns the search
    alone has no effect.

    Parameters
    ----------
    out : pathlib.Path, optional
        File to write: .npz (the instance) or .mps (a program); without an end a folder with both.
    made_by : sequence of str
        The words of the shell.

    Examples
    --------
    $ seqopt instance arch25 --out arch25.npz
    $ seqopt instance arch25 --budget travel=0.8 --out arch25.mps
    $ seqopt instance chain:bricks=7 --schedule free --aim minmax,steps --out chain7
    """
    words = asked.words
    if out and out.suffix not in ("", *WRITTEN):
        raise ProblemError(f"--out {out}: give a name with {', '.join(WRITTEN)}, or a folder")
    mortar = engine_mortar(words.get("engine"), words.get("mortar"), verdicts=True)
    found: Instance = asked(mortar=mortar, progress=progress)
    to = out or Path(re.sub(r"\W+", "-", found.name).strip("-") + ".npz")
    made = {"made_by": OUTPUT.sub("", shlex.join(["seqopt", *made_by]))}
    found = replace(found, name=to.stem, facts={**found.facts, **made})
    progress("writing the instance")
    Output(out, words.get("scene"), words.get("schedule")).keep_apart(to)
    save_instance(found, to)
    limited = ", ".join(f"{c.name} {c.most:g}" for c in found.caps if c.column is not None)
    lines = [f"{found!r}".strip("<>"), *([f"capped: {limited}"] if limited else [])]
    lines += [f"written to {to}; seqopt judge {to} SOLUTION checks an answer"]
    notes = () if out else (f"file: {to}; --out names another, or a folder for every format",)
    return Answer(found.facts_of(), "\n".join(lines), written=(to,), notes=notes)
