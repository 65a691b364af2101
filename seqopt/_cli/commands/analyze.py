"""The command ``analyze``: responses of every step of one sequence."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence

import pandas as pd

from seqopt._cli.answer import Answer, Status
from seqopt._cli.asked import (
    arm_notes,
    asked_engine,
    asked_scene,
    asked_steps,
    exceeded,
    idle_notes,
    level_notes,
    scene_facts,
    strictly,
)
from seqopt._cli.options import (
    BUILT,
    CSV_OUT,
    MOVES,
    POSTURES,
    STEPS_USAGE,
    WRITTEN,
    declare,
    engine_options,
    form_options,
    scene_options,
    steps_options,
)
from seqopt._cli.outputs import keep_apart, put_table
from seqopt._cli.screens import question
from seqopt._cli.values import parse_time_limit
from seqopt._files import write_bytes
from seqopt._interrupts import ending
from seqopt.arms.reach import find_postures
from seqopt.engines._kinds import ChoosingEngine, Level
from seqopt.engines.interface import Engine, Fields, Want
from seqopt.engines.registry import provenance
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.problem._limit_words import length_word
from seqopt.problem.requirements import _prop_faults, overloads
from seqopt.responses._enough import what_was_enough
from seqopt.responses._staged import Placing, staged_fields
from seqopt.responses._tolerance import COLUMN, stiffness_for, with_tolerances
from seqopt.responses.quantities import _plain, _steps_in_words, length_text
from seqopt.responses.table import LinearRange, archive, response_table, step_fields
from seqopt.sequence.steps import Step
from seqopt.work.progress import with_progress

DESCRIPTION = (
    "Compute how the structure responds in every step of one sequence, and write a table with the "
    "columns of Table A.1 of Bruun et al.: forces in N, moments in N m, displacements in 0.001 mm."
)
USAGE = STEPS_USAGE
EXAMPLES = (
    "seqopt analyze arch25 --method cantilever --out cantilever.csv",
    "seqopt analyze my.json --plan plan.csv --out responses.csv",
    "seqopt analyze arch25 --method sequential --json",
)


UNITS = "in the name of each column: N, Nm, 1e-3mm"


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``analyze``."""
    scene_options(question(command, BUILT))
    steps_options(question(command, MOVES))
    how = engine_options(command)
    how.add_argument(
        "--staged",
        choices=tuple(way.value for way in Placing),
        help="carry what each step locks in on to the next, instead of analyzing every step from "
        "scratch: bricks come without stress, fitted to the deformed structure or set down where "
        "they are planned, and grips close where they find their nodes",
    )
    how.add_argument(
        "--tolerance",
        nargs="?",
        const="",
        metavar="LENGTH",
        help="also find how far every grip may be from where it should be before a robot carries "
        "more than its payload, in the worst direction: a column tolerance_mm; of a length, such "
        "as 0.4mm, also how soft grips must be to be so far off",
    )
    about = {
        "--fields FILE": "also write every edge force, node displacement and reaction, as a NumPy "
        "archive (.npz)",
        "--time-limit SECONDS": "stop after it, with the steps that were computed by then",
    }
    declare(how, POSTURES)
    declare(question(command, WRITTEN), CSV_OUT | about)
    form_options(command, strict=True)


def run(options: argparse.Namespace) -> Answer:
    """Analyze every step of a sequence."""
    keep_apart(options, options.out, options.fields)
    scene = asked_scene(options)
    find_postures(scene, options.cache, options.tell)
    network = build_network(scene)
    engine, steps = asked_engine(options, network), asked_steps(options, network)
    limit = parse_time_limit(options.time_limit)
    within = LinearRange(engine)
    in_time = _InTime(_step_answers(options, within, steps), limit)
    answers = in_time if options.fields is None else list(in_time)
    table = response_table(network, answers)
    late, ended = _late(options, len(table), len(steps), engine, in_time)
    if table.empty:
        return Answer(facts={"steps": ()}, failures=late, status=ended)
    computed = steps[: len(table)]
    off: tuple[str, ...] = ()
    if options.tolerance is not None:
        table = with_tolerances(engine, computed, table)
        off = _tolerance_notes(engine, computed, table, options.tolerance)
    staged = None if options.staged is None else staged_fields(network, computed, options.staged)
    outside = within.departures(table, staged)
    if options.fields is not None:
        write_bytes(options.fields, archive(network, answers))
    said = put_table(options.out, table, f"{len(table)} steps")
    if options.fields is not None:
        said["written"] = (*said.get("written", ()), options.fields)
    enough = what_was_enough(within, {"": table}, staged=staged is not None)
    facts = {"scene": scene_facts(scene), "units": UNITS, "steps": table, **provenance(engine)}
    answer = Answer(
        facts={**facts, "enough": enough.facts()},
        notes=(
            *off,
            *level_notes(engine),
            *within.unchecked,
            *enough.lines,
            *(f"payload exceeded: {excess}" for excess in overloads(scene, table)),
            *(f"props: {fault}" for fault in _prop_faults(scene, table)),
            *idle_notes(scene, steps),
        ),
        failures=late,
        status=ended,
        **said,
    )
    unreached = arm_notes(scene, {"": computed})
    return strictly(answer, options, exceeded(scene, table), outside, unreached=unreached)


