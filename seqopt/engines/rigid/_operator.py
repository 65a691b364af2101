"""The compliance operator: how one partial structure answers forces at its inner nodes.

The operators of all brick counts come from what grows with the build. From one follow the equations
of many grip sets at once: which forces hold the grips still. Two grips may share a brick: between
them along it, rigid ones leave a force undetermined, which `share_pairs` gives to the node that it
reaches. The compliance of compliant grips is added to the equations; where two that are nearly
rigid share a brick, digits are lost (`nearly_rigid`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import prod
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from seqopt.arrays import Bools, Floats, FrozenValue, Ints, frozen
from seqopt.engines.interface import RIGID, SHAPES, GripCompliance, _counts_of_fields
from seqopt.engines.rigid._growth import Growth, SpanningTree
from seqopt.network._mechanics import build_statics, node_motion, point_motion
from seqopt.network.network import Network

AT_ONCE = 2**18  # numbers mapped at a time: they stay in the processor's cache
_Number = TypeVar("_Number", np.float64, np.int64)
_OF_TWISTS = ("displacement", "brick_twist")  # the other fields follow from wrenches
_FEW = 200  # loads whose responses take little, and are always made once for all
_CLOSE = 1e-4  # flexibility of two grips on one brick, over its own, below which digits are lost


@dataclass(frozen=True, eq=False, repr=False)
class SceneMaps(FrozenValue):
    """What twists and wrenches of all bricks and springs of a scene mean, once all springs act.

    ``edge`` (E, 6S): what edges carry of wrenches. ``motion`` (3N, 6B): how twists move nodes.
    ``since`` (m,): of the entries of ``motion``, from which brick count on they hold; before, where
    its spring does not act yet, a joint node follows the brick that is there alone. ``support`` (G,
    6, 6): force and moment at every ground end for the wrench of its spring.
    """

    network: Network
    edge: sparse.csr_array
    motion: sparse.csr_array
    since: Ints
    support: Floats


def scene_maps(network: Network) -> SceneMaps:
    """Return the maps of a scene."""
    statics, springs = build_statics(network), network.springs
    every = sparse.eye_array(len(springs.since))
    motion = node_motion(network, len(network.inner))
    edge = sparse.csr_array(statics.edge_of_spring @ sparse.kron(every, np.eye(3, 6)))
    of_node = np.where(network.node_spring >= 0, springs.since[network.node_spring], 0)
    since = np.repeat(np.repeat(of_node, 3), np.diff(motion.indptr))
    return SceneMaps(network, edge, motion, since, statics.support_of_spring.transpose(0, 2, 1))


@dataclass(frozen=True, eq=False, repr=False)
class ResponseMaps(FrozenValue):
    """What twists (.., 6b) and wrenches (.., 6s) of the first b bricks and s springs mean."""

    scene: SceneMaps
    bricks: int  # how many stand

    @cached_property
    def ground(self) -> Floats:
        """How nodes move with the ground alone, (3n,), m."""
        return frozen(self.scene.network.ground_motion(self.bricks).ravel())

    @cached_property
    def inner(self) -> tuple[Ints, Floats, Floats]:
        """The inner edges of bricks (b,), unit vectors along them (b, 3), and what pulls there.

        That is the weight on their second nodes, with that of loads, along the edge (b,), N.
        """
        network = self.scene.network
        edge = np.flatnonzero(network.edge_spring[: network.count_edges(self.bricks)] < 0)
        axis = network.edge_axis[edge]
        pull = np.einsum("bi,bi->b", axis, network.inner_load(self.bricks)[1::2])
        return frozen((edge, axis, pull))

    @cached_property
    def edge(self) -> sparse.csr_array:
        """What edges carry of wrenches, (E, 6s)."""
        network = self.scene.network
        acting = int(np.searchsorted(network.springs.since, self.bricks, side="right"))
        return frozen(self.scene.edge[: network.count_edges(self.bricks), : 6 * acting])

    @cached_property
    def motion(self) -> sparse.csr_array:
        """How twists move nodes, (3n, 6b)."""
        every, bricks = self.scene.motion, self.bricks
        first = every.indptr[: 3 * self.scene.network.count_nodes(bricks) + 1]
        at, moved = every.indices[: first[-1]], every.data[: first[-1]]
        there = at < 6 * bricks
        moved = moved * there * np.where(self.scene.since[: first[-1]] > bricks, 2.0, 1.0)
        entries = moved, at * there, first
        return frozen(sparse.csr_array(entries, shape=(len(first) - 1, 6 * bricks)))

    def count(self, name: str) -> int:
        """Return how many numbers a field has."""
        return _counts_of_fields(self.scene.network, self.bricks)[name] * prod(SHAPES[name])

    def apply(self, name: str, states: Floats, out: Floats | None = None) -> Floats:
        """Return a field of states, edge forces without those of loads on the inner edges.

        ``states`` (S, n): wrenches, or twists of displacements and brick twists; ``out`` (S, Q).
        """
        out = np.empty((len(states), self.count(name))) if out is None else out
        if name == "support":
            for g, spring in enumerate(self.scene.network.springs.support.tolist()):
                mine = states[:, 6 * spring : 6 * spring + 6]
                there = mine.shape[1] > 0  # else it does not act
                out[:, 6 * g : 6 * g + 6] = mine @ self.scene.support[g] if there else 0.0
        elif name in ("joint_wrench", "brick_twist"):
            out[:, states.shape[1] :] = 0.0
            out[:, : states.shape[1]] = states
        else:
            maps = self.edge if name == "edge_force" else self.motion
            step = max(16, AT_ONCE // max(1, *maps.shape))
            for start in range(0, len(states), step):
                part = slice(start, start + step)
                out[part] = (maps @ states[part].T).T
        return out


@dataclass(frozen=True, eq=False, repr=False)
class Doubts(FrozenValue):
    """Error bounds of rounding, (l,): by a load's own flexibility, the weight, and lost digits."""

    flexibility: Floats
    dead: Floats
    loss: Floats

    @cached_property
    def shares(self) -> Floats:
        """Roots of flexibilities, share of the weight, and factors to forces; (3, l)."""
        own = np.maximum(np.abs(self.flexibility), np.finfo(float).tiny)
        root = np.sqrt(own * self.loss)
        return frozen(np.stack([root, np.abs(self.dead) * self.loss / root, root / own]))


