"""The command ``analyze``: responses of every step of one sequence."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.outputs import keep_apart
from seqopt.cli.status import Status
from seqopt.cli.words.asked import (
    asked_engine,
    asked_scene,
    exceeded,
    idle_notes,
    level_notes,
    scene_facts,
    step_answers,
    strictly,
    timely,
)
from seqopt.cli.words.common_arguments import (
    asked_steps,
    engine_arguments,
    form_arguments,
    group,
    scene_argument,
    steps_arguments,
    strict_argument,
    time_argument,
)
from seqopt.cli.words.values import parse_time_limit
from seqopt.engines.interface import Fields
from seqopt.engines.registry import provenance
from seqopt.files import csv_text, write_bytes, write_csv
from seqopt.network.build import build_network
from seqopt.responses.staged import Placing, staged_fields
from seqopt.responses.table import LinearRange, archive, response_table
from seqopt.sequence.steps import Step

DESCRIPTION = (
    "Compute how the structure responds in every step of one sequence, and write a table with the "
    "columns of Table A.1 of Bruun et al.: forces in N, moments in N m, displacements in 0.001 mm."
)
USAGE = (
    "[SCENE] --method NAME [--out FILE] [other options]",
    "[SCENE] --plan FILE [--out FILE] [other options]",
)
EXAMPLES = (
    "seqopt analyze arch25 --method cantilever --out cantilever.csv",
    "seqopt analyze my.json --plan plan.csv --out responses.csv",
    "seqopt analyze arch25 --method sequential --json",
)


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``analyze``."""
    basic = group(command, "what is analyzed")
    scene_argument(basic)
    steps_arguments(basic)
    basic.add_argument(
        "--out", type=Path, metavar="FILE", help="CSV file to write (default: standard output)"
    )
    how = group(command, "how responses are computed (advanced)")
    engine_arguments(how)
    how.add_argument(
        "--staged",
        choices=tuple(way.value for way in Placing),
        help="carry what each step locks in on to the next, instead of analyzing every step from "
        "scratch: bricks come without stress, fitted to the deformed structure or set down where "
        "they are planned, and grips close where they find their nodes",
    )
    how.add_argument(
        "--fields",
        type=Path,
        metavar="FILE",
        help="also write every edge force, node displacement and reaction, as a NumPy archive "
        "(.npz)",
    )
    time_argument(how, "stop after it, with the steps that were computed by then")
    form = group(command, "what is printed")
    strict_argument(form)
    form_arguments(form)


def run(options: argparse.Namespace) -> Answer:
    """Analyze every step of a sequence.

    ``options``: of the command.
    """
    keep_apart(options, options.out, options.fields)
    scene = asked_scene(options)
    network = build_network(scene)
    engine, steps = asked_engine(options, network), asked_steps(scene, options)
    limit = parse_time_limit(options.time_limit)
    answers: Iterable[tuple[Step, Fields]] = timely(step_answers(options, engine, steps), limit)
    if options.fields is not None:
        answers = list(answers)
    table = response_table(network, answers)
    late = _late(options, len(table), len(steps))
    if table.empty:
        return Answer(facts={"steps": ()}, failures=late, status=Status.FAILED)
    within, computed = LinearRange(engine), steps[: len(table)]
    staged = None if options.staged is None else staged_fields(network, computed, options.staged)
    outside = within.departures(table, staged)
    written = [path for path in (options.out, options.fields) if path is not None]
    if options.fields is not None:
        write_bytes(options.fields, archive(network, answers))
    if options.out is not None:
        write_csv(options.out, table)
    answer = Answer(
        facts={"scene": scene_facts(scene), "units": UNITS, "steps": table, **provenance(engine)},
        text="" if options.out is None else _said(table, options.out),
        data=csv_text(table) if options.out is None else "",
        written=tuple(written),
        notes=(*level_notes(engine), *within.unchecked, *idle_notes(scene, steps)),
        failures=late,
        status=Status.FAILED if late else Status.DONE,
    )
    return strictly(answer, options, exceeded(scene, table), outside)


def _late(options: argparse.Namespace, computed: int, steps: int) -> tuple[str, ...]:
    """Return a line if the time limit came before the last step, else none."""
    if computed == steps:
        return ()
    so_far = f"{computed} of {steps} steps" if computed else "no step"
    return (
        f"seqopt: error: --time-limit {options.time_limit}: {so_far} computed; give more seconds",
    )


def _said(table: pd.DataFrame, path: Path) -> str:
    return f"{len(table)} steps written to {path}"


UNITS = "in the name of each column: N, Nm, 1e-3mm"
