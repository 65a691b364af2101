r"""The share of a limit that a misplacement uses up, in the worst of all directions.

Grips that are off by :math:`\delta_i` change a vector of a structure, the force of a grip or the
displacement of a node, from :math:`\lambda` to :math:`\lambda + \sum_i A_i \delta_i`. Of all
misplacements that are no longer than :math:`t` each, the worst makes it

.. math:: \max_{|u| = 1} \; u^T \lambda + t \, h(u), \qquad h(u) = \sum_i |A_i^T u|,

long: each :math:`\delta_i` points along :math:`A_i^T u`. It reaches a length :math:`L` at
:math:`t = 1 / m` with

.. math:: m = \max_{|u| = 1} \; \frac{h(u)}{L - u^T \lambda}.

Any direction gives a lower bound of :math:`m`. An upper one comes from :math:`2 |v| \le w |v|^2 +
1/w`, by which the sum is below a quadratic form, and weak duality; where that is not close, from
spherical triangles: in the cone of three directions the convex :math:`h(u) + m u^T \lambda` is
at most the largest of its values at these over the distance of their plane.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints

_CLOSE = 1e-11  # share of itself by which a rate must grow for the search to go on
_STEPS = 25  # of the search from one direction
_BEST = 4  # directions from which it begins
_PROVEN = (1e-6, 1e-4, 1e-3, 1e-2, 1e-1)  # shares of itself within which a rate is proven
_MOST = 20_000  # triangles that a proof may look at
_AT_ONCE = 2048  # vectors
_TINY = np.finfo(float).tiny


def worst_rates(own: Floats, influence: Floats, most: Floats) -> tuple[Floats, Floats]:
    """Return the worst rate of a misplacement of one meter, as a share of the limit of vectors.

    ``own`` (n, 3): the vectors where nothing is misplaced; ``influence`` (n, r, 3, 3): by what
    they change, by component, for one meter of each grip, by direction; ``most`` (n,): how long
    they may be. Results: ``rate`` (n,), 1/m, infinite where they are too long already;
    ``direction`` (n, 3): unit vectors along which they become so first.
    """
    rate, direction = np.full(len(own), np.inf), np.tile([1.0, 0.0, 0.0], (len(own), 1))
    vectors = _Vectors.of(own, influence, most)
    rows = np.flatnonzero(np.linalg.norm(own, axis=1) < most)
    for start in range(0, len(rows), _AT_ONCE):
        part = rows[start : start + _AT_ONCE]
        rate[part], direction[part] = _search(vectors.some(part))
    return rate, direction


def proven_rates(
    own: Floats, influence: Floats, most: Floats, direction: Floats
) -> tuple[Floats, Floats]:
    """Return proven lower and upper bounds of the rates of vectors, (n,) each, 1/m.

    ``direction`` (n, 3): estimates of the worst ones; else as `worst_rates`.
    """
    low, high = np.full((2, len(own)), np.inf)
    vectors = _Vectors.of(own, influence, most)
    for i in np.flatnonzero(np.linalg.norm(own, axis=1) < most):
        low[i], high[i], _ = _bracket(vectors.some(np.array([i])), direction[i : i + 1])
    return low, high


def worst_misplacement(influence: Floats, direction: Floats) -> Floats:
    """Return the unit misplacements (n, r, 3) that are worst for vectors in their directions."""
    pulls = np.einsum("ngij,ni->ngj", influence, direction)
    return np.asarray(pulls / np.maximum(np.linalg.norm(pulls, axis=2), _TINY)[..., None])


class _Vectors(NamedTuple):
    """Vectors that misplacements change, n of them."""

    own: Floats  # (n, 3)
    influence: Floats  # (n, 3, 3r); all directions of all grips side by side
    most: Floats  # (n,)

    @classmethod
    def of(cls, own: Floats, influence: Floats, most: Floats) -> _Vectors:
        n, r = influence.shape[:2]
        wide = np.ascontiguousarray(influence.transpose(0, 2, 1, 3).reshape(n, 3, 3 * r))
        return cls(own, wide, most)

    def some(self, rows: Ints) -> _Vectors:
        return _Vectors(*(each[rows] for each in self))

    def pulls(self, u: Floats) -> Floats:
        """Return the influence (n, d, r, 3) of every grip in directions (n, d, 3)."""
        found = u @ self.influence
        return np.asarray(found.reshape(*found.shape[:2], found.shape[2] // 3, 3))

    def rates(self, u: Floats) -> Floats:
        """Return the rates (n, d) in directions (n, d, 3)."""
        room = self.most[:, None] - (u @ self.own[:, :, None])[..., 0]
        return np.asarray(np.sqrt(np.square(self.pulls(u)).sum(axis=3)).sum(axis=2) / room)


def _search(vectors: _Vectors) -> tuple[Floats, Floats]:
    """Return rates (n,) and directions (n, 3): from one start where it is proven optimal.

    Elsewhere from several, and if no bound is tight, by spherical triangles.
    """
    sphere = np.unique(_triangles(2).reshape(-1, 3).round(12), axis=0)
    every = np.broadcast_to(sphere, (len(vectors.own), *sphere.shape))
    starts = sphere[np.argsort(-vectors.rates(every), axis=1, kind="stable")[:, :_BEST]]
    rate, direction = _climb(vectors, starts[:, 0])
    for other in range(1, _BEST):
        rows = np.flatnonzero(~_below_quadratic(vectors, direction, rate * (1 + _PROVEN[0])))
        found, ends = _climb(vectors.some(rows), starts[rows, other])
        better = found > rate[rows]
        rate[rows[better]], direction[rows[better]] = found[better], ends[better]
    for i in np.flatnonzero(~_below_quadratic(vectors, direction, rate * (1 + _PROVEN[0]))):
        rate[i], _, direction[i] = _bracket(vectors.some(np.array([i])), direction[i : i + 1])
    return rate, direction


def _climb(vectors: _Vectors, start: Floats) -> tuple[Floats, Floats]:
    """Return locally maximal rates (n,) and their directions (n, 3).

    Along its own slope a convex function of degree one is at least as large as where that was
    taken; a step of Newton's is tried beside it.
    """
    u, rate = start.copy(), vectors.rates(start[:, None])[:, 0]
    left = np.arange(len(u))
    for _ in range(_STEPS):
        some, before = vectors.some(left), rate[left]
        new = _steps(some, before, u[left])
        found = some.rates(new)
        best = found.argmax(axis=1)
        found, new = found[np.arange(len(left)), best], new[np.arange(len(left)), best]
        better = found > before
        u[left[better]], rate[left[better]] = new[better], found[better]
        left = left[found > (1 + _CLOSE) * before]
        if not len(left):
            break
    return rate, u


def _steps(vectors: _Vectors, rate: Floats, u: Floats) -> Floats:
    """Return the directions (n, 2, 3) of the gradient and of a Newton step on the sphere."""
    pulls = vectors.pulls(u[:, None])[:, 0]
    size = _floored(np.sqrt(np.square(pulls).sum(axis=2)))[:, :, None]
    ahead = vectors.influence @ (pulls / size).reshape(len(u), 3 * pulls.shape[1], 1)
    slope = ahead[..., 0] + rate[:, None] * vectors.own
    weighed = vectors.influence / np.repeat(size[..., 0], 3, axis=1)[:, None]
    bend = weighed @ vectors.influence.transpose(0, 2, 1)
    n, r = pulls.shape[:2]
    back = vectors.influence.reshape(n, 3, r, 3) * (pulls / size**1.5)[:, None]
    back = back.sum(axis=3)
    bend -= back @ back.transpose(0, 2, 1)
    upright = np.maximum((u * slope).sum(axis=1), _TINY)[:, None]
    across = slope - upright * u
    first = np.cross(u, np.eye(3)[np.abs(u).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frame = np.stack([first, np.cross(u, first)], axis=1)  # (n, 2, 3)
    turn = upright[..., None] * np.eye(2) - frame @ bend @ frame.transpose(0, 2, 1)
    (a, b), (c, d) = turn.transpose(1, 2, 0)
    det = a * d - b * c
    sound = det > 1e-9 * upright[:, 0] ** 2
    x, y = (frame @ across[..., None])[..., 0].T
    step = np.stack([d * x - b * y, a * y - c * x], axis=1) / np.where(sound, det, 1.0)[:, None]
    newton = np.where(sound[:, None], (step[:, None] @ frame)[:, 0], 0.0)
    return np.stack([_unit(slope, u), _unit(u + newton, u)], axis=1)


def _unit(vectors: Floats, otherwise: Floats) -> Floats:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(size > _TINY, vectors / np.maximum(size, _TINY), otherwise)


def _bracket(one: _Vectors, u: Floats) -> tuple[float, float, Floats]:
    """Return lower and upper bound of the rate of one vector, by the tightest proof.

    Last is the direction (1, 3) of the first: triangles may meet one that is worse than ``u``.
    """
    low = float(one.rates(u[:, None])[0, 0])
    for share in _PROVEN:
        while True:
            high = low * (1 + share)
            if _below_quadratic(one, u, np.array([high]))[0]:
                return low, high, u
            found = None if share == _PROVEN[0] else _by_triangles(one, high)
            if not isinstance(found, np.ndarray):
                break
            rate, u = _climb(one, found)  # a better one was met on the way
            low = float(rate[0])
        if found is True:
            return low, high, u
    return low, np.inf, u


def _floored(size: Floats) -> Floats:
    """Return lengths (n, r) bounded away from zero: any weights give a valid bound."""
    total = size.sum(axis=1, keepdims=True)
    return np.asarray(np.maximum(size, np.where(total > 0, 1e-9 * total, 1.0)))


def _below_quadratic(vectors: _Vectors, u: Floats, rate: Floats) -> Bools:
    """Return whether weak duality proves that no direction has larger rates (n,)."""
    size = _floored(np.sqrt(np.square(vectors.pulls(u[:, None])[:, 0]).sum(axis=2)))
    weighed = vectors.influence / np.repeat(size, 3, axis=1)[:, None]
    values, axes = np.linalg.eigh(weighed @ vectors.influence.transpose(0, 2, 1))
    all_of = rate * vectors.most
    room = all_of[:, None] - values
    pulled = (vectors.own[:, None] @ axes)[:, 0] * rate[:, None]
    sound = room.min(axis=1) > 0
    total = (pulled**2 / np.where(sound[:, None], room, 1.0)).sum(axis=1) + size.sum(axis=1)
    return np.asarray(sound & (total <= all_of))


def _by_triangles(one: _Vectors, rate: float) -> bool | Floats:
    """Prove by triangles that no direction has a larger rate, or return one (1, 3) that has."""
    left, seen = _triangles(1), 0
    while len(left):
        seen += len(left)
        if seen > _MOST:
            return False
        corners = left.reshape(1, -1, 3)
        found = one.rates(corners)[0]
        if found.max() > rate:
            return corners[:, found.argmax()]
        pulls = np.linalg.norm(one.pulls(corners)[0], axis=2).sum(axis=1)
        values = (pulls + rate * (corners[0] @ one.own[0])).reshape(-1, 3).max(axis=1)
        normal = np.cross(left[:, 1] - left[:, 0], left[:, 2] - left[:, 0])
        size = np.maximum(np.linalg.norm(normal, axis=1), _TINY)
        plane = np.abs(np.einsum("ti,ti->t", normal, left[:, 0])) / size  # from the center
        left = _quartered(left[values > rate * one.most[0] * plane])
    return True


def _quartered(triangles: Floats) -> Floats:
    """Return four triangles (4t, 3, 3) on the sphere for each."""
    a, b, c = triangles.transpose(1, 0, 2)
    middle = [_unit(x + y, x) for x, y in ((a, b), (b, c), (c, a))]
    ab, bc, ca = middle
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])


@cache
def _triangles(times: int) -> Floats:
    """Return triangles (t, 3, 3) that cover the sphere: of an octahedron, quartered."""
    signs = np.array([[i, j, k] for i in (1, -1) for j in (1, -1) for k in (1, -1)], dtype=float)
    out = np.stack([np.diag(row) for row in signs])
    for _ in range(times):
        out = _quartered(out)
    return out
