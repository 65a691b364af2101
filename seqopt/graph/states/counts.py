"""Steps and regrips of a free schedule together: how they follow from the grips held at the end.

Every grip that is taken, by placing a brick or as a regrip, is let go alone or held at the end. Of
B bricks, r regrips and h grips held before the end, a plan therefore has 2 B + 2 r - h steps, and
one more where all are let go at once. Among plans with the same h both are least at once; which h
is best is tried out, since there are no more than robots.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import Graph
from seqopt.graph.states.states import States
from seqopt.sequence.free_rules import Ending


def steps_with(problem: States, regrips: Floats, held: Ints) -> Floats:
    """Return how many steps plans have.

    ``regrips`` (n,): infinite where there is no plan; ``held`` (n,): how many grips are held at the
    end, or before the last step where that lets all go. Result (n,).
    """
    released = problem.free_rules.ending is not Ending.HELD
    return np.asarray(2 * problem.space.levels + 2 * regrips - held + released)


def with_held(problem: States, graph: Graph, held: Bools) -> Graph:
    """Return a graph whose paths end in some states, or let all go in them last.

    ``held`` (n,): which states hold as many grips as wanted.
    """
    if problem.free_rules.ending is Ending.HELD:
        return replace(graph, ends=graph.ends & held)
    return graph.only(~graph.ends[graph.target] | held[graph.source])
