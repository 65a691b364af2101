r"""An instance as a mixed-integer program, the content of its files for solvers.

With :math:`x_a \in \{0, 1\}` for every arc, one unit flows from node 0 to an end. A sum is
:math:`\sum c_a x_a`. A peak is :math:`t` with :math:`t \ge \sum c_a x_a` over the arcs of every
level where all paths have one arc on each, else over the arcs to every node. A tail is
:math:`\eta + m \sum_s u_s` with :math:`u_s \ge \sum_a c_{s a} x_a - \eta`, where :math:`m` is the
largest weight. When acts end is no part of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.graph import PEAK, SUM, TAIL
from seqopt.instances.model import Instance


class Program(NamedTuple):
    """Minimize ``cost @ x`` with rows between limits; further goals are rows without limits.

    ``names`` (v), ``cost`` (v,), ``upper`` (v,), from 0; ``whole`` (v,) bool; ``matrix`` (r, v),
    ``low``, ``high`` (r,); ``rows`` (r): names.
    """

    names: list[str]
    cost: Floats
    upper: Floats
    whole: Bools
    matrix: sparse.csr_array
    low: Floats
    high: Floats
    rows: list[str]


def as_mps(instance: Instance) -> str:
    """Return the program in free MPS; further goals are rows of type N after the first."""
    found = program(instance)
    made_by, goals = instance.facts.get("made_by", ""), [goal.name for goal in instance.goals]
    said = [
        f"* seqopt instance {instance.name}: {', '.join(goals)}",
        *([f"* {made_by}"] * bool(made_by)),
    ]
    bounded = np.isfinite(found.low)
    kinds = np.where(bounded, "G", np.where(np.isfinite(found.high), "L", "N"))
    kinds[found.low == found.high] = "E"
    right = np.where(kinds == "N", 0.0, np.where(bounded, found.low, found.high))
    lines = [*said, "NAME " + "".join(c if c.isalnum() else "_" for c in instance.name)]
    lines += ["ROWS", " N goal_0"]
    lines += [f" {kind} {name}" for kind, name in zip(kinds, found.rows, strict=True)]
    lines += ["COLUMNS", *_columns(found), "RHS"]
    lines += [f" RHS {found.rows[k]} {float(right[k])!r}" for k in np.flatnonzero(right)]
    lines.append("BOUNDS")
    for name, upper, whole in zip(found.names, found.upper.tolist(), found.whole, strict=True):
        lines += [f" BV BND {name}"] if whole else []
        lines += [f" UP BND {name} {upper!r}"] if np.isfinite(upper) and not whole else []
    return "\n".join([*lines, "ENDATA", ""])


def _columns(found: Program) -> Iterator[str]:
    """Yield the entries of variables, those that are whole numbers, which come first, marked."""
    whole, rows = int(found.whole.sum()), ["goal_0", *found.rows]
    entries = sparse.vstack([sparse.csr_array(found.cost[None]), found.matrix]).tocsc()
    yield " MARKER 'MARKER' 'INTORG'"
    for j, name in enumerate(found.names):
        if j == whole:
            yield " MARKER 'MARKER' 'INTEND'"
        part = slice(entries.indptr[j], entries.indptr[j + 1])
        for row, value in zip(entries.indices[part], entries.data[part].tolist(), strict=True):
            yield f" {name} {rows[row]} {value!r}"
    if whole == len(found.names):
        yield " MARKER 'MARKER' 'INTEND'"


@dataclass
class _Draft:
    """Rows of the program under construction."""

    at: list[tuple[Ints, Ints, Floats]] = field(default_factory=list)
    low: list[Floats] = field(default_factory=list)
    high: list[Floats] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def add(
        self,
        name: str,
        rows: Ints | int,
        columns: Ints | int,
        values: Floats | float,
        low: Floats | float,
        high: Floats | float = np.inf,
    ) -> None:
        """Add rows: their entries by row from 0 and column, and limits, one for every row."""
        entries = np.broadcast_arrays(len(self.names) + np.atleast_1d(rows), columns, values)
        limits = np.broadcast_arrays(np.atleast_1d(low), high)
        self.at.append((entries[0], entries[1], entries[2]))
        self.low.append(limits[0])
        self.high.append(limits[1])
        count = len(limits[0])
        self.names += [name] if count == 1 else [f"{name}_{k}" for k in range(count)]


def program(instance: Instance) -> Program:
    """Return the program of the first goal; further goals are unbounded rows."""
    if instance.asks_time:
        raise ProblemError(f"instance {instance.name}: no program has times; give the .npz")
    arcs, draft, names, at = instance.arcs, _Draft(), list[str](), list[int]()
    for k, goal in enumerate(instance.goals):  # variables besides arcs, and the first of each goal
        at.append(arcs + len(names))
        names += [f"t{k}"] if goal.kind == PEAK else []
        if goal.kind == TAIL:
            names += [f"eta{k}", *(f"u{k}_{s}" for s in range(len(goal.columns)))]
    every = np.arange(arcs)
    _flow(draft, instance)
    goals = [_goal(draft, instance, k, at[k], len(names)) for k in range(len(instance.goals))]
    for k, cap in enumerate(instance.caps):
        assert cap.column is not None  # as of times alone
        draft.add(f"cap_{k}", 0, every, instance.amounts[:, cap.column], -np.inf, cap.most)
    for k, own in enumerate(goals[1:], start=1):
        used = np.flatnonzero(own)
        draft.add(f"goal_{k}", 0, used, own[used], -np.inf)
    rows, columns, values = (np.concatenate(each) for each in zip(*draft.at, strict=True))
    shape = len(draft.names), arcs + len(names)
    matrix = sparse.csr_array((values, (rows, columns)), shape=shape)
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    whole = np.arange(shape[1]) < arcs
    limits = np.concatenate(draft.low), np.concatenate(draft.high)
    named = [*(f"x{k}" for k in every), *names]
    return Program(
        named, goals[0], np.where(whole, 1.0, np.inf), whole, matrix, *limits, draft.names
    )


def _flow(draft: _Draft, instance: Instance) -> None:
    """Add flow conservation of one unit from node 0 to an end."""
    source, target, inner = instance.source, instance.target, ~instance.ends
    number = np.cumsum(inner) - 1
    leaves, comes = np.flatnonzero(inner[source]), np.flatnonzero(inner[target])
    rows = np.concatenate([number[source[leaves]], number[target[comes]]])
    signs = np.repeat([1.0, -1.0], [len(leaves), len(comes)])
    right = np.zeros(int(inner.sum()))
    right[0] = 1.0
    draft.add("flow", rows, np.concatenate([leaves, comes]), signs, right, right)
    last, went = np.flatnonzero(instance.ends[target]), np.flatnonzero(instance.ends[source])
    signs = np.repeat([1.0, -1.0], [len(last), len(went)])
    draft.add("ends", 0, np.concatenate([last, went]), signs, 1.0, 1.0)


def _goal(draft: _Draft, instance: Instance, k: int, first: int, more: int) -> Floats:
    """Add the rows of a goal, and return its costs; ``first``: its own variable, of so many."""
    goal, every = instance.goals[k], np.arange(instance.arcs)
    out = np.zeros(instance.arcs + more)
    if goal.kind == SUM:
        out[every] = instance.amounts[:, goal.columns[0]]
    elif goal.kind == PEAK:  # what arcs to a level take, or to a node
        out[first] = 1.0
        groups = instance.levels[instance.target] if instance.is_layered else instance.target
        own, rows = np.unique(groups, return_inverse=True)
        ones = np.ones(len(own))
        columns = np.concatenate([every, np.full(len(own), first)])
        values = np.concatenate([-instance.amounts[:, goal.columns[0]], ones])
        draft.add("peak", np.append(rows, np.arange(len(own))), columns, values, 0 * ones)
    else:
        out[first], out[first + 1 : first + 1 + len(goal.columns)] = 1.0, goal.most
        for s, column in enumerate(goal.columns):  # u_s: what a total is above the threshold
            values = np.append(-instance.amounts[:, column], [1.0, 1.0])
            draft.add(f"total_{s}", 0, np.append(every, [first, first + 1 + s]), values, 0.0)
    return out
