"""The command ``analyze``: responses of every step of one sequence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Annotated

from seqopt._cli import outputs, remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.inputs import find_engine, read_steps
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt.arms._kept import arm_faults
from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import Engine, Fields, OpeningEngine, Want
from seqopt.engines.registry import AutoEngine, provenance, recipe_of
from seqopt.errors import MechanismError, SceneError, SeqoptError, SolverError
from seqopt.problem.requirements import _prop_faults, overloads
from seqopt.responses._enough import what_was_enough
from seqopt.responses.quantities import _steps_in_words
from seqopt.responses.table import LinearRange, _with_faults, response_table, step_fields
from seqopt.sequence.steps import Step, _idle_note
from seqopt.stability._steps import assess_steps
from seqopt.stability.assessment import Verdict
from seqopt.work.progress import Tell, with_progress

UNITS = "in the name of each column: N, Nm, 1e-3mm"


def analyze(
    asked: Annotated[Call, ("call", read_steps)],
    *,
    engine: str | None = None,
    mortar: str | None = None,
    out: File = None,
    progress: Tell,
) -> Answer:
    """Compute how the structure responds in every step of one sequence, and write a table.

    It has the columns of Table A.1 of Bruun et al.: forces in N, moments in N m, displacements in
    0.001 mm.

    Parameters
    ----------
    engine, mortar : optional
        As of `optimize`.
    out : pathlib.Path, optional
        CSV file to write (default: standard output).

    Examples
    --------
    $ seqopt analyze arch25 --method cantilever --out cantilever.csv
    $ seqopt analyze my.json --plan plan.csv --out responses.csv
    $ seqopt analyze arch25 --method sequential --json
    """
    Output(out, asked.words.get("scene"), asked.words.get("plan")).keep_apart(out)
    given = asked(progress=progress)
    scene, computed = given.scene, find_engine(given.network, engine, mortar)
    faults = dict[int, SeqoptError]()
    within, steps = LinearRange(computed), with_progress("steps", given.steps, progress)
    table = response_table(given.network, _solved(within, steps, faults))
    solved = [step for step in given.steps if step.number not in faults]
    whole = _with_faults(scene, table, given.steps, faults) if faults else table
    mechanisms = sum(isinstance(fault, MechanismError) for fault in faults.values())
    counted = f"{len(whole)} steps" + f", {mechanisms} of them mechanisms," * bool(mechanisms)
    answer = Answer(
        {"units": UNITS, "steps": whole, **provenance(computed)},
        scene=scene,
        failures=_describe_faults(faults, len(given.steps)),
        status=_status_of(faults),
        notes=(*given.notes, *remarks.level_notes(engine, computed)),
        **outputs.put_table(out, whole, counted),
    )
    if table.empty:
        return answer
    enough = what_was_enough(within, {"": table})
    notes = [
        *(*answer.notes, *within.unchecked, *enough.lines),
        *(f"payload exceeded: {excess}" for excess in overloads(scene, table)),
        *(f"props: {fault}" for fault in _prop_faults(scene, table)),
        *_idle_note(scene, "robots", given.steps),
    ]
    facts = {**answer.facts, "enough": enough.facts()}
    answer = replace(answer, facts=facts, notes=(*notes,))
    over, left = remarks.exceeded(scene, table), within.departures(table)
    return remarks.marked(answer, left, over, unreached=arm_faults(scene, solved))


def _solved(
    within: LinearRange, steps: Iterator[Step], faults: dict[int, SeqoptError]
) -> Iterator[tuple[Step, Fields]]:
    """Yield solved steps with fields; errors of the others go to ``faults``, by step number."""
    for step in steps:
        try:
            yield step, within.seen(step, step_fields(within.engine, step, Want.ALL))
        except (MechanismError, SolverError) as error:
            faults[step.number] = _fault(within.engine, step, error)


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


def _status_of(faults: Mapping[int, SeqoptError]) -> Status:
    """Return the exit status, given the errors of steps."""
    if any(isinstance(error, SolverError) for error in faults.values()):
        return Status.FAILED
    return Status.NO_ANSWER if faults else Status.DONE
