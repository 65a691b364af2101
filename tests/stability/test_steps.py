"""Verdicts of steps apart from their margins; verdicts of many steps."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace
from itertools import count

import numpy as np
import pytest

import seqopt
from seqopt.contact.assembly import Assembly, PartialAssemblies, step_assembly
from seqopt.contact.mortar import DRY, EPOXY, Mortar
from seqopt.errors import ProblemError, SceneError, SceneWarning
from seqopt.network.network import build_network
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability import _steps as chain
from seqopt.stability import assess
from seqopt.stability._steps import (
    assess_steps,
    each_stability,
    each_verdict,
    stability_row,
    step_verdicts,
)
from seqopt.stability.assessment import verdict
from seqopt.stability.limit_analysis import Answer, Claim
from seqopt.stability.verdict import ASSESSED, Verdict
from tests.blocks import with_shapes
from tests.builders import branch, from_both_ends, running_bond, six_bricks
from tests.limit_scenes import chain as leaning_chain
from tests.limit_scenes import without_joint

NUMBERS = {"bond": "bond", "friction": "friction", "tilt": "tilt", "payload": "grip"}


@pytest.fixture(scope="module")
def network():
    return seqopt.build_network(seqopt.load_scene("arch25"))


@pytest.fixture(scope="module")
def steps(network):
    return seqopt.cantilever(network)[24:28]


@pytest.fixture(scope="module")
def wholes(network, steps):
    """What is known of every step, with all margins."""
    return [assess(step_assembly(network, step.bricks, step.grips), DRY) for step in steps]


@pytest.mark.xdist_group("steps with all margins")  # which are found once
@pytest.mark.parametrize("margin", ASSESSED)
def test_a_margin_is_found_alone_as_with_all_others(network, steps, wholes, margin):
    for whole, found in zip(wholes, assess_steps(network, steps, DRY, [margin]), strict=True):
        assert found.verdict is whole.verdict
        for name, number in NUMBERS.items():
            own, other = getattr(found, number), getattr(whole, number)
            if name == margin:
                assert own == pytest.approx(other, rel=2e-3, abs=1e-6, nan_ok=True)
            else:
                assert np.isnan(own)


def test_bricks_that_interpenetrate_are_warned_of_once(recwarn):
    """Bricks 1 and 3 of a wall, without a joint of theirs: every step stood without a word."""
    wall = seqopt.load_scene("wall:columns=3,courses=1")
    (x, y, z), *_ = (brick.position for brick in wall.bricks[2:])
    moved = replace(wall.bricks[2], position=(x - 0.25, y, z))
    joints = tuple(joint for joint in wall.joints if 3 not in joint.bricks)
    ends = tuple(
        replace(
            end,
            position=tuple(np.subtract(end.position, (0.25, 0, 0))),
            anchor=tuple(np.subtract(end.anchor, (0.25, 0, 0))),
        )
        if end.brick == 3
        else end
        for end in wall.grounds
    )
    sunk = replace(wall, bricks=(*wall.bricks[:2], moved), joints=joints, grounds=ends)
    network = seqopt.build_network(sunk)
    with pytest.warns(SceneWarning, match="bricks 1 and 3 interpenetrate by 50 mm"):
        found = assess_steps(network, seqopt.sequential(network)[:1], DRY)
    assert len(found) == 1
    recwarn.clear()
    assess_steps(network, seqopt.sequential(network)[1:2], DRY)
    assess_steps(wall, seqopt.sequential(wall)[:1], DRY)
    assert not recwarn.list


@pytest.mark.slow
def test_shared_steps_have_the_same_rows(network):
    steps = seqopt.sequential(network)[:20]
    alone = [*each_stability(network, steps, EPOXY)]
    shared = assess_steps(network, steps, EPOXY, workers=2)
    with ThreadPoolExecutor(2) as threads:
        given = assess_steps(network, steps, EPOXY, workers=threads)
    verdicts = [[found.verdict for found in each] for each in (alone, shared, given)]
    assert verdicts[0] == verdicts[1] == verdicts[2]
    rows = [stability_row(*pair) for pair in zip(steps, shared, strict=True)]
    assert [row["step"] for row in rows] == [step.number for step in steps]


def test_no_steps_and_no_such_margin():
    network = seqopt.build_network(six_bricks())
    assert assess_steps(network, (), DRY) == ()
    assert [*each_stability(network, (), DRY, shared=(None, 2))] == []
    with pytest.raises(SceneError, match=r"margin 'tillt' \(did you mean tilt\?\): give all"):
        assess_steps(network, (), DRY, ["tillt"])


@pytest.mark.parametrize("workers", [0, "two", None])
def test_workers_that_cannot_be(network, workers):
    with pytest.raises(ProblemError, match=f"workers is {workers!r}; give a whole number from 1"):
        assess_steps(network, (), DRY, workers=workers)


def test_a_step_that_touches_nothing_is_not_called_standing(network, steps):
    """The control: verdicts follow the step, and not the ones before it."""
    bare = [replace(step, grips=(None,) * 3) for step in steps]
    found = assess_steps(network, [*steps[:2], *bare], DRY)
    assert {each.verdict for each in found[2:]} == {seqopt.stability.Verdict.FALLS}


# verdicts of many steps: those of the cone program, one by one, whatever is tried before it
SCENES = {
    "arch": six_bricks,
    "both ends": lambda: from_both_ends(7),
    "wall": lambda: running_bond(3, 3),
    "branch": branch,
    "blocks": lambda: with_shapes(six_bricks()),
}
MORTARS = {
    "dry": DRY,
    "smooth": Mortar(friction=0.0),
    "weak bond": Mortar(friction=0.7, tensile_strength=2e3, cohesion=3e3),
    "no cohesion": Mortar(friction=0.5, tensile_strength=300.0),
    "epoxy": EPOXY,
}


def random_steps(network, length, seed, most=None):
    """Steps that nobody would plan: bricks come and go, and whatever nodes are held."""
    rng, robots = np.random.default_rng(seed), len(network.scene.robots)
    most = most or len(network.inner)
    bricks, steps = int(rng.integers(1, most + 1)), []
    for number in range(1, length + 1):
        bricks = int(np.clip(bricks + rng.choice([0, 1, 1, 2, -3]), 1, most))
        nodes = [node for brick in network.scene.placed[:bricks] for node in brick.nodes]
        held = rng.choice(nodes, int(rng.integers(0, min(robots, len(nodes)) + 1)), replace=False)
        grips = rng.permutation([*held.tolist(), *[None] * (robots - len(held))]).tolist()
        steps.append(Step(number, StepKind.PLACE, bricks, tuple(grips)))
    return steps


def one_by_one(network, steps, mortar):
    return tuple(verdict(step_assembly(network, s.bricks, s.grips), mortar) for s in steps)


WHOLE = {name: (scene, None) for name, scene in SCENES.items()} | {
    "arch25": (lambda: load_scene("arch25"), None),
    "vault": (lambda: load_scene("vault338"), 40),
    "dome": (lambda: load_scene("dome163"), 30),
    "a chain in two": (lambda: without_joint(leaning_chain(25)).scene, None),
}


@pytest.mark.parametrize("name", WHOLE)
def test_parts_cut_from_the_whole_are_those_built_alone(name):
    make, most = WHOLE[name]
    network = build_network(make())
    cut = PartialAssemblies(network, most or len(network.inner))
    for step in random_steps(network, 12, 5, most):
        part = cut(step.bricks, step.grips)
        alone = step_assembly(network, step.bricks, step.grips)
        assert part == alone
        for own in ("corner_area", "area", "axes", "scales", "stress_scale"):
            np.testing.assert_array_equal(getattr(part, own), getattr(alone, own), own)
        for own in ("contact_map", "grip_map"):
            mine, other = getattr(part, own), getattr(alone, own)
            assert (type(mine), mine.shape) == (type(other), other.shape)
            assert abs(mine - other).max() < 1e-12 if mine.size else not other.size
        assert not any(
            getattr(part, field.name).flags.writeable
            for field in fields(Assembly)
            if isinstance(getattr(part, field.name), np.ndarray)
        )


@pytest.mark.parametrize(("name", "mortar"), [*zip(SCENES, MORTARS, strict=True)])
def test_verdicts_are_those_of_the_cone_program(name, mortar):
    network = build_network(SCENES[name]())
    steps = random_steps(network, 7, 3)
    expected = one_by_one(network, steps, MORTARS[mortar])
    assert step_verdicts(network, steps, MORTARS[mortar]) == expected
    back = step_verdicts(network, steps[::-1], MORTARS[mortar])
    assert back[::-1] == expected


@pytest.mark.parametrize("mortar", [DRY, EPOXY])
def test_a_build_needs_no_cone_program(arch25, mortar):
    network = build_network(arch25)
    steps = METHODS["sequential"](network)

    def none(assembly):
        raise AssertionError("a cone program")

    found = [*each_verdict(network, steps, mortar, none)]
    assert Counter(step.verdict for step in found)[Verdict.UNDECIDED] == 0
    wanted = {"forces"} if mortar is EPOXY else {"forces", "motion"}
    assert wanted <= {step.proof for step in found}
    for step, own in zip(found, steps, strict=True):
        if step.verdict is Verdict.STANDS:
            assert not step.motion.any()
        else:
            assert step.motion.shape == (own.bricks, 6)
            assert np.abs(step.motion[:, :3]).max() <= 1


# what is offered is not believed
def nonsense(assembly, seed):
    """Forces and motions of all sizes, some of them no numbers."""
    rng = np.random.default_rng(seed)
    shapes = (len(assembly.corner), 3), (len(assembly.payload), 3), (len(assembly.centroid), 6)
    for size in (0.0, 1e-9, 1.0, 1e9, np.inf, np.nan):
        with np.errstate(invalid="ignore"):
            parts = [size * rng.standard_normal(shape) for shape in shapes]
        yield Answer(Claim.SOLVED, 0.0, *parts)
    down = np.tile([0.0, 0.0, -1.0, 0.0, 0.0, 0.0], (len(assembly.centroid), 1))
    yield Answer(Claim.SOLVED, 0.0, *(np.ones(shape) for shape in shapes[:2]), down)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_nonsense_that_is_remembered_turns_no_verdict(monkeypatch):
    network = build_network(six_bricks())
    steps = random_steps(network, 14, 8)
    expected = one_by_one(network, steps, DRY)
    real, kind = chain.VerdictChain._learn, count()

    def poisoned(self, assembly, proven, held):
        bad = [*nonsense(assembly, 3)][next(kind) % 7]
        real(self, assembly, replace(proven, held=0.0, bound=1.0, answer=bad), held)

    monkeypatch.setattr(chain.VerdictChain, "_learn", poisoned)
    assert step_verdicts(network, steps, DRY) == expected


# numbers from elsewhere
@pytest.mark.parametrize("lie", [False, True])
def test_what_is_sought_near_what_fell_is_proven_of_the_whole(lie, monkeypatch):
    """Also where what is said to fall with it does not: then it proves nothing."""
    monkeypatch.setattr(chain, "_NEAR", 1.0)
    asked, real = [], chain.approach

    def watched(assembly, case, blocks=None, near=0.0):
        asked.append(blocks is not None)
        found = real(assembly, case, blocks, near)
        shape = (len(assembly.centroid), 6)
        return (replace(a, motion=np.ones(shape)) if lie and asked[-1] else a for a in found)

    monkeypatch.setattr(chain, "approach", watched)
    network = build_network(SCENES["both ends"]())
    steps = random_steps(network, 20, seed=3)
    assert step_verdicts(network, steps, DRY) == one_by_one(network, steps, DRY)
    assert any(asked)
