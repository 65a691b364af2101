"""The stiffness of a partial structure, and whether it resists every motion."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from seqopt.arrays import Floats, Ints
from seqopt.errors import MechanismError
from seqopt.network.kinematics import node_motion, spring_maps
from seqopt.network.network import Network
from seqopt.network.statics import Statics, build_statics

NO_RESISTANCE = 1e-13  # smallest scaled eigenvalue of a structure that resists every motion


class RigidStructure(NamedTuple):
    """One partial structure: springs, stiffness (6b, 6b), motion of nodes (3N, 6b), statics."""

    acting: Ints
    gap: Floats
    stiffness: Floats
    matrix: Floats
    motion: Floats
    held: Floats
    maps: Statics


def rigid_structure(network: Network, bricks: int) -> RigidStructure:
    """Return the parts of the stiffness of the first ``bricks`` bricks."""
    acting, gap, stiffness = spring_maps(network, bricks)
    matrix = np.einsum("sik,sij,sjl->kl", gap, stiffness, gap, optimize=True)
    motion = node_motion(network, bricks).toarray()
    inner = network.inner[:bricks].ravel()
    held = motion[(3 * inner[:, None] + np.arange(3)).ravel()]
    return RigidStructure(acting, gap, stiffness, matrix, motion, held, build_statics(network))


def require_resistance(network: Network, bricks: int, columns: Ints) -> None:
    """Raise a `MechanismError` if one grip set leaves a motion that nothing resists."""
    parts = rigid_structure(network, bricks)
    fixed = parts.held[(3 * columns[:, None] + np.arange(3)).ravel()]
    resisting_modes(network, parts.matrix, fixed)


def resisting_modes(
    network: Network, matrix: Floats, fixed: Floats
) -> tuple[Floats, Floats, Floats]:
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
        raise mechanism_error(network, free[:, 0])
    motions = free / np.sqrt(np.maximum(diagonal, NO_RESISTANCE * diagonal.max()))
    values, vectors = np.linalg.eigh(motions.T @ matrix @ motions)
    if values[0] < NO_RESISTANCE * values[-1]:
        raise mechanism_error(network, motions @ vectors[:, 0])
    return values, vectors, motions


def mechanism_error(
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
