"""What an operator alone says about grip sets, and which of its answers stand."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import SHAPES, Fields, Want, names_wanted
from seqopt.engines.rigid.grip_equations import Pairs, grip_forces, pairs_of, share_pairs, trusted
from seqopt.engines.rigid.operator import ComplianceOperator

_CHUNK = 4096  # grip sets per pass: keeps the work arrays in the processor's cache
ACCURACY = 1e-9  # largest error of fields over the largest of each
_UNSEEN = 100 * np.finfo(float).eps  # largest error met, over what is read off the equations
_CANCEL = 10.0  # what the grips undo over what is left, where pivots do not


@dataclass(frozen=True)
class Tried:
    """What an operator alone says about grip sets."""

    operator: ComplianceOperator
    columns: Ints  # (S, r); grips as indices into ``network.inner.ravel()``
    index: Ints  # (S, k); its loads at the grips
    force: Floats  # (S, k); there, N; zero where it cannot be trusted
    pairs: Pairs  # of grips on one brick
    trusted: Bools  # (S,); which sets it answers well enough

    def fields(self, want: Want) -> dict[str, Floats]:
        """Return the fields of all sets by name.

        Result: as of `Fields`, grip forces in the directions of the operator.
        """
        operator, columns = self.operator, self.columns
        force = self.force.copy() if len(self.pairs.sets) else self.force
        loads, asked = operator.loads(self.index, force), names_wanted(want)
        found = {}
        for name, shape in SHAPES.items():
            if name in asked:
                wanted = operator.answer(name, self.index, force, loads)
                found[name] = wanted.reshape(len(wanted), wanted.shape[1] // prod(shape), *shape)
            else:
                found[name] = np.empty((len(columns), 0, *shape))
        share_pairs(operator, columns, self.index, force, found["edge_force"], self.pairs)
        nodes = force[:, : columns.shape[1] * operator.directions]
        found["grip_force"] = nodes.reshape(*columns.shape, operator.directions)
        return found


def try_forces(
    operator: ComplianceOperator, columns: Ints, *, even: bool, accuracy: float
) -> Tried:
    """Return what an operator alone says about grip sets, and which of them it answers well enough.

    ``columns`` (S, r): grips as indices into ``network.inner.ravel()``; ``even``: whether the
    joints are about equally stiff: where not, pivots do not tell the whole error; ``accuracy``:
    largest error of fields, over the largest entry of each, that is accepted.
    """
    sets, index, pairs = len(columns), operator.load_index(columns), pairs_of(operator, columns)
    force, good = np.empty(index.shape), np.empty(sets, dtype=bool)
    for start in range(0, sets, _CHUNK):
        part = slice(start, start + _CHUNK)
        mine = pairs if sets <= _CHUNK else pairs.within(start, start + _CHUNK)
        found = grip_forces(operator, columns[part], index[part], mine)
        force[part] = found.force
        good[part] = trusted(operator, index[part], found, accuracy / _UNSEEN)
    force[~good] = 0.0
    if not even:
        good &= ~cancels(operator, index, force)
    return Tried(operator, columns, index, force, pairs, good)


def solve_batch(
    operator: ComplianceOperator,
    columns: Ints,
    want: Want = Want.RESPONSES,
    *,
    even: bool = True,
    accuracy: float = ACCURACY,
) -> tuple[Fields, Bools]:
    """Return the fields of grip sets, and which of them are accurate.

    ``columns`` (S, r): grips as indices into ``network.inner.ravel()``; ``even``, ``accuracy``: as
    of `try_forces`: joints about equally stiff, `ACCURACY`. Results: ``fields``: grip forces in the
    directions of the operator; ``trusted`` (S,).
    """
    tried = try_forces(operator, columns, even=even, accuracy=accuracy)
    return Fields(**tried.fields(want)), tried.trusted


def cancels(operator: ComplianceOperator, index: Ints, force: Floats) -> Bools:
    """Return whether motions cancel at the grips of sets.

    ``index`` (S, k): rows of the operator that the grips load; ``force`` (S, k): there, N. Result
    (S,).
    """
    out = np.zeros(len(index), dtype=bool)
    if not index.size:
        return out
    size = np.abs(operator.flexibility)
    dead = operator.dead_displacement
    for start in range(0, len(index), _CHUNK):
        rows, pull = index[start : start + _CHUNK], force[start : start + _CHUNK]
        held = rows[:, :, None], rows[:, None]
        parts = np.einsum("sij,sj->si", size[held], np.abs(pull)) + np.abs(dead[rows])
        left = np.abs(operator.answer("displacement", rows, pull)).max(axis=1)
        out[start : start + _CHUNK] = parts.max(axis=1) > _CANCEL * left
    return out
