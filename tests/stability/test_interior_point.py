"""The search for forces: its systems, and where it begins."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import EPOXY
from seqopt.network.network import build_network
from seqopt.scene.library import chain
from seqopt.stability._interior_point import Balance, approach
from seqopt.stability._steps import judged
from seqopt.stability.assessment import bonded
from seqopt.stability.limit_analysis import violation


@pytest.fixture
def held():
    return step_assembly(build_network(chain(9)), 6, (3, None, 8))


def test_systems_are_those_of_the_map(held):
    """E B E^T y = r in a band, against the matrix written out, for weights that are not alike."""
    whole = sparse.hstack([held.contact_map, held.grip_map], format="csr")
    rng = np.random.default_rng(4)
    half = rng.normal(size=(whole.shape[1] // 3, 3, 3))
    weight = half @ half.transpose(0, 2, 1) + np.eye(3)
    dense = whole.toarray() @ sparse.block_diag(weight).toarray() @ whole.toarray().T
    right = rng.normal(size=len(dense))
    found = Balance(whole).solver(weight.transpose(1, 2, 0))(right)
    size = np.abs(dense).max() * np.abs(found).max()
    assert np.abs(dense @ found - right).max() <= 1e-9 * size
    assert np.abs(dense @ (1.01 * found) - right).max() > 1e-9 * size


def test_forces_that_hold_are_where_a_search_begins(held):
    """They come back as they were; from others next to them come forces in equilibrium."""
    case = bonded(held, EPOXY)
    least = next(approach(held, case))
    near = np.vstack([least.contact_force, least.grip_force])
    moved = near + 0.1 * np.random.default_rng(1).normal(size=near.shape)
    for given, apart in ((near, False), (moved, True)):
        first = next(approach(held, case, None, given))
        assert violation(held, case, first) <= 1e-6
        change = np.abs(np.vstack([first.contact_force, first.grip_force]) - near).max()
        assert bool(change > 1e-3) is apart


@pytest.mark.parametrize(("share", "proves"), [(0.5, True), (2.0, False)])
def test_forces_prove_within_their_tolerance_alone(held, share, proves):
    case = bonded(held, EPOXY)
    least = next(approach(held, case))
    push = np.zeros(least.contact_force.shape)
    push[0, 0] = 1.0
    wrong = violation(held, case, replace(least, contact_force=least.contact_force + push))
    given = least.contact_force + share * 1e-8 / wrong * push  # that far off they prove
    answer = replace(least, contact_force=given, motion=np.zeros(least.motion.shape))
    assert (judged(held, case, answer) is not None) is proves
