r"""Answers of many grip sets corrected together, with one factorization per brick count.

What is left of the equations of `seqopt.engines.rigid._mixed` when an answer is put in is
answered by the system without grips, all sets as right-hand sides of one solution, and by the
grips' equations of the operator. The first correction of an answer is its error, but for the share
by which the operator itself is wrong; the next one is that share smaller.

Parts that nothing, or only something soft, ties to the rest can move by themselves: a brick that
robots alone hold, what turns about a hinge. The system of `seqopt.engines.rigid._mixed`
without grips is then singular, or nearly. Held at one brick of each such part, :math:`W u =
\alpha`, it is as good as that of a sound structure; how far the loose motions go, :math:`\alpha`,
is an unknown of each grip set beside the forces of its grips.

A loose motion stands on a spring of its own that every grip set takes away again: with the
flexibility ``G`` of the structure on these springs of softness ``s`` and the displacements ``R``
that the loose motions make, forces ``λ`` and motions ``β`` follow from ``G λ + R β = -d`` and
``Rᵀ λ - K β = -p``, where ``p`` is how the weight pulls at the motions and ``K`` how soft springs
resist them, mostly not at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.sparse.linalg import splu

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import RIGID, Fields, GripCompliance, _join_sets, _merge_sets, no_sets
from seqopt.engines.rigid._mixed import (
    LAST_CORRECTION,
    Solution,
    Ungripped,
    bordered,
    borne,
    require_resistance,
    rescaled,
    respond,
    solve_mixed,
    unchanged,
    ungripped_system,
    unscaled,
)
from seqopt.engines.rigid._operator import (
    ComplianceOperator,
    ResponseMaps,
    as_rows,
    grip_forces,
    load_rows,
    nearly_rigid,
    pairs_of,
    scene_maps,
    undone,
)
from seqopt.errors import SolverError
from seqopt.network._mechanics import point_motion
from seqopt.network.network import GROUND, Network

_NEAR = 0.1  # of the largest: a pivot that large is taken if it fills less, and corrected after
_PANEL = 4  # columns that are eliminated together: few, since each meets few others
_SOFT = 1e-7  # stiffness over the typical one below which a direction ties nothing
_TIED = 0.1  # most that what resists loose motions may be of the springs that they stand on
_TOGETHER = 256  # grip sets per pass: their unknowns stay in the processor's cache
_STEPS = 5  # corrections, after which a set is solved on its own
_HARDLY_HELD = 1e-9  # a pivot of loose motions below which they are looked into one by one


class _HeldSystem:
    """The factored system of a partial structure whose loose motions, ``loose``, are held.

    ``tied``: whether springs are known to tie every brick to the ground, however softly. Raises
    `SolverError` if it is exactly singular all the same.
    """

    def __init__(self, parts: Ungripped, *, tied: bool) -> None:
        rows = _held_motions(parts, tied=tied)
        self.parts, self.loose = parts, rows.shape[0]
        matrix, near = bordered(parts.matrix, rows), _NEAR
        try:
            # springs first, then bricks as they are built: neighbors stand near each other
            self._factors = splu(matrix, "NATURAL", diag_pivot_thresh=near, panel_size=_PANEL)
        except RuntimeError as error:  # SuperLU met an exactly zero pivot
            raise SolverError(
                f"{parts.bricks} bricks: exactly singular in double precision; stiffen what is soft"
            ) from error

    def solve(self, loads: Floats, moved: Floats | None = None) -> tuple[Floats, Floats]:
        """Return scaled states (S, 6s + 6b) and the forces (S, m) that pull at loose motions, N.

        ``loads`` (S, 6s + 6b): scaled, of the springs' equations and of equilibrium. ``moved`` (S,
        m): how far the loose motions are moved, m; nowhere by default.
        """
        size = loads.shape[1]
        whole = np.zeros((size + self.loose, len(loads)), order="F")
        whole[:size] = loads.T
        if moved is not None:
            whole[size:] = moved.T
        answer = self._factors.solve(whole).T
        return answer[:, :size], answer[:, size:] * self.parts.unit


def _held_motions(parts: Ungripped, *, tied: bool) -> sparse.csr_array:
    """Return the rows (m, 6b) whose products with scaled twists say how far loose motions go."""
    firm = parts.stiffness.reshape(-1, 6).min(axis=1) >= _SOFT
    none = sparse.csr_array((0, 6 * parts.bricks))
    if tied and firm.all():
        return none
    bodies = parts.network.springs.bodies[parts.acting[firm]]
    ends, count = np.where(bodies == GROUND, parts.bricks, bodies), parts.bricks + 1
    tied_pairs = sparse.coo_array((np.ones(len(ends)), tuple(ends.T)), shape=(count, count))
    _, group_of = csgraph.connected_components(tied_pairs, directed=False)
    loose = np.flatnonzero(group_of[:-1] != group_of[-1])  # by firm springs; the ground is last
    if not len(loose):
        return none
    _, lead, own = np.unique(group_of[loose], return_index=True, return_inverse=True)
    label, first = np.full(parts.bricks, -1), loose[lead]
    label[loose] = own
    center = parts.network.centroid[: parts.bricks]
    each = np.zeros((parts.bricks, 6, len(first), 6))  # twists where groups move as one
    for group, lead in enumerate(first):
        mine = np.flatnonzero(label == group)
        each[mine, :3, group] = point_motion(center[mine] - center[lead])
        each[mine, 3:, group, 3:] = np.eye(3)
    rigid = each.reshape(6 * parts.bricks, -1) / parts.twist_unit[:, None]
    soft = np.repeat(~firm, 6)
    strain = np.sqrt(parts.stiffness[soft])[:, None] * (parts.deformation[soft] @ rigid)
    _, sizes, modes = np.linalg.svd(strain)  # SciPy 1.12 refuses an empty matrix
    weak = np.ones(len(modes), dtype=bool)
    weak[: len(sizes)] = sizes < np.sqrt(_SOFT)
    held = (6 * first[:, None] + np.arange(6)).ravel()
    rows = sparse.lil_array((int(weak.sum()), 6 * parts.bricks))
    rows[:, held] = np.linalg.pinv((rigid @ modes[weak].T)[held])
    return sparse.csr_array(rows)


def _operator(
    parts: Ungripped, states: Floats, flexibility: Floats, softness: float, loose: int
) -> ComplianceOperator:
    """Return the operator whose loads and loose motions lead to scaled states (l + m, n).

    Its last row is the weight alone: corrections add what else there is.
    """
    network, bricks = parts.network, parts.bricks
    moments = (len(states) - loose) // bricks - 6
    weight = np.zeros(len(states))
    at = load_rows(np.arange(2 * bricks)[None], moments).reshape(2 * bricks, 3 + moments)
    weight[at[:, :3].ravel()] = network.inner_weight[: 2 * bricks].ravel()
    wrench, twist = unscaled(parts, states)
    wrench = wrench[:, parts.acting].reshape(len(states), -1)
    return ComplianceOperator(
        held=np.arange(bricks),
        flexibility=flexibility,
        dead_displacement=flexibility @ weight,
        twist=np.vstack([twist, weight @ twist]),
        wrench=np.vstack([wrench, weight @ wrench]),
        maps=ResponseMaps(scene_maps(network), bricks),
        loss=np.ones(len(states)),
        loose=loose,
        softness=softness,
        moments=moments,
    )


class Refinement:
    """Answers grip sets of one partial structure to rounding, also with loose parts.

    ``tied``: whether springs are known to tie every brick to the ground.
    """

    def __init__(self, network: Network, bricks: int, *, tied: bool = False) -> None:
        self.network, self.bricks = network, bricks
        self.parts = ungripped_system(network, bricks)
        self.held = _HeldSystem(self.parts, tied=tied)
        size = 6 * bricks
        self.inner = self.parts.inner  # loads on scaled twists, (l, 6b), as of `load_rows`
        if network.scene.grip_kinds.turns.any():
            turned = np.zeros((3 * bricks, size))
            turns = (6 * np.arange(bricks)[:, None] + np.arange(3, 6)).ravel()
            turned[np.arange(3 * bricks), turns] = network.lever
            moments = sparse.csr_array(turned * self.parts.twist_unit)
            both = sparse.vstack([self.parts.inner, moments], format="csr")
            rows = np.arange(size).reshape(-1, 6), size + np.arange(size // 2).reshape(-1, 3)
            self.inner = sparse.csr_array(both[np.hstack(rows).ravel()])

    @cached_property
    def own(self) -> ComplianceOperator:
        """Of all nodes and directions, from the factored system; loose motions are unknowns."""
        parts, loose, inner = self.parts, self.held.loose, self.inner
        joints, loads = len(parts.wrench_unit), inner.shape[0]
        right = np.zeros((loads + loose, joints + 6 * parts.bricks))
        right[:loads, joints:] = inner.toarray() / parts.unit
        states, pull = self.held.solve(right, np.eye(loads + loose, loose, -loads))
        motion = (inner @ states[:, joints:].T).T
        reach, resistance = motion[loads:], pull[loads:]
        softness = 0.0  # of the springs that loose motions stand on, m/N
        if loose:
            # about that of the structure where they reach, so that equations keep their digits; one
            # that reaches no node, as of bricks that turn about the line they lie on, counts as one
            own = np.trace(motion[:loads]) / max(float((reach**2).sum()), float(loose))
            most = _TIED / max(float(np.abs(resistance).sum()), np.finfo(float).tiny)
            softness = min(max(float(own), 1 / parts.unit), most)
        states[:loads] += softness * (reach.T @ states[loads:])
        flexibility = np.zeros((loads + loose, loads + loose))
        flexibility[:loads, :loads] = motion[:loads] + softness * (reach.T @ reach)
        flexibility[loads:, :loads], flexibility[:loads, loads:] = reach, reach.T
        corner = np.linalg.solve(np.eye(loose) - softness * resistance, resistance)
        flexibility[loads:, loads:] = -0.5 * (corner + corner.T)
        return _operator(parts, states, flexibility, softness, loose)

    def solve(
        self,
        columns: Ints,
        operator: ComplianceOperator | None = None,
        largest: float = LAST_CORRECTION,
        compliance: GripCompliance = RIGID,
    ) -> Fields:
        """Return all fields of grip sets.

        ``operator``: of these grips, if there is one; it serves if nothing is loose. ``largest``:
        correction of a set after which it needs no other, over the largest of each kind.
        """
        operator = self.own if operator is None or self.held.loose else operator
        corrector = _Corrector(self, operator, largest)
        parts = [no_sets(self.network, self.bricks, columns.shape[1])]
        for start in range(0, len(columns), _TOGETHER):
            part = slice(start, start + _TOGETHER)
            parts.append(corrector.together(columns[part], compliance.select(part)))
        return _join_sets(parts)


@dataclass(frozen=True, eq=False)
class _Corrector:
    """Corrects answers of an operator, as `Refinement.solve`."""

    system: Refinement
    operator: ComplianceOperator
    largest: float = LAST_CORRECTION

    def together(self, columns: Ints, compliance: GripCompliance = RIGID) -> Fields:
        """Return the fields of a few sets."""
        operator, parts, network = self.operator, self.system.parts, self.system.network
        index = operator.load_index(columns)
        pairs = pairs_of(operator.across, columns)
        found = grip_forces(operator, columns, index, pairs, compliance)
        if operator.loose:
            for at in np.flatnonzero(~(found.lowest >= _HARDLY_HELD)):
                mine = compliance.select(slice(at, at + 1))
                require_resistance(network, parts.bricks, columns[at], mine)
        states = self._states(index, found.force)
        force = found.force[:, : len(index.T) - operator.loose].copy()
        done = self._correct(columns, index, compliance, states, force)
        done &= ~nearly_rigid(operator, index, pairs, compliance)
        wrench, twist = unscaled(parts, states[done])
        mine = compliance.select(done)
        solution = Solution(twist, wrench, *borne(force[done], columns.shape[1], mine))
        fields = respond(network, operator.maps.motion, columns[done], solution)
        if done.all():
            return fields
        rest = compliance.select(~done)
        return _merge_sets(done, fields, solve_mixed(network, parts.bricks, columns[~done], rest))

    def _states(self, index: Ints, force: Floats, weight: float = 1.0) -> Floats:
        """Return the scaled answers (S, n) to forces (S, k) at loads, and the weight or none."""
        operator, loads = self.operator, self.operator.loads(index, force, weight)
        wrench = (loads @ operator.wrench).reshape(len(index), -1, 6)
        return rescaled(self.system.parts, wrench, loads @ operator.twist)

    def _correct(
        self, columns: Ints, index: Ints, compliance: GripCompliance, states: Floats, force: Floats
    ) -> Bools:
        """Correct answers in place until they no longer change; return which have come so far.

        ``states`` (S, n): scaled wrenches and twists; ``force`` (S, 3r): of the grips.
        """
        done = np.zeros(len(columns), dtype=bool)
        left = np.flatnonzero(np.isfinite(states).all(axis=1))
        for _ in range(_STEPS):
            if not len(left):
                break
            before, own = states[left], compliance.select(left)
            change, more = self._correction(columns[left], index[left], own, before, force[left])
            states[left] += change
            force[left] += more
            done[left] = unchanged(self.system.parts, before, change, self.largest)
            left = left[~done[left] & np.isfinite(change).all(axis=1)]
        return done

    def _correction(
        self, columns: Ints, index: Ints, compliance: GripCompliance, states: Floats, force: Floats
    ) -> tuple[Floats, Floats]:
        """Return the corrections of scaled answers (S, n) and grip forces (S, 3r)."""
        operator, system = self.operator, self.system
        parts, inner = system.parts, system.inner
        joints = len(parts.wrench_unit)
        at = load_rows(columns, operator.moments)
        load = np.zeros((len(at), inner.shape[0]))
        np.add.at(load, (np.arange(len(at))[:, None], at), force)  # a brick may be turned twice
        pulled = (inner.T @ load.T).T / parts.unit + parts.load
        missing = -parts.apply(states)
        missing[:, joints:] += pulled
        missing[:, :joints] += parts.moved
        answer, pull = system.held.solve(missing)
        moved = (inner @ (states + answer)[:, joints:].T).T
        loose = -operator.softness * pull  # how far what is missing moves loose parts
        if operator.loose:
            moved += loose @ operator.flexibility[-operator.loose :, : -operator.loose]
        moved = np.hstack([np.take_along_axis(moved, at, axis=1), -pull])
        apart = None
        if not compliance.rigid:  # how far grips let their nodes be
            bears = force.reshape(*columns.shape, operator.width)
            off = np.zeros(bears.shape)
            if compliance.matrix is not None:
                off += np.einsum("srij,srj->sri", compliance.transmitted, bears)
            if compliance.moved is not None:
                off[..., :3] -= compliance.moved
            apart = as_rows(off)
        pairs, rows = pairs_of(operator.across, columns), np.ascontiguousarray(index.T)
        right = np.ascontiguousarray(moved.T)
        change = undone(operator, pairs, rows, right, compliance, apart)[0].T
        more = change[:, : at.shape[1]].copy()
        change[:, change.shape[1] - operator.loose :] += loose
        return answer + self._states(index, change, 0.0), more
