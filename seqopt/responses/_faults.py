"""Responses of builds, some steps of which are mechanisms, or cannot be solved."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import chain

import numpy as np
import pandas as pd

from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import Engine, Fields, OpeningEngine, Want
from seqopt.engines.registry import AutoEngine, recipe_of
from seqopt.errors import MechanismError, SceneError, SeqoptError, SolverError
from seqopt.responses.quantities import _steps_in_words
from seqopt.responses.table import LinearRange, _held_cells, _table_of, response_table, step_fields
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.stability._steps import assess_steps
from seqopt.stability.verdict import Verdict


def analyze_each(
    within: LinearRange, steps: Iterable[Step], faults: dict[int, SeqoptError]
) -> pd.DataFrame:
    """Return responses of steps that an engine solves; others' errors by number in ``faults``."""

    def solved() -> Iterator[tuple[Step, Fields]]:
        for step in steps:
            try:
                yield step, within.seen(step, step_fields(within.engine, step, Want.ALL))
            except (MechanismError, SolverError) as error:
                faults[step.number] = _fault(within.engine, step, error)

    return response_table(within.engine.network, solved())


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
                text = f"step {step.number}: {why}; add a grip, a bond or friction"
                return MechanismError(text, (*mode,))
        return error
    numbers = engine.network.scene.grip_numbers(step.grips, step.bricks)
    diagnosis = diagnose(engine.network, step.bricks, numbers)
    if diagnosis.finding is Finding.MECHANISM:
        return MechanismError(f"step {step.number}: {diagnosis.reason}; add a grip or a joint")
    return error


def _with_faults(
    scene: Scene, table: pd.DataFrame, steps: Sequence[Step], faults: Mapping[int, SeqoptError]
) -> pd.DataFrame:
    """Return a table of `analyze` with rows of steps that were not solved, and a reason for each.

    The column ``finding`` is ``mechanism``, with the brick that moves most, or ``not solved``,
    which leaves the step undecided; the cells of their responses are empty.
    """
    rows: dict[int, dict[str, object]] = {}
    for row in table.assign(finding="").to_dict("records"):
        rows[row["step"]] = {str(name): cell for name, cell in row.items()}
    for step in (step for step in steps if step.number in faults):
        rows[step.number] = _held_cells(scene, step)
        rows[step.number]["finding"] = "not solved"
        if isinstance(fault := faults[step.number], MechanismError):
            sizes = {brick: max(map(abs, motion)) for brick, motion in fault.mode}
            most = f" (brick {max(sizes, key=sizes.__getitem__)})" if sizes else ""
            rows[step.number]["finding"] = f"mechanism{most}"
    names = dict.fromkeys(
        ("step", "type", "bricks", "finding", *chain.from_iterable(rows.values()))
    )
    ordered = [rows[number] for number in sorted(rows)]
    return _table_of({name: [row.get(name, np.nan) for row in ordered] for name in names})


def faults_said(faults: Mapping[int, SeqoptError], steps: int) -> Iterator[str]:
    """Yield which steps of how many are mechanisms, and for which the solver failed."""
    for what, kind in (("mechanism", MechanismError), ("solver failed", SolverError)):
        own = {number: error for number, error in faults.items() if isinstance(error, kind)}
        if own:
            where = f"{len(own)} of {steps} steps" if len(own) < steps else "every step"
            yield f"{what}: {where} ({_steps_in_words([*own])}); {own[min(own)]}"
