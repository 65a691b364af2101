"""Grip sets of one structure in several scenarios, in one batch.

Scenarios differ in numbers alone. The operators of all stand below each other as rows of one, so
that what a batch costs beside its sets is paid once, not once for every scenario.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Floats, Ints, frozen
from seqopt.engines.interface import Fields, Want, grip_columns, require_finite
from seqopt.engines.rigid._operator import ComplianceOperator
from seqopt.engines.rigid.compliance import (
    _LARGE,
    ComplianceEngine,
    Extremes,
    _extremes_in,
    _FastSolution,
)

_CHUNK = 2048  # sets whose fields are held at once
_MOST, _KEPT = 64e6, 256e6  # bytes of one stacked operator, and of all that are kept


@dataclass(frozen=True, eq=False, repr=False)
class StackedOperator(ComplianceOperator):
    """The operators of several scenarios, of B rows each; columns of grips are numbered through.

    ``parts``: by scenario, with loads on all bricks; ``flexibility`` (WB, B).
    """

    parts: tuple[ComplianceOperator, ...] = ()

    @classmethod
    def of(cls, parts: Sequence[ComplianceOperator]) -> StackedOperator:
        """Return operators of the same loads as one; the weight of each is its last row."""
        first = parts[0]
        flexibility = np.concatenate([np.pad(each.flexibility, ((0, 1), (0, 1))) for each in parts])
        dead = np.concatenate([np.append(each.dead_displacement, 0.0) for each in parts])
        loss = np.concatenate([np.append(each.loss, 1.0) for each in parts])
        none = np.zeros((len(flexibility), 0))
        arrays = flexibility, dead, none, none
        return cls(first.held, *arrays, first.maps, loss, parts=tuple(parts))

    @cached_property
    def inner(self) -> tuple[Ints, Floats]:
        """The inner edges of bricks (Wb,) and their directions (Wb, 3), scenario by scenario."""
        edges, axes = zip(*(each.inner for each in self.parts), strict=True)
        return frozen((np.concatenate(edges), np.concatenate(axes)))

    def load_index(self, columns: Ints) -> Ints:
        part, own = np.divmod(columns, 2 * self.maps.bricks)
        return np.asarray(super().load_index(own) + self.flexibility.shape[1] * part[:, :1])

    def weight_rows(self, index: Ints) -> Ints:
        rows = self.flexibility.shape[1]
        return np.asarray(rows * (index[:, 0] // rows + 1) - 1)

    def answers(self, names: Sequence[str], index: Ints, force: Floats) -> dict[str, Floats]:
        loads = self.loads(index, force)
        return {name: np.asarray(loads @ self.of_loads(name)) for name in names}

    def of_loads(self, name: str, *, keep: bool = True) -> Floats:
        if name not in self._made:
            every = [each.of_loads(name, keep=False) for each in self.parts]
            self._made[name] = frozen(np.concatenate(every))
        return self._made[name]


class StackedEngines:
    """Engines of the same structure in several scenarios; each may be asked alone, too."""

    def __init__(self, engines: Sequence[ComplianceEngine]) -> None:
        self._engines = tuple(engines)
        self._kept: dict[int, StackedOperator] = {}  # the one that was asked last comes last

    def fits(self, bricks: int) -> bool:
        """Return whether operators answer sets of so many bricks, and are small together."""
        first = self._engines[0].network
        edges, nodes = first.count_edges(bricks), 3 * first.count_nodes(bricks)
        size = 8 * len(self._engines) * (6 * bricks + 1) * (6 * bricks + edges + nodes)
        return size <= _MOST and all(
            bricks <= min(each._uniform, len(each._tree.spring))
            and each.network.scene.grip_kinds.rigid
            and len(each.network.inner) < _LARGE
            for each in self._engines
        )

    def extremes(
        self, parts: Sequence[int], bricks: int, grips: ArrayLike, want: Want
    ) -> Iterator[Extremes]:
        """Yield the extremes of fields of grip sets (S, r), r > 0, in some scenarios, by number."""
        engines, numbers = [self._engines[k] for k in parts], np.asarray(grips)
        columns, operator = grip_columns(engines[0].network, bricks, grips), self._operator(bricks)
        every = columns + 2 * bricks * np.array(parts)[:, None, None]
        every, found, good = every.reshape(-1, columns.shape[1]), [], []
        for start in range(0, len(every), _CHUNK):
            own = every[start : start + _CHUNK]
            accuracy = engines[0]._accepted(want)
            fast = _FastSolution(operator, own, even=True, accuracy=accuracy)
            held = numbers[np.arange(start, start + len(own)) % len(numbers)]
            fields = require_finite(Fields(**fast.fields(want)), bricks, held)
            found.append(_extremes_in(fields, want))
            good.append(fast.well_conditioned)
        joined, sure = (
            Extremes(*map(np.concatenate, zip(*found, strict=True))),
            np.concatenate(good),
        )
        for k, engine in enumerate(engines):
            rows = slice(k * len(numbers), (k + 1) * len(numbers))
            out, wrong = Extremes(*(each[rows] for each in joined)), ~sure[rows]
            engine.answered += int(np.count_nonzero(~wrong))
            if wrong.any():
                better = engine._extremes(bricks, numbers[wrong], want)
                for values, others in zip(out, better, strict=True):
                    values[wrong] = others
            yield out

    def _operator(self, bricks: int) -> StackedOperator:
        known = self._kept.pop(bricks, None)
        if known is None:
            every = np.arange(2 * bricks)[None]
            parts = [each._operator(bricks, every) for each in self._engines]
            taken = sum(each.nbytes for each in self._kept.values())
            while taken > _KEPT:  # those that were not asked for longest go
                taken -= self._kept.pop(next(iter(self._kept))).nbytes
            known = StackedOperator.of(parts)
        self._kept[bricks] = known
        return known
