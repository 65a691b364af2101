"""The command ``compare``: all ways to build a scene, side by side, in at most 80 columns."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from seqopt._cli import grammar, inputs, options, outputs, remarks
from seqopt._cli.answer import Answer, Result
from seqopt._cli.terminal import columns, wrapped
from seqopt._files import csv_text
from seqopt._showing import PAGE
from seqopt.arms.reach import find_postures
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance, simplest
from seqopt.errors import ProblemError
from seqopt.network.build import build_network
from seqopt.problem.requirements import Criterion
from seqopt.report._pages import comparison_page
from seqopt.report._regret._measure import check_reference
from seqopt.report.comparison import Comparison, _printed_largest, compare, format_comparison
from seqopt.responses.table import builds_in_words
from seqopt.stability._builds import BuildProver
from seqopt.workflow import DEFAULTS

SPEED = "Speed against regret"


class Compare(
    options.Written,
    options.Strict,
    options.Postures,
    options.Judged,
    options.Ranks,
    options.Team,
    options.Built,
):
    """What is built, and by whom?

    out : DIR
        write tables, figures and a page with all builds
    speed : SECONDS
        also chart speed against regret: every engine, schedule and formulation, all within so many
        seconds together (60), each plan valued in the most detailed model that there is data for
    reference : ENGINE
        with --speed: the engine that values plans (compliance; with --mortar every step has to
        stand, too; discrete lets joints open; staged adds what earlier steps lock in)
    """

    speed: float = options.word(0.0, const="60", advice="; give seconds, and the scene before it")
    reference: str = ""


def run(asked: Compare) -> Result:
    """Build a scene in every way that seqopt knows, on paper, and show all side by side.

    These are the fixed sequences, a loop of robots whose grips each formulation chooses, and the
    free schedule. Show the largest forces, moments and displacements; for the arch of Bruun et al.
    beside the figures that they print, with a list of the inconsistencies in print.

    Usage
    [SCENE] [--out DIR] [other options]

    Examples
    --------
    seqopt compare
    seqopt compare wall:columns=6,courses=4 --out wall
    seqopt compare arch25 --criteria worst-ratio --json
    seqopt compare arch25 --grips 1e6
    seqopt compare arch25 --grips 1e6 --speed 60 --out speed
    """
    if asked.reference and not asked.speed:
        raise ProblemError("--reference: it values the plans of --speed; give --speed 60 with it")
    check_reference(asked.reference)
    scene = inputs.find_scene(asked)
    find_postures(scene, asked.cache, asked.tell)
    engine = inputs.find_engine(asked, build_network(scene))
    usual = DEFAULTS["any other"].criterion
    criterion = grammar.parse_criterion(asked, usual) or usual
    outputs.require_out(asked)
    prover = inputs.find_prover(asked, engine.network)
    robots = grammar.parse_robots(asked.robots)
    result = compare(engine, criterion, asked.tell, robots, prover, asked.speed, asked.reference)
    return Result(result, lambda: _answer(asked, engine, criterion, prover, result))


def _answer(
    asked: Compare, engine: Engine, criterion: Criterion, prover: BuildProver, result: Comparison
) -> Answer:
    """Write a comparison, and return its answer."""
    scene = engine.network.scene
    criteria = {k: {"criterion": c.name, **c.settings} for k, c in result.criteria.items()}
    about = {"criteria": criteria, **provenance(engine)}
    blocks = [format_comparison(result, scene, criterion, columns())]
    if result.speed is not None:
        blocks.append("\n".join([SPEED, str(result.speed)]))
    written: tuple[Path, ...] = ()
    if asked.path is not None:
        asked.tell("drawing figures")
        files = _files(result) | {PAGE: comparison_page(engine, result)}
        files["summary.json"] = json.dumps({"scene": scene.name, **about}, indent=2) + "\n"
        written = outputs.write_outputs(asked, lambda: files)
        blocks.append(_where(asked.path, speed=result.speed is not None))
    else:
        blocks.append(wrapped("--out DIR writes tables, figures and a step viewer."))
    answer = Answer(
        facts=about
        | {"criterion": criterion.name, **_facts(result)}
        | ({} if result.speed is None else {"speed": result.speed.facts()}),
        text="\n\n".join(blocks),
        written=written,
        scene=scene,
        notes=(
            *remarks.level_notes(asked, simplest(engine)),
            *result.enough.lines,
            *remarks.refused(prover),
            *outputs.figure_notes(written),
        ),
    )
    over = remarks.exceeded(scene, *result.tables.values())
    left = builds_in_words(result.departures)
    return remarks.held_to(answer, over, left, result.verdicts)


def _where(folder: Path, *, speed: bool) -> str:
    timed = "\n  speed.csv: a row per engine, schedule and formulation" * speed
    return (
        f"written to {folder}\n"
        f"  {PAGE}: every build step by step; open it in a browser\n"
        "  comparison.csv: a row per way to build; steps_NAME.csv: a row per step of each\n"
        "  summary.json: the criteria with their numbers, the engine, and versions of packages"
        f"{timed}"
    ) + ("" if outputs.figure_notes() else "\n  *.png, *.svg: the figures")


def _facts(result: Comparison) -> dict[str, object]:
    """Return rows, notes and the published values, for scripts."""
    table = result.table.assign(
        steps=[len(result.tables[name]) for name in result.table.index],
        paper=pd.Series({name: _printed_largest(result, name) for name in result.table.index}),
    )
    loop, printed = result.loop, result.printed
    paper = None if printed is None else printed.set_axis(result.maxima.columns, axis=1)
    return {
        "rows": table.rename_axis("name").reset_index(),
        "largest_by_robot": result.maxima.to_dict(),
        "paper_by_robot": None if paper is None else paper.to_dict(),
        "loop": None
        if loop is None
        else {
            "method": loop.method,
            "seconds": dict(loop.seconds),
            "models_paper_count": loop.paper_models,
        },
        "why_no_loop": result.refusal or None,
        "enough": result.enough.facts(),
        "findings": list(result.notes),
    }


def _files(result: Comparison) -> dict[str, bytes | str]:
    """Return tables and figures of a comparison by file name."""
    speed = result.speed
    files: dict[str, bytes | str] = {
        "comparison.csv": result.table.to_csv(float_format="%.6g"),
        **{f"steps_{name}.csv": csv_text(table) for name, table in result.tables.items()},
    }
    files |= outputs.picture("responses", lambda charts: charts.responses_figure(result.tables))
    if speed is None:
        return files
    return files | {
        "speed.csv": csv_text(speed.table),
        **outputs.picture("speed", lambda _: speed.plot()),
    }
