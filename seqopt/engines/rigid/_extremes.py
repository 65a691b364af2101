"""The extremes of the fields of many grip sets, without the fields.

Who compares grip sets asks for the largest tension of any edge, the largest displacement of any
node, the largest moment at any ground end. What every load means is kept by parts of the structure,
as many edges and nodes to a part as stay in the processor's cache while all grip sets are summed
there; of each sum only the extremes are kept.

The loops are those of `seqopt.engines.rigid._compiled`, where numba is installed; else, and for
little work, extremes are taken from fields, which are the reference. Loading numba takes half a
second, so it is left to those who ask for it.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from math import prod
from types import ModuleType
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Fields, Want, names_wanted
from seqopt.engines.rigid._operator import ComplianceOperator

_PART = 2**15  # numbers under all loads of a part: a quarter of a megabyte
_LEAST = 256  # of them under each load
_LINE = 8  # of them in a line of the processor's cache


class Extremes(NamedTuple):
    """Extremes of the fields of S grip sets.

    ``least``, ``most`` (S,): force of any edge, N; ``shift`` (S,): displacement of any node, m;
    ``moment`` (S,): at any ground end, N m; ``force`` (S, r): of every grip, N. What was not asked
    for means nothing.
    """

    least: Floats
    most: Floats
    shift: Floats
    moment: Floats
    force: Floats


class ExtremeRows(NamedTuple):
    """What every load of an operator means, by parts of the structure.

    ``rows`` (p, l + 1, n): the weight's last; ``counts``: edges, nodes, ground ends of a part. A
    row has the forces of its edges, then the displacements of its nodes along x, then y, then z,
    then the moments at its ends so. Where the last part has fewer, some stand twice.
    """

    rows: Floats
    counts: tuple[int, int, int]
    edges: int  # in all

    @property
    def nbytes(self) -> int:
        """Bytes of the rows."""
        return self.rows.nbytes


_OF = {"edge_force": 1, "displacement": 3, "support": 6}  # of which the last three are taken


def rows_of(operator: ComplianceOperator, want: Want) -> ExtremeRows:
    """Return what every load of an operator means to the extremes of some fields."""
    asked = names_wanted(want).intersection(_OF)
    return operator.made(("extremes", asked), lambda: _made_rows(operator, asked))


def _made_rows(operator: ComplianceOperator, asked: frozenset[str]) -> ExtremeRows:
    loads, maps = len(operator.twist), operator.maps
    sizes = [maps.count(name) // size if name in asked else 0 for name, size in _OF.items()]
    total = sizes[0] + 3 * (sizes[1] + sizes[2])
    parts = max(1, min(total * loads // _PART, total // _LEAST))
    edges, nodes, ends = (-(-size // parts) for size in sizes)
    rows, first = _in_lines(parts, loads, edges + 3 * (nodes + ends)), 0
    for count, (name, size) in zip((edges, nodes, ends), _OF.items(), strict=True):
        if not count:
            continue
        found = operator.mean(name)
        field = found.reshape(len(found), -1, size).transpose(0, 2, 1)[:, -3:]
        for part in range(parts):
            start = min(part * count, field.shape[2] - count)
            for axis in range(field.shape[1]):
                here = slice(first + axis * count, first + axis * count + count)
                rows[part, :, here] = field[:, axis, start : start + count]
        first += count * field.shape[1]
    return ExtremeRows(rows, (edges, nodes, ends), sizes[0])


def _in_lines(parts: int, loads: int, width: int) -> Floats:
    """Return zeros of which each row begins with a line of the processor's cache: a fifth faster.

    Rows are longer by what is left of their last lines.
    """
    shape = parts, loads, width + -width % _LINE
    rows = np.zeros(prod(shape) + _LINE)
    first = -(rows.ctypes.data // rows.itemsize) % _LINE
    return rows[first : first + prod(shape)].reshape(shape)


def extremes_of(known: ExtremeRows, index: Ints, force: Floats, idle: Ints) -> Floats:
    """Return the extremes of edge forces, of displacements and of moments of sets, (4, S).

    ``index``, ``force`` (S, k): loads of the operator, and how much of each; ``idle`` (S, q): edges
    that carry nothing whatever these mean, -1 for none.
    """
    found = np.zeros((4, len(index)))
    if known.counts[0]:
        found[0], found[1] = np.inf, -np.inf
    counts = *known.counts, known.edges
    _loops().reduce_rows(known.rows, counts, (index, force), idle, found)
    np.sqrt(found[2:], out=found[2:])
    return found


def extremes_in(fields: Fields, want: Want) -> Extremes:
    """Return the extremes of fields that are there."""
    sets = len(fields.grip_force)
    found = np.zeros((4, sets))
    if want & Want.EDGES:
        found[:2] = fields.edge_force.min(axis=1), fields.edge_force.max(axis=1)
    if want & Want.DISPLACEMENTS:
        found[2] = _squared(fields.displacement).max(axis=1)
    if want & Want.SUPPORT:
        found[3] = _squared(fields.support[..., 3:]).max(axis=1)
    np.sqrt(found[2:], out=found[2:])
    size = np.sqrt(_squared(fields.grip_force))
    return Extremes(found[0], found[1], found[2], found[3], size)


def _squared(vectors: Floats) -> Floats:
    """Return the squares of lengths (S, n) of vectors (S, n, 3), of which NumPy takes thrice."""
    return np.asarray(np.einsum("snk,snk->sn", vectors, vectors))


@cache
def can_compile() -> bool:
    """Return whether loops can be compiled: numba is there."""
    return find_spec("numba") is not None


@cache
def _loops() -> ModuleType:
    """Return the compiled functions; loading them takes half a second."""
    from seqopt.engines.rigid import _compiled  # noqa: PLC0415  # numba is an extra

    return _compiled


class Solved(NamedTuple):
    """Forces of rigid grips as compiled loops find them.

    ``force`` (S, k): at loads, N; ``pivot`` (k, S): scaled; ``size`` (S, r): of the forces of
    grips, what is between two on one brick shared by them; ``idle`` (S, q): edges that carry
    nothing then.
    """

    force: Floats
    pivot: Floats
    size: Floats
    idle: Ints


def solve_compiled(operator: ComplianceOperator, columns: Ints, index: Ints) -> Solved:
    """Return what rigid grips exert on nodes (S, r), which are loads (S, k)."""
    (sets, grips), axis, loops = columns.shape, operator.axis, _loops()
    found = Solved(
        force=np.empty(index.shape),
        pivot=np.empty(index.shape[::-1]),
        size=np.empty(columns.shape),
        idle=np.empty((sets, grips // 2), dtype=np.int64),
    )
    flexibility, dead, held = operator.flexibility, operator.dead_displacement, (columns, index)
    loops.solve_grips(flexibility, dead, axis, held, found.force, found.pivot)
    edge = operator.inner_edge
    mean = operator.made(
        "inner edges", lambda: np.ascontiguousarray(operator.mean("edge_force")[:, edge])
    )
    inner = edge, mean
    loops.share_pairs(axis, inner, held, found.force, found.size, found.idle)
    return found
