"""Screens: solvers that lie, what is asked of a solver at all, and wrong questions."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

import seqopt
from experiments.stability.parts.blocks import stack
from formulations.contact.held_equilibrium import compile_held
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt import Prop
from seqopt.contact.assembly import PartialAssemblies, _prop_grips, step_assembly
from seqopt.contact.mortar import DRY
from seqopt.errors import GripError, SceneError
from seqopt.network.network import build_network
from seqopt.scene.parts import Robot
from seqopt.stability._screens import FALLS, OPEN, STANDS, Margins, Screen, held_places
from seqopt.stability.assessment import assess, bonded, load_factors
from seqopt.stability.limit_analysis import (
    _MORE,
    DIRECTIONS,
    EXACT,
    Claim,
    Prover,
    hulls,
    safe_pull,
    sideways,
)
from seqopt.stability.verdict import Verdict
from tests.builders import small_arch


def pairs_and_triples(bricks):
    """Every set of two or three nodes that holds the newest brick."""
    newest, places = {2 * bricks - 1, 2 * bricks}, range(2, 2 * bricks + 1)
    return np.array(
        [c + (0,) * (3 - k) for k in (2, 3) for c in combinations(places, k) if newest & set(c)]
    )


def liar(change):
    """A compiler whose programs change what the true one answers."""

    def compiled(assembly, case):
        program = compile_held(assembly, case)
        return lambda payload, enough: change(program(payload, enough))

    return compiled


def swapped(answer):
    """Whatever is true, the other."""
    if answer.claim is Claim.INFEASIBLE:
        return replace(answer, claim=Claim.SOLVED, value=0.0)
    return replace(answer, claim=Claim.INFEASIBLE, value=np.nan, motion=1.0 + 0 * answer.motion)


LIES = {
    "the other claim": swapped,
    "zeros": lambda a: replace(
        a, value=0.0, contact_force=0 * a.contact_force, grip_force=0 * a.grip_force
    ),
    "stronger robots": lambda a: replace(a, value=0.0, grip_force=3 * a.grip_force),
    "NaN": lambda a: replace(a, value=np.nan, motion=np.nan * a.motion),
    "infinite": lambda a: replace(a, value=-np.inf, motion=np.inf * np.ones_like(a.motion)),
    "backwards": lambda a: replace(a, value=-1.0, motion=-a.motion),
    "a motion from elsewhere": lambda a: replace(a, value=np.nan, motion=a.motion[::-1] + 1.0),
    "no forces": lambda a: replace(a, contact_force=a.contact_force[:0]),
    "stalls": lambda a: replace(a, claim=Claim.STALLED, value=np.nan, motion=0 * a.motion),
}


@pytest.fixture(scope="module")
def true(arch25):
    """A structure, grip sets, and which of them stand."""
    network, sets = build_network(arch25), pairs_and_triples(5)
    return network, sets, Screen(network, DRY).stands(5, sets)


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_not_believed(true, lie):
    """It may leave sets open; it never turns a verdict."""
    network, sets, truth = true
    told = Screen(network, DRY, compiled=liar(LIES[lie])).stands(5, sets)
    assert {1, -1} <= set(truth.tolist())
    assert ((told == truth) | (told == OPEN)).all()
    assert (told == OPEN).any()


def test_few_sets_are_solved(arch25):
    """All 624 sets of 13 bricks; asked again, nothing is solved at all."""
    screen = Screen(build_network(arch25), DRY)
    sets = pairs_and_triples(13)
    first = screen.stands(13, sets)
    assert not (first == OPEN).any()
    assert screen.solved < len(sets) / 8
    before = screen.solved
    assert (screen.stands(13, sets[::-1]) == first[::-1]).all()
    assert screen.solved == before


def test_a_motion_rules_out_every_set_that_it_leaves_at_rest(arch25):
    """One set is solved; the sets whose nodes rest fall with it, others stay open."""
    network = build_network(arch25)
    screen = Screen(network, DRY)
    assert screen.stands(14, [[2, 28]]) == FALLS
    sets = pairs_and_triples(14)
    states = screen._proofs.upright[(14, True), DRY]
    known = states.known.bracket(*held_places(network, 14, sets, None))
    ruled_out = known[:, 0] > EXACT
    assert screen.solved == states.solved <= 2
    assert 3 < ruled_out.sum() < len(sets) / 2
    truth = Screen(network, DRY).stands(14, sets)
    assert (truth[ruled_out] == FALLS).all()


def test_a_brick_without_joint_falls_whatever_the_bond():
    """The second brick has no joint: nothing but a robot carries it."""
    scene = replace(small_arch(3), joints=(), robots=(Robot(name="rob1", payload=500.0),))
    screen = Screen(scene, "bond=1e9")
    assert screen.stands(2, [[0, 0], [3, 4]]).tolist() == [FALLS, STANDS]
    assert np.isinf(Margins(scene, DRY).bond(2, [[0, 0]])).all()


def test_wrong_questions_get_a_line(arch25):
    screen = Screen(build_network(arch25), DRY)
    with pytest.raises(GripError, match="node 11 of 5 bricks; give from 1 to 10"):
        screen.stands(5, [[11, 2]])
    with pytest.raises(GripError, match="give a row of nodes per grip set"):
        screen.stands(5, [1.5, 2.0])
    with pytest.raises(GripError, match="26 bricks: give from 1 to 25"):
        screen.stands(26, [[1, 2]])
    with pytest.raises(GripError, match="payload: it is negative or no number"):
        screen.stands(5, [[1, 2]], np.nan)
    unequal = replace(arch25, robots=(arch25.robots[0], Robot(name="other", payload=1.0)))
    with pytest.raises(GripError, match="no payload in common"):
        Screen(unequal, DRY).stands(5, [[1, 2]])
    with pytest.raises(SceneError, match="bond=STRENGTH"):
        Screen(arch25, "bond=strong")
    with pytest.raises(SceneError, match="mortar bond=-1: give epoxy, dry, or bond=STRENGTH"):
        Screen(arch25, "bond=-1")


# what stands on props: the cone program, chains of verdicts and screens agree on which way
UP = (0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -1.0)
HELD = {
    "none": (),
    "both ways": (Prop(node=8),),
    "pushes up": (Prop(node=8, direction=UP),),
    "pushes down": (Prop(node=8, direction=DOWN),),
    "weak": (Prop(node=8, direction=UP, capacity=5.0),),
    "two that push": (Prop(node=8, direction=UP), Prop(node=4, direction=(0.0, 0.6, 0.8))),
}


def bonds(scene, bricks=5):
    """The least bond of a part that no robot holds, by the cone program and by linear programs."""
    network = seqopt.build_network(scene)
    none = (None,) * len(scene.robots)
    cone = assess(step_assembly(network, bricks, none), seqopt.DRY, margins=("bond",)).bond
    part = PartialAssemblies(network, bricks)(bricks, none)
    again = assess(part, seqopt.DRY, margins=("bond",)).bond
    low, high = Margins(network, seqopt.DRY).bond(bricks, np.zeros((1, 3), int))[0]
    assert again == pytest.approx(cone, rel=1e-5)
    assert low * (1 - 1e-5) <= cone <= high * (1 + 1e-5)
    return cone


def test_props_help_as_far_as_they_reach(arch25):
    found = {name: bonds(arch25.with_props(*props)) for name, props in HELD.items()}
    assert found["both ways"] < 0.1 * found["pushes up"] < 0.1 * found["weak"]
    assert found["weak"] < 0.99 * found["none"]
    assert found["pushes down"] == pytest.approx(found["none"])
    assert found["two that push"] <= found["pushes up"] * (1 + 1e-6)


def test_a_weak_prop_takes_off_its_capacity_times_its_lever(arch25):
    """Within what it can, a bond that is lacking grows as much as each newton less bears."""
    at = [bonds(arch25.with_props(Prop(node=8, direction=UP, capacity=c))) for c in (2.0, 4.0, 6.0)]
    assert at[0] - at[1] == pytest.approx(at[1] - at[2], rel=1e-3)
    assert at[0] > at[1] > at[2]


def test_props_are_struck_with_the_last_grip(arch25):
    """The finished arch stands or falls bare: a prop that would pull it down does not count."""
    network = seqopt.build_network(arch25.with_props(Prop(node=26)))
    screen = Screen(network, seqopt.DRY)
    sets = np.array([[0, 0, 0], [0, 0, 50]])
    assert (screen.stands(25, sets) == STANDS).all()
    assert _prop_grips(network, 25, held=False).nodes == ()
    assert _prop_grips(network, 25, held=True).nodes == (26,)
    assert screen.stands(14, sets[:1]) == STANDS
    assert screen.stands(13, sets[:1]) == FALLS  # its brick is not there
    none = step_assembly(network, 25, (None,) * 3)
    assert len(none.payload) == 0
    assert len(step_assembly(network, 25, (49, None, None)).payload) == 2


def test_steps_of_plans_say_the_same_alone_and_together(arch25):
    scene = arch25.with_props(Prop(node=20), Prop(node=30, direction=UP))
    network = seqopt.build_network(scene)
    steps = seqopt.sequential(network)[10:30]
    chained = [found.verdict for found in seqopt.assess(network, steps, "dry")]
    alone = [
        assess(step_assembly(network, s.bricks, s.grips), seqopt.DRY, margins=()).verdict
        for s in steps
    ]
    assert chained == alone
    assert Verdict.STANDS in alone


def test_what_is_not_found_with_props_that_push_is_said(arch25):
    scene = arch25.with_props(*HELD["pushes up"])
    network = seqopt.build_network(scene)
    with pytest.raises(SceneError, match="the least payload is not found where props only push"):
        Margins(network, seqopt.DRY).grip(5, [[10, 7]])
    (found,) = seqopt.assess(network, seqopt.sequential(network)[9:10], "dry", ["payload"])
    assert np.isnan(found.grip)
    windy = seqopt.build_network(replace(scene, wind=(0.1, 0.0, 0.0)))
    with pytest.raises(SceneError, match="load factors know no props that only push"):
        load_factors(windy, seqopt.sequential(windy)[:1], "dry")


# how far structures can be tilted, whatever the direction
def turned(assembly, angle):
    """The same assembly, turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    names = ("centroid", "weight", "normal", "corner", "grip_position")
    return replace(assembly, **{name: getattr(assembly, name) @ turn.T for name in names})


