"""How far an answer can be well_conditioned: solved well, ill-conditioned, or a mechanism.

Two questions are kept apart. The backward error says whether the fields answer a problem next to
the one that was asked; a long chain may be solved well although its condition is huge and the plain
residual, relative to the load, looks like failure. Whether the structure resists every motion at
all is asked of the ties that springs and grips are, however soft; the smallest eigenvalue of the
stiffness, scaled by its diagonal, says how well it does.

Deformations, wrenches and balances are written out here once more, on purpose: a check that used
the maps of `seqopt.network._mechanics` would share their errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.interface import (
    RIGID,
    Engine,
    Fields,
    GripCompliance,
    Want,
    grip_columns,
    read_compliance,
)
from seqopt.engines.rigid._mixed import (
    MixedSystem,
    free_motion,
    mixed_system,
    solve_mixed,
    ungripped_system,
)
from seqopt.errors import MechanismError, SolverError
from seqopt.network.network import GROUND, Network

UNRESISTED = 1e-17  # a scaled eigenvalue below this is found by a shift
_LEAST_DIAGONAL = 1e-13  # over the largest: by it a motion without stiffness is scaled
_SHIFT = 1e-15  # added to the scaled stiffness of a mechanism to find its mode
_EIGENVALUE_TOLERANCE = 1e-6  # relative
_Pull = tuple[Ints, Floats, Floats]  # bricks, points and wrenches about them
_LOOKED_INTO = 1e-15  # a smallest scaled eigenvalue below which a motion may be free
WELL = 1e-9  # largest backward error of fields that keep the nine digits an engine promises


def _spectrum(
    network: Network, bricks: int, columns: Ints, compliance: GripCompliance = RIGID
) -> tuple[float, float, Floats]:
    """Return how the constrained stiffness, scaled by its diagonal, resists motions.

    The mixed system applies the inverse: it keeps small eigenvalues that the stiffness matrix has
    lost to rounding; a mechanism is shifted. Results: eigenvalue, condition, mode of `Diagnosis`.
    """
    parts = ungripped_system(network, bricks)
    root = np.sqrt(parts.stiffness)[:, None]
    diagonal = np.asarray((parts.deformation * root).power(2).sum(axis=0)).ravel()
    most = max(diagonal.max(), 1.0 if not diagonal.any() else 0.0)
    scale = np.sqrt(np.maximum(diagonal, _LEAST_DIAGONAL * most))
    try:
        lowest, motion = _lowest(
            mixed_system(parts, columns, compliance=compliance), scale, len(root)
        )
    except RuntimeError:  # exactly singular, or the iteration broke down
        lowest = 0.0
    if not lowest > UNRESISTED:
        shifted = mixed_system(parts, columns, _SHIFT * scale**2, compliance)
        lowest, motion = _lowest(shifted, scale, len(root))
        lowest = max(lowest - _SHIFT, 0.0)
    scaled = sparse.diags_array(root.ravel()) @ parts.deformation @ sparse.diags_array(1 / scale)
    condition = np.inf
    if lowest:  # the largest eigenvalue is that of the unconstrained scaled stiffness
        start = np.random.default_rng(0).standard_normal(len(scale))
        square = scaled.T @ scaled
        highest = eigsh(square, k=1, tol=1e-3, return_eigenvectors=False, v0=start)
        condition = float(highest[0]) / lowest
    return lowest, condition, (motion / motion[np.abs(motion).argmax()]).reshape(-1, 6)


def _lowest(system: MixedSystem, scale: Floats, before: int) -> tuple[float, Floats]:
    """Return the smallest eigenvalue and its motion in scaled twists, which stand after others."""
    factors = splu(system.matrix)
    load, mine = np.zeros(system.matrix.shape[0]), slice(before, before + len(scale))

    def inverse(vector: Floats) -> Floats:
        load[mine] = scale * vector.ravel()
        answer = factors.solve(load)
        answer += factors.solve(load - system.matrix @ answer)
        return np.asarray(scale * answer[mine])

    operator = LinearOperator((len(scale), len(scale)), matvec=inverse, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(len(scale))
    values, vectors = eigsh(operator, k=1, tol=_EIGENVALUE_TOLERANCE, v0=start)
    return float(1 / values[0]), vectors[:, 0] / scale


@dataclass(frozen=True)
class _Residuals:
    """What is left of the equations when fields are put in, without unit.

    ``equilibrium``: force or moment on a brick over the largest sum of magnitudes on one;
    ``joints``: wrench less stiffness times deformation, over the magnitudes in it or at least a
    brick's weight; ``grips``: between a held node and its grip, over the largest motion of any
    brick, or at least what a brick's weight does to the stiffest joint.
    """

    equilibrium: float
    joints: float
    grips: float

    @property
    def backward_error(self) -> float:
        """The largest of the three."""
        return max(self.equilibrium, self.joints, self.grips)


def residual(
    network: Network, bricks: int, columns: Ints, fields: Fields, compliance: GripCompliance = RIGID
) -> _Residuals:
    """Return the residuals of the first grip set's fields, from the network alone."""
    springs, center = network.springs, network.centroid[:bricks]
    acting = springs.acting(bricks)
    bodies, at, axes = springs.bodies[acting], springs.position[acting], springs.axes[acting]
    raw = springs.stiffness[acting]
    wrench, twist = fields.joint_wrench[0, acting], fields.brick_twist[0]
    gap, moved = np.zeros_like(wrench), np.zeros_like(wrench)
    ends = []
    for side, sign in ((0, -1.0), (1, 1.0)):
        there = np.flatnonzero(bodies[:, side] != GROUND)
        body = bodies[there, side]
        ends.append((there, body, sign))
        parts = _moved(twist[body], at[there] - center[body])
        gap[there] += sign * parts.sum(axis=0)
        moved[there] += np.abs(parts).sum(axis=0)
    ground = _ground_motion(network)[acting]
    gap, moved = gap - ground, moved + np.abs(ground)
    own = np.einsum("sij,shj->shi", axes, gap.reshape(-1, 2, 3)) * raw.reshape(-1, 2, 3)
    law = np.einsum("sij,shi->shj", axes, own).reshape(-1, 6)  # stiffness times deformation
    size = raw.reshape(-1, 2, 3).max(axis=2)[:, :, None]
    scale = (size * moved.reshape(-1, 2, 3) + np.abs(wrench).reshape(-1, 2, 3)).max(axis=2)
    heavy, least = _beside_weight(network, bricks, raw)
    apart = np.abs(wrench + law).reshape(-1, 2, 3).max(axis=2)
    node = network.node_position[network.inner[:bricks].ravel()]
    owner = columns // 2
    grip = np.hstack([fields.grip_force[0], fields.grip_moment[0]])
    still = _moved(twist[owner], node[columns] - center[owner]).sum(axis=0)
    still = _off_grips(still, grip, compliance)
    every = np.repeat(np.arange(bricks), 2)
    motion = np.abs(_moved(twist[every], node - center[every])[:, :, :3]).sum(axis=0).max()
    dead = np.hstack([network.weight[:bricks], np.zeros((bricks, 3))])
    outside = [(np.arange(bricks), center, dead), (owner, node[columns], grip)]
    outside += _loads(network, bricks)
    inside = [(body, at[there], sign * wrench[there]) for there, body, sign in ends]
    left = _balance(center, [*inside, *outside])
    rest, most = (np.abs(part).reshape(-1, 2, 3).max(axis=(0, 2)) for part in left)
    return _Residuals(
        equilibrium=float((rest / np.maximum(most, np.finfo(float).tiny)).max()),
        joints=float((apart / np.maximum(scale, heavy)).max()),
        grips=float(np.abs(still).max(initial=0.0) / max(motion, least)),
    )


