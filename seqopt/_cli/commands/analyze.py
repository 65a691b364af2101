"""The command ``analyze``: responses of every step of one sequence."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated

from seqopt._cli import remarks
from seqopt._cli.answer import Answer, Status
from seqopt._cli.outputs import read_build
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt.arms._kept import arm_faults
from seqopt.engines.registry import level_notes, provenance
from seqopt.errors import MechanismError, SeqoptError, SolverError
from seqopt.exchange._files import Output, csv_text
from seqopt.problem.requirements import _prop_faults, overloads
from seqopt.questions import analyze
from seqopt.responses._faults import _with_faults, analyze_each, faults_said
from seqopt.responses.table import LinearRange, what_was_enough
from seqopt.sequence.steps import _idle_note
from seqopt.work import Tell, with_progress

UNITS = "in the name of each column: N, Nm, 1e-3mm"


def run(
    asked: Annotated[Call, ("call", analyze)],
    *,
    out: File = None,
    details: bool = False,
    progress: Tell,
) -> Answer:
    """Compute how the structure responds in every step of one sequence, and write a table.

    It has the columns of Table A.1 of Bruun et al.: forces in N, moments in N m, displacements in
    0.001 mm.

    Parameters
    ----------
    out : pathlib.Path, optional
        CSV file to write (default: standard output).
    details : bool
        As of `optimize`.

    Examples
    --------
    $ seqopt analyze arch25 --method cantilever --out cantilever.csv
    $ seqopt analyze my.json --plan plan.csv --out responses.csv
    $ seqopt analyze arch25 --method sequential --json
    """
    words = asked.words
    output = Output(out, words.get("scene"), words.get("plan"))
    output.keep_apart(out)
    build, taken = read_build(words, progress)
    faults, within = dict[int, SeqoptError](), LinearRange(build.engine)
    scene, steps = build.engine.network.scene, build.steps
    table = analyze_each(within, with_progress("steps", steps, progress), faults)
    solved = [step for step in steps if step.number not in faults]
    whole = _with_faults(scene, table, steps, faults) if faults else table
    mechanisms = sum(isinstance(fault, MechanismError) for fault in faults.values())
    counted = f"{len(whole)} steps" + f", {mechanisms} of them mechanisms," * bool(mechanisms)
    answer = Answer(
        {"units": UNITS, "steps": whole, **provenance(build.engine)},
        scene=scene,
        failures=tuple(f"seqopt: {each}" for each in faults_said(faults, len(steps))),
        status=_status_of(faults),
        notes=(*taken, *level_notes(words.get("engine"), build.engine)),
        **output.put(csv_text(whole), counted),
    )
    if table.empty:
        return answer
    enough = what_was_enough(within, {"": table})
    notes = [
        *(*answer.notes, *within.unchecked, *enough.lines),
        *(f"payload exceeded: {excess}" for excess in overloads(scene, table)),
        *(f"props: {fault}" for fault in _prop_faults(scene, table)),
        *_idle_note(scene, "robots", steps),
    ]
    models = {"needed": len({(step.bricks, step.grips) for step in steps if step.bricks})}
    models |= {name: getattr(build.engine, name, 0) for name in ("answered", "corrected")}
    notes += [remarks.spent_said({"models": models})] if details else []
    facts = {**answer.facts, "enough": enough.facts(), "spent": {"models": models}}
    answer = replace(answer, facts=facts, notes=(*notes,))
    over, left = remarks.exceeded(scene, table), within.departures(table)
    return remarks.marked(answer, left, over, unreached=arm_faults(scene, solved))


def _status_of(faults: Mapping[int, SeqoptError]) -> Status:
    """Return the exit status, given the errors of steps."""
    if any(isinstance(error, SolverError) for error in faults.values()):
        return Status.FAILED
    return Status.NO_ANSWER if faults else Status.DONE
