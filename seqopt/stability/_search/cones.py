"""Second-order cones of four numbers: what corners and grips bear, and the algebra of cones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.assembly import Assembly
from seqopt.stability.limit_analysis import Case, limits

FLIP = np.array([[1.0], [-1.0], [-1.0], [-1.0]])
_MIRROR = np.diag(FLIP[:, 0])[:, :, None]
_ROUNDED = 1e-12  # share of a square by which a difference may be negative from rounding
_FARTHEST = 1e3  # share of a step that counts as no limit


class Changing(NamedTuple):
    """The part of an assembly that changes: other blocks rest, other corner forces stay.

    ``blocks`` (B,), ``corners`` (K,), ``grips`` (G,): which; ``kept`` (K, 3): what others bear,
    over the force scale.
    """

    blocks: Bools
    corners: Bools
    grips: Bools
    kept: Floats


class Sought(NamedTuple):
    """A search for forces or a motion: assembly, case, and what alone changes, by default all.

    Of the case, only what it bears at a z of zero counts.
    """

    assembly: Assembly
    case: Case
    part: Changing | None = None

    def changing(self) -> Changing:
        """Return what changes."""
        if self.part is not None:
            return self.part
        assembly = self.assembly
        counts = len(assembly.centroid), len(assembly.corner), len(assembly.payload)
        blocks, corners, grips = (np.ones(count, dtype=bool) for count in counts)
        return Changing(blocks, corners, grips, np.zeros((len(corners), 3)))


def numbered(counts: Sequence[int]) -> Ints:
    """Return the number of its assembly for each of so many things of every one."""
    return np.repeat(np.arange(len(counts)), counts)


class Cones:
    """What corners and grips bear: cones of friction and payload, then cut-offs of tension.

    ``most`` (C,): the first row of h, which has no other; ``map`` (4, 3, C): G, of the force of the
    corner or grip that owns the cone; ``group`` (C,): number of the assembly. The first cones are
    owned in order, those of corners first, and the cut-offs by corners whose cone of friction does
    not end before.
    """

    def __init__(self, sought: Sequence[Sought], parts: Sequence[Changing]) -> None:
        borne = []
        for each, part in zip(sought, parts, strict=True):
            tension, cohesion, payload = limits(each.assembly, each.case, 0.0)
            own = tension[part.corners], cohesion[part.corners], payload[part.grips]
            borne.append((*own, np.full(len(own[0]), each.case.friction)))
        tension, cohesion, payload, friction = map(np.concatenate, zip(*borne, strict=True))
        corners, self.owners = len(tension), len(tension) + len(payload)
        self._cut = np.flatnonzero((friction == 0) | (friction * tension < cohesion))
        self.owner = np.concatenate([np.arange(self.owners), self._cut])
        counts = [[len(each[0]) for each in borne], [len(each[2]) for each in borne]]
        self.group = np.concatenate([numbered(count) for count in counts])[self.owner]
        self._groups = len(parts)
        self.most = np.concatenate([cohesion, payload, tension[self._cut]])
        self.map = np.zeros((4, 3, len(self.owner)))
        self.map[0, 0, :corners] = friction
        self.map[[1, 2], [1, 2], :corners] = 1.0
        self.map[[1, 2, 3], [0, 1, 2], corners : self.owners] = 1.0
        self.map[0, 0, self.owners :] = 1.0

    def of(self, force: Floats) -> Floats:
        """Return G f (4, C)."""
        return apply(self.map, force[:, self.owner])

    def owned(self, values: Floats) -> Floats:
        """Return the sums over the cones of every owner, (..., N)."""
        out = values[..., : self.owners].copy()
        out[..., self._cut] += values[..., self.owners :]
        return out

    def pulled(self, values: Floats) -> Floats:
        """Return the transpose of G times values (4, C), (3, N)."""
        return self.owned(apply(self.map.swapaxes(0, 1), values))

    def sums(self, values: Floats) -> Floats:
        """Return the sums over every assembly, (A,), of values of its cones or their owners."""
        return np.asarray(np.bincount(self.group[: len(values)], values, self._groups), float)

    def least(self, values: Floats, which: Bools | slice = slice(None)) -> Floats:
        """Return the least of some values (C,) of every assembly, (A,)."""
        out = np.full(self._groups, np.inf)
        np.minimum.at(out, self.group[which], values[which])
        return out

    def reach(self, cones: Floats, step: Floats) -> Floats:
        """Return how many steps (4, C) lead from within the cones to their edge, (A,)."""
        turned = step * FLIP
        second = product(step, turned)
        first, none = product(cones, turned), product(cones, cones * FLIP)
        under = first**2 - second * none
        fall = np.sqrt(np.maximum(under, 0.0)) - first
        ends = (under >= -_ROUNDED * first**2) & (fall > 0)  # zero where only the first is any
        return np.minimum(self.least(none / fall, ends), _FARTHEST)


def scaling(slack: Floats, press: Floats) -> tuple[Floats, Floats]:
    """Return the matrices (4, 4, C) that scale multipliers as their inverse does slacks."""
    sizes = [np.sqrt(product(part, part * FLIP)) for part in (slack, press)]
    slack, press = slack / sizes[0], press / sizes[1]
    middle = slack + press * FLIP
    middle /= np.sqrt(2 * (1 + product(slack, press)))
    middle[0] += 1.0
    turn = middle[:, None] * (middle / middle[0]) - _MIRROR
    size = np.sqrt(sizes[0] / sizes[1])
    return turn * size, turn * (FLIP[:, None] * FLIP) / size


def inverse_of(matrices: Floats) -> Floats:
    """Return the inverses of positive definite matrices (3, 3, N): a tenth of NumPy's time."""
    (a, b, c), (_, d, e), (_, _, f) = matrices
    first, second = b / a, c / a
    d = d - first * b
    third = (e - second * b) / d
    f = f - second * c - third * third * d
    far = first * third - second
    out = np.empty_like(matrices)
    out[2, 2] = 1 / f
    out[1, 2] = out[2, 1] = -third / f
    out[0, 2] = out[2, 0] = far / f
    out[1, 1] = 1 / d + third * third / f
    out[0, 1] = out[1, 0] = -first / d - far * third / f
    out[0, 0] = 1 / a + first * first / d + far * far / f
    return out


def circle(first: Floats, second: Floats) -> Floats:
    """Return the Jordan products of vectors (4, C)."""
    out: Floats = first[0] * second + second[0] * first
    out[0] = product(first, second)
    return out


def divide(jordan: Floats, factor: Floats) -> Floats:
    """Return the other factors of Jordan products (4, C)."""
    turned = factor * FLIP
    first = product(jordan, turned) / product(factor, turned)
    out: Floats = (jordan - first * factor) / factor[0]
    out[0] = first
    return out


def product(first: Floats, second: Floats) -> Floats:
    """Return the inner products (C,) of vectors (n, C)."""
    return np.asarray(np.einsum("ic,ic->c", first, second))


def apply(matrices: Floats, vectors: Floats) -> Floats:
    """Return products (n, C) of matrices (n, m, C) with vectors (m, C)."""
    return np.asarray(np.einsum("ijc,jc->ic", matrices, vectors))


def times(first: Floats, second: Floats) -> Floats:
    """Return products (n, k, C) of matrices (n, m, C) and (m, k, C)."""
    return np.asarray(np.einsum("ijc,jkc->ikc", first, second))
