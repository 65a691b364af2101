r"""The states of a build by continuing the most promising path first (A*): exact.

A path to a state :math:`v` that takes :math:`z_g` of a goal takes at least

.. math::

   f_g = z_g + h_g(v) \quad\text{or}\quad f_g = \max \{ z_g, h_g(v) \}, \qquad
   h_g(v) = \min_{a = (v, w)} \; \bigl( c_{a g} + h_g(w) \bigr)
   \quad\text{or}\quad
   h_g(v) = \min_{a = (v, w)} \; \max \{ c_{a g}, h_g(w) \},

where :math:`h_g`, which is 0 at an end, is what is left of the goal alone. The path whose vector
:math:`f` is least, goal by goal, is continued first; those whose vector another one of the same
state is nowhere above are dropped. Source: Mandow and Pérez de la Cruz, Multiobjective A* search
with consistent heuristics (2010).
"""

from __future__ import annotations

import numpy as np

from formulations.states.on_graph import Choice, best_label, on_graph
from seqopt.arrays import Floats
from seqopt.graph.graph import Graph
from seqopt.plan.calling.formulation import Watch


def choose(graph: Graph, watch: Watch) -> Choice:
    """Return the best path, with what is left of every goal known exactly."""
    return best_label(graph, to_go(graph), watch)


def to_go(graph: Graph) -> Floats:
    """Return what every goal takes at least from a state to an end, (n, g); infinite if none is."""
    left = np.where(graph.ends[:, None], 0.0, np.inf) * np.ones(len(graph.peaks))
    states, firsts = np.unique(graph.source, return_index=True)
    while True:
        ahead = left[graph.target]
        through = np.where(graph.peaks, np.maximum(graph.amounts, ahead), graph.amounts + ahead)
        least = np.minimum.reduceat(through, firsts)
        if not (least < left[states]).any():
            return left
        left[states] = np.minimum(left[states], least)


FORMULATION = on_graph("best_first", "most promising path first, with what is left known", choose)
