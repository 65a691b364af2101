"""Answers of solvers that are almost true: no verdict turns, however a number is changed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from experiments.stability.parts.blocks import Blocks, Contact, ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, Mortar
from seqopt.network.build import build_network
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.two_robots import METHODS
from seqopt.stability import _prover as prover
from seqopt.stability import assessment, limit_analysis
from seqopt.stability._prover import Prover
from seqopt.stability.assessment import Verdict, _verdict_of, assess, bonded
from seqopt.stability.limit_analysis import CAP, Claim, bound

SLIPPERY = Mortar(friction=1e-3)


def wedged():
    """A bar between two walls, which only friction holds."""
    bar = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    vertex = np.concatenate([bar, bar + np.array([0, 0, 1])])
    ends = [Contact((-1, 0), vertex[[0, 3, 7, 4]]), Contact((-1, 0), vertex[[1, 2, 6, 5]])]
    return Blocks(vertex[None], tuple(ends)).assembly(2000.0)


@cache
def structures():
    """By name: an assembly, its mortar and the true verdict."""
    network = build_network(load_scene("arch25"))
    steps = METHODS["cantilever"](network)
    step = {n: step_assembly(network, steps[n].bricks, steps[n].grips) for n in (10, 25, 26, 27)}
    stands, falls = Verdict.STANDS, Verdict.FALLS
    return {
        "a stack that leans": (stack([0.2, 0.1]).assembly(2000.0), DRY, stands),
        "a stack that leans too far": (stack([0.7]).assembly(2000.0), DRY, falls),
        "a stack that just falls": (stack([0.501]).assembly(2000.0), DRY, falls),
        "a thick arch": (ring(9, 5.0, 0.9).assembly(2000.0), DRY, stands),
        "a thin arch": (ring(9, 5.0, 0.3).assembly(2000.0), DRY, falls),
        "a bar between walls": (wedged(), SLIPPERY, stands),
        "a bar between smooth walls": (wedged(), Mortar(friction=0.0), falls),
        "step 11": (step[10], DRY, falls),
        "step 26": (step[25], DRY, stands),
        "step 27": (step[26], DRY, falls),
        "step 28": (step[27], DRY, falls),
    }


CLAIMS = (Claim.SOLVED, Claim.ALMOST)
VALUES = {
    "true": lambda z, _: z,
    "2e-6 more": lambda z, _: z + 2e-6,
    "5e-4 more": lambda z, _: z + 5e-4,
    "9e-4 more": lambda z, _: z + 9e-4,
    "5e-4 less": lambda z, _: z - 5e-4,
    "zero": lambda z, _: 0.0,
    "one": lambda z, _: 1.0,
    "NaN": lambda z, _: np.nan,
    "what the motion says": lambda z, motion: motion,
}
FORCES = {
    "true": lambda f, rng: f,
    "scaled": lambda f, rng: f * (1 + 1e-5),
    "zero": lambda f, rng: 0 * f,
    "disturbed": lambda f, rng: f + 1e-7 * rng.standard_normal(f.shape),
}
MOTIONS = {
    "true": lambda v, rng: v,
    "zero": lambda v, rng: 0 * v,
    "random": lambda v, rng: rng.standard_normal(v.shape),
    "down": lambda v, rng: np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], (len(v), 1)),
    "disturbed": lambda v, rng: v + 1e-6 * rng.standard_normal(v.shape),
    "backwards": lambda v, rng: -v,
}


@cache
def truths(name):
    """How the solver answers whether a structure stands."""
    assembly, mortar, _ = structures()[name]
    return compile_equilibrium(assembly)(bonded(assembly, mortar))


def fakes(assembly, case, true, seed):
    """All mixtures of a changed value, changed forces and a changed motion."""
    rng = np.random.default_rng(seed)
    for value, force, motion in product(VALUES.values(), FORCES.values(), MOTIONS.values()):
        moved, claim = motion(true.motion, rng), CLAIMS[rng.integers(len(CLAIMS))]
        said = bound(assembly, case, replace(true, motion=moved))
        faked = value(true.value, said)
        yield replace(
            true,
            claim=Claim.INFEASIBLE if np.isnan(faked) else claim,
            value=faked,
            contact_force=force(true.contact_force, rng),
            grip_force=force(true.grip_force, rng),
            motion=moved,
        )


def judged():
    """Return the true and the judged verdict of every faked answer."""
    out = []
    for seed, (name, (assembly, mortar, truth)) in enumerate(structures().items()):
        case, helped = bonded(assembly, mortar), []
        for fake in fakes(assembly, case, truths(name), seed):

            def compiled(built, fake=fake, assembly=assembly, helped=helped):
                """Of the structure with hands, the true answer: it is the same every time."""
                if built is assembly:
                    return lambda *_: fake

                def true(asked, attempt):
                    helped[:] = helped or [compile_equilibrium(built)(asked, attempt)]
                    return helped[0]

                return true

            out.append((truth, _verdict_of(Prover(assembly, compiled)(case))))
    return out


def false(verdicts):
    """Return how many verdicts are neither true nor open."""
    return sum(verdict not in (truth, Verdict.UNDECIDED) for truth, verdict in verdicts)


def test_the_true_answers_are_believed():
    for name, (assembly, mortar, truth) in structures().items():
        proven = Prover(assembly, compile_equilibrium)(bonded(assembly, mortar))
        assert _verdict_of(proven) is truth, name


def test_no_faked_answer_turns_a_verdict():
    """2,376 answers; those that keep enough of the truth are believed."""
    verdicts = judged()
    assert len(verdicts) >= 600
    assert false(verdicts) == 0
    for truth in (Verdict.STANDS, Verdict.FALLS):
        assert {(truth, truth), (truth, Verdict.UNDECIDED)} <= set(verdicts)


@pytest.mark.parametrize("more", [2e-6, 5e-4, 9e-4])
def test_a_value_alone_says_neither_falls_nor_how_much_friction_is_needed(more):
    """The motion of a structure that stands proves nothing, whatever the value beside it."""

    def compiled(assembly):
        program = compile_equilibrium(assembly)

        def answer(case, attempt):
            true = program(case, attempt)
            return replace(true, claim=Claim.ALMOST, value=true.value + more)

        return answer

    result = assess(stack([0.2]).assembly(2000.0), DRY, compiled=compiled)
    assert result.verdict is Verdict.UNDECIDED
    assert not result.friction > 0


WEAKER = {
    "the value makes it fall": (assessment, "_verdict_of", None),
    "closing is free": (limit_analysis, "LARGEST_FORCE", 0.0),
    "any closing is charged": (limit_analysis, "_CLOSING", CAP),
    "forces may violate": (prover, "violation", lambda *_: 0.0),
}


@pytest.mark.parametrize("weaker", WEAKER)
def test_a_weaker_judge_is_noticed(weaker, monkeypatch):
    module, name, weak = WEAKER[weaker]
    if weak is None:
        monkeypatch.setitem(globals(), name, by_value)
    else:
        monkeypatch.setattr(module, name, weak)
    if weaker == "closing is free":
        monkeypatch.setattr(module, "_CLOSING", CAP)
    assert false(judged()) > 0


def by_value(stand):
    """The verdict as the forces' value alone would have it."""
    if np.isnan(stand.value):
        return Verdict.UNDECIDED
    return Verdict.STANDS if stand.value <= limit_analysis.EXACT else Verdict.FALLS
