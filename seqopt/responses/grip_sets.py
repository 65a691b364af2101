"""Responses of grip sets, computed when they are first needed, and kept.

For whoever searches among more sets than need to be solved: all sets that are asked for at once are
solved in batches, each of them once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from operator import or_

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Engine, Want
from seqopt.errors import MechanismError
from seqopt.responses.batches import BLOCK
from seqopt.responses.quantities import CHOSEN_BY, lengths, require_finite


class KnownRows:
    """Rows of values by a key and a code, each computed once.

    ``count``: how many rows were computed.

    Examples
    --------
    >>> rows = KnownRows()
    >>> codes = np.array([3, 1, 3])
    >>> rows.of("squares", codes, lambda places: codes[places, None] ** 2.0).ravel()
    array([9., 1., 9.])
    >>> rows.count
    2
    """

    def __init__(self) -> None:
        self._known: dict[object, tuple[Ints, Floats]] = {}
        self.count = 0

    @property
    def nbytes(self) -> int:
        """How much memory the rows take."""
        return sum(
            codes.nbytes + (0 if values is None else values.nbytes)
            for codes, values in self._known.values()
        )

    def of(self, key: object, codes: Ints, compute: Callable[[Ints], Floats]) -> Floats:
        """Return the rows of codes, those that are new computed now, all together.

        ``key``: codes of other keys are others; ``codes`` (n,); ``compute``: returns the rows (m,
        k) of distinct codes, given the places (m,) where they first stand among those asked for.
        Result (n, k).
        """
        distinct, first = np.unique(codes, return_index=True)
        known, values = self._known.get(key, (distinct[:0], None))
        fresh = first[~np.isin(distinct, known, assume_unique=True)]
        if values is None or len(fresh):
            computed = compute(fresh)
            known = np.concatenate([known, codes[fresh]])
            values = computed if values is None else np.concatenate([values, computed])
            order = np.argsort(known, kind="stable")
            known, values = known[order], values[order]
            self._known[key] = known, values
            self.count += len(fresh)
        return np.asarray(values[np.searchsorted(known, codes)])


class GripSets:
    """The responses of grip sets of one scene.

    ``engine``: what solves them; ``names``: responses of `seqopt.responses.quantities.CHOSEN_BY`
    that are wanted; ``screen``: whether six digits are enough, to choose by.

    Examples
    --------
    >>> import numpy as np
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> sets = GripSets(seqopt.make_engine("compliance", network), ["T_max"])
    >>> responses, forces = sets.answers(2, np.array([[0, 3], [2, 3]]))  # zero: no grip
    >>> responses.shape, forces.shape, sets.solved
    ((2, 1), (2, 2), 2)
    """

    def __init__(self, engine: Engine, names: Sequence[str], *, screen: bool = False) -> None:
        self._engine = engine
        self._names = tuple(names)
        digits = Want.SCREEN if screen else Want(0)
        self._want = reduce(or_, (CHOSEN_BY[name].needs for name in names), digits)
        self._known = KnownRows()
        scene = engine.network.scene
        self._number = np.array([0, *(node for brick in scene.placed for node in brick.nodes)])

    def __repr__(self) -> str:
        return f"<GripSets of {self._engine}: {self.solved} solved>"

    @property
    def names(self) -> tuple[str, ...]:
        """The responses that are wanted."""
        return self._names

    @property
    def solved(self) -> int:
        """How many different grip sets were solved."""
        return self._known.count

    @property
    def nbytes(self) -> int:
        """How much memory their responses take."""
        return self._known.nbytes

    def answers(self, bricks: int, held: Ints) -> tuple[Floats, Floats]:
        """Return the responses of grip sets and the forces of their grips.

        ``held`` (S, r): nodes held, ascending in every row, as places in build order counted from
        1; zeros for robots that hold none. Results: ``responses`` (S, R): in the order of the
        names, SI units; infinite where something would be loose. ``forces`` (S, r): N; zero for a
        robot that holds none.
        """
        held = np.asarray(held)
        out = np.zeros((len(held), len(self._names) + held.shape[1]))
        grips = (held > 0).sum(axis=1)
        for count in np.unique(grips).tolist():
            rows = np.flatnonzero(grips == count)
            nodes = held[rows, held.shape[1] - count :]
            found = self._found(bricks, count, nodes)
            out[rows, : len(self._names)] = found[:, : len(self._names)]
            out[rows, out.shape[1] - count :] = found[:, len(self._names) :]
        return out[:, : len(self._names)], out[:, len(self._names) :]

    def _found(self, bricks: int, count: int, nodes: Ints) -> Floats:
        """Return responses and forces of sets (S, count), those that are new solved now."""
        return self._known.of(
            (bricks, count), self._codes(nodes), lambda new: self._solve(bricks, nodes[new])
        )

    def _codes(self, nodes: Ints) -> Ints:
        """Return a number for every set (S, r) that no other one has."""
        out = np.zeros(len(nodes), dtype=np.int64)
        for column in nodes.T:
            out = out * len(self._number) + column
        return out

    def _solve(self, bricks: int, nodes: Ints) -> Floats:
        """Return responses and forces of sets, (S, R + r)."""
        parts = [
            self._block(bricks, self._number[nodes[start : start + BLOCK]])
            for start in range(0, len(nodes), BLOCK)
        ]
        width = len(self._names) + nodes.shape[1]
        return np.concatenate([np.zeros((0, width)), *parts])

    def _block(self, bricks: int, grips: ArrayLike) -> Floats:
        """Return the same of a few sets of node numbers; those that leave something loose apart."""
        grips = np.asarray(grips)
        try:
            fields = self._engine.solve(bricks, grips, self._want)
        except MechanismError:
            if len(grips) == 1:
                return np.full((1, len(self._names) + grips.shape[1]), np.inf)
            half = len(grips) // 2
            halves = [self._block(bricks, part) for part in (grips[:half], grips[half:])]
            return np.concatenate(halves)
        columns = [CHOSEN_BY[name].of(self._engine.network, fields) for name in self._names]
        forces = lengths(fields.grip_force)
        for name, values in zip(self._names, columns, strict=True):
            require_finite(name, values, bricks)
        require_finite("grip force", forces, bricks)
        return np.column_stack([*columns, forces])
