"""Equilibrium of rigid blocks with contact for many sets of grips, as linear programs.

Cones and balls are spanned from inside by directions, so that forces which satisfy the program
satisfy `formulations.contact.limit_analysis` as well::

    minimize    z   (or -z, or nothing)
    subject to  E f + G g + w + z w' = 0
                f = -a (s + z s') n + sum_j l_j (n + m d_j) + sum_j k_j d_j,   l, k >= 0
                sum_j k_j <= a (c + z c' - m (s + z s'))
                g = sum_j h_j v_j,   sum_j h_j <= p + z p',   h >= 0,   h = 0 if nobody holds there

with n the normal and d_j tangents of a contact, v_j unit vectors, and the other letters from
`seqopt.stability.limit_analysis.Case`; s is cut off at c / m, the tip of the cone, which takes
nothing away where c >= m s. The multipliers of the first line are a motion. Where it closes a
contact or outruns a payload more than the directions there are can see, the best direction of that
corner or grip joins them, whose reduced cost has a closed form, until the answer is enough.

One program serves all grips of a structure: those not held are fixed at zero, and the simplex
method goes on from the basis of the set before.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import highspy
import numpy as np
from scipy import sparse

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.contact.assembly import Assembly
from seqopt.stability._screens import Enough, HeldProgram
from seqopt.stability.limit_analysis import CAP, Answer, Case, Claim, limits

_SIDES = 8  # of a cone to start with, the axes of its contact among them
_SPREAD = np.array([p for p in product((-1.0, 0.0, 1.0), repeat=3) if any(p)])
_GAIN = 1e-7  # least gain for which a direction joins, over the largest entry of the motion
ROUNDS = 12  # of refinement
GROWN = 4  # times as many directions as at the start are too many: it starts again
FREE = highspy.kHighsInf
OPTIONS: dict[str, Any] = {
    "output_flag": False,
    "presolve": "off",
    "solver": "simplex",
    "threads": 1,
    "primal_feasibility_tolerance": 1e-9,
    "dual_feasibility_tolerance": 1e-9,
    "simplex_scale_strategy": 0,  # programs come scaled; without, none went in circles
    "simplex_iteration_limit": 5000,  # of one answer; what takes longer has stalled
}


@dataclass(frozen=True, eq=False, repr=False)
class _Directions(FrozenValue):
    """_Directions in which corners and grips act.

    ``owner`` (n,): corner, or grip counted on after the corners. ``unit`` (n, 3): unit vectors;
    those of a corner have no normal part.
    """

    owner: Ints
    unit: Floats

    def joined(self, other: _Directions) -> _Directions:
        """Return these directions and others after them."""
        owner = np.concatenate([self.owner, other.owner])
        return _Directions(owner, np.concatenate([self.unit, other.unit]))


def _first_directions(corners: int, grips: int) -> _Directions:
    """Return directions to start with, the same ones for every corner and for every grip."""
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    flat = np.stack([np.zeros(_SIDES), np.cos(angle), np.sin(angle)], axis=1)
    space = _SPREAD / np.linalg.norm(_SPREAD, axis=1, keepdims=True)
    of_corners = _Directions(np.repeat(np.arange(corners), _SIDES), np.tile(flat, (corners, 1)))
    of_grips = corners + np.repeat(np.arange(grips), len(space))
    return of_corners.joined(_Directions(of_grips, np.tile(space, (grips, 1))))


class _HeldEquilibrium:
    """The program of one assembly, whose grips are all that may ever be held, and case."""

    def __init__(self, assembly: Assembly, case: Case) -> None:
        self._assembly, self._case = assembly, case
        self._corners, self._grips = len(assembly.corner), len(assembly.payload)
        maps = [assembly.contact_map, assembly.grip_map]
        self._map = sparse.csc_array(sparse.hstack(maps, format="csc"))
        self._lines = self._map.shape[0]  # of equilibrium; then of discs, then of payloads
        start, more = (limits(assembly, case, z, assembly.payload) for z in (0.0, 1.0))
        cut = np.minimum(start[0], start[1] / (case.friction or np.inf))
        self._cut = np.stack([cut if case.friction else start[0], more[0] - start[0]])
        disc = np.stack([start[1], more[1] - start[1]]) - case.friction * self._cut
        self._disc = np.maximum(disc, 0.0) if disc.max(initial=0.0) > 0 else disc[:, :0]
        self._limits = self._disc.shape[1] + self._grips  # lines of discs and payloads
        self._start()

    def _start(self) -> None:
        """Write the program down with the directions to start with."""
        self._directions = _Directions(np.zeros(0, np.int64), np.zeros((0, 3)))
        self._owner = np.zeros(0, np.int64)  # of every column but the first, and its force
        self._force = np.zeros((0, 3))
        self._held = np.zeros(self._grips)  # payloads in the program
        self._solver: Any = highspy.Highs()  # its annotations are not complete
        for name, value in OPTIONS.items():
            self._solver.setOptionValue(name, value)
        right = self._right()
        least = np.where(np.arange(len(right)) < self._lines, right, -FREE)
        self._solver.addRows(len(right), least, right, 0, [], [], [])
        case = self._case
        grown = (case.tension, case.cohesion, case.payload, case.applied)
        grows = any((*(growth for _, growth in grown), *case.pull))
        cost, most = (case.sense.value, CAP) if grows else (0.0, 0.0)
        pulls, held = self._case.loads(self._assembly)[1], np.full(self._grips, case.payload[1])
        z = np.concatenate([pulls - self._pressed(self._cut[1]), -self._disc[1], -held])
        self._add(np.array([cost]), np.array([most]), sparse.csc_array(z[:, None]))
        self._join(_first_directions(self._corners, self._grips))
        self._first = len(self._owner)

    def _add(self, cost: Floats, most: Floats, matrix: sparse.csc_array) -> None:
        """Add columns from 0 on."""
        starts, rows = matrix.indptr[:-1].astype(np.int32), matrix.indices.astype(np.int32)
        least, count = np.zeros(len(cost)), len(cost)
        self._solver.addCols(count, cost, least, most, matrix.nnz, starts, rows, matrix.data)

    def _pressed(self, cut: Floats) -> Floats:
        """Return the wrenches of all corners that press by an amount (K,)."""
        push = np.pad(cut[:, None], ((0, 0), (0, 2)))  # along normals
        return np.asarray(self._assembly.contact_map @ push.ravel())

    def _right(self) -> Floats:
        """Return the right-hand side of all lines for the payloads that are held."""
        payload = self._case.payload[0] * self._held / self._assembly.scales[0]
        balance = self._pressed(self._cut[0]) - self._case.loads(self._assembly)[0]
        return np.concatenate([balance, self._disc[0], payload])

    def _join(self, new: _Directions) -> None:
        """Add the columns of directions: rays of cones, points of discs, and grips."""
        corner = new.owner < self._corners
        at, unit, by = new.owner[corner], new.unit[corner], new.owner[~corner]
        pushed = np.array([1.0, 0.0, 0.0]) + self._case.friction * unit
        parts = [(at, pushed, np.full(len(at), -1))]  # third the line that limits their sum
        parts += [(at, unit, at)] if self._disc.size else []
        parts += [(by, new.unit[~corner], by - self._corners + self._disc.shape[1])]
        owner, force, limited = (np.concatenate(part) for part in zip(*parts, strict=True))
        self._add(np.zeros(len(owner)), self._most(owner), self._matrix(owner, force, limited))
        self._directions = self._directions.joined(new)
        self._owner = np.concatenate([self._owner, owner])
        self._force = np.concatenate([self._force, force])

    def _matrix(self, owner: Ints, force: Floats, limited: Ints) -> sparse.csc_array:
        """Return the columns of forces (n, 3), whose sums some lines limit."""
        count = len(owner)
        rows = 3 * owner[:, None] + np.arange(3)
        shape = (self._map.shape[1], count)
        local = sparse.csc_array((force.ravel(), rows.ravel(), 3 * np.arange(count + 1)), shape)
        own = np.flatnonzero(limited >= 0)
        ones = np.ones(len(own)), (limited[own], own)
        sums = sparse.csc_array(ones, shape=(self._limits, count))
        return sparse.csc_array(sparse.vstack([self._map @ local, sums]))

    def _most(self, owner: Ints) -> Floats:
        """Return how large the columns of owners may be: nothing where nobody holds."""
        held = np.concatenate([np.ones(self._corners, dtype=bool), self._held > 0])
        return np.where(held[owner], FREE, 0.0)

    def __call__(self, payload: Floats, enough: Enough) -> Answer:
        """Return the solver's answer for payloads (G,), zero where nobody holds: a claim.

        ``enough``: says of an answer whether the program need not be refined.
        """
        if len(self._owner) > GROWN * self._first:
            self._start()
        self._hold(payload)
        again = True
        for _ in range(ROUNDS):
            answer = self._solve()
            if answer.claim is Claim.STALLED or enough(answer):
                break
            better = self._better(answer.motion)
            if len(better.owner):
                self._join(better)
            elif again:  # what is left is rounding: once from another basis
                self._solver.clearSolver()
                again = False
            else:
                break
        return answer

    def _hold(self, payload: Floats) -> None:
        """Set the payloads in the program; columns of grips that nobody holds are fixed."""
        changed = np.flatnonzero(payload != self._held)
        self._held = payload.copy()
        right = self._right()
        for row in (len(right) - self._grips + changed).tolist():
            self._solver.changeRowBounds(row, -FREE, float(right[row]))
        which = np.flatnonzero(np.isin(self._owner, self._corners + changed))
        if len(which):
            least, most = np.zeros(len(which)), self._most(self._owner[which])
            columns = (1 + which).astype(np.int32)
            self._solver.changeColsBounds(len(which), columns, least, most)

    def _solve(self) -> Answer:
        for _ in range(2):  # once more from the start if the solver is lost
            self._solver.run()
            status = self._solver.getModelStatus()
            if status == highspy.HighsModelStatus.kOptimal:
                return self._forces()
            if status == highspy.HighsModelStatus.kInfeasible:
                _, known, ray = self._solver.getDualRay()
                if known:  # a motion that says why there are no forces
                    motion = -np.array(ray) * (np.sign(self._right() @ ray) or 1.0)
                    return self._nothing(Claim.INFEASIBLE, motion[: self._lines])
            self._solver.clearSolver()
        return self._nothing(Claim.STALLED, np.zeros(self._lines))

    def _forces(self) -> Answer:
        solution = self._solver.getSolution()
        x = np.array(solution.col_value)
        force = np.zeros((self._corners + self._grips, 3))
        np.add.at(force, self._owner, x[1:, None] * self._force)
        force[: self._corners, 0] -= self._cut[0] + x[0] * self._cut[1]
        force[self._corners :][self._held <= 0] = 0.0  # the solver tolerates a little
        motion = -np.array(solution.row_dual)[: self._lines].reshape(-1, 6)
        value = float(x[0])
        return Answer(Claim.SOLVED, value, force[: self._corners], force[self._corners :], motion)

    def _nothing(self, claim: Claim, motion: Floats) -> Answer:
        forces = np.zeros((self._corners, 3)), np.zeros((self._grips, 3))
        return Answer(claim, np.nan, *forces, motion.reshape(-1, 6))

    def _better(self, motion: Floats) -> _Directions:
        """Return the directions of steepest gain, of corners and grips, that the program lacks.

        ``motion``: the duals of equilibrium, (b, 6), which give the reduced cost of a unit force.
        """
        largest = np.abs(motion).max(initial=0.0) or 1.0
        along = -(self._map.T @ (motion.ravel() / largest)).reshape(-1, 3)
        corner = along[: self._corners]
        closing = corner[:, 0] + self._case.friction * np.linalg.norm(corner[:, 1:], axis=1)
        corner[:, 0] = 0.0
        cones = (closing > 0) | bool(self._disc.size)
        wanted, known = np.concatenate([cones, self._held > 0]), self._directions
        best, size = np.zeros(len(along)), np.linalg.norm(along, axis=1)
        np.maximum.at(best, known.owner, np.einsum("ij,ij->i", known.unit, along[known.owner]))
        which = np.flatnonzero(wanted & (size - best > _GAIN))
        return _Directions(which, along[which] / size[which, None])


def compile_held(assembly: Assembly, case: Case) -> HeldProgram:
    """Return the program of an assembly, whose grips are all that may ever be held, and a case."""
    return _HeldEquilibrium(assembly, case)
