"""Rigid bricks solved directly, one grip set at a time: the general case, mechanisms included."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse

from seqopt.errors import MechanismError, SolverError
from seqopt.fields import Fields
from seqopt.kinematics import centroids, node_motion
from seqopt.network import GROUND, Floats, Ints, Network
from seqopt.statics import Statics, skew, statics

MECHANISM = 1e-13  # smallest scaled eigenvalue of a structure that resists every motion
BACKWARD = 1e-10  # largest backward error of an accepted solution


def spring_maps(network: Network, bricks: int) -> tuple[Ints, Floats, Floats]:
    """Return the acting springs, their deformations for unit twists and their stiffnesses.

    Shapes (s,), (s, 6, 6b), (s, 6, 6): global axes, second body relative to first.
    """
    springs = network.springs
    acting = np.flatnonzero(springs.since <= bricks)
    center = centroids(network)
    gap = np.zeros((len(acting), 6, 6 * bricks))
    stiffness = np.zeros((len(acting), 6, 6))
    for row, s in enumerate(acting):
        for body, sign in zip(springs.bodies[s], (-1.0, 1.0), strict=True):
            if body != GROUND:
                block = gap[row, :, 6 * body : 6 * body + 6]
                block += sign * np.eye(6)
                block[:3, 3:] -= sign * skew(springs.position[s] - center[body])
        axes = springs.axes[s]
        stiffness[row, :3, :3] = axes.T * springs.translational_stiffness[s] @ axes
        stiffness[row, 3:, 3:] = axes.T * springs.rotational_stiffness[s] @ axes
    return acting, gap, stiffness


class _Structure(NamedTuple):
    """One partial structure: springs, stiffness (6b, 6b), motion of nodes (3N, 6b), statics."""

    acting: Ints
    gap: Floats
    stiffness: Floats
    matrix: Floats
    motion: Floats
    held: Floats
    maps: Statics


def _structure(network: Network, bricks: int) -> _Structure:
    acting, gap, stiffness = spring_maps(network, bricks)
    matrix = np.einsum("sik,sij,sjl->kl", gap, stiffness, gap, optimize=True)
    motion = node_motion(network, bricks).toarray()
    inner = network.inner[:bricks].ravel()
    held = motion[(3 * inner[:, None] + np.arange(3)).ravel()]
    return _Structure(acting, gap, stiffness, matrix, motion, held, statics(network))


def require_resistance(network: Network, bricks: int, columns: Ints) -> None:
    """Raise a `MechanismError` if one grip set leaves a motion that nothing resists."""
    parts = _structure(network, bricks)
    fixed = parts.held[(3 * columns[:, None] + np.arange(3)).ravel()]
    _spectrum(network, parts.matrix, fixed)


def solve_rigid(network: Network, bricks: int, columns: Ints) -> Fields:
    """Return the fields of grip sets (S, r), given as places in ``network.inner.ravel()``."""
    parts = _structure(network, bricks)
    answers = [_solve_one(network, parts, grips) for grips in columns]
    return stack(network, bricks, columns, answers)


def stack(
    network: Network, bricks: int, columns: Ints, answers: list[tuple[Floats, ...]]
) -> Fields:
    """Return the fields of grip sets (S, r) from the answer of each."""
    edges, nodes = network.count_edges(bricks), network.count_nodes(bricks)
    shapes = (
        (edges,),
        (nodes, 3),
        (columns.shape[1], 3),
        (6,),
        (len(network.springs.since), 6),
        (bricks, 6),
    )
    return Fields(
        *(
            np.array([answer[i] for answer in answers]).reshape(len(answers), *shape)
            for i, shape in enumerate(shapes)
        )
    )


def _solve_one(network: Network, parts: _Structure, grips: Ints) -> tuple[Floats, ...]:
    """Return the fields of one grip set, in the order of `Fields`."""
    bricks = len(parts.matrix) // 6
    weight = np.repeat(0.5 * network.weight[:bricks], 2, axis=0)
    pull = parts.held.T @ weight.ravel()
    fixed = parts.held[(3 * grips[:, None] + np.arange(3)).ravel()]
    twist = _constrained(network, parts.matrix, fixed, pull)
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[parts.acting] = -np.einsum("sij,sjk,k->si", parts.stiffness, parts.gap, twist)
    missing = parts.matrix @ twist - pull
    force = np.linalg.lstsq(fixed.T, missing, rcond=None)[0].reshape(-1, 3)
    return respond(
        network,
        grips,
        maps=parts.maps,
        motion=parts.motion,
        twist=twist,
        wrench=wrench,
        force=force,
    )


def respond(
    network: Network,
    grips: Ints,
    *,
    maps: Statics,
    motion: Floats | sparse.csr_array,
    twist: Floats,
    wrench: Floats,
    force: Floats,
) -> tuple[Floats, ...]:
    """Return the fields of one grip set, in the order of `Fields`, from what determines them.

    Parameters
    ----------
    grips : (r,) int
    maps : Statics
        Of the network.
    motion : (3N, 6b) float
        Displacements of the nodes for unit twists.
    twist, wrench, force : (6b,), (S, 6), (r, 3) float
        Of bricks, springs and grips; two grips on one brick may share their force in any way.
    """
    bricks = len(twist) // 6
    edges = network.count_edges(bricks)
    load = np.repeat(0.5 * network.weight[:bricks], 2, axis=0)
    load[grips] += force
    carried = maps.edge_of_spring[:edges] @ wrench[:, :3].ravel()
    carried += maps.edge_of_load[:edges, : load.size] @ load.ravel()
    _split_pairs(network, grips, force, carried)
    support = maps.support_of_spring @ wrench[network.springs.support]
    moved = (motion @ twist).reshape(-1, 3)
    return carried, moved, force, support, wrench, twist.reshape(-1, 6)


def _spectrum(network: Network, matrix: Floats, fixed: Floats) -> tuple[Floats, Floats, Floats]:
    """Return eigenvalues and modes of the scaled stiffness, and the motions (6b, m) they combine.

    Raises
    ------
    MechanismError
        If the smallest eigenvalue is zero beside the largest.
    """
    free = linalg.null_space(fixed) if len(fixed) else np.eye(len(matrix))
    reduced = free.T @ matrix @ free
    diagonal = np.diag(reduced)
    if not diagonal.max() > 0:
        raise mechanism(network, free[:, 0])
    motions = free / np.sqrt(np.maximum(diagonal, MECHANISM * diagonal.max()))
    values, vectors = np.linalg.eigh(motions.T @ matrix @ motions)
    if values[0] < MECHANISM * values[-1]:
        raise mechanism(network, motions @ vectors[:, 0])
    return values, vectors, motions


def _constrained(network: Network, matrix: Floats, fixed: Floats, load: Floats) -> Floats:
    """Return the twists under a load with some motions held still."""
    values, vectors, motions = _spectrum(network, matrix, fixed)
    target = motions.T @ load
    answer = vectors @ (vectors.T @ target / values)
    residual = np.abs(motions.T @ (matrix @ (motions @ answer)) - target).max()
    if not residual <= BACKWARD * (values[-1] * np.abs(answer).max() + np.abs(target).max()):
        raise SolverError(f"direct solve of {len(matrix) // 6} bricks: backward error too large")
    return np.asarray(motions @ answer)


def mechanism(
    network: Network,
    twist: Floats,
    text: str = "nothing resists a motion of brick {brick}; add a grip, a joint or stiffness",
) -> MechanismError:
    """Return the error that shows an unresisted motion (6b,), its largest component scaled to 1."""
    shape = (twist / np.abs(twist).max()).reshape(-1, 6)
    worst = int(np.abs(shape).max(axis=1).argmax())
    names = [brick.name for brick in network.scene.placed[: len(shape)]]
    return MechanismError(
        f"{len(shape)} bricks: {text.format(brick=names[worst])}",
        tuple((name, tuple(row)) for name, row in zip(names, shape.tolist(), strict=True)),
    )


def _split_pairs(network: Network, grips: Ints, force: Floats, carried: Floats) -> None:
    """Let each of two grips on one brick take what reaches its own node."""
    for brick in np.flatnonzero(np.bincount(grips // 2) == 2):
        edge = int(np.flatnonzero((network.edge_brick == brick) & (network.edge_spring < 0))[0])
        second = np.flatnonzero(grips == 2 * brick + 1)[0]
        first = np.flatnonzero(grips == 2 * brick)[0]
        force[second] -= carried[edge] * network.edge_axis[edge]
        force[first] += carried[edge] * network.edge_axis[edge]
        carried[edge] = 0.0
