"""Screens: solvers that lie, what is asked of a solver at all, and wrong questions."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from formulations.contact.held_equilibrium import compile_held
from seqopt.contact.mortar import DRY
from seqopt.errors import GripError, SceneError
from seqopt.network.build import build_network
from seqopt.scene.parts import Robot
from seqopt.stability._screens import FALLS, OPEN, STANDS, Margins, Screen, held_places
from seqopt.stability.limit_analysis import EXACT, Claim
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


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_is_not_believed(arch25, lie):
    """It may leave sets open; it never turns a verdict."""
    network, sets = build_network(arch25), pairs_and_triples(5)
    truth = Screen(network, DRY).stands(5, sets)
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
    states = screen._upright((14, True))
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
    with pytest.raises(SceneError, match="tensile_strength is -1"):
        Screen(arch25, "bond=-1")
