"""Structures that stand only because they are wedged in place are marked."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.stability.parts.blocks import Blocks, Contact, ring, stack
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability._steps import _MARGINS, format_rows, stability_table
from seqopt.stability.assessment import Verdict, assess


def bar(*, on_the_ground=False):
    """A bar between two walls; perhaps it lies on the ground as well."""
    base = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    vertex = np.concatenate([base, base + np.array([0, 0, 1])])
    faces = [vertex[[0, 3, 7, 4]], vertex[[1, 2, 6, 5]], *([base] if on_the_ground else [])]
    return Blocks(vertex[None], tuple(Contact((-1, 0), face) for face in faces)).assembly(2000.0)


def rows_of(table):
    return table.to_dict("records")


@pytest.mark.parametrize("friction", [1e-3, 0.5])
def test_a_bar_between_walls_is_marked(friction):
    result = assess(bar(), Mortar(friction=friction))
    assert result.verdict is Verdict.STANDS
    assert result.jammed
    assert "stands, but only jammed" in repr(result)
    step = Step(1, StepKind.PLACE, 1, (None,))
    table = stability_table([step], [result])
    assert table["jammed"].tolist() == [True]
    assert "1 stand, 0 do not stand, 0 are undecided (1 only jammed" in format_rows(
        table.to_dict("records")
    )


def test_what_its_weight_holds_is_not_marked():
    plain = {
        "beside walls, on the ground": (bar(on_the_ground=True), DRY),
        "bonded to walls": (bar(), bond_mortar(1e5)),
        "a stack": (stack([0.2]).assembly(2000.0), DRY),
        "an arch": (ring(9, 5.0, 0.9).assembly(2000.0), DRY),
        "between walls without friction": (bar(), Mortar(friction=0.0)),
    }
    for name, (assembly, mortar) in plain.items():
        result = assess(assembly, mortar)
        assert not result.jammed, name
        table = stability_table([Step(1, StepKind.PLACE, 1, (None,))], [result])
        assert "jammed" not in format_rows(rows_of(table))


def test_the_worst_margin_of_the_steps_is_said():
    steps = [Step(number, StepKind.PLACE, 1, (None,)) for number in (1, 2)]
    table = stability_table(steps, [assess(bar(on_the_ground=True), DRY)] * 2)
    margins = [name for name, *_ in _MARGINS]
    table[margins] = np.nan
    assert format_rows(rows_of(table)).endswith("proven 2 by cone program")
    table["friction_needed"] = [0.0, 0.25]
    assert format_rows(rows_of(table)).endswith("; friction: needs 0.25 at most (step 2)")
    table["friction_needed"] = [np.inf, 0.25]
    table["tilt_survived_deg"] = [7.0, 3.0]
    said = "; friction: no value is enough (step 1); tilt: survives 3° at least (step 2)"
    assert format_rows(rows_of(table)).endswith(said)
