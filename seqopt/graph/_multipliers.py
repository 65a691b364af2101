r"""Multipliers with the highest Lagrangian bound, by cutting planes.

Every path :math:`p` is a plane over the multipliers :math:`\lambda`, and the least of all planes is
a bound on what is sought, concave and piecewise linear:

.. math::

   \max_{\lambda \in \Lambda} \; L(\lambda), \qquad
   L(\lambda) = \min_p \; \bigl( c(p) + \lambda^T s(p) \bigr) .

An oracle finds a shortest path at given multipliers. The next ones are the highest point of the
planes found so far (Kelley, The cutting-plane method, 1960),

.. math::

   \max_{\lambda \in \Lambda, \, \theta} \; \theta \quad\text{s.t.}\quad
   \theta \le c(p) + \lambda^T s(p) \quad \text{for every path } p \text{ found so far,}

until :math:`\theta`, which is above :math:`L` everywhere, is no higher than the best bound. What
the multipliers are of differs:

- budgets :math:`B`: :math:`s = a(p) - B`, from 0 up to a largest, over what a path costs per unit;
- scenarios: :math:`c = 0` and :math:`s` the totals; weights up to a largest, which add up to one;
- robots' time: :math:`c = 0` and :math:`s` the work of all and of a robot of every kind; shares of
  which, times the number of robots, :math:`n^T \lambda = 1`.

Where they add up to one, every second ones are halfway to the best known: at corners planes say
little of the others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats


class Plane(NamedTuple):
    """The plane of the best path at given multipliers, and a lower bound of the dual there."""

    constant: float
    slope: Floats
    bound: float


class Highest(NamedTuple):
    """The best multipliers so far, and their Lagrangian bound: infinite if there is no path."""

    multipliers: Floats
    bound: float


class Polyhedron(NamedTuple):
    """Multipliers from 0 on.

    ``most``: the largest; of budgets, over what a path costs per unit; ``units`` (d,): of budgets,
    their size; ``counts`` (d,): of shares, with which they add up to one.
    """

    most: float
    units: Floats | None = None
    counts: Floats | None = None

    def highest(self, planes: Sequence[Plane]) -> Highest | None:
        """Return the highest point under all planes; None where the program has no solution."""
        from scipy.optimize import linprog  # noqa: PLC0415  # slow to import, few ask for it

        constant, slope = (
            np.array([p.constant for p in planes]),
            np.array([p.slope for p in planes]),
        )
        size = np.abs(slope).max(axis=0, initial=0.0)
        scale = float(np.abs(constant).max() or (1.0 if self.counts is None else size.max() or 1.0))
        if self.units is None:
            size = np.full_like(size, scale)
        else:
            size = np.maximum(size, self.units)
            size[size == 0] = 1.0
        found = linprog(
            [*[0.0] * len(size), -1.0],
            A_ub=np.column_stack([-slope / size, np.ones(len(planes))]),
            b_ub=constant / scale,
            A_eq=None if self.counts is None else [[*self.counts, 0.0]],
            b_eq=None if self.counts is None else [1.0],
            bounds=[*[(0.0, self.most)] * len(size), (None, None)],
            method="highs",
        )
        if found.x is None or found.fun is None:
            return None
        multipliers = np.clip(found.x[:-1], 0.0, self.most) * scale / size
        if self.counts is not None:
            multipliers /= multipliers @ self.counts
        return Highest(multipliers, float(-found.fun) * scale)


def highest_bound(
    oracle: Callable[[Floats], Plane | None],
    start: Floats,
    polyhedron: Polyhedron,
    ended: Callable[[float], bool],
    *,
    rounds: int,
    closed: float,
) -> Highest:
    """Return the multipliers with the highest bound.

    ``oracle``: finds a shortest path at multipliers, None if there is no path; ``start``: asked
    first; ``ended``: called with the best bound after every plane; ``closed``: share of a bound to
    which it is the highest.
    """
    planes, ask, best = list[Plane](), start, Highest(start, -np.inf)
    for step in range(rounds):
        plane = oracle(ask)
        if plane is None:
            return Highest(ask, np.inf)
        planes.append(plane)
        if plane.bound > best.bound:
            best = Highest(ask, plane.bound)
        if ended(best.bound):
            break
        top = polyhedron.highest(planes)
        if top is None or top.bound - best.bound <= closed * max(abs(top.bound), abs(best.bound)):
            break
        halfway = polyhedron.counts is not None and step % 2 == 1
        ask = 0.5 * (top.multipliers + best.multipliers) if halfway else top.multipliers
    return best
