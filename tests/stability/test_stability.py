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
from seqopt.stability.limit_analysis import CAP, EXACT, Claim, bound, violation


def liar(change):
    """A compiler whose programs change what the true one answers."""

    def compiled(assembly):
        program = compile_equilibrium(assembly)
        return lambda case, attempt: change(program(case, attempt), assembly)

    return compiled


LIES = {
    "zeros": lambda a, _: replace(
        a,
        value=0.0,
        contact_force=0 * a.contact_force,
        grip_force=0 * a.grip_force,
        motion=0 * a.motion,
    ),
    "NaN": lambda a, _: replace(
        a, value=np.nan, contact_force=np.nan * a.contact_force, motion=np.nan * a.motion
    ),
    "no forces, true motion": lambda a, _: replace(a, contact_force=0 * a.contact_force),
    "NaN forces": lambda a, _: replace(a, contact_force=np.nan * a.contact_force),
    "infinite motion": lambda a, _: replace(a, motion=np.inf * np.ones_like(a.motion)),
    "a motion from elsewhere": lambda a, _: replace(a, motion=a.motion[::-1] + 1.0),
    "a smaller value": lambda a, _: replace(a, value=0.5 * a.value),
    "says infeasible": lambda a, _: replace(a, claim=Claim.INFEASIBLE, value=np.nan),
    "stalls": lambda a, _: replace(a, claim=Claim.STALLED, value=np.nan),
}


@pytest.mark.parametrize("lie", LIES)
@pytest.mark.parametrize("falls", [True, False])
def test_a_lie_is_not_believed(lie, falls):
    """It may leave the verdict open; it never turns it."""
    leaning = stack([0.7 if falls else 0.2]).assembly(2000.0)
    result = assess(leaning, DRY, compiled=liar(LIES[lie]))
    truth = Verdict.FALLS if falls else Verdict.STANDS
    assert result.verdict in (Verdict.UNDECIDED, truth)
    if falls:
        assert result.verdict is Verdict.UNDECIDED
        assert result.unproven
        assert not result.motion.any()


def test_the_truth_is_believed():
    leaning = stack([0.7]).assembly(2000.0)
    assert assess(leaning, DRY, compiled=liar(lambda a, _: a)).verdict is Verdict.FALLS


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
    """Every fourteenth here; all of them in the experiment."""
    net = build_network(arch25)
    for step in METHODS[method](net)[3::14]:
        assembly = step_assembly(net, step.bricks, step.grips)
        assert assess(assembly, EPOXY).verdict is Verdict.STANDS
        assert assess(assembly, DRY).verdict is not Verdict.UNDECIDED


def test_minus_infinity_is_no_proof():
    """An infinite value made every tolerance infinite: an overhang that falls stood."""
    falling = stack([0.7]).assembly(2000.0)
    minus = assess(falling, DRY, compiled=liar(lambda a, _: replace(a, value=-np.inf)))
    assert minus.verdict is Verdict.UNDECIDED
    assert np.isnan(minus.friction)  # nothing proven is not "no friction is enough"


def faked(rng, true):
    """An answer with any mixture of odd numbers, some of them true."""

    def entries(array):
        odd = rng.choice([0.0, 1.0, 1e-320, -1e-320, 1e308, -1e308, np.inf, -np.inf, np.nan])
        kinds = (array, np.full_like(array, odd), rng.standard_normal(array.shape), -array)
        return kinds[rng.integers(len(kinds))]

    values = [true.value, 0.0, 1e-7, -1.0, 1.0, CAP, 1e308, -1e308, np.inf, -np.inf, np.nan]
    return replace(
        true,
        claim=list(Claim)[rng.integers(len(Claim))],
        value=float(values[rng.integers(len(values))]),
        contact_force=entries(true.contact_force),
        grip_force=entries(true.grip_force),
        motion=entries(true.motion),
    )


@pytest.mark.parametrize("falls", [True, False])
def test_faked_answers_give_no_false_verdict(falls):
    """60 solvers that fake all of their answers, for a stack that falls and one that stands."""
    leaning = stack([0.7 if falls else 0.2]).assembly(2000.0)
    truth = Verdict.FALLS if falls else Verdict.STANDS
    true = compile_equilibrium(leaning)(bonded(leaning, DRY))
    verdicts = []
    for seed in range(60):
        rng = np.random.default_rng(seed)

        def compiled(assembly, rng=rng):
            grips = np.zeros((len(assembly.payload), 3))  # hands, in the proof that nothing will do
            return lambda *_: faked(rng, replace(true, grip_force=grips))

        with np.errstate(all="ignore"):
            verdicts.append(assess(leaning, DRY, compiled=compiled).verdict)
    assert set(verdicts) <= {Verdict.UNDECIDED, truth}
