"""The fast engine: exactly rigid bricks, one compliance operator per brick count.

With the flexibility ``G`` of the inner nodes and their displacements ``d`` under the weight, grips
at the nodes ``S`` exert the forces ``λ`` that hold them still, ``G[S, S] λ = -d[S]``; every
response is then the sum of the responses to the weight and to ``λ``. Where these nearly cancel
(grips far out on a long chain and close together, or beyond a joint that is nearly loose) the grip
set is solved again with wrenches and motions side by side (`seqopt.engines.rigid.mixed`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.basis import SPACE, Basis
from seqopt.engines.failures import failing_in_a_line
from seqopt.engines.interface import (
    Fields,
    Want,
    grip_columns,
    keep_wanted,
    merge_sets,
    require_finite,
    select_sets,
)
from seqopt.engines.rigid.grip_equations import grip_forces
from seqopt.engines.rigid.mechanism import require_resistance
from seqopt.engines.rigid.mixed import solve_mixed
from seqopt.engines.rigid.operator import ComplianceOperator, OperatorBuilder
from seqopt.engines.rigid.spanning_tree import grow_tree
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene

CHUNK = 2048  # grip sets per pass: keeps the work arrays in the processor's cache
TRUSTED = 1e-5  # smallest scaled pivot of the grips' equations that keeps errors below about 1e-9
EVEN = 5e-5  # softest over stiffest joint from which on pivots tell the whole error
CANCEL = 10.0  # what the grips undo over what is left, where pivots do not


class ComplianceEngine:
    """Answers any batch of grip sets on any partial structure of a scene.

    Parameters
    ----------
    network : Network or Scene
    basis : Basis, optional
        The directions in which bricks are loaded and move; all by default, fewer in a plane.
    """

    def __init__(self, network: Network | Scene, basis: Basis = SPACE) -> None:
        network = network_of(network)
        self._network = network
        self._basis = basis
        tree = grow_tree(network)
        self._builder = None if tree is None else OperatorBuilder(network, tree, basis)
        self._operators: dict[int, ComplianceOperator] = {}
        springs = network.springs
        self._even = all(
            stiffness.min() >= EVEN * stiffness.max()
            for stiffness in (springs.translational_stiffness, springs.rotational_stiffness)
        )

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""
        return self._network

    @failing_in_a_line
    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Return the fields of a partial structure for many grip sets.

        Parameters
        ----------
        bricks : int
            How many bricks stand.
        grips : (S, r) int
            Node numbers.
        want : Want, optional

        Returns
        -------
        Fields

        Raises
        ------
        GripError, MechanismError, SolverError
            As of `seqopt.engines.interface.Engine`.
        """
        columns = grip_columns(self._network, bricks, grips)
        if self._builder is None:
            for row in columns:
                require_resistance(self._network, bricks, row)
            answer = solve_mixed(self._network, bricks, columns)
            return require_finite(answer, bricks, grips)
        if bricks not in self._operators:
            self._operators[bricks] = self._builder.operator(bricks)
        operator = self._operators[bricks]
        fields, trusted = solve_batch(operator, columns, want, even=self._even)
        if self._basis is not SPACE:
            fields = replace(fields, grip_force=fields.grip_force @ self._basis.force)
        if not trusted.all():
            better = solve_mixed(self._network, bricks, columns[~trusted])
            better = keep_wanted(better, want)
            fields = merge_sets(trusted, select_sets(fields, trusted), better)
        return require_finite(fields, bricks, grips)


def solve_batch(
    operator: ComplianceOperator, columns: Ints, want: Want = Want.RESPONSES, *, even: bool = True
) -> tuple[Fields, Bools]:
    """Return the fields of grip sets, and which of them are accurate.

    Parameters
    ----------
    operator : ComplianceOperator
    columns : (S, r) int
        Grips as indices into ``network.inner.ravel()``.
    want : Want, optional
    even : bool, optional
        Whether the joints are about equally stiff: where not, pivots do not tell the whole error.

    Returns
    -------
    fields : Fields
        Grip forces in the directions of the operator.
    trusted : (S,) bool
    """
    sets, held = columns.shape
    index = operator.load_index(columns)
    force = np.empty(index.shape)
    trusted = np.empty(sets, dtype=bool)
    for start in range(0, sets, CHUNK):
        part = slice(start, start + CHUNK)
        force[part], pivot = grip_forces(operator, columns[part], index[part])
        trusted[part] = pivot >= TRUSTED
    force[~trusted] = 0.0
    if not even:
        trusted &= ~cancels(operator, index, force)
    load = _loads(index, force, len(operator.flexibility))

    def answer(rows: Floats, flag: Want, *shape: int) -> Floats:
        wanted = load @ rows if want & flag else np.empty((sets, 0))
        return np.asarray(wanted.reshape(sets, wanted.shape[1] // math.prod(shape), *shape))

    fields = Fields(
        edge_force=answer(operator.edge_force, Want.EDGES),
        displacement=answer(operator.displacement, Want.DISPLACEMENTS, 3),
        grip_force=force.reshape(sets, held, operator.directions),
        support=answer(operator.support, Want.SUPPORT, 6),
        joint_wrench=answer(operator.joint_wrench, Want.JOINTS, 6),
        brick_twist=answer(operator.brick_twist, Want.BRICKS, 6),
    )
    return fields, trusted


def _loads(index: Ints, force: Floats, size: int) -> sparse.csr_array:
    """Return forces (S, k) at the rows ``index``, and the weight, as a matrix (S, size + 1).

    A few entries of hundreds: multiplying only these takes half the time of a dense product.
    """
    sets, count = index.shape
    column = np.full((sets, count + 1), size, dtype=np.int32)
    column[:, :-1] = index
    value = np.ones((sets, count + 1))
    value[:, :-1] = force
    first = np.arange(0, column.size + 1, count + 1, dtype=np.int32)
    return sparse.csr_array((value.ravel(), column.ravel(), first), shape=(sets, size + 1))


def cancels(operator: ComplianceOperator, index: Ints, force: Floats) -> Bools:
    """Return whether motions cancel at the grips of sets.

    Parameters
    ----------
    operator : ComplianceOperator
    index : (S, k) int
        Rows of the operator that the grips load.
    force : (S, k) float
        There, N.

    Returns
    -------
    (S,) bool
    """
    out = np.zeros(len(index), dtype=bool)
    motion = operator.displacement
    for row, rows in enumerate(index if index.size else ()):
        parts = np.abs(operator.flexibility[np.ix_(rows, rows)]) @ np.abs(force[row])
        parts += np.abs(operator.dead_displacement[rows])
        left = np.abs(motion[-1] + force[row] @ motion[rows]).max()
        out[row] = parts.max() > CANCEL * left
    return out
