"""Exactly rigid bricks where joints are loose, chains long and systems small or not positive."""

from __future__ import annotations

import numpy as np
import pytest

from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid import compliance as trial
from seqopt.engines.rigid._grip_equations import _solve_positive
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from tests.builders import hinged, solve_batch
from tests.limit_scenes import HELD, LOOSE_AT, chain, loosened
from tests.reference_chain import solve_exactly


def error(net, fields, row, grips):
    """The largest relative error of displacements, joint forces and joint moments."""
    bricks = len(net.inner)
    columns = grip_columns(net, bricks, np.array([grips], dtype=int))[0]
    exact = solve_exactly(net, bricks, columns)
    wrench = fields.joint_wrench[row]
    pairs = (
        (fields.displacement[row, net.inner.ravel()], exact.displacement),
        (wrench[:, :3], exact.joint_wrench[:, :3]),
        (wrench[:, 3:], exact.joint_wrench[:, 3:]),
    )
    return max(np.abs(got - want).max() / np.abs(want).max() for got, want in pairs)


@pytest.mark.parametrize("only_turning", [True, False])
@pytest.mark.parametrize("factor", [1e-3, 1e-6, 1e-9, 1e-12, 1e-15])
def test_grips_beyond_a_loose_joint(factor, only_turning):
    """The force method alone loses every digit here and says nothing: the second assertion."""
    net = build_network(loosened(chain(25), factor, only_turning=only_turning))
    sets = [HELD, (30, 37, 49), (3, 8, 10)]
    fields = ComplianceEngine(net).solve(25, sets, Want.ALL)
    for row, grips in enumerate(sets):
        assert error(net, fields, row, grips) <= 1e-9
    operator = OperatorBuilder(net, grow_tree(net)).operator(25)
    columns = grip_columns(net, 25, np.array(sets))
    for accuracy in (1e-9, 1e-6):
        fields, trusted = solve_batch(operator, columns, Want.ALL, accuracy=accuracy)
        assert trusted[2]
        assert not trusted[:2].any() or factor >= 1e3 * np.finfo(float).eps / accuracy
        for row in np.flatnonzero(trusted):
            assert error(net, fields, row, sets[row]) <= accuracy


@pytest.mark.parametrize("count", [1, 2, 6, 9])
def test_many_small_systems(count):
    rng = np.random.default_rng(count)
    root = rng.standard_normal((7, count, count))
    matrix, load = root @ root.transpose(0, 2, 1), rng.standard_normal((7, count))
    system = np.concatenate([np.tril(matrix), load[:, None]], axis=1).transpose(1, 2, 0).copy()
    answer, pivot = _solve_positive(system)
    expected = np.linalg.solve(matrix, load[..., None])[..., 0]
    diagonals = np.linalg.cholesky(matrix).diagonal(axis1=1, axis2=2) ** 2
    scaled = diagonals / matrix.diagonal(axis1=1, axis2=2)
    rounding = count * np.finfo(float).eps * np.linalg.cond(matrix)  # of both routes, at most

    def is_near(answer):
        off = np.abs(answer.T - expected).max(axis=1)
        return (off <= rounding * np.abs(expected).max(axis=1)).all()

    assert is_near(answer)
    assert (np.abs(pivot.T / scaled - 1).max(axis=1) <= rounding).all()
    assert not is_near(answer * (1 + 1e-6))  # the control


@pytest.mark.parametrize("last", [-1.0, 0.0, 0.5, 1.0, 1.0 + 1e-9])
def test_a_system_that_is_not_positive_is_seen(last):
    """Beside a sound one, whose answer stays."""
    system = np.empty((4, 3, 2))
    system[:3, :, 0] = [[2, 0, 0], [1, 1, 0], [1, 1, last]]  # positive definite beyond 1
    system[:3, :, 1] = 2 * np.eye(3)
    system[3] = 1.0
    answer, pivot = _solve_positive(system)
    assert not pivot[:, 0].min() >= 1e-8  # also where it is no number
    assert np.abs(pivot[:, 1] - 1).max() <= 1e-15
    assert np.abs(answer[:, 1] - 0.5).max() <= 1e-15


def test_a_batch_of_many_passes(monkeypatch):
    net = build_network(chain(8))
    sets = [(1, 9, 14), (14, 15, 3), (4, 5, 2), (12, 10, 7), (8, 9, 15)]
    whole = ComplianceEngine(net).solve(8, sets, Want.ALL)
    monkeypatch.setattr(trial, "_CHUNK", 2)
    parts = ComplianceEngine(net).solve(8, sets, Want.ALL)
    for name in ("edge_force", "displacement", "grip_force", "support"):
        gap = np.abs(getattr(parts, name) - getattr(whole, name)).max()
        assert gap <= 1e-12 * np.abs(getattr(whole, name)).max()


def test_what_is_solved_again_fits_what_was_asked():
    net = build_network(loosened(chain(25), 1e-9, only_turning=True))
    engine = ComplianceEngine(net)
    whole = engine.solve(25, [HELD, (3, 8, 10), (48, 49, 30)], Want.ALL)
    part = engine.solve(25, [HELD, (3, 8, 10), (48, 49, 30)], Want.SUPPORT)
    for name in ("support", "grip_force"):
        size = np.abs(getattr(whole, name)).max()
        assert np.abs(getattr(part, name) - getattr(whole, name)).max() <= 1e-12 * size
    assert part.edge_force.shape == (3, 0)
    held = whole.displacement[2, [net.index_of_node[n] for n in (48, 49, 30)]]
    assert np.abs(held).max() < 1e-12 * np.abs(whole.displacement[2]).max()
    inner = np.flatnonzero((net.edge_brick == 24) & (net.edge_spring < 0))
    assert whole.edge_force[2, inner] == 0  # nothing between two grips on one brick


def test_grips_close_together_on_a_long_chain():
    net = build_network(chain(150))
    sets = [(296, 297, 299), (297, 298, 299), (297, 299, 295)]
    fields = ComplianceEngine(net).solve(150, sets, Want.ALL)
    for row, grips in enumerate(sets):
        assert error(net, fields, row, grips) <= 1e-12


def test_a_hundred_bricks_with_a_hinge():
    """A spring without stiffness leaves no operator."""
    net = build_network(hinged(chain(100), 50))
    fields = ComplianceEngine(net).solve(100, [(150, 199)], Want.ALL)
    assert error(net, fields, 0, (150, 199)) <= 1e-12


def test_what_double_precision_cannot_tell_from_a_mechanism_is_refused():
    net = build_network(loosened(chain(25), 1e-13, only_turning=False))
    with pytest.raises((MechanismError, SolverError)) as caught:
        ComplianceEngine(net).solve(25, [[30, 49]])
    if isinstance(caught.value, MechanismError):
        moving = np.array([np.abs(row).max() for _, row in caught.value.mode])
        assert moving[: LOOSE_AT + 1].max() < 1e-6
