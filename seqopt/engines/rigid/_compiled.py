"""The loops of `seqopt.engines.rigid._extremes`, compiled by numba where it is installed.

Nothing else imports this file. Grip sets are solved a few at a time, side by side, so that a
processor works on several at once; what loads mean is summed for one stretch of edges or
nodes at a time, over all sets, so that it stays in the processor's cache. The code is compiled when
it is first called and kept in the folder that numba chooses: beside this file, or the user's own
(``NUMBA_CACHE_DIR`` names another). No function touches what another call works on, and none holds
Python's lock.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import numba
import numpy as np

from seqopt.arrays import Floats, Ints

_SIDE_BY_SIDE = 16  # sets: a number that is known when loops are compiled

_Function = TypeVar("_Function", bound=Callable[..., object])


def _compiled(*freedom: str) -> Callable[[_Function], _Function]:
    """Return what compiles a function when it is first called, and keeps it if there is a place.

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
def solve_grips(
    flexibility: Floats,
    dead: Floats,
    axis: Floats,
    held: tuple[Ints, Ints],
    force: Floats,
    pivot: Floats,
) -> None:
    """Find the forces (S, k) that undo the displacements (l,) at grips, and scaled pivots (k, S).

    As ``_solve_positive`` of `seqopt.engines.rigid._grip_equations`, of rigid grips. ``axis`` (b,
    d): along bricks; ``held`` (S, r), (S, k): nodes and their loads.
    """
    columns, index = held
    sets, count = index.shape
    low, share = np.empty((count, count, _SIDE_BY_SIDE)), np.empty((count, _SIDE_BY_SIDE))
    at = np.empty(count, dtype=np.uint64)  # else each look-up asks whether it counts from the end
    for start in range(0, sets, _SIDE_BY_SIDE):
        for s in range(_SIDE_BY_SIDE):
            mine = min(start + s, sets - 1)
            for i in range(count):
                at[i] = index[mine, i]
                for j in range(i + 1):
                    low[i, j, s] = flexibility[at[i], at[j]]
                share[i, s] = -dead[at[i]]
            _brace(low, s, axis, columns, mine)
        _undo(low, share, start, force, pivot)


@_compiled()
def _undo(low: Floats, share: Floats, start: int, force: Floats, pivot: Floats) -> None:
    """Find forces (S, k) and scaled pivots (k, S) of the sets from one on, which lie side by side.

    ``low`` (k, k, w), ``share`` (k, w): their equations, which are used up.
    """
    pivots, own = np.empty((2, len(share), _SIDE_BY_SIDE))
    for i in range(len(share)):
        for s in range(_SIDE_BY_SIDE):
            own[i, s] = low[i, i, s]
    _eliminate(low, pivots)
    _substitute(low, share)
    for s in range(min(_SIDE_BY_SIDE, len(force) - start)):
        for i in range(len(share)):
            force[start + s, i] = share[i, s]
            pivot[i, start + s] = pivots[i, s] / own[i, s]


@_compiled()
def _brace(low: Floats, s: int, axis: Floats, columns: Ints, mine: int) -> None:
    """Give the force between two grips on one brick a flexibility, so that there is one answer."""
    width, scale = axis.shape[1], 0.0
    for i in range(len(low)):
        scale += low[i, i, s]
    for second in range(1, columns.shape[1]):
        for first in range(second):
            brick = columns[mine, first] // 2
            if columns[mine, second] // 2 != brick:
                continue
            f, g = width * first, width * second
            for i in range(width):
                for j in range(width):
                    more = scale * axis[brick, i] * axis[brick, j]
                    if j <= i:
                        low[f + i, f + j, s] += more
                        low[g + i, g + j, s] += more
                    low[g + i, f + j, s] -= more


@_compiled()
def share_pairs(
    axis: Floats,
    inner: tuple[Ints, Floats],
    held: tuple[Ints, Ints],
    force: Floats,
    size: Floats,
    idle: Ints,
) -> None:
    """Find what each grip bears, where each of two on one brick takes what reaches its own node.

    As ``share_pairs`` of `seqopt.engines.rigid._grip_equations`. ``inner`` (b,), (l + 1, b): the
    inner edges, and what loads mean to them; ``size`` (S, r): of the forces; ``idle`` (S, p): inner
    edges that carry nothing then, -1 for none.
    """
    columns, index = held
    edge, mean = inner
    width, own = axis.shape[1], np.empty(force.shape[1])
    for s in range(len(columns)):
        pairs = 0
        for k in range(len(own)):
            own[k] = force[s, k]
        for second in range(1, columns.shape[1]):
            for first in range(second):
                node, brick = columns[s, first], columns[s, first] // 2
                if columns[s, second] // 2 != brick:
                    continue
                idle[s, pairs] = edge[brick]
                pairs += 1
                carried = mean[len(mean) - 1, brick]
                for k in range(len(own)):
                    carried += own[k] * mean[index[s, k], brick]
                carried *= 1.0 - 2.0 * (node % 2)  # the axis leads to the second node
                for i in range(width):
                    own[width * first + i] += carried * axis[brick, i]
                    own[width * second + i] -= carried * axis[brick, i]
        for k in range(pairs, idle.shape[1]):
            idle[s, k] = -1
        for grip in range(size.shape[1]):
            squared = 0.0
            for i in range(width * grip, width * grip + width):
                squared += own[i] * own[i]
            size[s, grip] = np.sqrt(squared)