def _off_grips(moved: Floats, borne: Floats, compliance: GripCompliance) -> Floats:
    """Return how far nodes are from where their grips let them be (r, n), m, turns over a lever.

    ``moved``, ``borne`` (r, 6): how nodes shift and turn, what grips exert on them.
    """
    if compliance.rigid:
        return moved[:, :3]
    out = moved * np.repeat([1.0, compliance.lever], 3)
    bears = borne / np.repeat([1.0, compliance.lever], 3)
    if compliance.moved is not None:
        out[:, :3] -= compliance.moved[0]
    if compliance.matrix is not None:
        flexibility = compliance.transmitted[0]
        ways = flexibility.shape[2]
        out[:, :ways] += np.einsum("rij,rj->ri", flexibility, bears[:, :ways])
    out[~compliance.transmits(len(moved)), 3:] = 0.0
    return np.asarray(out)


def _beside_weight(network: Network, bricks: int, stiffness: Floats) -> tuple[Floats, float]:
    """Return scales: weight of a brick, its moment over a brick's length, its displacement, m."""
    tiny = np.finfo(float).tiny
    heavy = float(np.linalg.norm(network.weight[:bricks], axis=1).max())
    ends = network.node_position[network.inner[:bricks]]
    longest = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
    moved = heavy / max(stiffness[:, :3].max(initial=0.0), tiny)
    return np.maximum([heavy, heavy * longest], tiny), max(moved, tiny)


def _ground_motion(network: Network) -> Floats:
    """Return how the ground moves at every spring, (S, 6)."""
    out = np.zeros((len(network.springs.since), 6))
    for spring, ground in zip(network.springs.support, network.scene.grounds, strict=True):
        if ground.movement is not None:
            shift, turn = np.array(ground.movement).reshape(2, 3)
            arm = np.subtract(ground.position, ground.anchor)
            out[spring] = *(shift + np.cross(turn, arm)), *turn
    return out


