"""Equilibrium of rigid blocks with contact, as a second-order cone program.

Forces act at the corners of the contact faces, parts normal and tangential to the face, and at the
grips; over the heaviest block's weight, lengths over the longest lever::

    minimize    z   (or -z)
    subject to  E f + G g + w + z w' = 0
                f_n + a (s + z s') >= 0
                |f_t| <= m f_n + a (c + z c')
                |g| <= p + z p'
                0 <= z <= 100000

with E and G from `seqopt.contact.assembly.Assembly`, a the share of a corner in the contact area,
and the other letters from `seqopt.stability.limit_analysis.Case`. The multipliers of the first line
are the motion in which the structure fails. One program per assembly: the cases differ in
parameters only.

Static theorem of limit analysis with corner forces: Livesley (1978), Int. J. Numer. Methods Eng.
12; as a cone program: Portioli et al. (2014), Comput. Struct. 135.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np

from formulations.solvers import end_of
from seqopt.contact.assembly import Assembly
from seqopt.stability.limit_analysis import CAP, Answer, Case, Claim, Program

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Equilibrium:
    """The program of one assembly; call it with a case.

    Parameters
    ----------
    assembly : Assembly
        Blocks, the faces at which they touch, and grips.
    """

    def __init__(self, assembly: Assembly) -> None:
        blocks, corners, grips = (
            len(part) for part in (assembly.centroid, assembly.corner, assembly.payload)
        )
        self._assembly = assembly
        self._shape = (blocks, corners, grips)
        self._z = cp.Variable()
        self._force = cp.Variable((max(corners, 1), 3))
        self._grip = cp.Variable((max(grips, 1), 3))
        self._sense = cp.Parameter()
        self._friction = cp.Parameter(nonneg=True)
        self._strength = cp.Parameter(4)  # tension, its growth, cohesion, its growth
        self._payload = cp.Parameter(2)
        self._pull = cp.Parameter(3)
        self._balance, constraints = self._pose()
        self._program = cp.Problem(
            cp.Minimize(self._sense * self._z),
            [self._balance, *constraints, self._z >= 0, self._z <= CAP],
        )

    def _pose(self) -> tuple[cp.Zero, list[cp.Constraint]]:
        _, corners, grips = self._shape
        assembly = self._assembly
        weight = assembly.load()
        pulled = np.stack([assembly.load(axis) for axis in AXES], axis=1)
        balance = weight + pulled @ (self._pull * self._z)
        constraints: list[cp.Constraint] = []
        if corners:
            balance += assembly.contact_map @ self._force.flatten(order="C")
            share = assembly.corner_area * assembly.stress_scale / assembly.scales[0]
            normal = self._force[:, 0]
            tension = self._strength[0] + self._strength[1] * self._z
            cohesion = self._strength[2] + self._strength[3] * self._z
            constraints += [
                cp.NonNeg(normal + share * tension),
                cp.SOC(self._friction * normal + share * cohesion, self._force[:, 1:], axis=1),
            ]
        if grips:
            balance += assembly.grip_map @ self._grip.flatten(order="C")
            own = assembly.payload / assembly.scales[0]
            reach = own * self._payload[0] + np.ones(grips) * (self._payload[1] * self._z)
            constraints.append(cp.SOC(reach, self._grip, axis=1))
        return cp.Zero(balance), constraints

    def __call__(self, case: Case, attempt: int = 0) -> Answer:
        """Return the solver's answer to a case.

        Parameters
        ----------
        case : Case
            What is asked of the assembly.
        attempt : int
            Index of the solver's options to use, from 0.

        Returns
        -------
        Answer
            Claimed, not proven.
        """
        blocks, corners, grips = self._shape
        self._sense.value = case.sense.value
        self._friction.value = case.friction
        self._strength.value = np.array([*case.tension, *case.cohesion])
        self._payload.value = np.array(case.payload)
        self._pull.value = np.array(case.pull)
        claim = end_of(self._program, attempt)
        if claim in (Claim.STALLED, Claim.INFEASIBLE) or self._z.value is None:
            return Answer(
                claim, np.nan, np.zeros((corners, 3)), np.zeros((grips, 3)), np.zeros((blocks, 6))
            )
        return Answer(
            claim,
            float(self._z.value),
            _values(self._force, corners),
            _values(self._grip, grips),
            np.asarray(self._balance.dual_value).reshape(blocks, 6),
        )


def _values(variable: cp.Variable, count: int) -> np.ndarray:
    return np.zeros((0, 3)) if variable.value is None else np.asarray(variable.value)[:count]


def compile_equilibrium(assembly: Assembly) -> Program:
    """Return the program of an assembly.

    Parameters
    ----------
    assembly : Assembly
        Blocks, the faces at which they touch, and grips.

    Returns
    -------
    Program
        To be called with a case.
    """
    return Equilibrium(assembly)
