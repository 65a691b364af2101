"""The command ``analyze``: responses of every step of one sequence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Annotated

import pandas as pd

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.inputs import find_engine, find_steps
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import door
from seqopt._cli.words import BuiltFrom, File, Words, as_built, shown
from seqopt._files import write_bytes
from seqopt._interrupts import ending
from seqopt.arms._kept import arm_faults
from seqopt.arms.reach import find_postures
from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import Engine, Fields, OpeningEngine, Want
from seqopt.engines.registry import AutoEngine, provenance, recipe_of
from seqopt.errors import MechanismError, SceneError, SeqoptError, SolverError
from seqopt.network.build import build_network
from seqopt.plan.build import ShownBuild
from seqopt.problem.requirements import _prop_faults, length_word, overloads
from seqopt.responses._enough import what_was_enough
from seqopt.responses._tolerance import COLUMN, stiffness_for, tolerances_along
from seqopt.responses.quantities import _plain, _steps_in_words, length_text
from seqopt.responses.table import (
    Departure,
    LinearRange,
    _with_faults,
    archive,
    response_table,
    step_fields,
)
from seqopt.sequence.steps import Step, _idle_note
from seqopt.stability._steps import assess_steps
from seqopt.stability.assessment import Verdict
from seqopt.work.progress import Clock, Tell, with_progress

INTERRUPTED = "seqopt: interrupted; the steps are those that were computed"
RANGE = "whether they are in the linear range"
UNITS = "in the name of each column: N, Nm, 1e-3mm"


@door
def analyze(  # noqa: PLR0913  # every option is a parameter
    scene: BuiltFrom = "arch25",
    *,
    robots: Words | None = None,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    cache: Path | str | None = None,
    progress: Tell = shown,
    method: str | None = None,
    plan: ShownBuild | Path | str | None = None,
    tolerance: Annotated[str | None, ("value", "LENGTH"), ("const", "")] = None,
    fields: File | None = None,
    time_limit: float = inf,
    out: File | None = None,
) -> Answer[pd.DataFrame]:
    """Compute how the structure responds in every step of one sequence, and write a table.

    It has the columns of Table A.1 of Bruun et al.: forces in N, moments in N m, displacements in
    0.001 mm.

    Parameters
    ----------
    scene, robots, engine, mortar, cache, progress : optional
        As of `optimize`; of a plan its steps are taken too.
    method : str, optional
        How it is built: by two robots, or published, the three-robot plan that Bruun et al. print
        for arch25 (default: the first of sequential, cantilever that fits, or the steps of a plan's
        folder).
    plan : ShownBuild, pathlib.Path or str, optional
        A plan's folder, or a CSV file of steps: step, type, bricks, NAME_node of each robot.
    tolerance : str, optional
        Also find how far every grip may be from where it should be before a robot carries more than
        its payload, in the worst direction: a column tolerance_mm; of a length, such as 0.4mm, also
        how soft grips must be to be so far off.
    fields : pathlib.Path or str, optional
        Also write every edge force, node displacement and reaction, as a NumPy archive (.npz).
    time_limit : float, optional
        Limit of the whole command, with what is said of the steps: those that were computed by then
        are written, and what there was no time for is named.
    out : pathlib.Path or str, optional
        CSV file to write (default: standard output).

    Returns
    -------
    pandas.DataFrame
        A row per step, units in the names of columns. ``attrs['notes']`` says what is worth
        knowing, ``attrs['failures']`` which steps are mechanisms, or were not solved.

    Examples
    --------
    $ seqopt analyze arch25 --method cantilever --out cantilever.csv
    $ seqopt analyze my.json --plan plan.csv --out responses.csv
    $ seqopt analyze arch25 --method sequential --json
    """
    output, archived = Output(out, scene, plan), None if fields is None else Path(fields)
    output.keep_apart(output.path, archived)
    clock, faults = Clock(time_limit), dict[int, SeqoptError]()
    with clock.needed("reading scene and steps"):
        built = as_built(scene).read(robots)
        find_postures(built, cache, progress)
        network = build_network(built)
        computed = find_engine(network, engine, mortar)
        named = find_steps(network, scene, plan, method, robots, progress, cache)
    within, steps = LinearRange(computed), named.steps
    solved = _solved(within, with_progress("steps", steps, progress), clock, faults)
    answers = solved if archived is None else list(solved)
    table = response_table(network, answers)
    reached = len(table) + len(faults)
    late, ended = _late(time_limit, reached, len(steps), computed, clock)
    failures, status = (*_describe_faults(faults, reached), *late), _status_of(faults, ended)
    solved_steps, off = [s for s in steps[:reached] if s.number not in faults], tuple[str, ...]()
    if solved_steps and tolerance is not None:
        tolerances = partial(_with_tolerances, tolerance, computed, solved_steps, table)
        table, off = clock.spare("tolerances", tolerances, (table, off))
    whole = _with_faults(built, table, steps, faults) if faults or table.empty else table
    mechanisms = sum(isinstance(fault, MechanismError) for fault in faults.values())
    counted = f"{len(whole)} steps" + f", {mechanisms} of them mechanisms," * bool(mechanisms)
    said = outputs.put_table(output.path, whole, counted) if len(whole) else {}
    answer = Answer({"steps": whole}, scene=built, value=whole, **said)
    notes = (*named.notes, *off)
    answer = replace(answer, notes=notes, failures=failures, status=status)
    if table.empty:
        return answer
    if archived is not None:
        write_bytes(archived, archive(network, answers))
        answer = replace(answer, written=(*answer.written, archived))
    return _explained(engine, answer, within, steps, table, clock)


def _explained(
    named: str | None,
    answer: Answer[pd.DataFrame],
    within: LinearRange,
    steps: Sequence[Step],
    table: pd.DataFrame,
    clock: Clock,
) -> Answer[pd.DataFrame]:
    """Return an answer with what there is time to say of the steps that were computed."""
    engine, scene = within.engine, answer.scene
    departures = partial(within.departures, table)
    outside: tuple[Departure, ...] = clock.spare(RANGE, departures, ())
    found = partial(what_was_enough, within, {"": table})
    enough = clock.spare("which model is enough", found, None)
    facts = {"units": UNITS, **answer.facts, **provenance(engine)}
    facts |= {"enough": None if enough is None else enough.facts()}
    notes = (
        *answer.notes,
        *remarks.level_notes(named, engine),
        *within.unchecked,
        *(() if enough is None else enough.lines),
        *(f"payload exceeded: {excess}" for excess in overloads(scene, table)),
        *(f"props: {fault}" for fault in _prop_faults(scene, table)),
        *_idle_note(scene, "robots", steps),
    )
    answer = remarks.in_time(replace(answer, facts=facts, notes=notes), clock, INTERRUPTED)
    over = remarks.exceeded(scene, table)
    cannot = arm_faults(scene, [s for s in steps if s.number in {*table["step"]}])
    return remarks.held_to(answer, over, outside, unreached=cannot)


def _solved(
    within: LinearRange, steps: Iterator[Step], clock: Clock, faults: dict[int, SeqoptError]
) -> Iterator[tuple[Step, Fields]]:
    """Yield solved steps with fields until the time limit or an interrupt.

    Errors of the others go to ``faults``, by step number.
    """
    while True:
        try:
            with ending(clock.left):
                step = next(steps, None)
                if step is None:
                    return
                fields = within.seen(step, step_fields(within.engine, step, Want.ALL))
        except TimeoutError:
            return
        except KeyboardInterrupt:
            clock.interrupted = True
            return
        except (MechanismError, SolverError) as error:
            assert step is not None
            faults[step.number] = _fault(within.engine, step, error)
        else:
            yield step, fields


def _fault(engine: Engine, step: Step, error: SeqoptError) -> SeqoptError:
    """Return the error of a step: of a step that falls a mechanism, not a solver's failure."""
    if isinstance(error, MechanismError):
        return error
    recipe = recipe_of(engine)
    if isinstance(engine, AutoEngine | OpeningEngine):
        mortar = EPOXY if recipe is None else recipe.options.get("mortar", EPOXY)
        assert isinstance(mortar, Mortar)  # as `make_engine` keeps it
        with suppress(SceneError):  # faces that are not known prove nothing
            (found,) = assess_steps(engine.network, [step], mortar)
            if found.verdict is Verdict.FALLS:
                why = "a motion proves that it falls, robots within payload"
                mode = zip(engine.network.scene.build_order, map(tuple, found.motion), strict=False)
                said = f"step {step.number}: {why}; add a grip, a bond or friction"
                return MechanismError(said, (*mode,))
        return error
    numbers = engine.network.scene.grip_numbers(step.grips, step.bricks)
    told = diagnose(engine.network, step.bricks, numbers)
    if told.finding is Finding.MECHANISM:
        return MechanismError(f"step {step.number}: {told.reason}; add a grip or a joint")
    return error