def _loads(network: Network, bricks: int) -> list[_Pull]:
    """Return the loads on bricks beside their weight, if any."""
    scene, out = network.scene, []
    pulls = [
        (load.brick, load.position, load.force)
        for load in scene.loads
        if max(scene.since[load.brick], scene.since[load.starts_with]) <= bricks
    ]
    size = np.linalg.norm(scene.gravity)
    if any(scene.wind):
        blown = np.array(scene.wind) * size
        pulls += [(brick.name, None, blown * brick.mass) for brick in scene.placed[:bricks]]
    for name, position, force in pulls:
        brick = scene.since[name] - 1
        point = network.centroid[brick] if position is None else np.array(position)
        out.append((np.array([brick]), point[None], np.append(force, np.zeros(3))[None]))
    return out


def _moved(twist: Floats, arm: Floats) -> Floats:
    """Return motions (2, n, 6) at an arm by translation and rotation of two bricks."""
    zero = np.zeros_like(arm)
    turning = np.hstack([np.cross(twist[:, 3:], arm), twist[:, 3:]])
    return np.stack([np.hstack([twist[:, :3], zero]), turning])


def _balance(center: Floats, pulls: list[_Pull]) -> tuple[Floats, Floats]:
    """Return the sums (b, 6) of wrenches on every brick about its centroid, and of magnitudes."""
    total, size = np.zeros((2, len(center), 6))
    for body, point, wrench in pulls:
        turn = np.hstack([np.zeros_like(point), np.cross(point - center[body], wrench[:, :3])])
        np.add.at(total, body, wrench + turn)
        np.add.at(size, body, np.abs(wrench) + np.abs(turn))
    return total, size


class Finding(Enum):
    """What a diagnosis says."""

    SOLVED_WELL = "SOLVED WELL"
    ILL_CONDITIONED = "ILL-CONDITIONED"
    MECHANISM = "MECHANISM"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(FrozenValue):
    """The diagnosis of one grip set on one partial structure.

    Attributes
    ----------
    finding : Finding
    reason : str
    residuals : Residuals or None
        None if the engine refused.
    smallest_eigenvalue : float
        Of the constrained stiffness scaled by its diagonal, without unit; 0 of a mechanism.
    condition : float
        Largest over smallest scaled eigenvalue.
    mode : (b, 6) float
        The motion that is resisted least: translation of every brick's centroid over the length of
        the longest brick's inner edge, and rotation; the largest component is 1.
    """

    finding: Finding
    reason: str
    residuals: _Residuals | None
    smallest_eigenvalue: float
    condition: float
    mode: Floats

    @property
    def backward_error(self) -> float:
        """Largest residual; infinite if the engine refused."""
        return np.inf if self.residuals is None else self.residuals.backward_error


def diagnose(
    source: Engine | Network, bricks: int, grips: ArrayLike, moved: ArrayLike | None = None
) -> Diagnosis:
    """Return whether one grip set is solved well, ill-conditioned or a mechanism.

    Parameters
    ----------
    source : Engine or Network
        The engine whose fields are judged; of a network, the mixed solution is.
    bricks : int
        How many bricks stand.
    grips : (r,) int
        Node numbers.
    moved : (r, 3) float, optional
        How far each grip is from where it should be, m, as engines take it.

    Returns
    -------
    Diagnosis

    Raises
    ------
    GripError
        If the grips are not those of a grip set.
    """
    network = source if isinstance(source, Network) else source.network
    numbers = np.array(grips, dtype=np.int64).reshape(1, -1)
    columns = grip_columns(network, bricks, numbers)
    far = None if moved is None else np.array(moved, dtype=float)[None]
    compliance = read_compliance(network, columns, numbers, far)
    lowest, condition, mode = _spectrum(network, bricks, columns[0], compliance)
    free = free_motion(network, bricks, columns[0], compliance) if lowest < _LOOKED_INTO else None
    if free is not None:
        lowest, condition, mode = 0.0, np.inf, free
    residuals, refusal = None, None
    try:
        if isinstance(source, Network):
            fields = solve_mixed(network, bricks, columns, compliance)
        elif far is None:
            fields = source.solve(bricks, numbers, Want.JOINTS | Want.BRICKS)
        else:
            fields = source.solve(bricks, numbers, Want.JOINTS | Want.BRICKS, far)
        residuals = residual(network, bricks, columns[0], fields, compliance)
    except (MechanismError, SolverError) as error:
        refusal = error
    rest = np.inf if residuals is None else residuals.backward_error
    finding = Finding.SOLVED_WELL if rest <= WELL else Finding.ILL_CONDITIONED
    most = f"{'at most' if rest <= WELL else 'above'} {WELL:g}"
    reason = f"backward error {rest:.1e}, {most}, at a condition of {condition:.1e}"
    reason += ": the fields do not solve the equations" if rest > WELL else ""
    if not lowest:
        finding, reason = Finding.MECHANISM, "neither joints nor ground nor grips resist the motion"
    elif residuals is None:
        reason = f"condition {condition:.1e}; the engine refused: {refusal}"
    return Diagnosis(finding, reason, residuals, lowest, condition, mode)