def fixed(assembly, mortar=DRY):
    case = bonded(assembly, mortar)
    return replace(case, tension=(case.tension[0], 0.0), cohesion=(case.cohesion[0], 0.0))


@cache
def least(name, count=45):
    """The least pull of many directions, one by one."""
    prove = Prover(STRUCTURES[name], compile_equilibrium)
    return min(prove(case).value for case in sideways(fixed(STRUCTURES[name]), UP, count))


STRUCTURES = {
    "a flat slab that slides": stack([], (2.0, 2.0, 0.2)).assembly(2000.0),
    "a narrow block that tips": stack([], (0.3, 1.0, 1.0)).assembly(2000.0),
    "a stack that leans": stack([0.1, 0.05], (0.6, 1.0, 1.0)).assembly(2000.0),
}


@pytest.mark.xdist_group("least tilts")  # which are found once
@pytest.mark.parametrize("name", STRUCTURES)
def test_turning_about_the_vertical_makes_no_tilt_larger_than_is_safe(name):
    """Eight fixed directions missed the worst: between them less was survived than was said."""
    assembly = turned(STRUCTURES[name], np.pi / 8)
    true = least(name)
    _, worst = safe_pull(Prover(assembly, compile_equilibrium), fixed(assembly), UP)
    assert worst <= true * (1 + 1e-3)
    assert worst >= true * np.cos(np.pi / 16) * (1 - 6e-3)
    assert np.tan(assess(assembly, DRY).tilt) == pytest.approx(worst, rel=1e-6)


