"""What an operator alone says about grip sets."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid.compliance import ACCURACY, _solve_fast
from seqopt.network.build import build_network
from tests.builders import small_arch, solve_batch


@pytest.fixture
def asked():
    """An operator, and sets of which some have two grips on one brick."""
    scene = small_arch(5)
    net = build_network(scene)
    first, a, b, c, _ = (brick.nodes for brick in scene.placed)
    sets = [(*a, c[0]), (*b, c[1]), (*c, a[0]), (first[1], b[0], c[1]), (a[1], *b)]
    columns = grip_columns(net, 5, sets)
    return OperatorBuilder(net, grow_tree(net)).operator(5), columns


def test_asked_twice_it_says_the_same(asked):
    """Two grips on one brick share their force for good."""
    tried = _solve_fast(*asked, even=True, accuracy=ACCURACY)
    assert len(tried.pairs.sets) == 4
    before = tried.force.copy()
    first, second = tried.fields(Want.ALL), tried.fields(Want.ALL)
    assert all((first[name] == second[name]).all() for name in first)
    assert (tried.force == before).all()
    with pytest.raises(FrozenInstanceError):
        tried.force = before


@pytest.mark.parametrize("chunk", [1, 2, 3, 5])
def test_sets_are_trusted_whatever_stands_beside_them(monkeypatch, asked, chunk):
    whole, trusted = solve_batch(*asked, Want.ALL)
    assert trusted.all()
    monkeypatch.setattr(trial, "_CHUNK", chunk)
    parts, also = solve_batch(*asked, Want.ALL)
    assert also.all()
    size = np.abs(whole.edge_force).max()
    assert np.abs(parts.edge_force - whole.edge_force).max() <= 1e-9 * size
