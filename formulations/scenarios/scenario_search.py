r"""The least worst or tail total over scenarios: weights of scenarios, then all that may be better.

.. math::

   \min_{o_1, \dots, o_K} \; \max_{w \in W} \sum_s w_s \, c_s(o), \qquad
   W = \Bigl\{ w \ge 0 : \sum_s w_s = 1, \; w_s \le \bar w \Bigr\}

with the totals :math:`c_s` of a choice in every scenario: the worst total for :math:`\bar w = 1`,
the mean of the worst for less. Weights come first,

.. math::

   \max_{w \in W} \; \min_{o_1, \dots, o_K} \; \sum_s w_s \, c_s(o) .

At fixed weights the cheapest choice is a shortest path, which dynamic programming finds; its value
is a bound on the value of any choice. Every choice is a plane over the weights, and the highest
point below all planes met so far is asked for next. The best weights leave a gap. They prove a
bound for every beginning of a choice: what it costs so far, weighed, and the least from there on.
Beginnings whose bound is not below the best choice are left out; where too many remain, those with
the highest bounds are, and the least of these bounds stays a bound on what was not looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import numpy as np

from formulations._weights import CLOSE, Weighed, best_weights, provers
from seqopt.arrays import Floats, Ints
from seqopt.errors import ProblemError
from seqopt.graph.formulation import End, Formulation, FormulationKind, On, Watch
from seqopt.graph.scenarios import Choice, ScenarioArcs, ScenarioLayers, largest_of, scenario_arcs
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim

WIDTH = 20_000  # beginnings that are kept after every move
NUMBERS = 2e7  # that beginnings with all candidates of the next move may be
IMPROVED = 50  # choices met that are improved move by move first


class _Layer(NamedTuple):
    """Beginnings of choices: totals so far (n, S), last candidates (n,), whose follower each is."""

    totals: Floats
    node: Ints
    parent: Ints


def solve(problem: ScenarioLayers, *, watch: Watch, width: int = WIDTH) -> Selection:
    """Return the choice whose worst or tail total is least, and the weights that bound it.

    ``width``: how many beginnings of choices are kept after every move. Result: its ``prices`` are
    the weights of the scenarios by number, from 1.
    """
    if problem.aim.aim is Aim.PEAK:
        raise ProblemError("worst peaks are those of one set of layers; take minimax")
    layers = problem.layered(Aim.SUM)
    largest_of(layers)  # says if no choice is allowed in all scenarios
    arcs = scenario_arcs(layers, problem.aim)
    weighed = best_weights(arcs, watch)
    found = _close_gap(arcs, weighed, watch, width)
    weights = {str(i): float(w) for i, w in enumerate(weighed.weights, start=1)}
    return replace(found, prices=weights, end=End.STOPPED if watch.over else End.DONE)


def _close_gap(arcs: ScenarioArcs, weighed: Weighed, watch: Watch, width: int = WIDTH) -> Selection:
    """Return the best choice as far as it can be found, with a bound.

    ``weighed``: of `best_weights`; ``width``: how many beginnings are kept after every move.
    """
    choice, value = weighed.choice, weighed.value
    for start in weighed.met[:IMPROVED]:
        if watch.over:
            break
        choice, value = min((choice, value), arcs.improved(start), key=lambda pair: pair[1])
    watch.tell(value, weighed.bound)
    level = value - CLOSE * max(abs(value), abs(weighed.bound))
    if weighed.bound >= level or watch.over:
        return Selection(choice, value, min(weighed.bound, value))
    layers, bound = _grown(arcs, provers(arcs, weighed), level, (watch, width))
    bound = max(bound, weighed.bound)
    last = layers[-1]
    if len(layers) == len(arcs.arcs) + 1 and len(last.node):
        values = arcs.aim.each(last.totals)
        best = int(np.argmin(values))
        if values[best] < value:
            choice = _traced(layers, best)
            value = arcs.aim.value(arcs.totals(choice))
    watch.tell(value, min(bound, value))
    return Selection(choice, value, min(bound, value))


def _grown(
    arcs: ScenarioArcs, proving: Floats, level: float, effort: tuple[Watch, int]
) -> tuple[list[_Layer], float]:
    """Return the beginnings after every move, and a bound on all that were left out.

    Fewer layers than moves come back where time was over.
    """
    watch, width = effort
    to_go = [arcs.to_go(weights)[1] for weights in proving]
    layers = [_Layer(np.zeros((1, arcs.scenarios)), np.zeros(1, int), np.zeros(1, int))]
    bound = level
    for k in range(len(arcs.arcs)):
        if watch.over:
            return layers, -np.inf
        grown, lowest = _followed(arcs, k, layers[-1], (proving, [rest[k + 1] for rest in to_go]))
        kept = np.flatnonzero(lowest < level)
        most = _fitting(arcs, k + 1, width)
        if len(kept) > most:
            order = kept[np.argsort(lowest[kept], kind="stable")]
            kept, bound = order[:most], min(bound, float(lowest[order[most]]))
        layers.append(_Layer._make(each[kept] for each in grown))
    return layers, bound


def _fitting(arcs: ScenarioArcs, k: int, width: int) -> int:
    """Return how many beginnings are kept before a move, so that what follows fits the memory."""
    if k == len(arcs.arcs):
        return width
    return max(1, min(width, int(NUMBERS / (arcs.scenarios * arcs.arcs[k].shape[2]))))


def _followed(
    arcs: ScenarioArcs, k: int, layer: _Layer, proofs: tuple[Floats, Sequence[Floats]]
) -> tuple[_Layer, Floats]:
    """Return every beginning with every candidate of the next move, and bounds of them."""
    proving, to_go = proofs
    parent, node = np.nonzero(~arcs.shut[k][layer.node])
    totals = layer.totals[parent] + arcs.arcs[k][:, layer.node[parent], node].T
    bounds = (totals @ w + rest[node] for w, rest in zip(proving, to_go, strict=True))
    return _Layer(totals, node, parent), reduce(np.maximum, bounds)


def _traced(layers: Sequence[_Layer], last: int) -> Choice:
    """Return the choice that ends with one of the last beginnings."""
    choice: list[int] = []
    for layer in reversed(layers[1:]):
        choice.insert(0, int(layer.node[last]))
        last = int(layer.parent[last])
    return tuple(choice)


FORMULATION = Formulation(
    "scenario_search",
    "totals over scenarios, by weights and beginnings of choices",
    FormulationKind.EXACT,
    None,
    solve,
    on=On.SCENARIOS,
)
