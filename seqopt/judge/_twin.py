"""What a room outside the core brings to the judge with a measure of whole builds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from seqopt._registry import offered
from seqopt.graph._timed import TimedGraph
from seqopt.graph.graph import Graph
from seqopt.network.network import Network
from seqopt.problem.problem import Measure
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule


class Twin(NamedTuple):
    """How a measure is computed and bounded once more, apart from the search.

    ``value``: of the steps of a problem, with the starts that are claimed; ``least``: combinatorial
    lower bound of all builds by some rules; ``bounds``: makes of an evaluator, rebuilt states, the
    values and what is claimed a function from subgraphs to lower bounds of the
    goals after those about margins; ``path_value``: of arcs and acts of an instance; ``claimed``:
    what a claim about an instance proves, as of `seqopt.judge._claims.proven`.
    """

    value: Callable[[Any, Sequence[Any], Sequence[float]], float]
    least: Callable[[Network, FreeRules | Schedule], float]
    bounds: Callable[..., Callable[[Graph], tuple[float, ...]]]
    path_value: Callable[[TimedGraph, Any, Any], float]
    claimed: Callable[..., float]


def twin_of(measure: Measure) -> Twin | None:
    """Return the twin of a measure; None if no room offers one, so that it is claimed."""
    found: Twin | None = offered(measure.value)
    return found
