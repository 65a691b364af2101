"""Verdicts and their proofs: solvers that lie or stall, every published step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.stability.parts.blocks import Blocks, Contact, ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar, bond_mortar
from seqopt.network.build import build_network
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability._prover import Prover
from seqopt.stability._steps import _MARGINS, format_rows, stability_table
from seqopt.stability.assessment import Verdict, assess, bonded
from seqopt.stability.limit_analysis import EXACT, Claim, bound, violation


def liar(change):
    """A compiler whose programs change what the true one answers."""

    def compiled(assembly):
        program = compile_equilibrium(assembly)
        return lambda case, attempt: change(program(case, attempt), assembly)

    return compiled


def test_almost_solved_is_counted_and_put_to_the_proof():
    leaning = stack([0.7]).assembly(2000.0)
    almost = liar(lambda a, _: replace(a, claim=Claim.ALMOST))
    result = assess(leaning, DRY, compiled=almost)
    assert result.verdict is Verdict.FALLS
    assert set(result.claims) == {Claim.ALMOST}


def test_a_time_limit_is_a_stall(monkeypatch):
    """The solver itself reaches its limit; that is counted, and no verdict."""
    monkeypatch.setattr("formulations.contact.limit_analysis.SECONDS", 1e-9)
    result = assess(ring(20, 5.0, 0.6).assembly(2000.0), DRY)
    assert result.verdict is Verdict.UNDECIDED
    assert (
        result.claims[Claim.STALLED] == sum(result.claims.values()) == 2 * result.unproven
    )  # two attempts each


def test_proofs_are_the_assemblys_own():
    """Forces of another load, and a motion that closes a contact, prove nothing."""
    light, heavy = stack([0.7]).assembly(1000.0), stack([0.6]).assembly(1000.0)
    case = bonded(light, DRY)
    answer = compile_equilibrium(light)(case)
    assert violation(light, case, answer) < EXACT < 1e-2 < violation(heavy, case, answer)
    assert bound(light, case, answer) == pytest.approx(answer.value, rel=1e-4)
    closing = replace(answer, motion=-answer.motion)
    assert bound(light, case, closing) == 0.0
    assert np.isnan(Prover(light, lambda _: lambda *_: closing)(case).value)


@pytest.mark.parametrize("method", ["sequential"])
def test_every_published_step_is_decided(arch25, method):
    """Every twenty-first here; all of them in the experiment."""
    net = build_network(arch25)
    for step in METHODS[method](net)[3::21]:
        assembly = step_assembly(net, step.bricks, step.grips)
        assert assess(assembly, EPOXY).verdict is Verdict.STANDS
        assert assess(assembly, DRY).verdict is not Verdict.UNDECIDED


def test_minus_infinity_is_no_proof():
    """An infinite value made every tolerance infinite: an overhang that falls stood."""
    falling = stack([0.7]).assembly(2000.0)
    minus = assess(falling, DRY, compiled=liar(lambda a, _: replace(a, value=-np.inf)))
    assert minus.verdict is Verdict.UNDECIDED
    assert np.isnan(minus.friction)  # nothing proven is not "no friction is enough"


# structures that stand only because they are wedged in place are marked


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
