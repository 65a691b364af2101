"""Rigid bricks solved with joint wrenches and motions as unknowns side by side.

One factorization of the system of `seqopt.engines.rigid.mixed_system` per grip set, corrected until
it no longer changes: slow, sure, and the last resort of the fast engine.
"""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Fields
from seqopt.engines.joined_fields import join_sets, no_sets
from seqopt.engines.rigid.mechanism import require_resistance
from seqopt.engines.rigid.mixed_system import factorize, mixed_system, unscaled
from seqopt.engines.rigid.recovery import Solution, respond
from seqopt.engines.rigid.ungripped import Ungripped, ungripped_system
from seqopt.errors import SolverError
from seqopt.network.network import Network

CORRECTIONS = 3  # after which an answer is judged
LAST_CORRECTION = 1e-10  # the largest of forces, moments, shifts and turns, relative to each
EMPTY = 1e-6  # forces this small beside the moments over a brick's length are not looked at alone
LIGHT = 1e-3  # nor what is this small beside the weight, or the motion it makes at a typical joint


def solve_mixed(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets, one factorization for each.

    A mechanism that no load excites passes:
    `seqopt.engines.rigid.mechanism.require_resistance` finds it.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (S, r) int
        Grips as indices into ``network.inner.ravel()``.

    Raises
    ------
    MechanismError
        If a motion that the load excites meets no resistance.
    SolverError
        If the answer still changes by more than `LAST_CORRECTION`.
    """
    parts = ungripped_system(network, bricks)
    answers = [_solve_one(parts, grips) for grips in columns]
    return join_sets([no_sets(network, bricks, columns.shape[1]), *answers])


def _solve_one(parts: Ungripped, grips: Ints) -> Fields:
    """Return the fields of one grip set."""
    network = parts.network
    solution = solve_load(parts, grips, parts.load)
    return respond(network, parts.statics, parts.motion, grips[None], solution)


def solve_load(parts: Ungripped, grips: Ints, pull: Floats) -> Solution:
    """Return how a partial structure answers to a load while a grip set holds its nodes still.

    Parameters
    ----------
    parts : Ungripped
    grips : (r,) int
        Indices into ``network.inner.ravel()``.
    pull : (6b,) float
        The load, scaled as ``parts.load``.

    Returns
    -------
    Solution
        Of one grip set.

    Raises
    ------
    MechanismError
        If a motion that the load excites meets no resistance.
    SolverError
        If the answer still changes by more than `LAST_CORRECTION`.
    """
    network, bricks = parts.network, parts.bricks
    system = mixed_system(parts, grips)
    joints, moves = len(parts.wrench_unit), len(parts.twist_unit)
    load = np.zeros(system.matrix.shape[0])
    load[joints : joints + moves] = pull
    try:
        factors = factorize(system)
    except RuntimeError as error:
        require_resistance(network, bricks, grips)
        raise SolverError(f"{bricks} bricks: exactly singular in double precision") from error
    result = factors.solve(load)
    for _ in range(CORRECTIONS):
        correction = factors.solve(load - system.matrix @ result)
        result += correction
    both = np.stack([result, correction])[:, None, : joints + moves]
    if not unchanged(parts, *both)[0]:
        require_resistance(network, bricks, grips)
        raise SolverError(
            f"{bricks} bricks: too close to a mechanism for double precision; "
            "add a grip or stiffness"
        )
    wrench, twist = unscaled(parts, result[None, : joints + moves])
    force = (system.force @ (result[joints + moves :] * parts.unit)).reshape(1, -1, 3)
    return Solution(twist, wrench, force)


def unchanged(
    parts: Ungripped, states: Floats, corrections: Floats, largest: float = LAST_CORRECTION
) -> Bools:
    """Return whether corrections are small beside forces, moments, shifts and turns each.

    Where nothing moves, as where robots hold every brick at both nodes, what is left is rounding:
    it is measured against the weight.

    Parameters
    ----------
    parts : Ungripped
    states, corrections : (S, 6s + 6b) float
        Scaled wrenches and twists.
    largest : float, optional
        That counts as small.

    Returns
    -------
    (S,) bool
    """
    size, change = _sizes(parts, states), _sizes(parts, corrections)
    other = size.reshape(-1, 2, 2).max(axis=2).repeat(2, axis=1)
    least = np.maximum(EMPTY * other, LIGHT * np.abs(parts.load).max())
    return np.asarray((change <= largest * np.maximum(size, least)).all(axis=1))


def _sizes(parts: Ungripped, states: Floats) -> Floats:
    """Return the largest force, moment, shift and turn of each state, (S, 4)."""
    ends = [len(parts.wrench_unit)]
    kinds = [
        part.reshape(len(states), part.shape[1] // 6, 2, 3)
        for part in np.split(states, ends, axis=1)
    ]
    return np.hstack([np.abs(part).max(axis=(1, 3), initial=0.0) for part in kinds])
