"""Solve an instance by any formulation that fits; the judge of bare solutions checks the answer."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError, SolverError
from seqopt.graph.instances.instance import PEAK, SUM, TAIL, TIME, Instance
from seqopt.graph.layers.interface import CostProblem
from seqopt.plan._layers import solve_layers
from seqopt.plan.calling._guard import StatePath, called, with_numbers
from seqopt.plan.calling.formulation import (
    Formulation,
    FormulationKind,
    On,
    Run,
    as_formulation,
    formulations,
)
from seqopt.plan.judge._bare._claims import Claim, as_layers
from seqopt.plan.judge._bare._judging import judge_instance
from seqopt.plan.judge.certificate import TOLERANCE, Certificate
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Aim

AIMS = {SUM: Aim.SUM, PEAK: Aim.PEAK}


@dataclass(frozen=True, eq=False, repr=False)
class InstanceLayers(CostProblem):
    """A layered instance as the costs of candidates, whose names are the numbers of nodes."""

    instance: Instance | None = None

    def nodes(self, choice: Any) -> tuple[int, ...]:
        """Return the nodes of the path that a choice stands for."""
        assert self.instance is not None  # it is made with one
        levels = self.instance.levels
        first = np.searchsorted(levels, np.arange(1, len(choice) + 1))
        return tuple((first + np.array(choice)).tolist())


def able(instance: Instance) -> tuple[str, ...]:
    """Return the names of formulations that an instance fits, the usual one first."""
    every = formulations()
    kind = On.TIMES if instance.asks_time else On.STATES
    found = [n for n, f in every.items() if f.on is kind and On.GRAPHS in f.also]
    if instance.caps:
        found = [name for name in found if every[name].takes_budgets]
    if _in_layers(instance):
        aim = AIMS[instance.goals[0].kind]
        own = [n for n, f in every.items() if f.on is On.LAYERS and f.aim is aim]
        found += [n for n in own if every[n].takes_budgets or not instance.caps]
    usual = ("makespan_labels", "labels" if instance.caps else "path_dp", "schedule_search")
    first = next(name for name in usual if name in found)
    return (first, *(name for name in found if name != first))


def _in_layers(instance: Instance) -> bool:
    """Return whether it is costs of candidates, one goal of them."""
    one = len(instance.goals) == 1 and instance.goals[0].kind in AIMS
    capped = all(cap.column is not None for cap in instance.caps)
    return instance.is_layered and one and capped and not instance.asks_time


def solve_instance(instance: Instance, named: Formulation | str | None, run: Run) -> Plan:
    """Return the plan of a formulation, of which an instance has the nodes and no steps.

    Raises `ProblemError` if the formulation does not fit; `SolverError` if its answer is not what
    is claimed.
    """
    names = able(instance)
    formulation = as_formulation(named or names[0])
    fits = formulation.name in names or (formulation.on is On.LAYERS and _in_layers(instance))
    if not fits and formulation.name in formulations():
        raise ProblemError(
            f"{formulation.name}: instance {instance.name} does not fit; use {' or '.join(names)}"
        )
    if formulation.on is On.LAYERS:
        costs = as_layers(instance)
        layers = InstanceLayers(costs.sums, costs.budgets, instance)
        return replace(solve_layers(layers, formulation, run), problem=instance)
    return _of_graph(instance, formulation, run)


def _of_graph(instance: Instance, formulation: Formulation, run: Run) -> Plan:
    """Return the plan of a path through the graph."""
    formulation.require_options(run.options)
    limit = {} if math.isinf(run.time_limit) else {"seconds": run.time_limit}
    start = time.perf_counter()
    solve = partial(formulation.solve, instance, **run.options, **limit)
    found = called(formulation.name, lambda: instance, StatePath, solve)
    selection = with_numbers(formulation.name, found, len(instance.goals))
    solved = time.perf_counter()
    certificate = _judged(instance, formulation, selection) if run.proof else None
    seconds = {"solve": solved - start, "verify": time.perf_counter() - solved}
    return Plan(instance, instance, formulation, selection, certificate, (), seconds)


def _judged(instance: Instance, formulation: Formulation, found: StatePath) -> Certificate:
    """Return the certificate of a path, by what the formulation says proves its bounds."""
    nodes = [state[0] for state in found.states]
    answer = {"nodes": nodes, "values": found.objective}
    proof = judge_instance(instance, answer, _claims(instance, found))
    exact = formulation.kind is FormulationKind.EXACT and not found.stopped
    if exact and instance.is_plain and proof.gap > TOLERANCE:
        raise SolverError(
            f"{formulation.name} promises the least, and no more than "
            f"{', '.join(f'{b:.9g}' for b in proof.bounds)} is proven"
        )
    pairs = zip(proof.values, proof.bounds, found.bound, strict=True)
    left = [(v - min(v, max(b, said))) / (abs(v) or 1.0) for v, b, said in pairs]
    return replace(proof, claimed_gap=max(left))


def _claims(instance: Instance, found: StatePath) -> list[Claim]:
    """Return what proves the bound of every goal, as far as the formulation says."""
    kinds = [goal.kind for goal in instance.goals]
    if instance.asks_time:
        return _of_times(instance, found, kinds)
    if kinds == [TAIL]:
        return [Claim(weights=np.array(found.prices[0]))] if found.prices else []
    if not instance.caps:
        return []
    sums = [cap.name for cap in instance.caps]
    out = list[Claim]()
    for goal, prices, bound in zip(instance.goals, found.prices, found.bound, strict=False):
        named = {n: max(p, 0.0) for n, p in zip(sums, prices, strict=False)}
        out.append(Claim(bound if goal.kind == PEAK else None, prices=named))
        if goal.kind == SUM:
            sums.append(goal.name)
    return out


def _of_times(instance: Instance, found: StatePath, kinds: list[str]) -> list[Claim]:
    """Return what proves times: labels where there are any, and shares."""
    first = 0 if instance.caps else kinds.index(TIME)
    own = [Claim() for _ in kinds]
    for k, proof in enumerate(found.proofs[: len(kinds) - first], start=first):
        if kinds[k] == TIME and len(proof.prices):
            shares, labels = _shares(instance, proof.prices), None
            if len(proof.labels):
                labels = proof.states[:, 1], proof.labels
            value = None if labels is None else found.bound[k]
            own[k] = Claim(value, shares=shares, labels=labels)
    return own


def _shares(instance: Instance, prices: Floats) -> Floats:
    """Return the share of all, and of a robot of every kind, of prices (L, 1 + c) by column."""
    assert instance.timed is not None  # prices are of robots
    _, firsts = np.unique(instance.timed.kinds, return_index=True)
    return np.asarray(prices[:, [0, *(1 + firsts)]])
