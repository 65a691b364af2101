"""The loops of `seqopt.engines.rigid._extremes`, compiled by numba where it is installed.

Nothing else imports this file. The code is compiled when it is first called and kept in the
folder that numba chooses: beside this file, or the user's own (``NUMBA_CACHE_DIR`` names another).
No function touches what another call works on, and none holds Python's lock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import numba
import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.rigid._extremes import Edges, Ends, Grown, Motion, Part

_ROUNDED = 1 + 1e-9  # a bound is as much larger than what rounding may leave

_Function = TypeVar("_Function", bound=Callable[..., object])


def _compiled(*freedom: str) -> Callable[[_Function], _Function]:
    """Return a decorator that compiles a function at its first call, cached if there is a folder.

    ``freedom``: what may differ from arithmetic by the book, in numba's words.
    """
    free = {"contract", *freedom}

    def compiled(function: _Function) -> _Function:
        make = partial(numba.njit, nogil=True, fastmath=free, error_model="numpy")
        try:
            found: Any = make(cache=True)(function)
        except RuntimeError:  # no folder can be written
            found = make()(function)
        return cast("_Function", found)

    return compiled


@_compiled()
def _add_six(out: Floats, rows: Floats, first: int, much: Floats) -> None:
    """Add six neighboring rows, so much of each."""
    a, b, c = rows[first], rows[first + 1], rows[first + 2]
    d, e, f = rows[first + 3], rows[first + 4], rows[first + 5]
    p, q, r, s, t, u = much[0], much[1], much[2], much[3], much[4], much[5]
    for n in range(len(out)):
        out[n] += (p * a[n] + q * b[n] + r * c[n]) + (s * d[n] + t * e[n] + u * f[n])


@_compiled()
def _sum_rows(moved: Floats, carried: Floats, grown: Grown, at: Ints, force: Floats) -> None:
    """Find the twists and wrenches under the weight and forces at nodes."""
    pull = np.empty(6)
    moved[:] = grown.twist[0, : len(moved)]
    carried[:] = grown.wrench[0, : len(carried)]
    for i in range(len(at)):
        brick, first = at[i] // 2, 3 * (at[i] % 2)
        for p in range(6):
            pull[p] = 0.0
            for a in range(3):
                pull[p] += grown.nodes[brick, first + a, p] * force[3 * i + a]
        _add_six(moved, grown.twist, 1 + 6 * brick, pull)
        _add_six(carried, grown.wrench, 1 + 6 * brick, pull)


@_compiled("nnan", "nsz")
def _extremes_outside(carried: Floats, edges: Edges, part: Part) -> tuple[float, float]:
    """Return the least and the largest force of all edges but inner ones."""
    least, most = np.inf, -np.inf
    for e in range(part.edges - part.bricks):
        j, tension = edges.first[e], 0.0
        if j < len(carried):  # else its spring does not act yet
            x, y, z = edges.along[0, e], edges.along[1, e], edges.along[2, e]
            tension = x * carried[j] + y * carried[j + 1] + z * carried[j + 2]
        least, most = min(least, tension), max(most, tension)
    return least, most


@_compiled()
def _pull_bricks(
    tension: Floats, carried: Floats, edges: Edges, part: Part, at: Ints, force: Floats
) -> None:
    """Find the forces of inner edges (b,); two grips on one share what is between them."""
    for b in range(part.bricks):
        total = part.at_second[b]
        for k in range(edges.start[b], edges.start[b + 1]):
            if edges.at[k] < len(carried):
                total += edges.much[k] * carried[edges.at[k]]
        tension[b] = total
    for i in range(len(at)):
        for a in range(3):
            along = part.axis[at[i] // 2, a] * (at[i] % 2)
            tension[at[i] // 2] += along * force[3 * i + a]
    for second in range(1, len(at)):
        for first in range(second):
            brick = at[first] // 2
            if at[second] // 2 == brick:
                between = tension[brick] * (1.0 - 2.0 * (at[first] % 2))
                tension[brick] = 0.0
                for a in range(3):
                    force[3 * first + a] += between * part.axis[brick, a]
                    force[3 * second + a] -= between * part.axis[brick, a]


@_compiled("nnan", "nsz")
def _square(moved: Floats, motion: Motion, node: int) -> float:
    """Return the square of how far a node moves."""
    square = 0.0
    for row in range(3 * node, 3 * node + 3):
        total = 0.0
        for k in range(motion.start[row], motion.start[row + 1]):
            if motion.at[k] < len(moved):
                alone = 6 * motion.since[k] > len(moved)
                total += motion.much[k] * moved[motion.at[k]] * (1.0 + alone)
        square += total * total
    return square


@_compiled("nnan", "nsz")
def _farthest(moved: Floats, motion: Motion, nodes: int, first: int) -> tuple[float, int]:
    """Return the square of how far any node moves, and its brick: one that may be it is first."""
    best, far = 0.0, first
    for after in range(-1, len(moved) // 6):
        brick = first if after < 0 else after
        shift = turn = 0.0
        for p in range(6 * brick, 6 * brick + 3):
            shift += moved[p] * moved[p]
            turn += moved[p + 3] * moved[p + 3]
        turn *= motion.reach[brick] * motion.reach[brick]
        if 2 * (shift + turn) * _ROUNDED <= best:  # as the square of a sum is no more than that
            continue
        if (shift + turn + 2 * np.sqrt(shift * turn)) * _ROUNDED <= best:
            continue
        for k in range(motion.first[brick], motion.first[brick + 1]):
            if motion.node[k] < nodes:
                square = _square(moved, motion, motion.node[k])
                if square > best:
                    best, far = square, brick
    return best, far


@_compiled("nnan", "nsz")
def _most_moment(carried: Floats, ends: Ends) -> float:
    """Return the square of the largest moment at any ground end that acts."""
    most = 0.0
    for g in range(len(ends.first)):
        first, square = ends.first[g], 0.0
        if first >= len(carried):
            continue
        for c in range(3):
            total = 0.0
            for p in range(6):
                total += carried[first + p] * ends.moment[g, p, c]
            square += total * total
        most = max(most, square)
    return most


@_compiled("nnan", "nsz")
def reduce_sets(
    grown: Grown, maps: tuple[Edges, Motion, Ends], part: Part, columns: Ints, force: Floats
) -> Floats:
    """Return squares of extremes of sets, (4, S), and let grips on one brick share, in place.

    Of edge forces they are no squares. ``force`` (S, k): of rigid grips at nodes (S, r).
    """
    edges, motion, ends = maps
    found, tension = np.zeros((4, len(columns))), np.empty(part.bricks)
    carried, moved, far = np.empty(part.wrenches), np.empty(6 * part.bricks), 0
    for s in range(len(columns)):
        _sum_rows(moved, carried, grown, columns[s], force[s])
        if part.nodes:
            found[2, s], far = _farthest(moved, motion, part.nodes, far)
        found[3, s] = _most_moment(carried, ends)
        least, most = _extremes_outside(carried, edges, part)
        _pull_bricks(tension, carried, edges, part, columns[s], force[s])
        for b in range(part.bricks):
            least, most = min(least, tension[b]), max(most, tension[b])
        found[0, s], found[1, s] = least, most
    return found
