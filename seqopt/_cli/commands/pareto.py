"""The command ``pareto``: all non-dominated plans."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from functools import partial
from typing import Annotated

import pandas as pd

from seqopt._cli import remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.signatures import Call
from seqopt._cli.words import Folder
from seqopt.engines.interface import Engine
from seqopt.engines.registry import engine_mortar, level_notes
from seqopt.exchange._files import Output
from seqopt.plan.front import Front
from seqopt.plan.solve import graph_of
from seqopt.questions import pareto
from seqopt.report._folders import figure_notes, front_counts, front_files, front_spent, numbered
from seqopt.report.comparison import shown_table
from seqopt.responses.table import Departure, LinearRange, analyze_builds, builds_in_words
from seqopt.sequence.rules import FREE
from seqopt.sequence.steps import Step
from seqopt.stability.failure_map import find_prover
from seqopt.work import INTERRUPT, Tell

INTERRUPTED = "seqopt: interrupted; the points are those that were found"
MOST_ROWS = 30  # of a table on the terminal


def run(
    asked: Annotated[Call, ("call", pareto)],
    *,
    stability: bool = True,
    out: Folder = None,
    details: bool = False,
    progress: Tell,
) -> Answer:
    """Find every plan of the free schedule, or of a sequence with open grips, that no other beats.

    No other plan beats it in all aims at once (the Pareto set). Check each, and write a table, the
    plans, a chart and a page for the browser. Any steps are allowed by default.

    Parameters
    ----------
    stability : bool, optional
        As of `optimize`.
    out : pathlib.Path, optional
        Folder to write.
    details : bool, optional
        As of `optimize`.

    Examples
    --------
    $ seqopt pareto arch25 --out front
    $ seqopt pareto arch25 --aim D_max,steps --time-limit 60 --out front
    $ seqopt pareto chain:bricks=7 --order search --aim T_max,F_largest --out front
    """
    words, mortar = asked.words, asked.words.get("mortar")
    schedule = words.get("schedule", FREE)
    output = Output(out, words.get("scene"), schedule)
    output.require()
    own = engine_mortar(words.get("engine"), mortar, verdicts=stability)
    front: Front = asked(schedule=schedule, mortar=own, progress=progress)
    free, stands = graph_of(front.problem), front.problem.stands
    shown, held = (mortar, None) if stands is None else (None, stands.mortar)
    made = partial(find_prover, mortar=shown, progress=progress, asks=stability, own=held)
    provers = {each: made(each.network) for each in {*front.engines}}
    tables, left = _responses(front)

    def files() -> dict[str, bytes | str]:
        every = (remarks.verdicts_of(provers[o], b, words) for o, b in _by_engine(front).items())
        verdicts = {name: each for own in every for name, each in own.items()}
        return front_files(front, tables, left, verdicts, str(schedule), showing())

    def showing() -> dict[str, int]:  # once all is proven that is shown
        own = {n: sum(each.spent[n] for each in provers.values()) for n in ("verdicts", "proven")}
        return {**own, "pictures": int(bool(output.path) and not figure_notes())}

    written = output.write(progress, files)
    notes = (
        *level_notes(words.get("engine"), free.engine),
        *(f"rules: {each}" for each in free.rules.relaxed(free.engine.network.scene)),
        *next(iter(provers.values())).notes,
        *(figure_notes() if written else ()),
        *([remarks.spent_said(front_spent(front), showing())] if details else []),
    )
    early = front.stopped == INTERRUPT or remarks.CUT in {p.refusal for p in provers.values()}
    points = "" if written else f"{numbered(front).to_string(max_rows=MOST_ROWS)}\n"
    count, whole = len(front.steps), "complete" if front.complete else "not complete"
    answer = Answer(
        {**front_counts(front), "points": shown_table(front.table)},
        f"{points}{count} point{'s' * (count != 1)}, {whole}; {output.said()}",
        written=written,
        notes=notes,
        failures=(INTERRUPTED,) if early else (),
        status=Status.INTERRUPTED if early else Status.DONE,
        scene=free.engine.network.scene,
    )
    return remarks.marked(answer, builds_in_words(left), beyond=front.beyond)


def _by_engine(front: Front) -> dict[Engine, dict[str, Sequence[Step]]]:
    """Return the steps of plans by name, grouped by the engine of their build order."""
    found = defaultdict[Engine, dict[str, Sequence[Step]]](dict)
    for number, (own, steps) in enumerate(zip(front.engines, front.steps, strict=True), start=1):
        found[own][f"point {number}"] = steps
    return found


def _responses(front: Front) -> tuple[dict[str, pd.DataFrame], dict[str, Sequence[Departure]]]:
    """Return the responses of the steps of every plan, and where they leave the linear range."""
    each, left = dict[str, pd.DataFrame](), dict[str, Sequence[Departure]]()
    for own, builds in _by_engine(front).items():
        found = analyze_builds(own, builds)
        each |= found
        left |= LinearRange(own).of_builds(found)
    names = [f"point {number}" for number in range(1, len(front.steps) + 1)]
    return {name: each[name] for name in names}, {n: left[n] for n in names if n in left}
