r"""How long a build takes at least, by a whole unit flow that shares the robots' time: a bound.

The flow of `flow_mip`, :math:`y_a \in \{0, 1\}` for every move, with one more variable: the
makespan :math:`C` is no less than what all steps take one after the other, nor than the mean time
of the robots of a kind :math:`K`, who prepare (:math:`p_a`), act and hold (:math:`d_a`),

.. math::

   \min_{y, C} \; C \quad\text{s.t.}\quad \text{flow}(y), \qquad
   C \ge \sum_a d_a y_a, \qquad
   \lvert K \rvert \, C \ge \sum_a y_a \bigl( d_a \, \#\{ r \in K \text{ holds or acts} \}
   + p_a \, [r_a \in K] \bigr) .

It does not know when robots are free, only how much they have to do: a relaxation, in which nobody
ever waits. The multipliers of its linear program are the prices of ``makespan_labels``. Its plan is
the best of a first one and that of the flow.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from formulations.solvers import STOPS, minimize_rows
from formulations.times._labels import useful
from formulations.times._search import in_time
from formulations.times._stages import Asked, Chosen
from seqopt.graph.formulation import FormulationKind


def _bounded(asked: Asked) -> Chosen:
    """Return the better one of a first plan and that of the flow, with the flow's bound."""
    first, watch = asked.first, asked.watch
    most = min(first.value, asked.caps.time)
    kept = useful(asked.timed, asked.prices, asked.kept, most) if np.isfinite(most) else asked.kept
    graph, work = asked.timed.graph.only(kept), asked.timed.work[kept]
    scale = asked.prices.bound or 1.0
    ends, moves = np.flatnonzero(graph.ends), np.arange(len(graph.source))
    count = len(moves) + len(ends)
    out = np.concatenate([graph.source, ends, graph.target])
    columns = np.concatenate([np.arange(count), moves])
    signs = np.concatenate([np.ones(count), -np.ones(len(moves))])
    flow = sparse.csc_array((signs, (out, columns)), shape=(graph.states, count + 1))
    shares = [np.pad(own / scale, (0, len(ends) + 1)) for own in work.T]
    for share, size in zip(shares, asked.timed.sizes, strict=True):
        share[-1] = -float(size)
    sums = [np.pad(graph.amounts[:, c], (0, len(ends) + 1)) for c in asked.caps.columns]
    rows = sparse.vstack([flow, sparse.csc_array(np.array([*shares, *sums]))], format="csc")
    right = np.zeros(rows.shape[0])
    right[0] = 1.0
    right[graph.states + len(shares) :] = [cap for _, cap in asked.caps.sums]
    cost = np.eye(1, count + 1, count)[0]
    found = minimize_rows(cost, rows, right, watch=watch, whole=count, equations=graph.states)
    least = np.inf if found.end == "kInfeasible" else scale * found.bound * (1 - 1e-9)
    bound = max(asked.prices.bound, least)
    taken = found.values[: len(moves)] > 0.5
    if taken.any():
        every = np.zeros(len(kept), dtype=bool)
        every[np.flatnonzero(kept)[taken]] = True
        first = min(first, asked.by(every), key=lambda each: each.value)
    return Chosen(first.path, first.value, min(bound, first.value), late=found.end in STOPS)


FORMULATION = in_time(
    "makespan_flow",
    "a whole unit flow that shares the robots' time: a bound",
    FormulationKind.BOUND,
    _bounded,
)