def _describe_faults(faults: Mapping[int, SeqoptError], steps: int) -> tuple[str, ...]:
    """Return lines naming the steps that are mechanisms, and those where the solver failed."""
    out = []
    for what, kind in (("mechanism", MechanismError), ("solver failed", SolverError)):
        own = {number: error for number, error in faults.items() if isinstance(error, kind)}
        if own:
            where = f"{len(own)} of {steps} steps" if len(own) < steps else "every step"
            first = str(own[min(own)])
            out.append(f"seqopt: {what}: {where} ({_steps_in_words([*own])}); {first}")
    return tuple(out)


def _status_of(faults: Mapping[int, SeqoptError], ended: Status) -> Status:
    """Return the exit status, given the errors of steps."""
    if ended is not Status.DONE or not faults:
        return ended
    failed = any(isinstance(error, SolverError) for error in faults.values())
    return Status.FAILED if failed else Status.NO_ANSWER


def _with_tolerances(
    length: str, engine: Engine, steps: Sequence[Step], table: pd.DataFrame
) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Return a table with tolerances of grips, and a note; ``length``: how far off they may be."""
    table = table.assign(**{COLUMN: tolerances_along(engine, steps)})
    off, numbers = 1e-3 * table[COLUMN].to_numpy(float), table["step"].astype(int)
    at = int(off.argmin())
    said = f"tolerance: grips may be {length_text(float(off[at]))} off (step {numbers.iloc[at]})"
    if not length:
        return table, (said,)
    wanted = length_word(length, f"--tolerance {length}")
    short = numbers[off < wanted].tolist()
    if not short:
        return table, (f"{said}, no less than {length_text(wanted)}",)
    found = stiffness_for(engine, steps, wanted)
    how = "however soft they are" if found is None else f"unless softer than {_plain(found, 3)} N/m"
    less = f"less than {length_text(wanted)} in {_steps_in_words(short)}"
    return table, (f"{said}, {less}, {how}",)


def _late(
    limit: float, computed: int, steps: int, engine: Engine, clock: Clock
) -> tuple[tuple[str, ...], Status]:
    """Return notes and status of an analysis that ended before the last step."""
    if computed == steps:
        return (), Status.DONE
    so_far = f"{computed} of {steps} steps computed" if computed else "no step computed"
    dear = engine.tally["discrete"] if isinstance(engine, AutoEngine) else 0
    if dear:
        so_far += f", {dear} by discrete elements, which are what takes long"
    if clock.interrupted:
        return (f"seqopt: interrupted; {so_far}",), Status.INTERRUPTED
    said = f"seqopt: error: --time-limit {limit:g}: {so_far}; give more seconds"
    return (said,), Status.FAILED
