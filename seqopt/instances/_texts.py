"""The program of an instance in the formats of solvers: MPS, LP, and the text of CP-SAT."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from seqopt.arrays import Floats
from seqopt.graph.instance import Instance
from seqopt.instances._program import NEVER, Program, program

FINEST = 1e9  # parts of the largest amount, where whole numbers are asked
PARTS = (1, 2, 5, 10, 20, 50, 100, 1000)
WIDTH = 8  # terms in a line


def as_mps(instance: Instance) -> str:
    """Return the program in free MPS; further goals are rows of type N after the first."""
    found = _switched(program(instance))
    return "\n".join(_mps(instance, found)) + "\n"


def as_lp(instance: Instance) -> str:
    """Return the program in the LP format; further goals are comments."""
    return "\n".join(_lp(instance, _switched(program(instance)))) + "\n"


def _switched(found: Program) -> Program:
    """Return a program without indicators: inactive rows are relaxed by their slack (big-M)."""
    rows = np.flatnonzero(found.where != NEVER)
    slack = (found.slack + np.where(np.isfinite(found.low), found.low, 0.0))[rows]
    shape = found.matrix.shape
    off = sparse.csr_array((-slack, (rows, found.where[rows])), shape=shape)
    low = found.low.copy()
    low[rows] -= slack
    return found._replace(matrix=sparse.csr_array(found.matrix + off), low=low)


def _comments(instance: Instance) -> list[str]:
    goals = ", ".join(goal.name for goal in instance.goals)
    return [f"seqopt instance {instance.name}: {goals}", f"{instance.facts.get('made_by', '')}"]


def _mps(instance: Instance, found: Program) -> Iterator[str]:
    yield from (f"* {line}" for line in _comments(instance) if line)
    yield "NAME " + "".join(c if c.isalnum() else "_" for c in instance.name)
    yield "ROWS"
    yield " N goal_0"
    yield from (f" N goal_{k + 1}" for k in range(found.later.shape[0]))
    kinds = _kinds(found)
    yield from (f" {kind} {name}" for kind, name in zip(kinds, found.rows, strict=True))
    yield from _columns(found)
    yield "RHS"
    right = np.where(np.isfinite(found.low), found.low, found.high)
    for row in np.flatnonzero(right).tolist():
        yield f" RHS {found.rows[row]} {float(right[row])!r}"
    yield "BOUNDS"
    for name, upper, is_whole in zip(found.names, found.upper, found.whole, strict=True):
        if is_whole:
            yield f" BV BND {name}"
        elif np.isfinite(upper):
            yield f" UP BND {name} {float(upper)!r}"
    yield "ENDATA"


def _columns(found: Program) -> Iterator[str]:
    yield "COLUMNS"
    whole = int(found.whole.sum())
    columns, later = found.matrix.tocsc(), found.later.tocsc()
    yield " MARKER 'MARKER' 'INTORG'"
    for j, name in enumerate(found.names):
        if j == whole:
            yield " MARKER 'MARKER' 'INTEND'"
        yield f" {name} goal_0 {float(found.cost[j])!r}"
        for part, called in ((later, "goal"), (columns, "")):
            for i in range(part.indptr[j], part.indptr[j + 1]):
                row = part.indices[i]
                label = f"goal_{row + 1}" if called else found.rows[row]
                yield f" {name} {label} {float(part.data[i])!r}"
    if whole == len(found.names):
        yield " MARKER 'MARKER' 'INTEND'"


def _kinds(found: Program) -> list[str]:
    equal = found.low == found.high
    kinds: list[str] = np.where(equal, "E", np.where(np.isfinite(found.low), "G", "L")).tolist()
    return kinds


def _lp(instance: Instance, found: Program) -> Iterator[str]:
    yield from (f"\\ {line}" for line in _comments(instance) if line)
    for k in range(found.later.shape[0]):
        row = found.later[[k]]
        yield f"\\ goal {k + 1}: {instance.goals[k + 1].name}, {row.nnz} terms; see the MPS file"
    yield "Minimize"
    some = np.flatnonzero(found.cost)
    yield from _terms(" goal_0:", some, found.cost[some], found.names)
    yield "Subject To"
    signs = {"E": "=", "G": ">=", "L": "<="}
    right = np.where(np.isfinite(found.low), found.low, found.high)
    for i, kind in enumerate(_kinds(found)):
        part = slice(found.matrix.indptr[i], found.matrix.indptr[i + 1])
        *lines, last = _terms(
            f" {found.rows[i]}:", found.matrix.indices[part], found.matrix.data[part], found.names
        )
        yield from lines
        yield f"{last} {signs[kind]} {float(right[i])!r}"
    yield "Bounds"
    for name, upper, is_whole in zip(found.names, found.upper, found.whole, strict=True):
        if not is_whole and np.isfinite(upper):
            yield f" 0 <= {name} <= {float(upper)!r}"
    yield "Binary"
    whole = [name for name, is_whole in zip(found.names, found.whole, strict=True) if is_whole]
    yield from (" " + " ".join(whole[k : k + WIDTH]) for k in range(0, len(whole), WIDTH))
    yield "End"


def _terms(start: str, columns: np.ndarray, values: np.ndarray, names: list[str]) -> Iterator[str]:
    """Yield lines of a sum; an empty one has a zero term."""
    terms = [
        f"{'-' if v < 0 else '+'} {abs(float(v))!r} {names[c]}"
        for c, v in zip(columns.tolist(), values.tolist(), strict=True)
    ] or [f"0 {names[0]}"]
    for k in range(0, len(terms), WIDTH):
        yield (start if k == 0 else " ") + " " + " ".join(terms[k : k + WIDTH])


def as_cp_sat(instance: Instance) -> str:
    """Return the text of CP-SAT's model (``CpModelProto``), with integer times.

    Amounts become integer multiples of 1/parts, rounded down; the model's objective has the scale.
    """
    found = program(instance)
    numbers = np.concatenate([found.cost, found.matrix.data, found.low[np.isfinite(found.low)]])
    for parts in map(float, PARTS):
        if np.allclose(np.rint(numbers * parts), numbers * parts, rtol=0.0, atol=1e-9):
            break
    else:
        parts = float(10.0 ** np.floor(np.log10(FINEST / float(np.abs(numbers).max()))))
    return "\n".join(_cp_sat(instance, found, parts)) + "\n"


def _cp_sat(instance: Instance, found: Program, parts: float) -> Iterator[str]:
    yield from (f"# {line}" for line in _comments(instance) if line)
    yield f"# a unit is {parts:.17g} parts"
    most = float(np.abs(found.matrix.data).max()) * parts * (found.matrix.shape[0] + 1)
    most = min(most, 2.0**50)  # of a variable that is no arc: all amounts together
    for name, upper, whole in zip(found.names, found.upper, found.whole, strict=True):
        top = 1 if whole else int(min(upper * parts, most))
        yield f'variables {{ name: "{name}" domain: [0, {top}] }}'
    for i, row in enumerate(found.rows):
        part = slice(found.matrix.indptr[i], found.matrix.indptr[i + 1])
        at, own = found.matrix.indices[part], found.matrix.data[part]
        flow = bool(found.whole[at].all()) and bool((own == np.rint(own)).all())
        scale = np.where(found.whole[at] & (not flow), parts, 1.0)
        yield _linear(row, (at, own * scale), (found, i), 1.0 if flow else parts)
    costs = np.flatnonzero(found.cost)
    scale = np.where(found.whole[costs], parts, 1.0)
    values = np.floor(found.cost[costs] * scale + 1e-9).astype(np.int64)
    if not found.whole[costs].any() and (found.cost[costs] != np.rint(found.cost[costs])).any():
        values = np.floor(found.cost[costs] * parts + 1e-9).astype(np.int64)
        parts = parts * parts
    terms = f"vars: {_listed(costs)} coeffs: {_listed(values)}"
    yield f"objective {{ {terms} scaling_factor: {1 / parts!r} }}"


def _linear(
    row: str, terms: tuple[np.ndarray, Floats], of: tuple[Program, int], scale: float
) -> str:
    """Return a row, its amounts rounded such that all paths stay feasible."""
    found, i = of
    at, own = terms
    low, high = found.low[i] * scale, found.high[i] * scale
    whole = np.floor(own + 1e-9) if low != high and np.isfinite(high) else np.ceil(own - 1e-9)
    low_ = int(np.floor(low + 1e-9)) if np.isfinite(low) else -(2**60)
    high_ = int(np.floor(high + 1e-9)) if np.isfinite(high) else 2**60
    where = "" if found.where[i] == NEVER else f"enforcement_literal: {found.where[i]} "
    coeffs = _listed(whole.astype(np.int64))
    linear = f"vars: {_listed(at)} coeffs: {coeffs} domain: [{low_}, {high_}]"
    return f'constraints {{ name: "{row}" {where}linear {{ {linear} }} }}'


def _listed(values: np.ndarray) -> str:
    return "[" + ", ".join(map(str, values.tolist())) + "]"
