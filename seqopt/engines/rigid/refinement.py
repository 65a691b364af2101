"""Answers of many grip sets corrected together, with one factorization per brick count.

What is left of the equations of `seqopt.engines.rigid.mixed_system` when an answer is put in is
answered by the system without grips, all sets as right-hand sides of one solution, and by the
grips' equations of the operator. The first correction of an answer is its error, but for the share
by which the operator itself is wrong; the next one is that share smaller.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.engines.interface import Fields
from seqopt.engines.joined_fields import join_sets, merge_sets, no_sets
from seqopt.engines.rigid.grip_equations import grip_forces, still_forces
from seqopt.engines.rigid.held_operator import held_operator
from seqopt.engines.rigid.loads import loads_of
from seqopt.engines.rigid.loose import HeldSystem, hold_loose
from seqopt.engines.rigid.mechanism import require_resistance
from seqopt.engines.rigid.mixed import LAST_CORRECTION, solve_mixed, unchanged
from seqopt.engines.rigid.mixed_system import rescaled, unscaled
from seqopt.engines.rigid.operator import ComplianceOperator
from seqopt.engines.rigid.recovery import Solution, respond
from seqopt.engines.rigid.ungripped import Shared, ungripped_system
from seqopt.network.network import Network

TOGETHER = 256  # grip sets per pass: their unknowns stay in the processor's cache
STEPS = 5  # corrections, after which a set is solved on its own
HARDLY_HELD = 1e-9  # a pivot of loose motions below which they are looked into one by one


class Refinement:
    """Answers grip sets of one partial structure to rounding, whatever is loose in it.

    Parameters
    ----------
    network : Network
    bricks : int
        How many bricks stand.
    shared : Shared, optional
        What the systems of all brick counts are cut from, if it is known.
    tied : bool, optional
        Whether springs are known to tie every brick to the ground.
    """

    def __init__(
        self, network: Network, bricks: int, shared: Shared | None = None, *, tied: bool = False
    ) -> None:
        self.network, self.bricks = network, bricks
        self.parts = ungripped_system(network, bricks, shared)
        self.held: HeldSystem = hold_loose(self.parts, tied=tied)
        self.inner = self.parts.inner
        weighed = sparse.csr_array(self.parts.load[None])
        self.pulls = sparse.vstack([self.inner / self.parts.unit, weighed], format="csr")

    @cached_property
    def own(self) -> ComplianceOperator:
        """Of all nodes and directions, from the factored system; for where something is loose."""
        return held_operator(self.held)

    def solve(
        self,
        columns: Ints,
        operator: ComplianceOperator | None = None,
        largest: float = LAST_CORRECTION,
        basis: Basis = SPACE,
    ) -> Fields:
        """Return all fields of grip sets.

        Parameters
        ----------
        columns : (S, r) int
            Grips as indices into ``network.inner.ravel()``.
        operator : ComplianceOperator, optional
            With wrenches and twists, if there is one for these grips; it serves if nothing is
            loose.
        largest : float, optional
            Correction of a set after which it needs no other, over the largest of each kind.
        basis : Basis, optional
            The directions that the operator knows; in the others nothing may move.

        Raises
        ------
        MechanismError, SolverError
            As of `seqopt.engines.interface.Engine`.
        """
        empty = no_sets(self.network, self.bricks, columns.shape[1])
        starts = range(0, len(columns), TOGETHER)
        if operator is None or self.held.loose:
            operator, basis = self.own, SPACE
        corrector = Corrector(self, operator, largest, basis)
        parts = (corrector.together(columns[i : i + TOGETHER]) for i in starts)
        return join_sets([empty, *parts])


class Corrector:
    """Corrects what an operator answers.

    Parameters
    ----------
    system : Refinement
    operator : ComplianceOperator
    largest : float, optional
        Correction of a set after which it needs no other.
    basis : Basis, optional
        The directions that the operator knows.
    """

    def __init__(
        self,
        system: Refinement,
        operator: ComplianceOperator,
        largest: float = LAST_CORRECTION,
        basis: Basis = SPACE,
    ) -> None:
        self.network, self.bricks, self.parts = system.network, system.bricks, system.parts
        self.held, self.inner, self.pulls = system.held, system.inner, system.pulls
        self.operator, self.largest, self.basis = operator, largest, basis

    def together(self, columns: Ints) -> Fields:
        """Return the fields of a few sets.

        Parameters
        ----------
        columns : (S, r) int
            Grips as indices into ``network.inner.ravel()``.
        """
        operator, parts, bricks = self.operator, self.parts, self.bricks
        index = operator.load_index(columns)
        found = grip_forces(operator, columns, index)
        if operator.loose:
            for row in columns[~(found.lowest >= HARDLY_HELD)]:
                require_resistance(self.network, bricks, row)
        answers = _Answers(
            self._states(index, found.force), self._in_space(found.force, columns.shape[1])
        )
        done = self._correct(columns, index, answers)
        wrench, twist = unscaled(parts, answers.states[done])
        held = answers.force[done].reshape(int(done.sum()), columns.shape[1], 3)
        solution = Solution(twist, wrench, held)
        motion = operator.maps.motion if self.basis is SPACE else parts.motion
        fields = respond(self.network, parts.statics, motion, columns[done], solution)
        if done.all():
            return fields
        return merge_sets(done, fields, solve_mixed(self.network, bricks, columns[~done]))

    def _states(self, index: Ints, force: Floats, weight: float = 1.0) -> Floats:
        """Return the scaled answers (S, n) to forces (S, k) at loads, and the weight or none."""
        loads = self.operator.loads(index, force, weight)
        every = self.basis.wrench
        wrench, twist = (
            loads.sum(rows).reshape(len(index), -1, len(every)) @ every
            for rows in (self.operator.wrench, self.operator.twist)
        )
        return rescaled(self.parts, wrench, twist.reshape(len(index), -1))

    def _in_space(self, force: Floats, grips: int) -> Floats:
        """Return forces of grips (S, 3r) that are given in the operator's directions (S, k)."""
        width = len(self.basis.force)
        nodes = force[:, : grips * width].reshape(len(force), grips, width)
        return np.asarray(nodes @ self.basis.force).reshape(len(force), 3 * grips)

    def _correct(self, columns: Ints, index: Ints, answers: _Answers) -> Bools:
        """Correct answers until they no longer change; return which have come so far, (S,)."""
        done = np.zeros(len(columns), dtype=bool)
        left = np.flatnonzero(np.isfinite(answers.states).all(axis=1))
        for _ in range(STEPS):
            if not len(left):
                break
            state, force = answers.states[left], answers.force[left]
            change, more = self._correction(columns[left], index[left], state, force)
            answers.states[left] = state + change
            answers.force[left] = force + more
            done[left] = unchanged(self.parts, state, change, self.largest)
            left = left[~done[left] & np.isfinite(change).all(axis=1)]
        return done

    def _correction(
        self, columns: Ints, index: Ints, states: Floats, force: Floats
    ) -> tuple[Floats, Floats]:
        """Return what must be added to scaled answers (S, n) and grip forces (S, 3r)."""
        operator, parts = self.operator, self.parts
        joints, grips = len(parts.wrench_unit), columns.shape[1]
        at = (3 * columns[:, :, None] + np.arange(3)).reshape(force.shape)
        pulled = loads_of(at, force, 6 * self.bricks + 1).matrix @ self.pulls
        missing = -(parts.matrix @ states.T).T
        missing[:, joints:] += pulled
        answer, pull = self.held.solve(missing)
        moved = (self.inner @ (states + answer)[:, joints:].T).T
        loose = -operator.softness * pull  # how far what is missing moves loose parts
        if operator.loose:
            moved += loose @ operator.flexibility[-operator.loose :, : -operator.loose]
        at_grips = np.take_along_axis(moved, at, axis=1).reshape(-1, 3) @ self.basis.force.T
        moved = np.hstack([at_grips.reshape(len(moved), -1), -pull])
        change = still_forces(operator, columns, index, moved)
        more = self._in_space(change, grips)
        change[:, change.shape[1] - operator.loose :] += loose
        return answer + self._states(index, change, 0.0), more


@dataclass(frozen=True)
class _Answers:
    """Scaled wrenches and twists (S, n), and forces of the grips (S, 3r), corrected in place."""

    states: Floats
    force: Floats
