"""What can be done: builds as paths through a graph of states and moves.

A *space* says which states there are, which moves lead from one to the next, and what they take. An
`Explorer` visits the states below a threshold and gives them as a `Graph`, which is arrays alone:
`seqopt.graph.graph` finds best paths through these, and proves that no path is better.

>>> import numpy as np
>>> from seqopt.graph import Graph, lexicographic
>>> graph = Graph(
...     source=np.array([0, 0, 1, 2]), target=np.array([1, 2, 3, 3]),
...     amounts=np.array([[3.0, 1.0], [2.0, 1.0], [1.0, 1.0], [2.5, 1.0]]),
...     peaks=(True, False), ends=np.array([False, False, False, True]))
>>> lexicographic(graph)
Best(path=(2, 3), values=(2.5, 2.0))
"""

from typing import TYPE_CHECKING

from seqopt._registry import later

if TYPE_CHECKING:
    from seqopt.graph.graph import Best, Graph, lexicographic
    from seqopt.graph.space import Explorer, Visited

__all__ = ["Best", "Explorer", "Graph", "Visited", "lexicographic"]
__getattr__, __dir__ = later(
    __name__, {name: "space" if name in ("Explorer", "Visited") else "graph" for name in __all__}
)
