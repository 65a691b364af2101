r"""A lower bound of the makespan, by an integer unit flow that shares the robots' time: a bound.

The flow of `overlap_mip`, :math:`y_a \in \{0, 1\}` for every move, with one more variable: the
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

from functools import partial

import cvxpy as cp
import numpy as np

from formulations.flow import conserved, unit_flow
from formulations.solvers import EXACTLY, minimize_by_highs
from formulations.times._labels import Caps, Carrying, Prices, useful
from formulations.times._search import plan_in_time
from formulations.times._stages import Chosen, StageFound
from seqopt.errors import InfeasibleError
from seqopt.graph.formulation import Formulation, FormulationKind, Watch


def _bounded(
    carrying: Carrying, stage: StageFound, first: Chosen, prices: Prices, watch: Watch
) -> Chosen:
    """Return the better one of the incumbent and the path of the flow, with the flow's bound."""
    timed, caps = carrying.timed, stage.caps
    assert timed is not None  # no further resource is asked of it
    most = min(first.value, caps.time)
    kept = useful(timed, prices, stage.kept, most) if np.isfinite(most) else stage.kept
    kept = kept & ~timed.graph.ends[timed.graph.source]
    flow, work = unit_flow(timed.graph.only(kept)), timed.work[kept]
    scale = prices.bound or 1.0
    arcs, makespan = cp.Variable(len(flow.cost), boolean=True), cp.Variable(nonneg=True)
    shared = cp.NonNeg(makespan * timed.sizes - work.T / scale @ arcs)
    sums = [cp.NonNeg(cap - flow.graph.amounts[:, column] @ arcs) for column, cap in caps.sums]
    program = cp.Problem(cp.Minimize(makespan), [conserved(flow, arcs), shared, *sums])
    try:
        found = minimize_by_highs(program, feasible=False, watch=watch, tolerance=EXACTLY)
    except InfeasibleError:
        return first._replace(bound=first.value)
    bound = max(prices.bound, scale * found.bound * (1 - 1e-9))
    if np.isfinite(found.value):
        every = np.zeros(len(kept), dtype=bool)
        every[np.flatnonzero(kept)[np.asarray(arcs.value) > 0.5]] = True
        swept = carrying.sweep(every, Caps(sums=caps.sums), prices, Watch())
        other = Chosen(swept.path, swept.best, bound)
        first = min(first, other, key=lambda each: each.value)
    return Chosen(first.path, first.value, min(bound, first.value), late=found.stopped)


FORMULATION = Formulation(
    "makespan_flow",
    "a whole unit flow that shares the robots' time: a bound",
    FormulationKind.BOUND,
    None,
    partial(plan_in_time, least=_bounded),
    answers=("time", "instance"),
    takes_budgets=True,
)
