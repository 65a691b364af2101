"""Answers that are almost true: no verdict turns, however a number is changed.

They come from the solver of the cone program, or from what a chain of verdicts tries before it.
"""

from dataclasses import replace
from functools import cache
from itertools import product, starmap

import numpy as np
import pytest

from experiments.stability.parts.blocks import Blocks, Contact, ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar, bond_mortar
from seqopt.network.network import build_network
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability import _steps as chain
from seqopt.stability import assessment, limit_analysis
from seqopt.stability._steps import _MARGINS, format_rows, stability_table
from seqopt.stability.assessment import _verdict_of, assess, bonded
from seqopt.stability.limit_analysis import CAP, EXACT, Claim, Proven, Prover, bound, violation
from seqopt.stability.verdict import Verdict

SLIPPERY = Mortar(friction=1e-3)


def bar(*, on_the_ground=False):
    """A bar between two walls; perhaps it lies on the ground as well."""
    base = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    vertex = np.concatenate([base, base + np.array([0, 0, 1])])
    faces = [vertex[[0, 3, 7, 4]], vertex[[1, 2, 6, 5]], *([base] if on_the_ground else [])]
    return Blocks(vertex[None], tuple(Contact((-1, 0), face) for face in faces)).assembly(2000.0)


@cache
def structures():
    """By name: an assembly, its mortar and the true verdict."""
    network = build_network(load_scene("arch25"))
    steps = METHODS["cantilever"](network)
    step = {n: step_assembly(network, steps[n].bricks, steps[n].grips) for n in (25, 26)}
    stands, falls = Verdict.STANDS, Verdict.FALLS
    return {
        "a stack that leans": (stack([0.2, 0.1]).assembly(2000.0), DRY, stands),
        "a stack that just falls": (stack([0.501]).assembly(2000.0), DRY, falls),
        "a thick arch": (ring(9, 5.0, 0.9).assembly(2000.0), DRY, stands),
        "a thin arch": (ring(9, 5.0, 0.3).assembly(2000.0), DRY, falls),
        "a bar between walls": (bar(), SLIPPERY, stands),
        "a bar between smooth walls": (bar(), Mortar(friction=0.0), falls),
        "step 26": (step[25], DRY, stands),
        "step 27": (step[26], DRY, falls),
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


MORE_FORCES = {
    "slightly tensile": lambda f, rng: f - [1e-5, 0.0, 0.0],
    "NaN": lambda f, rng: np.full_like(f, np.nan),
    "of another structure": lambda f, rng: f[1:],
}
MORE_MOTIONS = {
    "NaN": lambda v, rng: np.full_like(v, np.nan),
    "turned": lambda v, rng: np.roll(v, 3, axis=1),
    "of another structure": lambda v, rng: v[1:],
}


@cache
def truths(name):
    """How the solver answers whether a structure stands."""
    assembly, mortar, _ = structures()[name]
    return compile_equilibrium(assembly)(bonded(assembly, mortar))


def fakes(assembly, case, true, rng, forces, motions):
    """All mixtures of a changed value, changed forces and a changed motion."""
    for motion in motions.values():
        moved = motion(true.motion, rng)
        said = bound(assembly, case, replace(true, motion=moved))
        for value, force in product(VALUES.values(), forces.values()):
            faked, claim = value(true.value, said), CLAIMS[rng.integers(len(CLAIMS))]
            yield replace(
                true,
                claim=Claim.INFEASIBLE if np.isnan(faked) else claim,
                value=faked,
                contact_force=force(true.contact_force, rng),
                grip_force=force(true.grip_force, rng),
                motion=moved,
            )


def by_prover(assembly, case):
    """What judges a solver's answer; of the structure with hands it is true, every time."""
    helped = []

    def judge(fake):
        def compiled(built):
            if built is assembly:
                return lambda *_: fake

            def true(asked, attempt):
                helped[:] = helped or [compile_equilibrium(built)(asked, attempt)]
                return helped[0]

            return true

        return _verdict_of(Prover(assembly, compiled)(case))

    return judge


def by_chain(assembly, case):
    """What judges an answer that is tried before the cone program."""

    def judge(fake):
        proven = chain.judged(assembly, case, fake)
        return Verdict.UNDECIDED if proven is None else _verdict_of(proven)

    return judge


ROUTES = {
    "cone program": (by_prover, FORCES, MOTIONS),
    "chain": (by_chain, FORCES | MORE_FORCES, MOTIONS | MORE_MOTIONS),
}


def judged(route):
    """Yield the true and the judged verdict of every faked answer."""
    by, *changes = ROUTES[route]
    for seed, (name, (assembly, mortar, truth)) in enumerate(structures().items()):
        case, rng = bonded(assembly, mortar), np.random.default_rng(seed)
        judge = by(assembly, case)
        for fake in fakes(assembly, case, truths(name), rng, *changes):
            yield truth, judge(fake)


def is_false(truth, verdict):
    """Return whether a verdict is neither true nor open."""
    return verdict not in (truth, Verdict.UNDECIDED)


def test_the_true_answers_are_believed():
    for name, (assembly, mortar, truth) in structures().items():
        proven = Prover(assembly, compile_equilibrium)(bonded(assembly, mortar))
        assert _verdict_of(proven) is truth, name


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("route", ROUTES)
def test_no_faked_answer_turns_a_verdict(route):
    """1,728 answers, and 4,536 to the chain; those that keep enough of the truth are believed."""
    verdicts = [*judged(route)]
    assert len(verdicts) == (1728 if route == "cone program" else 4536)
    assert not any(starmap(is_false, verdicts))
    for truth in (Verdict.STANDS, Verdict.FALLS):
        assert {(truth, truth), (truth, Verdict.UNDECIDED)} <= set(verdicts)


def liar(change):
    """A compiler whose programs change what the true one answers."""

    def compiled(assembly):
        program = compile_equilibrium(assembly)
        return lambda case, attempt: change(program(case, attempt), assembly)

    return compiled


@pytest.mark.parametrize("more", [2e-6, 5e-4, 9e-4])
def test_a_value_alone_says_neither_falls_nor_how_much_friction_is_needed(more):
    """The motion of a structure that stands proves nothing, whatever the value beside it."""

    almost = liar(lambda a, _: replace(a, claim=Claim.ALMOST, value=a.value + more))
    result = assess(stack([0.2]).assembly(2000.0), DRY, compiled=almost)
    assert result.verdict is Verdict.UNDECIDED
    assert not result.friction > 0


def believed(assembly, case, answer):
    """A judge that takes the value that is claimed."""
    z = answer.value
    return None if np.isnan(z) else Proven(z, z, z, answer)


WEAKER = {
    "the value makes it fall": (assessment, "_verdict_of", None),
    "closing is free": (limit_analysis, "LARGEST_FORCE", 0.0),
    "any closing is charged": (limit_analysis, "_CLOSING", CAP),
    "forces may violate": (limit_analysis, "violation", lambda *_: 0.0),
}
WEAKER_CHAIN = {
    "the value is believed": (chain, "judged", believed),
    "closing is free": WEAKER["closing is free"],
    "forces may violate": (chain, "violation", lambda *_: 0.0),
    "every motion proves": (chain, "bound", lambda *_: 1.0),
}
JUDGES = [*product(["cone program"], WEAKER), *product(["chain"], WEAKER_CHAIN)]


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(("route", "name"), JUDGES)
def test_a_weaker_judge_is_noticed(route, name, monkeypatch):
    module, attribute, weak = (WEAKER if route == "cone program" else WEAKER_CHAIN)[name]
    if weak is None:
        monkeypatch.setitem(globals(), attribute, by_value)
    else:
        monkeypatch.setattr(module, attribute, weak)
    if name == "closing is free":
        monkeypatch.setattr(module, "_CLOSING", CAP)
    assert any(starmap(is_false, judged(route)))


def by_value(stand):
    """The verdict as the forces' value alone would have it."""
    if np.isnan(stand.value):
        return Verdict.UNDECIDED
    return Verdict.STANDS if stand.value <= limit_analysis.EXACT else Verdict.FALLS


# verdicts and their proofs: solvers that lie or stall, every published step
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


def test_every_published_step_is_decided(arch25):
    """Every twenty-first here; all of them in the experiment."""
    net = build_network(arch25)
    for step in METHODS["sequential"](net)[3::21]:
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
    table["friction_needed"] = [np.nan, 0.25]
    said = "; friction: needs 0.25 at most (step 2, not known of 1 steps)"
    assert format_rows(rows_of(table)).endswith(said)
    table["friction_needed"] = [np.inf, 0.25]
    table["tilt_survived_deg"] = [7.0, 3.0]
    said = "; friction: no value is enough (step 1); tilt: survives 3° at least (step 2)"
    assert format_rows(rows_of(table)).endswith(said)
    table["verdict"], table["tilt_survived_deg"] = ["stands", "does not stand"], [7.0, np.nan]
    said = "; tilt: steps that stand survive 7° at least (step 1)"
    assert format_rows(rows_of(table)).endswith(said)
