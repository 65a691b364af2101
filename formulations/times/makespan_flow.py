r"""A lower bound of the makespan, by an integer unit flow that shares the robots' time: a bound.

The flow of `flow_mip`, :math:`y_a \in \{0, 1\}` for every move, with one more variable: the
makespan :math:`C` is no less than what all steps take one after the other, nor than the mean time
of the robots of a kind :math:`K`, who prepare (:math:`p_a`), act and hold (:math:`d_a`),

.. math::

   \min_{y, C} \; C \quad\text{s.t.}\quad \text{flow}(y), \qquad
   C \ge \sum_a d_a y_a, \qquad
   \lvert K \rvert \, C \ge \sum_a y_a \bigl( d_a \, \#\{ r \in K \text{ holds or acts} \}
   + p_a \, [r_a \in K] \bigr) .

It does not know when robots are free, only how much they have to do: a relaxation, in which nobody
ever waits. The multipliers of its linear program are those of ``makespan_labels``. Its plan is
the best of a first one and that of the flow.
"""

from __future__ import annotations

import cvxpy as cp
import numpy as np

from formulations.flow import conserved, unit_flow
from formulations.solvers import EXACTLY, minimize_by_highs
from formulations.times._labels import useful
from formulations.times._search import in_time
from formulations.times._stages import Asked, Chosen
from seqopt.errors import InfeasibleError
from seqopt.graph.formulation import FormulationKind


def _bounded(asked: Asked) -> Chosen:
    """Return the better one of the incumbent and the path of the flow, with the flow's bound."""
    first, watch, timed = asked.first, asked.watch, asked.carrying.timed
    assert timed is not None  # no further resource is asked of it
    most = min(first.value, asked.caps.time)
    kept = useful(timed, asked.prices, asked.kept, most) if np.isfinite(most) else asked.kept
    kept = kept & ~timed.graph.ends[timed.graph.source]
    flow, work = unit_flow(timed.graph.only(kept)), timed.work[kept]
    scale = asked.prices.bound or 1.0
    arcs, makespan = cp.Variable(len(flow.cost), boolean=True), cp.Variable(nonneg=True)
    shared = cp.NonNeg(makespan * timed.sizes - work.T / scale @ arcs)
    sums = [
        cp.NonNeg(cap - flow.graph.amounts[:, column] @ arcs) for column, cap in asked.caps.sums
    ]
    program = cp.Problem(cp.Minimize(makespan), [conserved(flow, arcs), shared, *sums])
    try:
        found = minimize_by_highs(program, feasible=False, watch=watch, tolerance=EXACTLY)
    except InfeasibleError:
        return first._replace(bound=first.value)
    bound = max(asked.prices.bound, scale * found.bound * (1 - 1e-9))
    if np.isfinite(found.value):
        every = np.zeros(len(kept), dtype=bool)
        every[np.flatnonzero(kept)[np.asarray(arcs.value) > 0.5]] = True
        first = min(first, asked.by(every), key=lambda each: each.value)
    return Chosen(first.path, first.value, min(bound, first.value), late=found.stopped)


FORMULATION = in_time(
    "makespan_flow",
    "a whole unit flow that shares the robots' time: a bound",
    FormulationKind.BOUND,
    _bounded,
)
