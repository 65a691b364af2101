"""Verdicts and their proofs: solvers that lie or stall, every published step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.stability.parts.blocks import ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, EPOXY
from seqopt.network.build import build_network
from seqopt.sequence.methods import METHODS
from seqopt.stability._prover import Prover
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


@pytest.mark.parametrize("method", METHODS)
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
