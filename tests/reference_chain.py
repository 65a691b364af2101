"""Rigid bricks on springs solved to sixty digits: what engines are held against at their limits.

The doubles of a network are taken as exact. A held brick keeps only the motions that its grips
leave, about one node or about the line through two, so no multiplier and no penalty enters; the
stiffness of what is left is factored brick by brick in build order with the decimal numbers of the
standard library. In a chain the factor is block tridiagonal, in a wall it has a course's width.
"""

from decimal import Context, Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seqopt.arrays import Floats, Ints
from seqopt.errors import MechanismError
from seqopt.network.network import GROUND, Network

DIGITS = 60
ZERO = Decimal("1e-40")  # a pivot that falls below this share of its start is zero
Numbers = NDArray[np.object_]  # of Decimal
EXACT = np.vectorize(Decimal, otypes=[object])


class Reference(NamedTuple):
    """Answers of one grip set, rounded to double precision at the end.

    ``displacement`` (2b, 3) of the inner nodes, m; ``joint_wrench`` (S, 6), N and N m;
    ``brick_twist`` (b, 6), m and rad.
    """

    displacement: Floats
    joint_wrench: Floats
    brick_twist: Floats


def solve_exactly(
    network: Network, bricks: int, columns: Ints, stiffness: float | None = None
) -> Reference:
    """Return the answer for one grip set, given as places in ``network.inner.ravel()``.

    ``stiffness``: of every grip in all directions, N/m; rigid by default.

    Raises
    ------
    MechanismError
        If a motion is left that nothing resists.
    """
    with localcontext(Context(prec=DIGITS)):
        nodes = EXACT(network.node_position[network.inner[:bricks]])
        center = nodes.sum(axis=1) / 2
        rigid = columns if stiffness is None else columns[:0]
        bases = [_motions(nodes[b], center[b], rigid, b) for b in range(bricks)]
        springs = [
            (s, *_spring(network, s, center))
            for s in np.flatnonzero(network.springs.since <= bricks)
        ]
        soft = [] if stiffness is None else columns.tolist()
        grips = [_soft_grip(nodes[c // 2], center[c // 2], c, stiffness) for c in soft]
        blocks, loads = _assemble(network, bases, springs + grips)
        local = _solve(blocks, loads)
        twist = np.array([base @ x for base, x in zip(bases, local, strict=True)])
        wrench = np.full((len(network.springs.since), 6), Decimal(0))
        for s, matrix, maps in springs:
            gap = sum(part @ twist[body] for body, part in maps)
            wrench[s] = -(matrix @ gap)
        motion = [
            (_point_motion(node - center[b]) @ twist[b])
            for b, pair in enumerate(nodes)
            for node in pair
        ]
    return Reference(*(np.array(a).astype(float) for a in (motion, wrench, twist)))


def _soft_grip(
    nodes: Numbers, center: Numbers, column: int, stiffness: float | None
) -> tuple[int, Numbers, list[tuple[int, Numbers]]]:
    """Return a spring that holds a node, without a number of its own."""
    matrix = np.full((6, 6), Decimal(0))
    matrix[:3, :3] = EXACT(np.eye(3)) * Decimal(stiffness or 0.0)
    part = EXACT(np.eye(6))
    part[:3, 3:] = -_skew(nodes[column % 2] - center)
    return -1, matrix, [(column // 2, part)]


def _skew(v: Numbers) -> Numbers:
    zero = Decimal(0)
    return np.array([[zero, -v[2], v[1]], [v[2], zero, -v[0]], [-v[1], v[0], zero]])


def _point_motion(arm: Numbers) -> Numbers:
    """Return the displacement (3, 6) of a point at an arm from the centroid for unit twists."""
    return np.hstack([EXACT(np.eye(3)), -_skew(arm)])


def _motions(nodes: Numbers, center: Numbers, columns: Ints, brick: int) -> Numbers:
    """Return the twists (6, m) that the grips on a brick leave it."""
    held = [nodes[c % 2] for c in columns if c // 2 == brick]
    if not held:
        return EXACT(np.eye(6))
    turn = EXACT(np.eye(3)) if len(held) == 1 else (held[1] - held[0])[:, None]
    return np.vstack([_skew(held[0] - center) @ turn, turn])  # t = -ω × arm = arm × ω


def _spring(network: Network, s: int, center: Numbers) -> tuple[Numbers, list[tuple[int, Numbers]]]:
    """Return a spring's stiffness (6, 6) and its deformation (6, 6) for each brick it joins."""
    springs = network.springs
    axes = EXACT(springs.axes[s])
    stiffness = np.full((6, 6), Decimal(0))
    stiffness[:3, :3] = axes.T @ (EXACT(springs.translational_stiffness[s])[:, None] * axes)
    stiffness[3:, 3:] = axes.T @ (EXACT(springs.rotational_stiffness[s])[:, None] * axes)
    maps = []
    for body, sign in zip(springs.bodies[s].tolist(), (Decimal(-1), Decimal(1)), strict=True):
        if body != GROUND:
            part = EXACT(np.eye(6))
            part[:3, 3:] = -_skew(EXACT(springs.position[s]) - center[body])
            maps.append((body, sign * part))
    return stiffness, maps


def _assemble(
    network: Network, bases: list[Numbers], springs: list[Any]
) -> tuple[list[dict[int, Numbers]], list[Numbers]]:
    """Return the lower blocks of the stiffness, a dictionary per row, and the loads."""
    loads = [
        base.T @ np.concatenate([EXACT(network.weight[b]), EXACT(np.zeros(3))])
        for b, base in enumerate(bases)
    ]
    blocks: list[dict[int, Numbers]] = [{} for _ in bases]
    for _, stiffness, maps in springs:
        moved = [(body, part @ bases[body]) for body, part in maps]
        for i, left in moved:
            for j, right in moved:
                if j <= i:
                    blocks[i][j] = blocks[i].get(j, Decimal(0)) + left.T @ stiffness @ right
    for b, base in enumerate(bases):
        if b not in blocks[b]:
            raise MechanismError(f"nothing resists a motion of brick {b + 1}")
        assert blocks[b][b].shape == (base.shape[1],) * 2
    return blocks, loads


def _solve(blocks: list[dict[int, Numbers]], loads: list[Numbers]) -> list[Numbers]:
    """Solve by block elimination from the last row to the first, then substitution."""
    answer = list(loads)
    gains: list[dict[int, Numbers]] = [{} for _ in blocks]
    for i in reversed(range(len(blocks))):
        row = blocks[i]
        pivot = row.pop(i)
        others = list(row)
        right = np.column_stack([answer[i], *(row[j] for j in others)])
        solved = _eliminate(pivot, right)
        answer[i] = solved[:, 0]
        start = 1
        for j in others:
            gains[i][j] = solved[:, start : start + row[j].shape[1]]
            start += row[j].shape[1]
        for j in others:
            answer[j] = answer[j] - row[j].T @ answer[i]
            for k in others:
                if k <= j:
                    update = row[j].T @ gains[i][k]
                    blocks[j][k] = blocks[j].get(k, Decimal(0)) - update
    for i in range(len(blocks)):
        for j, gain in gains[i].items():
            answer[i] = answer[i] - gain @ answer[j]
    return answer


def _eliminate(matrix: Numbers, right: Numbers) -> Numbers:
    """Solve a positive definite system by Gauss elimination without pivoting."""
    a, b = matrix.copy(), right.copy()
    size = len(a)
    start = [a[i, i] for i in range(size)]
    for i in range(size):
        if not a[i, i] > ZERO * start[i]:
            raise MechanismError("a pivot is zero")
        for j in range(i + 1, size):
            factor = a[j, i] / a[i, i]
            a[j, i:] = a[j, i:] - factor * a[i, i:]
            b[j] = b[j] - factor * b[i]
    for i in reversed(range(size)):
        b[i] = (b[i] - a[i, i + 1 :] @ b[i + 1 :]) / a[i, i] if i + 1 < size else b[i] / a[i, i]
    return b