@_compiled()
def _eliminate(low: Floats, pivots: Floats) -> None:
    """Turn lower triangles (k, k, w) into their factors, with reciprocals of the pivots (k, w)."""
    count = len(low)
    row = np.empty((count, _SIDE_BY_SIDE))
    for j in range(count):
        for k in range(j):  # a row of the factors, left of the diagonal, times the pivots
            for s in range(_SIDE_BY_SIDE):
                row[k, s] = low[j, k, s] * pivots[k, s]
        for i in range(j, count):
            for k in range(j):
                for s in range(_SIDE_BY_SIDE):
                    low[i, j, s] -= low[i, k, s] * row[k, s]
        for s in range(_SIDE_BY_SIDE):
            pivots[j, s] = low[j, j, s]
            low[j, j, s] = 1.0 / low[j, j, s]
        for i in range(j + 1, count):
            for s in range(_SIDE_BY_SIDE):
                low[i, j, s] *= low[j, j, s]


@_compiled()
def _substitute(low: Floats, share: Floats) -> None:
    """Turn loads (k, w) into answers."""
    count = len(share)
    for i in range(count):
        for k in range(i):
            for s in range(_SIDE_BY_SIDE):
                share[i, s] -= low[i, k, s] * share[k, s]
    for i in range(count - 1, -1, -1):
        for s in range(_SIDE_BY_SIDE):
            share[i, s] *= low[i, i, s]
        for k in range(i + 1, count):
            for s in range(_SIDE_BY_SIDE):
                share[i, s] -= low[k, i, s] * share[k, s]


@_compiled()
def _sum_into(out: Floats, rows: Floats, part: int, loads: tuple[Ints, Floats], s: int) -> None:
    """Find what the weight, the last of the rows (p, l + 1, n), and forces of a set mean in a part.

    Rows are not cut out, for each part and set: it takes as long as summing a hundred numbers.
    Three at a time: those of a grip in space.
    """
    index, force = loads
    count, weight, m = index.shape[1], rows.shape[1] - 1, part
    for n in range(len(out)):
        out[n] = rows[m, weight, n]
    for k in range(0, count - 2, 3):
        a, b, c = index[s, k], index[s, k + 1], index[s, k + 2]
        p, q, r = force[s, k], force[s, k + 1], force[s, k + 2]
        for n in range(len(out)):
            out[n] += p * rows[m, a, n] + q * rows[m, b, n] + r * rows[m, c, n]
    for k in range(count - count % 3, count):
        for n in range(len(out)):
            out[n] += force[s, k] * rows[m, index[s, k], n]


@_compiled("nnan", "nsz")  # else no maximum is taken of several numbers at once
def reduce_rows(
    rows: Floats,
    counts: tuple[int, int, int, int],
    loads: tuple[Ints, Floats],
    idle: Ints,
    found: Floats,
) -> None:
    """Find extremes of what forces (S, k) at loads (S, k) and the weight mean.

    ``rows`` (p, l + 1, n), ``counts``, ``found`` (4, S): as of `seqopt.engines.rigid._extremes`,
    and of how many edges in all; ``idle`` (S, q): edges that carry nothing, -1 for none.
    """
    edges, nodes, ends, total = counts
    out = np.empty(rows.shape[2])
    tension, x, y, z = out[:edges], out[edges:], out[edges + nodes :], out[edges + 2 * nodes :]
    behind = edges + 3 * nodes
    u, v, w = out[behind:], out[behind + ends :], out[behind + 2 * ends :]
    for part in range(len(rows)):
        for s in range(len(idle)):
            _sum_into(out, rows, part, loads, s)
            for k in range(idle.shape[1]):
                place = idle[s, k] - min(part * edges, total - edges)
                if idle[s, k] >= 0 and 0 <= place < edges:
                    out[place] = 0.0
            least, most, shift, moment = found[0, s], found[1, s], found[2, s], found[3, s]
            for n in range(edges):
                least, most = min(least, tension[n]), max(most, tension[n])
            for n in range(nodes):
                shift = max(shift, x[n] * x[n] + y[n] * y[n] + z[n] * z[n])
            for n in range(ends):
                moment = max(moment, u[n] * u[n] + v[n] * v[n] + w[n] * w[n])
            found[0, s], found[1, s], found[2, s], found[3, s] = least, most, shift, moment
