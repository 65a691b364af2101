"""The program of an instance as the text of CP-SAT's model (``CpModelProto``)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from formulations._instance_program import Program, program
from seqopt.arrays import Floats
from seqopt.instances.model import Instance

FINEST = 1e9  # parts of the largest amount, where whole numbers are asked
PARTS = (1, 2, 5, 10, 20, 50, 100, 1000)


def as_cp_sat(instance: Instance) -> str:
    """Return the text of CP-SAT's model, with integer times; of the first goal.

    Amounts become integer multiples of 1/parts, rounded down; the model's objective has the scale.
    """
    found = program(instance)
    numbers = np.concatenate([found.cost, found.matrix.data, found.low[np.isfinite(found.low)]])
    for parts in map(float, PARTS):
        if np.allclose(np.rint(numbers * parts), numbers * parts, rtol=0.0, atol=1e-9):
            break
    else:
        parts = float(10.0 ** np.floor(np.log10(FINEST / float(np.abs(numbers).max()))))
    return "\n".join(_cp_sat(found, parts)) + "\n"


def _cp_sat(found: Program, parts: float) -> Iterator[str]:
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
    coeffs = _listed(whole.astype(np.int64))
    linear = f"vars: {_listed(at)} coeffs: {coeffs} domain: [{low_}, {high_}]"
    return f'constraints {{ name: "{row}" linear {{ {linear} }} }}'


def _listed(values: np.ndarray) -> str:
    return "[" + ", ".join(map(str, values.tolist())) + "]"
