"""The stiffness of a partial structure, and whether it resists every motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.rigid.ungripped import ungripped_system
from seqopt.engines.threads import one_thread
from seqopt.errors import MechanismError
from seqopt.network.mechanics import Statics, build_statics, node_motion, spring_maps
from seqopt.network.network import Network

_ROUNDING = 1e-13  # a smaller eigenvalue of the assembled stiffness may be rounding alone
_UNTIED = 1e-13  # share of the largest deformation of ties that is rounding: nothing is tied


@dataclass(frozen=True, eq=False, repr=False)
class RigidStructure(FrozenValue):
    """The parts of the stiffness of one partial structure."""

    acting: Ints  # (s,); the springs that act
    gap: Floats  # (s, 6, 6b); their deformations for unit twists of the bricks
    stiffness: Floats  # (s, 6, 6); theirs, N/m and N m/rad
    matrix: Floats  # (6b, 6b); stiffness of the structure without grips
    motion: Floats  # (3n, 6b); displacements of the nodes for unit twists
    inner_motion: Floats  # (6b, 6b); of these, the inner nodes in the order of ``network.inner``
    statics: Statics  # of the network

    def forbidden(self, grips: Ints) -> Floats:
        """Return the motions that grips forbid.

        ``grips`` (r,): indices into ``network.inner.ravel()``. Result (3r, 6b).
        """
        return np.asarray(self.inner_motion[(3 * grips[:, None] + np.arange(3)).ravel()])


def rigid_structure(network: Network, bricks: int) -> RigidStructure:
    """Return the parts of the stiffness of a partial structure."""
    acting, gap, stiffness = spring_maps(network, bricks)
    matrix = np.einsum("sik,sij,sjl->kl", gap, stiffness, gap, optimize=True)
    motion = node_motion(network, bricks).toarray()
    inner = network.inner[:bricks].ravel()
    of_inner = motion[(3 * inner[:, None] + np.arange(3)).ravel()]
    statics = build_statics(network)
    return RigidStructure(acting, gap, stiffness, matrix, motion, of_inner, statics)


def require_resistance(network: Network, bricks: int, columns: Ints) -> None:
    """Check that one grip set leaves no motion that nothing resists.

    The assembled stiffness settles most cases at once. It cannot tell a soft support from none;
    `free_motion` can.

    ``columns`` (r,): grips as indices into ``network.inner.ravel()``. Raises `MechanismError` if it
    does.
    """
    parts = rigid_structure(network, bricks)
    with one_thread():
        values, vectors, motions = resisting_modes(parts.matrix, parts.forbidden(columns))
    if lost_to_rounding(values) and free_motion(network, bricks, columns) is not None:
        raise mechanism_error(network, motions @ vectors[:, 0])


def free_motion(network: Network, bricks: int, columns: Ints) -> Floats | None:
    """Return a motion that deforms no spring with any stiffness and moves no held node.

    How stiff springs are does not count: a soft one ties as well as a stiff one, so that rounding
    has nothing to hide behind.

    ``columns`` (r,): grips as indices into ``network.inner.ravel()``. Result (b, 6): translation
    over the length of the longest brick's inner edge, and rotation; the largest component is 1.
    None if there is no such motion.
    """
    parts = ungripped_system(network, bricks)
    node = 3 * network.inner.ravel()[columns][:, None] + np.arange(3)
    held = parts.motion[node.ravel()].toarray() * parts.twist_unit
    ties = np.vstack([parts.deformation[parts.stiffness > 0].toarray(), held])
    with one_thread():
        _, sizes, motions = np.linalg.svd(ties, full_matrices=len(ties) < ties.shape[1])
    if len(sizes) == ties.shape[1] and sizes[-1] > _UNTIED * sizes[0]:
        return None
    motion = motions[-1]
    return np.asarray((motion / motion[np.abs(motion).argmax()]).reshape(-1, 6))


def lost_to_rounding(values: Floats) -> bool:
    """Return whether the least of eigenvalues may be rounding alone.

    ``values`` (m,): eigenvalues of a scaled stiffness, ascending.
    """
    return len(values) > 0 and not values[0] > _ROUNDING * values[-1]  # all may be zero


def resisting_modes(matrix: Floats, forbidden: Floats) -> tuple[Floats, Floats, Floats]:
    """Return how a structure resists the motions that its grips leave.

    ``matrix`` (6b, 6b): stiffness without grips; ``forbidden`` (c, 6b): motions that the grips
    forbid. Results: ``values`` (m,): eigenvalues of the scaled stiffness, ascending; ``vectors``
    (m, m): its modes; ``motions`` (6b, m): the motions that the modes combine.
    """
    free = linalg.null_space(forbidden) if len(forbidden) else np.eye(len(matrix))
    diagonal = np.diag(free.T @ matrix @ free)
    most = max(diagonal.max(initial=0.0), np.finfo(float).tiny / _ROUNDING)
    motions = free / np.sqrt(np.maximum(diagonal, _ROUNDING * most))
    values, vectors = np.linalg.eigh(motions.T @ matrix @ motions)
    return values, vectors, motions


def mechanism_error(
    network: Network,
    twist: Floats,
    text: str = "nothing resists a motion of brick {brick}; add a grip, a joint or stiffness",
) -> MechanismError:
    """Return the error that shows an unresisted motion.

    ``twist`` (6b,): the motion, of any size; ``text``: what to say of the brick that moves most,
    ``{brick}``. Result: with the motion's largest component scaled to 1.
    """
    shape = (twist / np.abs(twist).max()).reshape(-1, 6)
    worst = int(np.abs(shape).max(axis=1).argmax())
    names = [brick.name for brick in network.scene.placed[: len(shape)]]
    return MechanismError(
        f"{len(shape)} bricks: {text.format(brick=names[worst])}",
        tuple((name, tuple(row)) for name, row in zip(names, shape.tolist(), strict=True)),
    )
