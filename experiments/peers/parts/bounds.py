"""The matrix products alone that a batch of models takes: what no engine can beat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from experiments.peers.parts.workload import Case
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Want
from seqopt.network.network import Network


def products(
    net: Network, cases: list[Case], setting: str, *, sparsely: bool = False
) -> tuple[Callable[[], None], float]:
    """Return a call that does only the products of a batch, and how many flops they are."""
    rng = np.random.default_rng(0)
    work: list[tuple[Floats | sparse.csr_array, Floats, Floats]] = []
    flops = 0.0
    for case in cases:
        load = rng.standard_normal((len(case.grips), 6 * case.bricks + 1))
        index = np.hstack([load_index(case), np.full((len(load), 1), load.shape[1] - 1)])
        few = _spread(index, rng.standard_normal(index.shape), load.shape[1])
        each = index.shape[1] if sparsely else load.shape[1]
        for width in _widths(net, case, setting):
            rows = rng.standard_normal((load.shape[1], width))
            work.append((few if sparsely else load, rows, np.empty((len(load), width))))
            flops += 2 * len(load) * each * width

    def call() -> None:
        for load, rows, out in work:
            if isinstance(load, np.ndarray):
                np.matmul(load, rows, out=out)
            else:
                load @ rows

    call()
    return call, flops


def load_index(case: Case) -> Ints:
    """Return the loads (S, 3r) that the grips of a case exert."""
    return np.asarray(3 * case.columns[:, :, None] + np.arange(3)).reshape(len(case.columns), -1)


def _spread(index: Ints, values: Floats, size: int) -> sparse.csr_array:
    starts = np.arange(0, index.size + 1, index.shape[1])
    return sparse.csr_array((values.ravel(), index.ravel(), starts), shape=(len(index), size))


def _widths(net: Network, case: Case, setting: str) -> list[int]:
    """Return the sizes of the fields that a setting asks of a case."""
    sizes = (
        (Want.EDGES, net.count_edges(case.bricks)),
        (Want.DISPLACEMENTS, 3 * net.count_nodes(case.bricks)),
        (Want.SUPPORT, 6 * len(net.springs.support)),
    )
    return [size for flag, size in sizes if case.asked(setting) & flag]
