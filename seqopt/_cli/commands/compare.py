"""The command ``compare``: all ways to build a scene, side by side, in at most 80 columns."""

from __future__ import annotations

from typing import Annotated

import pandas as pd

from seqopt._cli import remarks
from seqopt._cli.answer import Answer
from seqopt._cli.signatures import Call
from seqopt._cli.terminal import columns, wrapped
from seqopt._cli.words import Folder
from seqopt.engines.registry import level_notes, provenance, simplest
from seqopt.exchange._files import Output
from seqopt.report._folders import comparison_files, figure_notes
from seqopt.report._questions import compare, own_engine
from seqopt.report.comparison import Comparison, _printed_largest, format_comparison
from seqopt.responses.table import builds_in_words
from seqopt.stability.failure_map import find_prover
from seqopt.study import find_criterion
from seqopt.work import Tell
from seqopt.workflow import DEFAULTS

SPEED = "Speed against regret"
WHAT = "every build step by step"


def run(asked: Annotated[Call, ("call", compare)], *, out: Folder = None, progress: Tell) -> Answer:
    """Build a scene in every way that seqopt knows, on paper, and show all side by side.

    These are the fixed sequences, a loop of robots whose grips each formulation chooses, and the
    free schedule. Show the largest forces, moments and displacements; for the arch of Bruun et al.
    beside the figures that they print, with a list of the inconsistencies in print.

    Parameters
    ----------
    out : pathlib.Path, optional
        Write tables and a page with all builds; with ``speed`` also its chart.

    Examples
    --------
    $ seqopt compare
    $ seqopt compare wall:columns=6,courses=4 --out wall
    $ seqopt compare arch25 --criterion worst-ratio --json
    $ seqopt compare arch25 --grips 1e6
    $ seqopt compare arch25 --grips 1e6 --speed 60 --out speed
    """
    words = asked.words
    output = Output(out, words.get("scene"))
    output.require()
    computed = Call(own_engine, words)()
    built, mortar, asks = computed.network.scene, words.get("mortar"), words.get("stability", True)
    prover = find_prover(computed.network, mortar, progress, asks=asks)
    costs = find_criterion(words.get("criterion") or DEFAULTS["any other"][0])
    result: Comparison = asked(scene=computed, prover=prover, progress=progress)
    levels = level_notes(words.get("engine"), simplest(computed))
    criteria = {k: {"criterion": c.name, **c.settings} for k, c in result.criteria.items()}
    about = {"criteria": criteria, **provenance(computed)}
    written = output.write(progress, lambda: comparison_files(computed, result, about))
    blocks, facts = [format_comparison(result, built, costs, columns())], dict[str, object]()
    if result.speed is not None:
        blocks.append("\n".join([SPEED, str(result.speed)]))
        facts = {"speed": result.speed.facts()}
    blocks.append(wrapped(output.said(tables="tables", what=WHAT)))
    answer = Answer(
        about | {"criterion": costs.name, **_facts(result)} | facts,
        "\n\n".join(blocks),
        written=written,
        scene=built,
        notes=(
            *(*levels, *result.enough.lines, *remarks.bonded(computed, mortar)),
            *(*prover.notes, *(figure_notes() if written else ())),
        ),
    )
    over = remarks.exceeded(built, *result.tables.values())
    return remarks.marked(answer, builds_in_words(result.departures), over, result.verdicts)


def _facts(result: Comparison) -> dict[str, object]:
    """Return rows, notes and the published values, for scripts."""
    table = result.table.assign(
        steps=[len(result.tables[name]) for name in result.table.index],
        paper=pd.Series({name: _printed_largest(result, name) for name in result.table.index}),
    )
    return {
        "rows": table.rename_axis("name").reset_index(),
        "why_no_loop": result.refusal or None,
        "enough": result.enough.facts(),
        "findings": list(result.notes),
    }
