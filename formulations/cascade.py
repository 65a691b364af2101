r"""The simplified cascading scheme of Bruun et al., move by move.

At each state it takes what is cheapest now. With ``charge="later"`` move :math:`k` knows the choice
before it and takes

.. math::

   o_k = \arg\min_i \; c_k(i) + d_k(o_{k-1}, i)

where :math:`d_k(o_{k-1}, \cdot)` is ranked among the candidates of move :math:`k` alone. With
``charge="earlier"`` a move answers for the step it shares with the next one, at the next one's
best:

.. math::

   o_k = \arg\min_i \; c_k(i) + \min_j d_{k+1}(i, j) .

Bruun et al. count four steps per optimization, from the reposition to the last release; these, and
the steps that their printed plan optimizes over, are those of ``later``, the default. Moves that
lead to no end are left out, and so are those after which as many moves are left as before. It is a
heuristic: what it leaves to the next move may cost more than it saved.
"""

from __future__ import annotations

import numpy as np

from formulations.on_graph import Choice, greedy, on_graph, onward
from seqopt.arrays import Floats
from seqopt.errors import ProblemError
from seqopt.graph.formulation import FormulationKind, Watch
from seqopt.graph.graph import Graph
from seqopt.problem.problem import Aim

CHARGES = ("later", "earlier")


def choose(graph: Graph, watch: Watch, *, charge: str = "later") -> Choice:
    """Return the path of the cascade.

    ``charge``: which of two moves answers for the step that they share: ``later`` or ``earlier``.
    Raises `ProblemError` if the charge is neither.
    """
    if charge not in CHARGES:
        raise ProblemError(f"cascade: charge is {charge!r}; give one of {', '.join(CHARGES)}")
    graph = onward(graph)
    return Choice(greedy(graph, _charged(graph, charge)), stopped=watch.over)


def _charged(graph: Graph, charge: str) -> Floats:
    """Return costs of moves (m,), by which of two moves pays for a shared step."""
    if graph.alone is None or graph.peaks[0]:
        return graph.amounts[:, 0]
    if charge == "later":
        return np.asarray(graph.alone.sum(axis=1))
    own = graph.alone[:, 0]
    ahead = np.full(graph.states, np.inf)
    np.minimum.at(ahead, graph.source, graph.amounts[:, 0] - own)
    return np.asarray(own + np.where(graph.ends, 0.0, ahead)[graph.target])


FORMULATION = on_graph(
    "cascade",
    "the cascading scheme of Bruun et al. over the whole build",
    choose,
    FormulationKind.HEURISTIC,
    aim=Aim.SUM,
    alone=True,
    windowed=(),
)
