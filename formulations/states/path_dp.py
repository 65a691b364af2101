r"""The states of a build by dynamic programming over the whole graph of its states: exact.

For one goal after the other, with moves :math:`a = (u, v)` that take :math:`c_a`,

.. math::

   d(v) = \min_{a = (u, v)} \; \max \{ d(u), c_a \}
   \quad\text{or}\quad
   d(v) = \min_{a = (u, v)} \; \bigl( d(u) + c_a \bigr),
   \qquad d(\text{start}) = 0 .

A sum is found by Dijkstra's algorithm from both sides, and only moves with :math:`d(u) + c_a +
d'(v)` at its least are left for the next goal, :math:`d'` being what is left to an end. Of a peak
the least value below which moves connect the start to an end is found by bisection.
"""

from __future__ import annotations

from formulations.states.on_graph import Choice, on_graph
from seqopt.graph.paths import lexicographic

FORMULATION = on_graph(
    "path_dp",
    "dynamic programming over all states, one goal after the other",
    lambda graph, _: Choice(*lexicographic(graph)),
)
