"""Exactly rigid bricks where joints are loose, chains long and systems small or not positive."""

from __future__ import annotations

import numpy as np
import pytest

from seqopt.engines.interface import Want, grip_columns
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
@pytest.mark.parametrize("factor", [1e-3, 1e-9, 1e-15])
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
