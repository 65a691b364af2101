"""The command ``compare``: all ways to build a scene, side by side, in at most 80 columns."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import pandas as pd

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer
from seqopt._cli.inputs import find_engine, find_prover
from seqopt._cli.outputs import Output
from seqopt._cli.terminal import columns, wrapped
from seqopt._cli.words import ARCH25, Built, Folder
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.arms.reach import find_postures
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance, simplest
from seqopt.errors import ProblemError
from seqopt.network.build import build_network
from seqopt.report._pages import comparison_page
from seqopt.report._regret._measure import check_reference
from seqopt.report.comparison import Comparison, _printed_largest, format_comparison
from seqopt.report.comparison import compare as compare_builds
from seqopt.responses.table import builds_in_words
from seqopt.study.published import find_criterion
from seqopt.work.progress import Tell
from seqopt.workflow import DEFAULTS

SPEED = "Speed against regret"
WHAT = "every build step by step"


def compare(  # noqa: PLR0913  # every option is a parameter
    scene: Built = ARCH25,
    *,
    robots: int | str | None = None,
    criterion: str | None = None,
    engine: str | None = None,
    mortar: str | None = None,
    stability: bool = True,
    cache: Path | None = None,
    progress: Tell,
    speed: Annotated[float, ("value", "SECONDS"), ("const", "60")] = 0.0,
    reference: Annotated[str, ("value", "ENGINE")] = "",
    out: Folder = None,
) -> Answer:
    """Build a scene in every way that seqopt knows, on paper, and show all side by side.

    These are the fixed sequences, a loop of robots whose grips each formulation chooses, and the
    free schedule. Show the largest forces, moments and displacements; for the arch of Bruun et al.
    beside the figures that they print, with a list of the inconsistencies in print.

    Parameters
    ----------
    scene, robots, criterion, engine, mortar, stability, cache, progress : optional
        As of `optimize`.
    speed : float, optional
        Also chart speed against regret: every engine, schedule and formulation, all within so many
        seconds together (60), each plan valued in the most detailed model that there is data for.
    reference : str, optional
        With ``speed``: the engine that values plans (compliance; with ``mortar`` every step has to
        stand, too; discrete lets joints open).
    out : pathlib.Path, optional
        Write tables and a page with all builds; with ``speed`` also its chart.

    Examples
    --------
    $ seqopt compare
    $ seqopt compare wall:columns=6,courses=4 --out wall
    $ seqopt compare arch25 --criteria worst-ratio --json
    $ seqopt compare arch25 --grips 1e6
    $ seqopt compare arch25 --grips 1e6 --speed 60 --out speed
    """
    if reference and not speed:
        raise ProblemError("--reference: it values the plans of --speed; give --speed 60 with it")
    check_reference(reference)
    output, built = Output(out, scene.scene), scene.parse(robots)
    find_postures(built, cache, progress)
    computed = find_engine(build_network(built), engine, mortar, verdicts=stability)
    costs = find_criterion(criterion or DEFAULTS["any other"][0])
    output.require()
    prover = find_prover(computed.network, mortar, progress, asks=stability)
    named = robots if isinstance(robots, tuple) else ()
    result = compare_builds(computed, costs, progress, named, prover, speed, reference)
    levels = remarks.level_notes(engine, simplest(computed))
    criteria = {k: {"criterion": c.name, **c.settings} for k, c in result.criteria.items()}
    about = {"criteria": criteria, **provenance(computed)}
    summary = json.dumps({"scene": built.name, **about}, indent=2) + "\n"
    written = output.write(
        progress, lambda: {"summary.json": summary, **_files(computed, result, progress)}
    )
    blocks, facts = [format_comparison(result, built, costs, columns())], dict[str, object]()
    if result.speed is not None:
        blocks.append("\n".join([SPEED, str(result.speed)]))
        facts = {"speed": result.speed.facts()}
    blocks.append(wrapped(outputs.written_to(out, tables="tables", what=WHAT)))
    answer = Answer(
        about | {"criterion": costs.name, **_facts(result)} | facts,
        "\n\n".join(blocks),
        written=written,
        scene=built,
        notes=(
            *(*levels, *result.enough.lines),
            *(*remarks.refused(prover), *outputs.figure_notes(written)),
        ),
    )
    over = remarks.exceeded(built, *result.tables.values())
    return remarks.marked(answer, builds_in_words(result.departures), over, result.verdicts)


def _files(engine: Engine, result: Comparison, tell: Tell) -> dict[str, bytes | str]:
    """Return tables, the chart of speed and the page of a comparison by file name."""
    tell("drawing figures")
    speed = result.speed
    files: dict[str, bytes | str] = {
        "comparison.csv": result.table.to_csv(float_format="%.6g"),
        **{f"steps_{name}.csv": csv_text(table) for name, table in result.tables.items()},
        PAGE: comparison_page(engine, result),
    }
    if speed is not None:
        files |= {"speed.csv": csv_text(speed.table)}
        files |= outputs.picture("speed", lambda _: speed.plot())
    return files


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
