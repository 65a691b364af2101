r"""The full overlap formulation by dynamic programming, one goal after the other: exact.

For the open grips of a schedule it is

.. math::

   \min_{o_1, \dots, o_K} \; \sum_{k=1}^{K} c_k(o_k) + \sum_{k=2}^{K} d_k(o_{k-1}, o_k)

with the costs :math:`c` of single candidates and :math:`d` of the step that neighboring moves
share, or with the largest cost in place of the sum (``minimax``); for a free schedule a path
through its states, over scenarios by weights and labels that they bound. With moves :math:`a = (u,
v)` that take :math:`c_a`,

.. math::

   d(v) = \min_{a = (u, v)} \; \max \{ d(u), c_a \}
   \quad\text{or}\quad
   d(v) = \min_{a = (u, v)} \; \bigl( d(u) + c_a \bigr),
   \qquad d(\text{start}) = 0 .

A sum is found by Dijkstra's algorithm from both sides, and only moves with :math:`d(u) + c_a +
d'(v)` at its least are left for the next goal, :math:`d'` being what is left to an end. Of a peak
the least value below which moves connect the start to an end is found by bisection. Among paths of
the same largest cost ``minimax`` takes one of least sum of the :math:`c` and :math:`d`.
"""

from __future__ import annotations

import numpy as np

from formulations.on_graph import Choice, on_graph, shortest
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Watch
from seqopt.graph.graph import Graph
from seqopt.problem.problem import Aim


def _least_peak(graph: Graph, watch: Watch) -> Choice:
    """Return the path of least peak, among these that of the least sum of its parts."""
    if not graph.peaks[0]:
        raise ProblemError("minimax: a sum comes first, and no largest cost; use overlap_dp")
    parts = graph.amounts[:, 0] if graph.alone is None else graph.alone.sum(axis=1)
    added = parts - min(0.0, float(parts.min()))  # of candidates, all paths have as many moves
    peaks, amounts = (True, *graph.peaks[1:], False), np.column_stack([graph.amounts, added])
    found = shortest(Graph(graph.source, graph.target, amounts, peaks, graph.ends), watch)
    return found._replace(bounds=found.bounds[:-1])


OVERLAP_DP = on_graph("overlap_dp", "full overlap, dynamic programming", shortest, aim=Aim.SUM)
MINIMAX = on_graph(
    "minimax", "smallest worst cost over the build", _least_peak, aim=Aim.PEAK, alone=True
)
