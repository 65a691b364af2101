"""Certificates of totals over scenarios: the value recomputed, and what weights prove."""

from __future__ import annotations

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SolverError
from seqopt.graph.layers.costs import TINY, LayeredCosts
from seqopt.graph.scenarios.scenarios import ScenarioLayers
from seqopt.plan.calling.formulation import Selection
from seqopt.plan.judge.certificate import TOLERANCE, Certificate, least_sum
from seqopt.problem.aims import Aim


def certify_scenarios(problem: ScenarioLayers, selection: Selection) -> Certificate:
    """Check a choice by its totals in every scenario, and the bound that its weights prove.

    ``selection``: its prices are the weights of scenarios. Raises `SolverError` if the choice is
    not worth what is claimed, weights do not fit the aim, or a bound is above the value.
    """
    layers = problem.layered(Aim.SUM)
    weights = np.array(
        [selection.prices.get(str(i), 0.0) for i in range(1, len(layers) + 1)], dtype=float
    )
    proven = _proven(problem, layers, weights)
    totals = np.array([each.cost(selection.choice) for each in layers])
    value = problem.aim.value(totals)
    scale = max(abs(value), abs(selection.objective), TINY)
    if not abs(value - selection.objective) <= TOLERANCE * scale:
        raise SolverError(f"the objective is {value:.9g}, not {selection.objective:.9g} as claimed")
    claimed = max(proven, selection.bound)
    if claimed > value + TOLERANCE * scale:
        raise SolverError(f"the bound is {claimed:.9g}, above the objective {value:.9g}")
    gaps = [max(0.0, value - bound) / scale for bound in (proven, claimed)]
    return Certificate((value,), (min(proven, value),), gaps[0], gaps[1])


def _proven(problem: ScenarioLayers, layers: tuple[LayeredCosts, ...], weights: Floats) -> float:
    """Return the bound that weights prove, by a judge that shares nothing with the search."""
    used = [(w, each) for w, each in zip(weights, layers, strict=True) if w > 0]
    most = problem.aim.most(len(layers)) * (1 + 1e-9)
    if abs(sum(w for w, _ in used) - 1.0) > 1e-9 or max(w for w, _ in used) > most:
        raise SolverError("the weights of scenarios do not fit the aim; the bound is none")
    moves = range(len(layers[0].single))
    single = tuple(_weighed([(w, each.single[k]) for w, each in used]) for k in moves)
    shared = tuple(_weighed([(w, each.shared[k]) for w, each in used]) for k in moves)
    return least_sum(_shut(LayeredCosts(single, shared), layers))


def _weighed(parts: list[tuple[float, Floats]]) -> Floats:
    """Return the weighed sum of costs, infinite where one is."""
    out = np.zeros_like(parts[0][1])
    for weight, costs in parts:
        out += weight * costs
    return out


def _shut(weighed: LayeredCosts, layers: tuple[LayeredCosts, ...]) -> LayeredCosts:
    """Return costs that are infinite also where a scenario without weight allows nothing."""

    def open_in_all(part: str, k: int) -> Floats:
        return np.where(
            np.isfinite([getattr(each, part)[k] for each in layers]).all(axis=0),
            getattr(weighed, part)[k],
            np.inf,
        )

    moves = range(len(weighed.single))
    return LayeredCosts(
        tuple(open_in_all("single", k) for k in moves),
        tuple(open_in_all("shared", k) for k in moves),
    )
