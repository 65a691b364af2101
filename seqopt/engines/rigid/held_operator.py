"""The compliance operator of a partial structure, loose parts included, from its held system.

A loose motion stands on a spring of its own that every grip set takes away again: with the
flexibility ``G`` of the structure on these springs of softness ``s`` and the displacements ``R``
that the loose motions make, forces ``λ`` and motions ``β`` follow from ``G λ + R β = -d`` and
``Rᵀ λ - K β = -p``, where ``p`` is how the weight pulls at the motions and ``K`` how soft springs
resist them, mostly not at all.
"""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats
from seqopt.engines.rigid.loads import inner_edges
from seqopt.engines.rigid.loose import HeldSystem
from seqopt.engines.rigid.mixed_system import unscaled
from seqopt.engines.rigid.operator import ComplianceOperator
from seqopt.engines.rigid.response_maps import ResponseMaps, scene_maps
from seqopt.engines.rigid.ungripped import Ungripped

TIED = 0.1  # most that what resists loose motions may be of the springs that they stand on


def held_operator(system: HeldSystem) -> ComplianceOperator:
    """Return the operator of a partial structure whose loose motions are unknowns of grip sets.

    Returns
    -------
    ComplianceOperator
        Of all directions of space, with a load for each loose motion after those of the nodes.
    """
    parts, loose = system.parts, system.loose
    joints, loads = len(parts.wrench_unit), 6 * parts.bricks
    inner = parts.inner
    right = np.zeros((loads + loose, joints + loads))
    right[:loads, joints:] = inner.toarray() / parts.unit
    moved = np.zeros((loads + loose, loose))
    moved[loads:] = np.eye(loose)
    states, pull = system.solve(right, moved)
    motion = (inner @ states[:, joints:].T).T
    reach, resistance = motion[loads:], pull[loads:]
    softness = _softness(motion[:loads], reach, resistance, parts.unit)
    states[:loads] += softness * (reach.T @ states[loads:])
    flexibility = np.zeros((loads + loose, loads + loose))
    flexibility[:loads, :loads] = motion[:loads] + softness * (reach.T @ reach)
    flexibility[loads:, :loads], flexibility[:loads, loads:] = reach, reach.T
    corner = np.linalg.solve(np.eye(loose) - softness * resistance, resistance)
    flexibility[loads:, loads:] = -0.5 * (corner + corner.T)
    return _operator(parts, states, flexibility, softness)


def _softness(flexibility: Floats, reach: Floats, resistance: Floats, unit: float) -> float:
    """Return the softness of the springs that loose motions stand on, m/N.

    About that of the structure where they reach, so that the grips' equations keep their digits. A
    motion that reaches no node, as of bricks that turn about the line they lie on, counts as if it
    took one node along: beside that, rounding stays small.
    """
    if not len(reach):
        return 0.0
    own = float(np.trace(flexibility)) / max(float((reach**2).sum()), float(len(reach)))
    most = TIED / max(float(np.abs(resistance).sum()), np.finfo(float).tiny)
    return min(max(own, 1 / unit), most)


def _operator(
    parts: Ungripped, states: Floats, flexibility: Floats, softness: float
) -> ComplianceOperator:
    """Return the operator whose loads and loose motions lead to scaled states (l + m, n)."""
    network, bricks = parts.network, parts.bricks
    loads = 6 * bricks
    weight = np.zeros(len(states))
    weight[:loads] = network.inner_weight[: 2 * bricks].ravel()
    wrench, twist = unscaled(parts, states)
    inner_edge, axis, at_second = inner_edges(network, bricks)

    def with_weight(rows: Floats) -> Floats:
        return np.vstack([rows, weight @ rows])

    return ComplianceOperator(
        held=np.arange(bricks),
        flexibility=flexibility,
        dead_displacement=flexibility @ weight,
        twist=with_weight(twist),
        wrench=with_weight(wrench[:, parts.acting].reshape(len(states), -1)),
        maps=ResponseMaps(scene_maps(network), bricks),
        at_second=at_second,
        axis=axis,
        inner_edge=inner_edge,
        loss=np.ones(len(states)),
        loose=len(states) - loads,
        softness=softness,
    )