def _tolerance_notes(
    engine: Engine, steps: Sequence[Step], table: pd.DataFrame, asked: str
) -> tuple[str, ...]:
    """Return how far grips may be off, and how soft they must be for what is asked."""
    at = int(table[COLUMN].to_numpy(float).argmin())
    least, number = 1e-3 * float(table[COLUMN].iloc[at]), int(table["step"].iloc[at])
    said = f"tolerance: grips may be {length_text(least)} off (step {number})"
    if not asked:
        return (said,)
    wanted = length_word(asked, f"--tolerance {asked}")
    short = [int(n) for n in table["step"][1e-3 * table[COLUMN].to_numpy(float) < wanted]]
    if not short:
        return (f"{said}, no less than {length_text(wanted)}",)
    found = stiffness_for(engine, steps, wanted)
    how = "however soft they are" if found is None else f"unless softer than {_plain(found, 3)} N/m"
    return (f"{said}, less than {length_text(wanted)} in {_steps_in_words(short)}, {how}",)


def _late(
    options: argparse.Namespace, computed: int, steps: int, engine: Engine, in_time: _InTime
) -> tuple[tuple[str, ...], Status]:
    """Return a line if steps ended before the last one, else none, and the status of that."""
    if computed == steps:
        return (), Status.DONE
    so_far = f"{computed} of {steps} steps computed" if computed else "no step computed"
    levels = engine.tally if isinstance(engine, ChoosingEngine) else {}
    dear = sum(sets for choice, sets in levels.items() if choice.level is Level.DISCRETE)
    if dear:
        so_far += f", {dear} by discrete elements, which are what takes long"
    if in_time.interrupted:
        return (f"seqopt: interrupted; {so_far}",), Status.INTERRUPTED
    said = f"seqopt: error: --time-limit {options.time_limit}: {so_far}; give more seconds"
    return (said,), Status.FAILED


def _step_answers(
    options: argparse.Namespace, within: LinearRange, steps: Sequence[Step]
) -> Iterator[tuple[Step, Fields]]:
    """Return steps with their fields, each from scratch or with what earlier ones lock in."""
    each, engine = with_progress("steps", steps, options.tell), within.engine
    if options.staged is None:
        return ((step, within.seen(step, step_fields(engine, step, Want.ALL))) for step in each)
    if options.engine != "compliance":
        raise SceneError(
            f"--engine {options.engine}: --staged goes with exactly rigid bricks alone; "
            "give --engine compliance"
        )
    return zip(each, staged_fields(engine.network, steps, options.staged), strict=True)


class _InTime:
    """Answers that come in time, from the first one that is asked for.

    ``interrupted``: whether somebody ended them; those that were there by then are not lost.
    """

    def __init__(self, answers: Iterator[tuple[Step, Fields]], seconds: float) -> None:
        self._answers, self._seconds, self.interrupted = answers, seconds, False

    def __iter__(self) -> Iterator[tuple[Step, Fields]]:
        end = time.perf_counter() + self._seconds
        while (answer := self._next(end - time.perf_counter())) is not None:
            yield answer

    def _next(self, seconds: float) -> tuple[Step, Fields] | None:
        try:
            with ending(seconds):
                return next(self._answers, None)
        except TimeoutError:
            return None
        except KeyboardInterrupt:
            self.interrupted = True
            return None
