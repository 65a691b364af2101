"""The compliance operator and its grips' equations against solving each structure directly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.harness.scenes import running_bond
from seqopt.engines.interface import _NAMES, Want, grip_columns
from seqopt.engines.rigid._grip_equations import grip_forces, well_conditioned
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from tests.builders import branch, from_both_sides, small_arch, solve_batch
from tests.direct_solve import solve_dense

SCENES = {
    "arch": small_arch(5),
    "wall": running_bond(3, 3),
    "both sides": from_both_sides(6, "VLR"),
    "branch": branch(),
}


def unequal(scene):
    """The scene with joints of which no two are alike, in no two directions."""
    joints = [
        replace(
            joint,
            translational_stiffness=(1e8 + 1e6 * i, 2e8 + 3e6 * i, 5e8),
            rotational_stiffness=(1e6 + 1e4 * i, 3e6, 4e6 + 2e4 * i),
        )
        for i, joint in enumerate(scene.joints)
    ]
    return replace(scene, joints=tuple(joints))


def free_nodes(scene, bricks):
    nodes = [node for brick in scene.placed[:bricks] for node in brick.nodes]
    return [node for node in nodes if node not in scene.blocked_nodes]


def sets_of(scene, bricks, grips, count=4):
    """Sets of free nodes, among them those of the last bricks, where two share a brick."""
    free = free_nodes(scene, bricks)
    rng = np.random.default_rng(10 * bricks + grips)
    drawn = [rng.choice(free, grips, replace=False) for _ in range(count)]
    return np.array([*drawn, free[:grips], free[-grips:]]) if grips else np.zeros((1, 0), int)


@pytest.mark.parametrize("grips", [0, 2, 4])
@pytest.mark.parametrize("name", SCENES)
def test_every_field_is_that_of_a_direct_solve(name, grips):
    """At every brick count: what closes loops is there or not, ends carry or do not yet."""
    scene = unequal(SCENES[name])
    net = build_network(scene)
    builder = OperatorBuilder(net, grow_tree(net))
    for bricks in range(1, len(scene.bricks) + 1):
        if len(free_nodes(scene, bricks)) < grips:
            continue
        columns = grip_columns(net, bricks, sets_of(scene, bricks, grips))
        fields, trusted = solve_batch(builder.operator(bricks), columns, Want.ALL)
        direct = solve_dense(net, bricks, columns)
        assert trusted.all()
        for field in _NAMES:
            own, other = getattr(fields, field), getattr(direct, field)
            unit = 1e-8 if field in ("displacement", "brick_twist") else 1.0  # what 1 N moves
            gap = np.abs(own - other).max(initial=0)
            assert gap <= 1e-9 * np.abs(other).max(initial=unit), (bricks, field)


def test_only_what_is_wanted_is_computed():
    net = build_network(small_arch(5))
    engine = ComplianceEngine(net)
    whole = engine.solve(5, [[3, 7]], Want.ALL)
    fields = {
        Want.EDGES: "edge_force",
        Want.DISPLACEMENTS: "displacement",
        Want.SUPPORT: "support",
        Want.JOINTS: "joint_wrench",
        Want.BRICKS: "brick_twist",
    }
    for want in fields:
        part = engine.solve(5, [[3, 7]], want)
        same(part.grip_force, whole.grip_force)
        for other, name in fields.items():
            if other is want:
                same(getattr(part, name), getattr(whole, name))
            else:
                assert getattr(part, name).shape[1] == 0


def same(part, whole):
    np.testing.assert_allclose(part, whole, rtol=0, atol=1e-12 * np.abs(whole).max())


def eliminated(matrix):
    """The pivots of a matrix, from the first unknown to the last."""
    left, pivots = matrix.copy(), []
    while len(left):
        pivots.append(left[0, 0])
        left = left[1:, 1:] - np.outer(left[1:, 0], left[0, 1:]) / left[0, 0]
    return np.array(pivots)


@pytest.mark.parametrize("grips", [(3,), (2, 7, 9)])
def test_what_rounding_may_change_grips_forces_by(grips):
    """Of each displacement the digits that are lost, over what is left to tell the force by."""
    net = build_network(unequal(small_arch(5)))
    operator = OperatorBuilder(net, grow_tree(net)).operator(5)
    rng = np.random.default_rng(0)
    operator = replace(operator, loss=rng.uniform(1.0, 9.0, len(operator.loss)))
    columns = np.array([grips])
    index = operator.load_index(columns)
    found = grip_forces(operator, columns, index)
    part, loss = operator.flexibility[np.ix_(index[0], index[0])], operator.loss[index[0]]
    own, size, dead = (
        np.diag(part),
        np.abs(found.force[0]),
        np.abs(operator.dead_displacement[index[0]]),
    )
    left = eliminated(part)
    sums = [
        sum(np.sqrt(own[i] * loss[i] * own[j] * loss[j]) * size[j] for j in range(len(own)))
        + dead[i] * loss[i]
        for i in range(len(own))
    ]
    doubt = (sums / left).max() / size.max()
    assert found.lowest == pytest.approx([(left / own).min()], rel=1e-9)
    for most, stands in ((doubt * (1 - 1e-9), False), (doubt * (1 + 1e-9), True)):
        assert well_conditioned(operator.doubts, index, found, most).tolist() == [stands]
    for lowest in (-1.0, 0.0, np.nan):  # not definite: nothing is known of the error
        pivot = found.pivot.copy()
        pivot[-1] = lowest
        found = found._replace(pivot=pivot)
        assert not well_conditioned(operator.doubts, index, found, 1e300).any()