def test_the_worst_of_eight_directions_is_not_safe():
    """The control: turned by half of what lies between them, the worst of eight is too large."""
    assembly = turned(STRUCTURES["a narrow block that tips"], np.pi / 8)
    pulls, worst = safe_pull(Prover(assembly, compile_equilibrium), fixed(assembly), UP)
    assert min(pull.held for pull in pulls[:DIRECTIONS]) > 1.05 * worst
    assert DIRECTIONS < len(pulls) <= DIRECTIONS + _MORE


def test_what_lies_between_two_pulls_is_on_the_line_between_them():
    angles = np.array([0.0, 1.0, 2.0, 3.5, 5.0])
    pulls = np.array([1.0, 2.0, 1.5, 1.0, 3.0])
    (worst,), (at,) = hulls(angles, pulls[None])
    ends = pulls[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    share = np.linspace(0, 1, 2001)[:, None]
    lines = [a + share * (b - a) for a, b in zip(ends, np.roll(ends, -1, axis=0), strict=True)]
    points = np.concatenate(lines)
    near = np.linalg.norm(points, axis=1)
    assert worst == pytest.approx(near.min(), rel=1e-6)
    x, y = points[near.argmin()]
    assert np.cos(at - np.arctan2(y, x)) == pytest.approx(1.0, abs=1e-5)


def test_a_tilt_is_proven_by_forces_alone():
    """A motion that is not as good as the forces made the tilt NaN, though it is survived."""

    def vague(assembly):
        program = compile_equilibrium(assembly)

        def answer(case, attempt):
            true = program(case, attempt)
            pulled = any(case.pull)
            return replace(true, motion=true.motion + 0.1 * pulled * np.abs(true.motion).max())

        return answer

    assembly = STRUCTURES["a stack that leans"]
    result, exact = assess(assembly, DRY, compiled=vague), assess(assembly, DRY)
    assert result.tilt == pytest.approx(exact.tilt, rel=1e-9)
    assert result.unproven
    assert not result.motion.any()


def test_directions_of_which_nothing_is_known_are_left_out():
    angles = 2 * np.pi * np.arange(8) / 8
    some = np.where(np.arange(8) == 2, np.nan, 1.0)
    assert hulls(angles, some[None])[0] == pytest.approx(np.sqrt(0.5))
    half = np.where(np.arange(8) < 5, 1.0, np.nan)
    assert np.isnan(hulls(angles, half[None])).all()
