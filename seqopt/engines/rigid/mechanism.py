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

ROUNDING = 1e-13  # a smaller eigenvalue of the assembled stiffness may be rounding alone
UNTIED = 1e-13  # share of the largest deformation of ties that is rounding: nothing is tied


@dataclass(frozen=True, eq=False, repr=False)
class RigidStructure(FrozenValue):
    """The parts of the stiffness of one partial structure.

    Attributes
    ----------
    acting : (s,) int
        The springs that act.
    gap : (s, 6, 6b) float
        Their deformations for unit twists of the bricks.
    stiffness : (s, 6, 6) float
        Theirs, N/m and N m/rad.
    matrix : (6b, 6b) float
        Stiffness of the structure without grips.
    motion : (3n, 6b) float
        Displacements of the nodes for unit twists.
    inner_motion : (6b, 6b) float
        Of these, the inner nodes in the order of ``network.inner``.
    statics : Statics
        Of the network.
    """

    acting: Ints
    gap: Floats
    stiffness: Floats
    matrix: Floats
    motion: Floats
    inner_motion: Floats
    statics: Statics

    def forbidden(self, grips: Ints) -> Floats:
        """Return the motions that grips forbid.

        Parameters
        ----------
        grips : (r,) int
            Indices into ``network.inner.ravel()``.

        Returns
        -------
        (3r, 6b) float
        """
        return np.asarray(self.inner_motion[(3 * grips[:, None] + np.arange(3)).ravel()])


def rigid_structure(network: Network, bricks: int) -> RigidStructure:
    """Return the parts of the stiffness of a partial structure.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    """
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

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (r,) int
        Grips as indices into ``network.inner.ravel()``.

    Raises
    ------
    MechanismError
        If it does.
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

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    columns : (r,) int
        Grips as indices into ``network.inner.ravel()``.

    Returns
    -------
    (b, 6) float or None
        Translation over the length of the longest brick's inner edge, and rotation; the largest
        component is 1. None if there is no such motion.
    """
    parts = ungripped_system(network, bricks)
    node = 3 * network.inner.ravel()[columns][:, None] + np.arange(3)
    held = parts.motion[node.ravel()].toarray() * parts.twist_unit
    ties = np.vstack([parts.deformation[parts.stiffness > 0].toarray(), held])
    with one_thread():
        _, sizes, motions = np.linalg.svd(ties, full_matrices=len(ties) < ties.shape[1])
    if len(sizes) == ties.shape[1] and sizes[-1] > UNTIED * sizes[0]:
        return None
    motion = motions[-1]
    return np.asarray((motion / motion[np.abs(motion).argmax()]).reshape(-1, 6))


def lost_to_rounding(values: Floats) -> bool:
    """Return whether the least of eigenvalues may be rounding alone.

    Parameters
    ----------
    values : (m,) float
        Eigenvalues of a scaled stiffness, ascending.
    """
    return len(values) > 0 and not values[0] > ROUNDING * values[-1]  # all may be zero


def resisting_modes(matrix: Floats, forbidden: Floats) -> tuple[Floats, Floats, Floats]:
    """Return how a structure resists the motions that its grips leave.

    Parameters
    ----------
    matrix : (6b, 6b) float
        Stiffness without grips.
    forbidden : (c, 6b) float
        Motions that the grips forbid.

    Returns
    -------
    values : (m,) float
        Eigenvalues of the scaled stiffness, ascending.
    vectors : (m, m) float
        Its modes.
    motions : (6b, m) float
        The motions that the modes combine.
    """
    free = linalg.null_space(forbidden) if len(forbidden) else np.eye(len(matrix))
    diagonal = np.diag(free.T @ matrix @ free)
    most = max(diagonal.max(initial=0.0), np.finfo(float).tiny / ROUNDING)
    motions = free / np.sqrt(np.maximum(diagonal, ROUNDING * most))
    values, vectors = np.linalg.eigh(motions.T @ matrix @ motions)
    return values, vectors, motions


def mechanism_error(
    network: Network,
    twist: Floats,
    text: str = "nothing resists a motion of brick {brick}; add a grip, a joint or stiffness",
) -> MechanismError:
    """Return the error that shows an unresisted motion.

    Parameters
    ----------
    network : Network
    twist : (6b,) float
        The motion, of any size.
    text : str, optional
        What to say of the brick that moves most, ``{brick}``.

    Returns
    -------
    MechanismError
        With the motion's largest component scaled to 1.
    """
    shape = (twist / np.abs(twist).max()).reshape(-1, 6)
    worst = int(np.abs(shape).max(axis=1).argmax())
    names = [brick.name for brick in network.scene.placed[: len(shape)]]
    return MechanismError(
        f"{len(shape)} bricks: {text.format(brick=names[worst])}",
        tuple((name, tuple(row)) for name, row in zip(names, shape.tolist(), strict=True)),
    )
