r"""Tolerances: how far grips may be off, in the worst direction, within all payloads.

Forces are linear in where grips are. Grips that are off by :math:`\delta_i` change the force of one
from :math:`\lambda` to :math:`\lambda + \sum_i A_i \delta_i`. Of all misplacements that are no
longer than :math:`t` each, the worst makes it

.. math:: \max_{|u| = 1} \; u^T \lambda + t \, h(u), \qquad h(u) = \sum_i |A_i^T u|,

long: each :math:`\delta_i` points along :math:`A_i^T u`. It reaches a payload :math:`L` at
:math:`t = 1 / m` with

.. math:: m = \max_{|u| = 1} \; \frac{h(u)}{L - u^T \lambda}.

Any direction gives a lower bound of :math:`m`. An upper one comes from :math:`2 |v| \le w |v|^2 +
1/w`, by which the sum is below a quadratic form, and weak duality; where that is not close, from
spherical triangles: in the cone of three directions the convex :math:`h(u) + m u^T \lambda` is
at most the largest of its values at these over the distance of their plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Engine, OpeningEngine, Want, grip_columns
from seqopt.engines.registry import AutoEngine
from seqopt.errors import ProblemError
from seqopt.responses.quantities import NO_TOLERANCE, TOLERANCE, length_text
from seqopt.sequence.steps import Step

COLUMN = "tolerance_mm"
_UNITS = {"travel": " m", "makespan": " s", "bond": " Pa", "tilt": "°"}  # and of responses:
_UNITS |= {"F_": " N", "T_": " N", "C_": " N", "M_": " N m", "D_": " m"}
_AT_ONCE = 4096  # grip sets that are solved together
_CLOSE = 1e-11  # share of itself by which a rate must grow for the search to go on
_STEPS = 25  # of the search from one direction
_BEST = 4  # directions from which it begins
_PROVEN = (1e-6, 1e-4, 1e-3, 1e-2, 1e-1)  # shares of itself within which a rate is proven
_MOST = 20_000  # triangles that a proof may look at
_TINY = np.finfo(float).tiny


def is_tolerance(name: str) -> bool:
    """Return whether a response is a tolerance: a length, of which more is better."""
    return name == TOLERANCE


def values_text(values: Mapping[str, float]) -> str:
    """Format values of aims or responses by name, with their units; see `value_text`."""
    return ", ".join(f"{name} {value_text(name, value)}" for name, value in values.items())


def value_text(name: str, value: float) -> str:
    """Format a value of an aim, a budget or a response to six digits, with its unit if it has one.

    >>> value_text("travel", 17.7484), value_text("D_max", 2e-5), value_text("sum(M_sup)", 3.0)
    ('17.7484 m', '20 µm', '3 N m')
    """
    if name in (TOLERANCE, "D_max"):
        return length_text(value)
    of = name.removeprefix("sum(")  # the response, F_largest of sum(F_largest)
    unit = _UNITS.get(name) or (_UNITS.get(of[:2], "") if of[1:2] == "_" else "")
    return f"{value:.6g}{unit}"


@dataclass(frozen=True)
class Tolerance:
    """The tolerance of the grips of a step, and the payload that is reached first.

    ``distance``: m; zero where something is too large with all grips in their places, infinite
    where grips change nothing; ``proven``: up to which nothing is too large, m, mostly a millionth
    below it; ``what``: becomes too large first; empty if nothing does; ``misplacement``: the worst
    of every grip that is as far, m.
    """

    distance: float
    proven: float
    what: str = ""
    misplacement: tuple[tuple[float, ...], ...] = ()


class Misplaced(NamedTuple):
    """Forces that misplacements change, n of them."""

    own: Floats  # (n, 3); with all grips in their places, N
    influence: Floats  # (n, 3, 3r); N/m, all directions of all grips side by side
    most: Floats  # (n,); payloads, N

    def some(self, rows: Ints | slice) -> Misplaced:
        """Select forces."""
        return Misplaced(*(each[rows] for each in self))

    def pulls(self, u: Floats) -> Floats:
        """Return the influence (n, d, r, 3) of every grip in directions (n, d, 3)."""
        found = u @ self.influence
        return np.asarray(found.reshape(*found.shape[:2], found.shape[2] // 3, 3))

    def rates(self, u: Floats) -> Floats:
        """Return the rates (n, d), 1/m, in directions (n, d, 3)."""
        room = self.most[:, None] - (u @ self.own[:, :, None])[..., 0]
        return np.asarray(np.sqrt(np.square(self.pulls(u)).sum(axis=3)).sum(axis=2) / room)


def _misplaced(engine: Engine, bricks: int, grips: Ints) -> Misplaced:
    """Return the forces of the grips of sets (S, r), joints never failing; S r of them."""
    if isinstance(engine, OpeningEngine):
        raise ProblemError(
            f"tolerance: a {type(engine).__name__} is not linear in where grips are; take the "
            "engine compliance or auto"
        )
    engine = engine.rigid if isinstance(engine, AutoEngine) else engine
    sets, held = grips.shape
    own = engine.solve(bricks, grips, Want(0)).grip_force
    moved = np.tile(np.eye(3 * held).reshape(3 * held, held, 3), (sets, 1, 1))  # one after another
    off = engine.solve(bricks, np.repeat(grips, 3 * held, axis=0), Want(0), moved).grip_force
    change = off.reshape(sets, 3 * held, held, 3) - own[:, None]
    influence = change.transpose(0, 2, 3, 1).reshape(sets * held, 3, 3 * held)
    kinds = engine.network.scene.grip_kinds
    most = kinds.payload[kinds.split(grips)[1]].ravel()
    return Misplaced(own.reshape(-1, 3), np.ascontiguousarray(influence), most)


def tied(engine: Engine, bricks: int, grips: Ints) -> Bools:
    """Return which sets (S,) have two rigid grips on one brick."""
    kinds = engine.network.scene.grip_kinds
    brick = grip_columns(engine.network, bricks, grips) // 2
    apart = -1 - np.arange(grips.shape[1])  # soft grips are on no brick together
    brick = np.where(kinds.gives[kinds.split(grips)[1]], apart, brick)
    return np.asarray((np.diff(np.sort(brick, axis=1), axis=1) == 0).any(axis=1))


def misfits(engine: Engine, bricks: int, grips: Ints) -> Floats:
    """Return the reciprocals (S,) of the tolerances of grip sets (S, r), by number, 1/m.

    `NO_TOLERANCE` if a payload is exceeded without misplacement, and if two rigid grips hold one
    brick, which any misplacement makes incompatible.
    """
    held = grips.shape[1]
    if not bricks:  # the empty site: nobody holds
        return np.zeros(len(grips))
    out = np.where(tied(engine, bricks, grips), NO_TOLERANCE, 0.0)
    rows = np.flatnonzero(out == 0) if held else np.arange(0)
    step = max(1, _AT_ONCE // (3 * held + 1))
    for start in range(0, len(rows), step):
        part = rows[start : start + step]
        rates, _ = worst_rates(_misplaced(engine, bricks, grips[part]))
        out[part] = rates.reshape(len(part), held).max(axis=1)
    return np.asarray(np.minimum(out, NO_TOLERANCE))


def step_tolerance(engine: Engine, step: Step) -> Tolerance:
    """Return the tolerance of the grips of a step, with its proven lower bound."""
    scene = engine.network.scene
    grips = np.array([scene.grip_numbers(step.grips, step.bricks)]).reshape(1, -1)
    pairs = zip(scene.robots, step.grips, strict=True)
    holding = [robot.name for robot, node in pairs if node is not None]
    holding += [prop.label for prop in scene.standing_props(step.bricks, held=bool(holding))]
    if not holding:
        return Tolerance(np.inf, np.inf)
    if tied(engine, step.bricks, grips)[0]:
        return Tolerance(0.0, 0.0, "two rigid grips on one brick")
    forces = _misplaced(engine, step.bricks, grips)
    rates, direction = worst_rates(forces)
    _, highest = proven_rates(forces, direction)
    at = int(rates.argmax())
    if not rates[at]:
        return Tolerance(np.inf, np.inf)
    far = worst_misplacement(forces.some(slice(at, at + 1)), direction[at : at + 1])[0] / rates[at]
    what = f"payload of {holding[at]}"
    return Tolerance(1 / rates[at], 1 / highest.max(), what, tuple(map(tuple, far.tolist())))


def misfits_along(tolerances: ArrayLike) -> Floats:
    """Return the reciprocals of tolerances in mm, 1/m."""
    with np.errstate(divide="ignore"):
        return np.asarray(np.minimum(1e3 / np.asarray(tolerances, dtype=float), NO_TOLERANCE))


# the worst direction


def worst_rates(forces: Misplaced) -> tuple[Floats, Floats]:
    """Return by how much of its payload a misplacement of one meter may change each force.

    Results: ``rate`` (n,), 1/m, infinite where they are too large already; ``direction`` (n, 3).
    """
    rate, direction = np.full(len(forces.own), np.inf), np.zeros_like(forces.own)
    direction[:, 0] = 1.0
    rows = np.flatnonzero(np.linalg.norm(forces.own, axis=1) < forces.most)
    for start in range(0, len(rows), _AT_ONCE):
        part = rows[start : start + _AT_ONCE]
        rate[part], direction[part] = _search(forces.some(part))
    return rate, direction


def proven_rates(forces: Misplaced, direction: Floats) -> tuple[Floats, Floats]:
    """Return proven bounds of the rates (n,), 1/m, from estimates of directions (n, 3)."""
    low, high = np.full((2, len(forces.own)), np.inf)
    for i in np.flatnonzero(np.linalg.norm(forces.own, axis=1) < forces.most):
        low[i], high[i], _ = _bracket(forces.some(slice(i, i + 1)), direction[i : i + 1])
    return low, high


def worst_misplacement(forces: Misplaced, direction: Floats) -> Floats:
    """Return the unit misplacements (n, r, 3) that are worst for forces in their directions."""
    pulls = forces.pulls(direction[:, None])[:, 0]
    return np.asarray(pulls / np.maximum(np.linalg.norm(pulls, axis=2), _TINY)[..., None])


def _search(forces: Misplaced) -> tuple[Floats, Floats]:
    """Return rates (n,) and directions (n, 3): from one start if proven optimal, else several."""
    sphere = np.unique(_triangles(2).reshape(-1, 3).round(12), axis=0)
    every = np.broadcast_to(sphere, (len(forces.own), *sphere.shape))
    starts = sphere[np.argsort(-forces.rates(every), axis=1, kind="stable")[:, :_BEST]]
    rate, direction = _climb(forces, starts[:, 0])
    for other in range(1, _BEST):
        rows = np.flatnonzero(~_is_bounded(forces, direction, rate * (1 + _PROVEN[0])))
        found, ends = _climb(forces.some(rows), starts[rows, other])
        better = found > rate[rows]
        rate[rows[better]], direction[rows[better]] = found[better], ends[better]
    for i in np.flatnonzero(~_is_bounded(forces, direction, rate * (1 + _PROVEN[0]))):
        rate[i], _, direction[i] = _bracket(forces.some(np.array([i])), direction[i : i + 1])
    return rate, direction


def _climb(forces: Misplaced, start: Floats) -> tuple[Floats, Floats]:
    """Return locally maximal rates (n,) and their directions (n, 3).

    Along its own slope a convex function of degree one is at least as large as where that was
    taken; a step of Newton's is tried beside it.
    """
    u, rate = start.copy(), forces.rates(start[:, None])[:, 0]
    left = np.arange(len(u))
    for _ in range(_STEPS):
        some, before = forces.some(left), rate[left]
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


def _steps(forces: Misplaced, rate: Floats, u: Floats) -> Floats:
    """Return the directions (n, 2, 3) of the gradient and of a Newton step on the sphere."""
    pulls = forces.pulls(u[:, None])[:, 0]
    size = _floored(np.linalg.norm(pulls, axis=2))[:, :, None]
    ahead = forces.influence @ (pulls / size).reshape(len(u), 3 * pulls.shape[1], 1)
    slope = ahead[..., 0] + rate[:, None] * forces.own
    weighed = forces.influence / np.repeat(size[..., 0], 3, axis=1)[:, None]
    bend = weighed @ forces.influence.transpose(0, 2, 1)
    n, r = pulls.shape[:2]
    back = forces.influence.reshape(n, 3, r, 3) * (pulls / size**1.5)[:, None]
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
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(size > _TINY, vectors / np.maximum(size, _TINY), otherwise)


def _bracket(one: Misplaced, u: Floats) -> tuple[float, float, Floats]:
    """Return lower and upper bound of the rate of one force, by the tightest proof.

    Last is the direction (1, 3) of the first: triangles may meet one that is worse than ``u``.
    """
    low = float(one.rates(u[:, None])[0, 0])
    for share in _PROVEN:
        high = low * (1 + share)
        if _is_bounded(one, u, np.array([high]))[0]:
            return low, high, u
        found = _by_triangles(one, high)
        if isinstance(found, np.ndarray):
            return _bracket(one, _climb(one, found)[1])
        if found:
            return low, high, u
    return low, np.inf, u


def _floored(size: Floats) -> Floats:
    """Return lengths (n, r) bounded away from zero: any weights give a valid bound."""
    total = size.sum(axis=1, keepdims=True)
    return np.asarray(np.maximum(size, np.where(total > 0, 1e-9 * total, 1.0)))


def _is_bounded(forces: Misplaced, u: Floats, rate: Floats) -> Bools:
    """Return whether weak duality, by weights from a direction, proves that rates are no larger."""
    size = _floored(np.linalg.norm(forces.pulls(u[:, None])[:, 0], axis=2))
    weighed = forces.influence / np.repeat(size, 3, axis=1)[:, None]
    values, axes = np.linalg.eigh(weighed @ forces.influence.transpose(0, 2, 1))
    whole = rate * forces.most
    room = whole[:, None] - values
    pulled = (forces.own[:, None] @ axes)[:, 0] * rate[:, None]
    sound = room.min(axis=1) > 0
    bound = (pulled**2 / np.where(sound[:, None], room, 1.0)).sum(axis=1) + size.sum(axis=1)
    return np.asarray(sound & (bound <= whole))


def _by_triangles(one: Misplaced, rate: float) -> bool | Floats:
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
    ab, bc, ca = (_unit(x + y, x) for x, y in ((a, b), (b, c), (c, a)))
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
