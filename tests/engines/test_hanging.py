"""Bricks that hang one on another are answered by one factor, as by one for every brick count."""

from __future__ import annotations

import numpy as np
import pytest

import seqopt
from seqopt.engines.interface import Want
from seqopt.engines.rigid import _grip_equations as equations
from seqopt.engines.rigid import compliance
from seqopt.engines.rigid._grip_equations import _solve_positive
from seqopt.engines.rigid._mechanism import Hanging, HangingSystem, share, ungripped_system
from seqopt.engines.rigid._refinement import Refinement, _HeldSystem, _hold_loose

CLOSE = 1e-9


@pytest.fixture(scope="module")
def chain():
    return seqopt.build_network(seqopt.load_scene("chain:bricks=12"))


def left(parts, states, loads):
    """What is left of the equations, over their largest right side."""
    return np.abs(parts.matrix @ states.T - loads.T).max() / np.abs(loads).max()


@pytest.mark.parametrize("bricks", [1, 2, 7, 11])
def test_beginnings_are_answered_by_the_factor_of_the_whole(chain, bricks):
    parts, hanging = ungripped_system(chain, bricks), Hanging(chain)
    loads = np.random.default_rng(bricks).standard_normal((3, 12 * bricks))
    states, none = HangingSystem(parts, hanging).solve(loads)
    other, _ = _hold_loose(parts, tied=True).solve(loads)
    assert none.shape == (3, 0)
    assert np.abs(states - other).max() <= CLOSE * np.abs(other).max()
    assert left(parts, states, loads) <= CLOSE
    assert left(parts, states * (1 + 1e-6), loads) > CLOSE  # a small mistake is seen


@pytest.mark.parametrize(
    ("name", "bricks"), [("chain:bricks=12", 11), ("arch25", 24), ("wall:columns=3,courses=2", 1)]
)
def test_it_ends_where_a_loop_is_closed(name, bricks):
    network = seqopt.build_network(seqopt.load_scene(name))
    hanging, shared = Hanging(network), share(network)
    assert hanging.bricks == bricks
    for count, kind in ((bricks, HangingSystem), (bricks + 1, _HeldSystem)):
        made = Refinement(network, count, shared, tied=True, hanging=hanging)
        assert isinstance(made.held, kind)
    untied = Refinement(network, bricks, shared, hanging=hanging)
    assert isinstance(untied.held, _HeldSystem)


def test_corrected_answers_are_those_of_a_factor_for_every_count(chain, monkeypatch):
    monkeypatch.setattr(compliance, "_UNSEEN", 1.0)  # no answer is trusted: all are corrected
    found = [seqopt.make_engine("compliance", chain) for _ in range(2)]
    assert found[0]._refinements.hanging.bricks
    found[1]._refinements.hanging.bricks = 0
    a, b = (engine.solve(11, [[20, 21], [2, 19]], Want.ALL) for engine in found)
    for name in ("edge_force", "displacement", "grip_force", "joint_wrench"):
        one, other = getattr(a, name), getattr(b, name)
        assert np.abs(one - other).max() <= CLOSE * np.abs(other).max()


def systems(count, size=9):
    """Positive definite systems as of `_solve_positive`, with loads as the last row."""
    root = np.random.default_rng(count).standard_normal((count, size + 1, size))
    matrix = root[:, :size] @ root[:, :size].transpose(0, 2, 1) + 0.1 * np.eye(size)
    return np.concatenate([matrix, root[:, size:]], axis=1).transpose(1, 2, 0).copy()


def test_a_few_systems_are_solved_as_many_are(monkeypatch):
    few = _solve_positive(systems(equations._FEW))
    monkeypatch.setattr(equations, "_FEW", 0)
    many = _solve_positive(systems(12))
    for one, other in zip(few, many, strict=True):
        assert np.abs(one - other).max() <= CLOSE * np.abs(other).max()