@dataclass(frozen=True, eq=False, repr=False)
class ComplianceOperator(FrozenValue):
    """What loads on a partial structure of b bricks move and stress; rows of arrays are loads.

    Row ``3m + i`` is a unit force in direction ``i`` at the ``m``-th inner node (`Network.inner`)
    of the h bricks that are loaded, l = 6h loads in all. Where grips transmit moments, those on a
    brick, over a lever, follow the forces at its nodes, and what they move are rotations times the
    lever: see `load_rows`. One more row at the end of all but the first two arrays is the weight of
    the b bricks, with what else loads them and how the ground moves.

    ``held`` (h,): the bricks that are loaded, ascending. ``flexibility`` (l, l): displacements of
    their inner nodes, m/N. ``dead_displacement`` (l,): displacements of these under the weight with
    no grip, m. ``twist`` (l + 1, 6b): of the bricks. ``wrench`` (l + 1, 6s): of
    the s springs that act on their second bodies. ``maps``: what these mean.
    ``loss`` (l,): how many last digits of the flexibility of each load are rounding.
    ``loose``: how many loose motions come after the loads, as further rows and unknowns; see
    `seqopt.engines.rigid._refinement`. ``softness``: of the springs that they stand on, m/N.
    """

    held: Ints
    flexibility: Floats
    dead_displacement: Floats
    twist: Floats
    wrench: Floats
    maps: ResponseMaps
    loss: Floats
    loose: int = 0
    softness: float = 0.0
    moments: int = 0  # of each brick that is loaded

    @property
    def width(self) -> int:
        """How many unknowns each grip has: forces, and then moments."""
        return 3 + self.moments

    def by_grip(self, force: NDArray[_Number]) -> NDArray[_Number]:
        """Return a view (S, r, w) of unknowns (S, k), or their loads, without loose motions."""
        own = force[:, : force.shape[1] - self.loose]
        return own.reshape(len(force), own.shape[1] // self.width, self.width)

    @property
    def nbytes(self) -> int:
        """Bytes of the dense arrays that there are by now."""
        made = self.flexibility, self.twist, self.wrench, *self._made.values()
        return sum(each.nbytes for each in made)

    @cached_property
    def place(self) -> Ints:
        """Which of the bricks that are loaded each is, (b,); -1 of one that is not."""
        out = np.full(self.maps.bricks, -1)
        out[self.held] = np.arange(len(self.held))
        return frozen(out)

    @property
    def inner(self) -> tuple[Ints, Floats]:
        """The inner edges of bricks (b,), and unit vectors along them (b, 3)."""
        return self.maps.inner[:2]

    @cached_property
    def across(self) -> Floats:
        """Unit vectors from each inner node to the other of its brick, (2b, d)."""
        axis = self.inner[1]
        return frozen(np.stack([axis, -axis], axis=1).reshape(-1, 3))

    @cached_property
    def doubts(self) -> Doubts:
        """What rounding may leave of the answers to its loads."""
        own = np.arange(len(self.flexibility))
        diagonal = self.flexibility[own, own % self.flexibility.shape[1]]
        return Doubts(diagonal, self.dead_displacement, self.loss)

    def load_index(self, columns: Ints) -> Ints:
        """Return which loads act at every grip, and after them all loose motions, (S, k)."""
        rows = load_rows(2 * self.place.take(columns // 2) + columns % 2, self.moments)
        if self.loose:
            after = len(self.flexibility) - self.loose + np.arange(self.loose)
            rows = np.hstack([rows, np.tile(after, (len(rows), 1))])
        return rows

    def weight_rows(self, index: Ints) -> Ints | int:
        """Return which row is the weight, of sets with loads (S, k)."""
        return len(self.twist) - 1

    def loads(self, index: Ints, force: Floats, weight: float = 1.0) -> sparse.csr_array:
        """Return forces (S, k) at loads (S, k) and a share of the weight as a matrix (S, l + 1)."""
        (sets, loads), count = index.shape, len(self.twist)
        rows, share = np.empty((sets, loads + 1), dtype=np.int32), np.empty((sets, loads + 1))
        rows[:, :-1], share[:, :-1] = index, force
        rows[:, -1], share[:, -1] = self.weight_rows(index), weight
        first = np.arange(0, rows.size + 1, loads + 1, dtype=np.int32)
        return sparse.csr_array((share.ravel(), rows.ravel(), first), shape=(sets, count))

    def answers(self, names: Sequence[str], index: Ints, force: Floats) -> dict[str, Floats]:
        """Return fields (S, Q) of sets of forces beside the weight.

        Where there are fewer sets than loads of all bricks, their twists and wrenches are summed
        and mapped; else those of the loads are mapped, once, and then summed. So are reactions,
        which few of the wrenches determine.
        """
        few = are_few(3 * self.maps.bricks, len(index))  # independent of earlier requests
        loads = self.loads(index, force)
        return {
            name: np.asarray(loads @ self.of_loads(name))
            if few or name == "support"
            else self._mapped(name, index, force)
            for name in names
        }

    def _mapped(self, name: str, index: Ints, force: Floats) -> Floats:
        """Return a field of sets whose twists and wrenches are summed first."""
        states = self.twist if name in _OF_TWISTS else self.wrench
        out = np.empty((len(index), self.maps.count(name)))
        step = max(16, AT_ONCE // states.shape[1])
        for start in range(0, len(index), step):
            part = slice(start, start + step)
            self.maps.apply(name, self.loads(index[part], force[part]) @ states, out[part])
        if name == "displacement" and self.maps.ground.any():
            out += self.maps.ground
        if name == "edge_force":  # of inner edges: the weight's and the grips' at second nodes too
            edge, axis, pull = self.maps.inner
            out[:, edge] += pull
            place, at = np.divmod(self.by_grip(index)[..., 0], 6 + self.moments)
            brick = self.held[place]
            given = self.by_grip(force)[..., :3]
            along = np.einsum("snd,snd->sn", given, axis[brick]) * (at // 3)
            for i in range(brick.shape[1]):  # two may share an edge
                out[np.arange(len(index)), edge[brick[:, i]]] += along[:, i]
        return out

    def of_loads(self, name: str, *, keep: bool = True) -> Floats:
        """Return a field under every load, (l + 1, Q); kept from when it is first asked for."""
        if name in self._made:
            return self._made[name]
        out = self.maps.apply(name, self.twist if name in _OF_TWISTS else self.wrench)
        if name == "edge_force":
            edge, axis, pull = self.maps.inner
            out[-1, edge] += pull
            each = 6 + self.moments
            rows = each * np.arange(len(self.held))[:, None] + np.arange(3, 6)
            out[rows, edge[self.held][:, None]] += axis[self.held]
        if name == "displacement":
            out[-1] += self.maps.ground
        if keep:
            self._made[name] = frozen(out)
        return out

    @cached_property
    def _made(self) -> dict[str, Floats]:
        return {}


def are_few(unknowns: int, sets: int) -> bool:
    """Return whether loads are few beside grip sets; ``unknowns``: bricks times directions."""
    return 2 * unknowns <= max(_FEW, sets)


def load_rows(nodes: Ints, moments: int) -> Ints:
    """Return the loads (S, rw) at nodes (S, r): the forces at each, then the moments on its brick.

    ``nodes``: as indices into inner nodes of the loaded bricks; ``moments``: of a brick, 3 or 0.
    """
    first = ((6 + moments) * (nodes // 2))[..., None]
    rows = first + 3 * (nodes % 2)[..., None] + np.arange(3)
    if moments:
        rows = np.concatenate([rows, first + np.arange(6, 9)], axis=2)
    return np.asarray(rows.reshape(len(nodes), nodes.shape[1] * (3 + moments)))


class OperatorBuilder:
    """Makes the operator of any brick count of a tree from data that grow with it."""

    def __init__(self, network: Network, tree: SpanningTree) -> None:
        self.network, self.growth = network, Growth(network, tree)
        self.maps = scene_maps(network)
        count, self.moments = len(network.inner), 3 if network.scene.grip_kinds.turns.any() else 0
        arms = network.node_position[network.inner] - network.centroid[:count, None]
        self.nodes = point_motion(arms).reshape(count, 6, 6)
        if self.moments:
            turned = network.lever * np.eye(6)[3:]
            every = np.broadcast_to(turned, (count, 3, 6))
            self.nodes = np.concatenate([self.nodes, every], axis=1)

    def operator(self, bricks: int, held: Ints | None = None) -> ComplianceOperator:
        """Return the operator of at most the tree's bricks; loads act on bricks (h,), or on all."""
        held = np.arange(bricks) if held is None else np.asarray(held)
        which = slice(bricks) if len(held) == bricks else held
        nodes = self.nodes[which]
        k, loads = nodes.shape[2], nodes.shape[0] * nodes.shape[1]
        moved, carried, loss = self.growth.answers(bricks, held)
        twist, wrench = _at_nodes(nodes, moved), _at_nodes(nodes, carried)
        turned = twist.reshape(len(twist), bricks, k)[:, which].transpose(1, 0, 2)
        at_nodes = np.empty((len(twist), *nodes.shape[:2]))  # displacements
        np.matmul(turned, nodes.swapaxes(1, 2), out=at_nodes.transpose(1, 0, 2))
        moved = at_nodes.reshape(len(twist), loads)
        return ComplianceOperator(
            held=held,
            flexibility=moved[:-1],
            dead_displacement=moved[-1],
            twist=twist,
            wrench=wrench,
            maps=ResponseMaps(self.maps, bricks),
            loss=np.repeat(loss, nodes.shape[1]),
            moments=self.moments,
        )


def _at_nodes(nodes: Floats, answers: Floats) -> Floats:
    """Return answers (hw + 1, n) to loads at nodes (h, w, k), weight last, from those on bricks."""
    (h, w, k), width = nodes.shape, answers.shape[1]
    out = np.empty((h * w + 1, width))
    np.matmul(nodes, answers[1:].reshape(h, k, width), out=out[:-1].reshape(h, w, width))
    out[-1] = answers[0]
    return out


class Pairs(NamedTuple):
    """Two grips on one brick.

    ``sets``, ``first``, ``second``, ``brick`` (p,): the grip set, which two of its grips, and the
    brick; ``axis`` (p, 3): unit vectors from the first grip to the second.
    """

    sets: Ints
    first: Ints
    second: Ints
    brick: Ints
    axis: Floats

    def only(self, which: Bools) -> Pairs:
        """Select pairs."""
        sets, first, second, brick, axis = self
        return Pairs(sets[which], first[which], second[which], brick[which], axis[which])

    def rigid(self, compliance: GripCompliance, sets: int, grips: int) -> Bools:
        """Return which pairs (p,) have two rigid grips, in so many sets."""
        yields = compliance.compliant(sets, grips)
        return np.asarray(~yields[self.sets, self.first] & ~yields[self.sets, self.second])


def pairs_of(across: Floats, columns: Ints) -> Pairs:
    """Return all pairs of grips of the sets that share a brick.

    ``across`` (2b, 3): unit vectors from each inner node to the other of its brick.
    """
    couples = np.array(np.triu_indices(columns.shape[1], 1))
    one, other = columns.T.take(couples, axis=0)
    same = one ^ 1 == other  # the two nodes of a brick
    if not np.count_nonzero(same):
        none = np.empty(0, dtype=np.int64)
        return Pairs(none, none, none, none, np.empty((0, 3)))
    couple, sets = same.nonzero()
    node, (first, second) = one[same], couples.take(couple, axis=1)
    return Pairs(sets, first, second, node // 2, across.take(node, axis=0))


def as_rows(each: Floats) -> Floats:
    """Return numbers of grips (S, r, w) as rows (k, S) of unknowns, loose motions left out."""
    return np.ascontiguousarray(each.reshape(len(each), each.shape[1] * each.shape[2]).T)


def solve_positive(system: Floats, negative: int = 0, scale: float = 1.0) -> tuple[Floats, Floats]:
    """Solve S positive definite systems of k unknowns in place, the batch along the last axis.

    Up to three times as fast as ``numpy.linalg.solve`` for a thousand 9 x 9 systems, which calls
    LAPACK once for each.

    ``system`` (k + 1, k, S): the matrices, of which only the lower triangles are read, and the
    loads as a last row. Overwritten; ``negative``: how many unknowns at the end are those of a
    saddle: what is left of their equations, when the others are eliminated, is negative definite;
    ``scale``: what their pivots are measured against. Results: ``answer`` (k, S): not finite where
    a matrix is not definite; ``pivot`` (k, S): pivots over their diagonal entries: small where
    equations nearly repeat those before them.
    """
    size = system.shape[1]
    every = np.arange(size)
    diagonal = np.abs(system[every, every])  # a negative pivot stays negative beside it
    diagonal[size - negative :] = -scale
    pivots = np.empty_like(diagonal)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for j in range(size):
            column = system[j:, j]
            if j:
                column -= np.einsum("ips,ps->is", system[j:, :j], system[j, :j] * pivots[:j])
            pivots[j] = column[0]
            column[1:] /= pivots[j]
        answer = system[size]
        for j in range(size - 1, 0, -1):
            answer[:j] -= system[j, :j] * answer[j]
        pivots /= diagonal
    return answer, pivots


class GripForces(NamedTuple):
    """The forces of the grips of sets, and how well they are determined."""

    force: Floats  # (S, k); N
    pivot: Floats  # (k, S); the scaled pivots of the equations

    @property
    def lowest(self) -> Floats:
        """The smallest pivot of each set, (S,): one where there are no grips."""
        return np.asarray(np.minimum.reduce(self.pivot, axis=0, initial=1.0))


def grip_forces(
    operator: ComplianceOperator,
    columns: Ints,
    index: Ints,
    pairs: Pairs | None = None,
    compliance: GripCompliance = RIGID,
) -> GripForces:
    """Return the forces of grips, by which their nodes stay, or go as far as they are compliant.

    Two rigid grips on one brick leave the force between them undetermined: see `share_pairs`.
    ``index`` (S, k): the loads at the grips, from `ComplianceOperator.load_index`.
    """
    pairs = pairs_of(operator.across, columns) if pairs is None else pairs
    rows = np.ascontiguousarray(index.T)
    off = None
    if compliance.moved is not None:  # rotations are none
        off = as_rows(np.pad(-compliance.moved, ((0, 0), (0, 0), (0, operator.moments))))
    dead = operator.dead_displacement.take(rows)
    force, pivot = undone(operator, pairs, rows, dead, compliance, off)
    return GripForces(force.T, pivot)


def well_conditioned(
    doubts: Doubts,
    index: Ints,
    found: GripForces,
    most: float,
    operator: ComplianceOperator | None = None,
    compliance: GripCompliance = RIGID,
) -> Bools:
    """Return which sets' forces (S,) rounding of one part in one changes by no more than ``most``.

    Over the largest force of each. A displacement is known to a share of all that adds up in it;
    with ``|G_ij| ≤ √(G_ii G_jj)`` that is read off the diagonal. Over its pivot, which must be
    positive, it is the force that it leaves undetermined. ``operator``: of compliant grips.
    """
    size = np.abs(found.force.T)
    root, own, scale = doubts.shares.take(np.ascontiguousarray(index.T), axis=1)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        own += (root * size).sum(axis=0)
        own *= scale
        if operator is not None and not compliance.rigid:
            flexibility, nodes = root / scale, len(own) - operator.loose
            given, softer = np.zeros_like(own), np.zeros_like(own)
            if compliance.moved is not None:
                far = np.pad(np.abs(compliance.moved), ((0, 0), (0, 0), (0, operator.moments)))
                given[:nodes] += as_rows(far)
            if compliance.matrix is not None:
                parts = np.abs(compliance.transmitted)
                yielded = np.einsum("srij,srj->sri", parts, operator.by_grip(size.T))
                given[:nodes] += as_rows(yielded)
                softer[:nodes] = as_rows(np.diagonal(parts, axis1=2, axis2=3))
            own = (own * flexibility + given) / (flexibility + softer)
        own /= found.pivot
        error = own.max(axis=0, initial=0.0) / size.max(axis=0, initial=np.finfo(float).tiny)
    return np.asarray((error <= most) & (found.lowest > 0))


def share_pairs(
    operator: ComplianceOperator, index: Ints, force: Floats, carried: Floats, pairs: Pairs
) -> None:
    """Let each of two grips on one brick take the force at its own node, in place.

    Then the inner edge between them carries nothing: the limit of a stiff bar with both ends held.
    ``force`` (S, k), ``carried`` (S, E): of grips and edges, N; (S, 0): they are computed.
    """
    if not len(pairs.sets):
        return
    sets, edges = pairs.sets, operator.inner[0][pairs.brick]
    if carried.shape[1]:
        between = carried[sets, edges]
        carried[sets, edges] = 0.0
    else:
        found = operator.answers(["edge_force"], index[sets], force[sets])
        between = found["edge_force"][np.arange(len(sets)), edges]
    shift, nodes = between[:, None] * pairs.axis, operator.by_grip(force)[..., :3]
    nodes[sets, pairs.first] += shift
    nodes[sets, pairs.second] -= shift


def undone(
    operator: ComplianceOperator,
    pairs: Pairs,
    rows: Ints,
    dead: Floats,
    compliance: GripCompliance,
    off: Floats | None,
) -> tuple[Floats, Floats]:
    """Return forces at loads (k, S) that undo displacements (k, S), and scaled pivots (k, S).

    ``dead`` (k, S): m; of loose motions, the force that pulls at them, N; ``off`` (n, S): by how
    much grips already let their nodes move, where they bear something.
    """
    count, sets = rows.shape
    system = np.empty((count + 1, count, sets))
    loads = operator.flexibility.shape[1]  # of several scenarios, those of each stand apart
    entries = rows[:, None] * loads + rows % loads
    operator.flexibility.take(entries, out=system[:count], mode="clip")  # others copy once more
    np.negative(dead, out=system[-1])
    scale = 1 / operator.softness if operator.loose else 1.0
    nodes = count - operator.loose
    if compliance.matrix is not None:
        _add_compliance(system, compliance.matrix)
        pairs = pairs.only(pairs.rigid(compliance, sets, nodes // operator.width))
    if off is not None:
        system[-1, : len(off)] -= off
    brace(system[:nodes, :nodes], pairs, operator.width)
    return solve_positive(system, operator.loose, scale)


def brace(matrices: Floats, pairs: Pairs, width: int) -> None:
    """Give the force between two grips on one brick a flexibility, so that there is one answer.

    ``matrices`` (n, n, S): the sets' equations, changed in place; ``width``: unknowns of a grip.
    """
    if not len(pairs.sets):
        return
    grips, sets = len(matrices) // width, matrices.shape[2]
    blocks = matrices.reshape(grips, width, grips, width, sets)[:, :3, :, :3]
    trace = np.einsum("ririt->t", blocks)[pairs.sets]
    block = (trace[:, None] * pairs.axis)[:, :, None] * pairs.axis[:, None]
    first = np.array([pairs.first, pairs.second, pairs.second])
    second = np.array([pairs.first, pairs.second, pairs.first])
    blocks[first, :, second, :, pairs.sets] += np.array([block, block, -block])


def nearly_rigid(
    operator: ComplianceOperator, index: Ints, pairs: Pairs, compliance: GripCompliance
) -> Bools:
    """Return which sets (S,) hold a brick by two compliant grips so stiff that digits are lost.

    They share what acts along the brick by their stiffness. ``index`` (S, k): loads at the grips.
    """
    out = np.zeros(len(index), dtype=bool)
    if compliance.matrix is None or not len(pairs.sets):
        return out
    each, width = compliance.matrix, operator.width
    own = (each[pairs.sets, pairs.first] + each[pairs.sets, pairs.second])[:, :3, :3]
    along = np.einsum("pi,pij,pj->p", pairs.axis, own, pairs.axis)
    rows = index[pairs.sets[:, None], width * pairs.second[:, None] + np.arange(3)]
    brick = operator.flexibility.diagonal()[rows].mean(axis=1)
    close = (along < _CLOSE * brick) & ~pairs.rigid(compliance, *each.shape[:2])
    out[pairs.sets[close]] = True
    return out


def _add_compliance(system: Floats, matrix: Floats) -> None:
    """Add to equations, in place, the compliance (S, r, w, w) of every grip.

    Moments to which it is infinite are none.
    """
    grips, ways = matrix.shape[1:3]
    for grip in range(grips):
        first = ways * grip
        for a, b in zip(*np.tril_indices(ways), strict=True):
            own = matrix[:, grip, a, b]
            if own.any():
                system[first + a, first + b] += own
        if ways > 3 and (free := np.flatnonzero(np.isinf(matrix[:, grip, 5, 5]))).size:
            for row in range(first + 3, first + 6):
                system[row][:, free] = 0.0
                system[:, row, free] = 0.0
                system[row, row, free] = 1.0
