r"""The states of a build by setting labels, vectors of all goals at once: exact.

A label of a state :math:`v` is what goals take of a path to it, :math:`z = (z_1, z_2, \dots)`. With
a move :math:`a = (v, w)` it becomes one of :math:`w`,

.. math::

   z'_g = \max \{ z_g, c_{a g} \} \quad\text{or}\quad z'_g = z_g + c_{a g},

and stays unless another label of :math:`w` is nowhere above it. Labels are continued in the order
of their first goals, then of their second, and so on: the first one at an end is the best, since no
goal ever gets less on the way. Source: Martins, On a multicriteria shortest path problem (1984).
"""

from __future__ import annotations

import numpy as np

from formulations.states.on_graph import Choice, best_label, on_graph
from seqopt.graph.graph import Graph
from seqopt.plan.calling.formulation import Watch


def choose(graph: Graph, watch: Watch) -> Choice:
    """Return the best path, with nothing known of what is ahead."""
    return best_label(graph, np.zeros((graph.states, len(graph.peaks))), watch)


FORMULATION = on_graph("path_labels", "labels with a vector of all goals", choose)
