r"""An instance as a mixed-integer program, the content of its files for solvers.

With :math:`x_a \in \{0, 1\}` for every arc (of times: for every act), one unit flows from node 0 to
an end. A sum is :math:`\sum c_a x_a`. A peak is :math:`t` with :math:`t \ge \sum c_a x_a` over the
arcs of every level where all paths have one arc on each, else over the arcs to every node. A tail
is :math:`\eta + m \sum_s u_s` with :math:`u_s \ge \sum_a c_{s a} x_a - \eta`, where :math:`m` is
the largest weight. Of times, :math:`T_v` is the end of the act that leads to a node, and
:math:`\rho_{v r}` the time from which robot :math:`r` is free there; the constraints of an act on
these are relaxed by the horizon (big-M) unless it is taken.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import HELD, NOW, TimedGraph
from seqopt.graph.instance import PEAK, SUM, TAIL, TIME, Instance
from seqopt.graph.paths import distances


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
    timed = instance.timed if instance.asks_time else None
    arc = np.arange(instance.arcs) if timed is None else timed.move
    every, more, draft = np.arange(len(arc)), _more(instance, timed), _Draft()
    names = [*(f"{'x' if timed is None else 'y'}{k}" for k in every), *more.names]
    _flow(draft, instance, arc)
    goals = [_goal(draft, instance, k, arc, more) for k in range(len(instance.goals))]
    for k, cap in enumerate(instance.caps):
        if cap.column is None:
            draft.add(f"cap_{k}", 0, more.at["end"], 1.0, -np.inf, cap.most)
        else:
            own = instance.amounts[arc, cap.column]
            draft.add(f"cap_{k}", 0, every, own, -np.inf, cap.most)
    if timed is not None:
        _times(draft, instance, timed, more)
    for k, own in enumerate(goals[1:], start=1):
        at = np.flatnonzero(own)
        draft.add(f"goal_{k}", 0, at, own[at], -np.inf)
    rows, columns, values = (np.concatenate(each) for each in zip(*draft.at, strict=True))
    shape = len(draft.names), len(names)
    matrix = sparse.csr_array((values, (rows, columns)), shape=shape)
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    whole = np.arange(len(names)) < len(arc)
    upper = np.where(whole, 1.0, more.most)
    limits = np.concatenate(draft.low), np.concatenate(draft.high)
    return Program(names, goals[0], upper, whole, matrix, *limits, draft.names)


class _More(NamedTuple):
    """Variables besides arcs: first index by purpose."""

    names: list[str]
    at: dict[str, int]
    most: float  # of each: with times an upper bound of the makespan, s


def _more(instance: Instance, timed: TimedGraph | None) -> _More:
    first = instance.arcs if timed is None else len(timed.move)
    names, at = list[str](), dict[str, int]()
    for k, goal in enumerate(instance.goals):
        if goal.kind == PEAK:
            at[f"peak {k}"] = first + len(names)
            names.append(f"t{k}")
        elif goal.kind == TAIL:
            at[f"tail {k}"] = first + len(names)
            names += [f"eta{k}", *(f"u{k}_{s}" for s in range(len(goal.columns)))]
    if timed is None:
        return _More(names, at, np.inf)
    at["end"], at["node"] = first + len(names), first + len(names) + 1
    at["since"] = at["node"] + instance.nodes
    names += ["makespan", *(f"T{v}" for v in range(instance.nodes))]
    names += [f"r{v}_{c}" for v in range(instance.nodes) for c in range(len(timed.kinds))]
    one_by_one = distances(timed.graph, timed.prepares + timed.acts)
    return _More(names, at, float(one_by_one[timed.graph.ends].min()))


def _flow(draft: _Draft, instance: Instance, arc: Ints) -> None:
    """Add flow conservation of one unit from node 0 to an end."""
    source, target, inner = instance.source[arc], instance.target[arc], ~instance.ends
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


def _goal(draft: _Draft, instance: Instance, k: int, arc: Ints, more: _More) -> Floats:
    """Add the rows of a goal, and return its cost vector."""
    goal, every, to = instance.goals[k], np.arange(len(arc)), instance.target[arc]
    out = np.zeros(len(arc) + len(more.names))
    if goal.kind == SUM:
        out[every] = instance.amounts[arc, goal.columns[0]]
    elif goal.kind == TIME:
        out[more.at["end"]] = 1.0
    elif goal.kind == PEAK:  # what arcs to a level take, or to a node
        variable = more.at[f"peak {k}"]
        out[variable] = 1.0
        groups = instance.levels[to] if instance.is_layered else to
        own, rows = np.unique(groups, return_inverse=True)
        ones = np.ones(len(own))
        columns = np.concatenate([every, np.full(len(own), variable)])
        values = np.concatenate([-instance.amounts[arc, goal.columns[0]], ones])
        draft.add("peak", np.append(rows, np.arange(len(own))), columns, values, 0 * ones)
    else:
        first, count = more.at[f"tail {k}"], len(goal.columns)
        out[first], out[first + 1 : first + 1 + count] = 1.0, goal.most
        for s, column in enumerate(goal.columns):  # u_s: what a total is above the threshold
            values = np.append(-instance.amounts[arc, column], [1.0, 1.0])
            draft.add(f"total_{s}", 0, np.append(every, [first, first + 1 + s]), values, 0.0)
    return out


def _times(draft: _Draft, instance: Instance, timed: TimedGraph, more: _More) -> None:
    """Add rows of end times of acts, and of the availability of robots."""
    move, column, big = timed.move, timed.column, more.most
    node, since, robots = more.at["node"], more.at["since"], len(timed.kinds)
    before, after = instance.source[move].astype(int), instance.target[move].astype(int)
    every = np.arange(len(move))
    acts, prepares = timed.acts[move], timed.prepares[move]
    _after(draft, "act", (node + after, node + before), acts, every, big)
    own = column >= 0
    free = since + robots * before + column
    _after(draft, "own", ((node + after)[own], free[own]), (acts + prepares)[own], every[own], big)
    for c in range(robots):
        origin = timed.origin[:, c]
        rows = np.flatnonzero(origin != HELD)
        from_node = origin[rows] == NOW
        was = np.where(from_node, node + after[rows], since + robots * before[rows] + origin[rows])
        is_ = since + robots * after[rows] + c
        _after(draft, f"ready{c}", (is_, was), np.zeros(len(rows)), rows, big)
    ends = np.flatnonzero(instance.ends)
    last = np.full(len(ends), more.at["end"])
    _after(draft, "last", (last, node + ends), np.zeros(len(ends)))
    for k, size in enumerate(timed.sizes.tolist()):
        values = np.append(-timed.work[move, k], float(size))
        draft.add(f"share_{k}", 0, np.append(every, more.at["end"]), values, 0.0)


def _after(
    draft: _Draft,
    name: str,
    variables: tuple[Ints, Ints],
    least: Floats,
    taken: Ints | None = None,
    big: float = 0.0,
) -> None:
    r"""Add precedence rows: one variable is at least another plus a duration.

    Of acts, :math:`t - t' - (M + d) y \ge -M`: only of those that are ``taken``.
    """
    ones = np.ones(len(least))
    columns, values, low = [*variables], [ones, -ones], least
    if taken is not None:
        columns, values, low = [*columns, taken], [*values, -(big + least)], -big * ones
    rows = np.tile(np.arange(len(least)), len(columns))
    draft.add(name, rows, np.concatenate(columns), np.concatenate(values), low)
