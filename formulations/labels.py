r"""Paths within budgets: a Lagrangian bound alone, or with labels that close the duality gap.

.. math::

   \min_{o_1, \dots, o_K} \; \sum_{k=1}^{K} c_k(o_k) + \sum_{k=2}^{K} d_k(o_{k-1}, o_k)
   \quad \text{s.t.} \quad \sum_k a_{bk}(o_{k-1}, o_k) \le B_b \quad \text{for every budget } b

is a path with resources; of a free schedule likewise, goal by goal. ``lagrangian`` relaxes it:
every budget has a multiplier,

.. math::

   \max_{\lambda \ge 0} \; L(\lambda), \qquad
   L(\lambda) = \min_{p} \; c(p) + \sum_b \lambda_b \bigl( a_b(p) - B_b \bigr)

over all paths :math:`p`, with their costs :math:`c` and amounts :math:`a`. At fixed multipliers
this is a shortest path. :math:`L` is concave and made of planes, one for every path; cutting planes
find its highest point,

.. math::

   \max_{\lambda \ge 0, \, \theta} \; \theta \quad \text{s.t.} \quad
   \theta \le c(p) + \sum_b \lambda_b \left( a_b(p) - B_b \right)
   \quad \text{for every path } p \text{ found so far.}

Its height is a bound on what any path within the budgets costs, the same as that of the linear
program, and the multipliers are its duals. The path is the cheapest within the budgets among those
met; it need not be the best. ``labels`` goes on: a label is a beginning of a path, with what it
costs and takes; those are continued that may become better than the best path known
(`seqopt.graph._budgets`). Without budgets both are the optimum.
"""

from __future__ import annotations

from formulations.on_graph import Choice, on_graph, within_caps
from seqopt.errors import ProblemError
from seqopt.graph.formulation import FormulationKind, Watch
from seqopt.graph.graph import Graph
from seqopt.problem.problem import Aim


def _exact(graph: Graph, watch: Watch, *, most: int = 20_000) -> Choice:
    """Return the optimal path within the budgets, or the incumbent.

    ``most``: how many labels are kept at a time, from 1; it has stopped early if more were needed.
    """
    if most < 1:
        raise ProblemError(f"labels: most is {most}; give a whole number from 1")
    return within_caps(graph, watch, most)


LABELS = on_graph(
    "labels", "full overlap, labels within budgets", _exact, aim=Aim.SUM, takes_budgets=True
)
LAGRANGIAN = on_graph(
    "lagrangian",
    "full overlap, multipliers of budgets",
    within_caps,
    FormulationKind.BOUND,
    aim=Aim.SUM,
    takes_budgets=True,
)
