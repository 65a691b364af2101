r"""The reference engine: the double-cross frame with stiff bars, one sparse solve per model.

Every edge of the network is an elastic beam, every joint two equal springs in series, one at the
end of each half-edge. With the deformations :math:`B u` of beams and springs and their stiffnesses
:math:`C`, the frame solves :math:`B^T C B u = f` and improves the answer by residuals taken
through the deformations. It shares no mechanics with `seqopt.engines.rigid.compliance` and exists
to check it and to show what that generality costs.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Fields, GripCompliance, SerialEngine, grip_springs
from seqopt.engines.rigid._mixed import require_resistance
from seqopt.errors import SolverError
from seqopt.network.network import Network, PartKind
from seqopt.scene.scene import Scene

CONTRAST = 1e7  # bar over joint stiffness: softer bars bend, stiffer ones lose digits
_FEWEST, _MOST = 3, 12  # corrections; how fast they shrink, each processor decides in its own way
_LAST_FRAME_CORRECTION = 1e-6  # the largest of an accepted solution, relative to it
_SUSPICIOUS = 1e-9  # a smallest scaled eigenvalue below this, over the contrast, is looked into
_KEPT = 0.5  # share of its stiffness that the softest motion keeps in the assembled matrix
_LOOSE = 1e-12  # stiffness of a spring that has none, over the stiffest: holds its joint node


class FrameEngine(SerialEngine):
    """Solves each grip set as a frame of its own.

    Raises `SolverError` if corrections do not settle, which a lower contrast may help.
    ``contrast``: stiffness of the bars over that of the stiffest joint, in stretching and in
    bending. Low values bend the bars, high ones spoil the conditioning.
    """

    def __init__(self, network: Network | Scene, contrast: float = CONTRAST) -> None:
        super().__init__(network)
        self._contrast = contrast

    def _answer(self, bricks: int, columns: Ints, compliance: GripCompliance) -> Fields:
        network, contrast = self.network, self._contrast
        edges, nodes = network.count_edges(bricks), network.count_nodes(bricks)
        split, deformation, stiffness = _frame(network, bricks, contrast)
        grips = _hold(network, columns, compliance, deformation.shape[1])
        load = _loads(network, bricks, deformation.shape[1] // 6)
        held = network.inner.ravel()[columns]
        base = np.flatnonzero(network.node_kind[:nodes] == PartKind.BASE.value)
        free = np.ones(load.shape, dtype=bool)
        free[base] = False
        free.ravel()[grips.fixed] = False
        ends, still = network.springs.support.tolist(), np.zeros(load.shape)
        for node in base:
            ground = network.scene.grounds[ends.index(network.node_spring[node])]
            still[node] = ground.movement or 0.0
        unknown, motion = np.flatnonzero(free), still.ravel()
        motion[grips.fixed] = grips.moved
        whole = sparse.csr_array(sparse.vstack([deformation, grips.spring]))
        every = np.concatenate([stiffness, grips.stiffness])
        reduced, strain = whole[:, unknown], whole @ motion
        strain[len(stiffness) :] -= grips.stretched
        examine = partial(require_resistance, network, bricks, columns, compliance)
        pull = load.ravel()[unknown]
        motion[unknown] = _solve(reduced, every, pull, strain, contrast, examine)
        stress = stiffness * (deformation @ motion)
        reaction = (deformation.T @ stress).reshape(load.shape) - load
        springs, which = network.springs, network.edge_spring[split]
        of_end = network.node_spring[base] == springs.support[:, None]  # (G, base nodes)
        mine = network.edge_brick[split] == springs.bodies[which, 1]
        mine &= springs.since[which] <= bricks
        halves, own = stress[-6 * len(split) :].reshape(2, len(split), 3)[:, mine], which[mine]
        wrench = np.zeros((len(springs.since), 6))
        wrench[own] = -np.einsum("hsk,ski->shi", halves, springs.axes[own]).reshape(-1, 6)
        shift = motion.reshape(load.shape)
        return Fields(
            edge_force=stress[None, :edges],
            displacement=shift[None, :nodes, :3],
            grip_force=reaction[None, held, :3],
            grip_moment=np.where(grips.turns[:, None], reaction[held, 3:], 0.0)[None],
            support=(of_end @ reaction[base])[None],
            joint_wrench=wrench[None],
            brick_twist=shift[network.inner[:bricks]].mean(axis=1)[None],
        )


def _loads(network: Network, bricks: int, nodes: int) -> Floats:
    """Return the loads (n, 6) of a frame: weight, and what else pulls at bricks."""
    load, both = np.zeros((nodes, 6)), network.inner[:bricks]
    load[both.ravel(), :3] = network.inner_weight[: 2 * bricks]
    applied = network.applied(bricks)
    arm = network.centroid[:bricks] - network.node_position[both].mean(axis=1)
    applied[:, 3:] += np.cross(arm, applied[:, :3])
    load[both] += 0.5 * applied[:, None]
    return load


class _Holds(NamedTuple):
    """How grips hold a frame."""

    fixed: Ints  # (f,); motions (6n,) that rigid grips prescribe
    moved: Floats  # (f,); by how much, m
    spring: sparse.csr_array  # (p, 6n); deformations of compliant grips
    stiffness: Floats  # (p,)
    stretched: Floats  # (p,); of these, where the nodes are in place
    turns: Bools  # (r,); which bear moments


def _hold(network: Network, columns: Ints, compliance: GripCompliance, size: int) -> _Holds:
    """Return how the grips of one set hold a frame with as many motions."""
    grips, at = len(columns), 6 * network.inner.ravel()[columns][:, None] + np.arange(6)
    rigid, turns = ~compliance.compliant(1, grips)[0], compliance.transmits(grips)
    spring: list[Floats] = [np.zeros((0, size))]
    stiffness: list[float] = []
    stretched: list[float] = []
    for grip, ways, flexibility, offset in grip_springs(compliance, grips):
        values, axes = np.linalg.eigh(flexibility)
        own = np.zeros((len(ways), size))
        own[:, at[grip, ways]] = axes.T
        spring.append(own)
        stiffness += (1 / values).tolist()
        stretched += (axes.T @ offset).tolist()
    rows = sparse.csr_array(np.vstack(spring))
    moved = compliance.offsets(grips)[rigid].ravel()
    fixed = at[rigid, :3].ravel()
    return _Holds(fixed, moved, rows, np.array(stiffness), np.array(stretched), turns)


def _frame(network: Network, bricks: int, contrast: float) -> tuple[Ints, sparse.csr_array, Floats]:
    """Return the frame of a partial structure: beams along the edges, springs at the joints.

    An edge that meets a joint ends in a frame node of its own, numbered after the network's.
    Results: these edges; deformations (R, 6n) of n frame nodes, of the edges first, of the half
    joints last: all translations, then all rotations; their stiffnesses (R,).
    """
    edges, nodes = network.count_edges(bricks), network.count_nodes(bricks)
    springs, kind = network.springs, network.edge_kind[:edges]
    split = np.flatnonzero(kind != PartKind.INNER.value)
    which = network.edge_spring[split]
    total = nodes + len(split)
    own_node, ends = np.arange(nodes, total), network.edge_nodes[:edges].copy()
    ends[split, np.where(kind[split] == PartKind.BASE.value, 0, 1)] = own_node
    pairs = np.stack([springs.node[which], own_node], axis=1)
    stretch = contrast * springs.translational_stiffness.max()  # EA / L
    bend = contrast * springs.rotational_stiffness.max()  # EI / L = GJ / L
    zero, turn = np.zeros_like(springs.axes[which]), springs.axes[which]
    beams, beam_stiffness = _beams(network, edges, stretch, bend)
    parts = [
        *((ends, first, second) for first, second in beams),
        (pairs, np.dstack([-turn, zero]), np.dstack([turn, zero])),
        (pairs, np.dstack([zero, -turn]), np.dstack([zero, turn])),
    ]
    kinds = springs.translational_stiffness, springs.rotational_stiffness
    own = [2 * np.maximum(k[which], _LOOSE * k.max()).ravel() for k in kinds]
    rows = []
    for nodes_of, first, second in parts:
        blocks = np.stack([first, second], axis=2)  # (M, k, 2, 6)
        row = np.arange(blocks.shape[0] * blocks.shape[1]).reshape(*blocks.shape[:2], 1, 1)
        column = 6 * nodes_of[:, None, :, None] + np.arange(6)
        index = tuple(np.broadcast_to(i, blocks.shape).ravel() for i in (row, column))
        rows.append(sparse.coo_array((blocks.ravel(), index), shape=(row.size, 6 * total)))
    return split, sparse.vstack(rows).tocsr(), np.concatenate([beam_stiffness, *own])


def _beams(
    network: Network, edges: int, stretch: float, bend: float
) -> tuple[list[tuple[Floats, Floats]], Floats]:
    """Return the natural deformations of the beams at both ends (E, k, 6) and their stiffnesses.

    Stretch; relative rotation; sum of the rotations across the axis less twice the chord's. Their
    stiffnesses EA/L, EI/L and 3 EI/L are those of an Euler-Bernoulli beam with GJ = EI.
    """
    axis = network.edge_axis[:edges]
    step = np.diff(network.node_position[network.edge_nodes[:edges]], axis=1)[:, 0]
    length = np.linalg.norm(step, axis=1)
    along = axis[:, None, :]
    none, turn = np.zeros((edges, 3, 3)), np.broadcast_to(np.eye(3), (edges, 3, 3))
    across = turn - axis[:, :, None] * along
    chord = np.cross(axis[:, None, :], np.eye(3)).transpose(0, 2, 1) * (2 / length)[:, None, None]
    modes = [
        (np.dstack([-along, none[:, :1]]), np.dstack([along, none[:, :1]])),
        (np.dstack([none, -turn]), np.dstack([none, turn])),
        (np.dstack([chord, across]), np.dstack([-chord, across])),
    ]
    return modes, np.repeat([stretch, bend, 3 * bend], [edges, 3 * edges, 3 * edges])


def _solve(
    maps: sparse.csr_array,
    stiffness: Floats,
    pull: Floats,
    strain: Floats,
    contrast: float,
    examine: Callable[[], None],
) -> Floats:
    """Return the displacements under a pull, corrected until they no longer change.

    ``maps``: to deformations; ``strain`` (R,): these where nothing moves but the ground. A matrix
    that looks singular is examined: ``examine`` raises if the structure is a mechanism.
    """
    matrix = maps.T @ sparse.diags_array(stiffness) @ maps
    scale = 1 / np.sqrt(np.maximum(matrix.diagonal(), np.finfo(float).tiny))
    scaled = (sparse.diags_array(scale) @ matrix @ sparse.diags_array(scale)).tocsc()
    failure = SolverError(
        f"frame at contrast {contrast:g}: too ill-conditioned; take the engine compliance, or in "
        "Python a lower contrast"
    )
    try:
        factor = splu(scaled, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    except RuntimeError as error:  # SuperLU met an exactly zero pivot
        examine()
        raise failure from error
    load = pull - maps.T @ (stiffness * strain)
    vector = np.random.default_rng(0).standard_normal(len(load))
    for _ in range(4):  # inverse iteration, for the smallest eigenvalue
        vector = factor.solve(vector / np.linalg.norm(vector))
    lowest = 1 / np.linalg.norm(vector)
    if lowest < _SUSPICIOUS / contrast:
        examine()
    kept = stiffness @ (maps @ (scale * vector * lowest)) ** 2 / lowest
    if kept < _KEPT:
        raise failure  # rounding has stiffened this motion: corrections would end far too early
    answer = scale * factor.solve(scale * load)
    for count in range(1, _MOST + 1):
        residual = pull - maps.T @ (stiffness * (maps @ answer + strain))
        correction = scale * factor.solve(scale * residual)
        answer += correction
        last, most = (np.abs(part / scale).max() for part in (correction, answer))
        if count >= _FEWEST and last <= min(kept, 1.0) * _LAST_FRAME_CORRECTION * most:
            return np.asarray(answer)
    raise failure
