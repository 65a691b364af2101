r"""An instance as a mixed-integer program, the content of its files for solvers.

With :math:`x_a \in \{0, 1\}` for every arc, one unit flows from node 0 to an end. A sum is
:math:`\sum c_a x_a`. A peak is :math:`t` with :math:`t \ge \sum c_a x_a` over the arcs of every
level where all paths have one arc on each, else over the arcs to every node. A tail is
:math:`\eta + m \sum_s u_s` with :math:`u_s \ge \sum_a c_{s a} x_a - \eta`, where :math:`m` is the
largest weight (Rockafellar and Uryasev). When acts end is no part of it.

An instance is a `seqopt.instances.Instance`: a graph with goals and caps.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from seqopt.arrays import Bools, Floats
from seqopt.errors import ProblemError
from seqopt.graph.graph import PEAK, SUM, TAIL


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


class _Rows(NamedTuple):
    """Rows of the program between limits, one for each or one of all."""

    names: list[str]
    entries: sparse.csr_array
    low: Floats | float
    high: Floats | float = np.inf


def as_mps(instance: Any) -> str:
    """Return the program in free MPS; further goals are rows of type N after the first."""
    found, made_by = program(instance), instance.facts.get("made_by", "")
    lines = [
        f"* seqopt instance {instance.name}: {', '.join(goal.name for goal in instance.goals)}"
    ]
    lines += [f"* {made_by}"] if made_by else []
    lines.append("NAME " + "".join(c if c.isalnum() else "_" for c in instance.name))
    bounded = np.isfinite(found.low)
    kinds = np.where(bounded, "G", np.where(np.isfinite(found.high), "L", "N"))
    kinds[found.low == found.high] = "E"
    right = np.where(kinds == "N", 0.0, np.where(bounded, found.low, found.high))
    lines += ["ROWS", " N goal_0"]
    lines += [f" {kind} {name}" for kind, name in zip(kinds, found.rows, strict=True)]
    lines += ["COLUMNS", " MARKER 'MARKER' 'INTORG'"]  # whole numbers come first
    rows, whole = ["goal_0", *found.rows], int(found.whole.sum())
    entries = sparse.vstack([sparse.csr_array(found.cost[None]), found.matrix]).tocsc()
    for j, name in enumerate(found.names, start=1):
        part = slice(entries.indptr[j - 1], entries.indptr[j])
        own = zip(entries.indices[part], entries.data[part].tolist(), strict=True)
        lines += [f" {name} {rows[row]} {value!r}" for row, value in own]
        lines += [" MARKER 'MARKER' 'INTEND'"] if j == whole else []
    lines.append("RHS")
    lines += [f" RHS {found.rows[k]} {float(right[k])!r}" for k in np.flatnonzero(right)]
    lines += ["BOUNDS", *(f" BV BND {name}" for name in found.names[:whole])]
    return "\n".join([*lines, "ENDATA", ""])


def program(instance: Any) -> Program:
    """Return the program of the first goal; further goals are unbounded rows."""
    if instance.asks_time:
        raise ProblemError(f"instance {instance.name}: no program has times; give the .npz")
    names, firsts, costs = [f"x{k}" for k in range(instance.arcs)], list[int](), list[Floats]()
    for k, goal in enumerate(instance.goals):  # variables besides arcs, and the first of each goal
        firsts.append(len(names))
        names += [f"t{k}"] if goal.kind == PEAK else []
        if goal.kind == TAIL:
            names += [f"eta{k}", *(f"u{k}_{s}" for s in range(len(goal.columns)))]
    blocks = _flow(instance, len(names))
    for k, first in enumerate(firsts):
        cost, rows = _goal(instance, k, first, len(names))
        costs.append(cost)
        blocks += rows
    for k, cap in enumerate(instance.caps):
        own = np.zeros((1, len(names)))
        own[0, : instance.arcs] = instance.amounts[:, cap.column or 0]  # None is of times alone
        blocks.append(_Rows([f"cap_{k}"], sparse.csr_array(own), -np.inf, cap.most))
    for k, cost in enumerate(costs[1:], start=1):
        blocks.append(_Rows([f"goal_{k}"], sparse.csr_array(cost[None]), -np.inf))
    matrix = sparse.vstack([block.entries for block in blocks]).tocsr()
    matrix.eliminate_zeros()
    low, high = (
        np.concatenate([np.full(len(block.names), block[at]) for block in blocks]) for at in (2, 3)
    )
    whole = np.arange(len(names)) < instance.arcs
    named = [name for block in blocks for name in block.names]
    return Program(names, costs[0], np.where(whole, 1.0, np.inf), whole, matrix, low, high, named)


def _flow(instance: Any, width: int) -> list[_Rows]:
    """Return flow conservation of one unit from node 0 to an end."""
    ones, every, inner = np.ones(instance.arcs), np.arange(instance.arcs), ~instance.ends
    leaves, comes = (
        sparse.csr_array((ones, (nodes, every)), shape=(instance.nodes, width))
        for nodes in (instance.source, instance.target)
    )
    out, start = leaves - comes, np.zeros(int(inner.sum()))
    start[0] = 1.0
    names = [f"flow_{k}" for k in range(len(start))] if len(start) > 1 else ["flow"]
    last = sparse.csr_array(-out[instance.ends].sum(axis=0)[None])
    return [_Rows(names, out[inner], start, start), _Rows(["ends"], last, 1.0, 1.0)]


def _goal(instance: Any, k: int, first: int, width: int) -> tuple[Floats, list[_Rows]]:
    """Return the costs of a goal, and its rows; ``first``: its own variable, of ``width``."""
    goal, arcs = instance.goals[k], instance.arcs
    cost, amounts = np.zeros(width), instance.amounts[:, list(goal.columns)]
    if goal.kind == SUM:
        cost[:arcs] = amounts[:, 0]
        return cost, []
    cost[first] = 1.0
    if goal.kind == PEAK:  # what arcs to a level take, or to a node
        groups = instance.levels[instance.target] if instance.is_layered else instance.target
        own, rows = np.unique(groups, return_inverse=True)
        every = np.arange(len(own))
        at = np.append(rows, every), np.append(np.arange(arcs), np.full(len(own), first))
        values = np.append(-amounts[:, 0], np.ones(len(own)))
        entries = sparse.csr_array((values, at), shape=(len(own), width))
        return cost, [
            _Rows([f"peak_{k}" for k in every] if len(own) > 1 else ["peak"], entries, 0.0)
        ]
    cost[first + 1 : first + 1 + len(goal.columns)] = goal.most
    total = np.zeros((len(goal.columns), width))  # u_s: what a total is above the threshold
    total[:, :arcs], total[:, first] = -amounts.T, 1.0
    np.fill_diagonal(total[:, first + 1 :], 1.0)
    return cost, [_Rows([f"total_{s}" for s in range(len(total))], sparse.csr_array(total), 0.0)]
