"""Paths through instances: chosen by formulations, judged by their claims, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import replace
from functools import partial
from itertools import chain, combinations
from math import inf, isfinite
from typing import Any

import numpy as np

from seqopt.errors import InfeasibleError, NothingFoundError, SeqoptError, SolverError, TimeUpError
from seqopt.graph.formulation import Formulation, FormulationKind, Run, Solution, Watch, timed
from seqopt.graph.graph import PEAK, SUM, TAIL, TIME, least_sum
from seqopt.instances._judge import Claim, OverCapError, judge_path
from seqopt.instances.model import Instance, _Cap
from seqopt.judge.arithmetic import _is_kept, least_within
from seqopt.judge.certificate import TOLERANCE, Certificate
from seqopt.plan._answers import Found, _proven, called, check_run, with_numbers
from seqopt.plan._infeasible import claimed
from seqopt.work import INTERRUPT, _answered

PROVEN = 1 - 1e-6  # of a path that costs nothing and is said to cost this much: there is none


def smallest_conflict(instance: Instance) -> tuple[_Cap, ...]:
    """Return the smallest set of caps proven infeasible together; empty if none is found."""
    counts, nothing = range(1, len(instance.caps) + 1), np.zeros(instance.arcs)
    for some in chain.from_iterable(combinations(instance.caps, count) for count in counts):
        own = instance.graph, nothing, _limited(some), 1.0
        if least_within(*own, labels=instance.is_layered) >= PROVEN:
            return some
    return ()


def _limited(caps: Sequence[_Cap]) -> list[tuple[int, float]]:
    return [(cap.column, cap.most) for cap in caps if cap.column is not None]


def refusal(instance: Instance, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names the caps in conflict; a `SolverError` if a path is feasible."""
    found = smallest_conflict(instance)
    limited, labels = _limited(instance.caps), instance.is_layered
    if not found and _is_kept(instance.graph, limited, labels=labels):
        return SolverError(
            f"formulation {name} says that no choice is within all budgets, and some are"
        )
    if not found:
        return claimed(name, "no choice is within all budgets; raise a bound", exact=exact)
    if len(found) == 1:
        (cap,) = found
        least = least_sum(instance.graph, instance.amounts[:, cap.column or 0])
        return InfeasibleError(
            f"no choice is within all budgets: every choice uses at least {least:.6g} of "
            f"{cap.name!r}, more than {cap.most:.6g}; raise that bound"
        )
    named = [f"{cap.most:.6g} of {cap.name!r}" for cap in found]
    fewer = "each can alone" if len(found) == 2 else "any fewer of them can"
    return InfeasibleError(
        f"no choice is within all budgets: {', '.join(named[:-1])} and {named[-1]} cannot be kept "
        f"together, though {fewer}; raise one of them"
    )


def find_path(instance: Instance, formulation: Formulation, run: Run) -> Found:
    """Find a path through an instance, as `seqopt.plan._answers.find`.

    On an interrupt the formulation returns its incumbent; `KeyboardInterrupt` if there is none yet.
    """
    options = check_run(formulation, run)
    watch = Watch(min(run.left, options.get("seconds", inf)), run.progress)
    seconds = {"compile": 0.0}
    with timed(seconds, "solve"):
        limit = {"seconds": run.left} if run.left < inf else {}
        options |= {"watch": watch} if formulation.watched else limit
        selection = _choose_path(instance, formulation, options, watch)
    seconds["compile"] = selection.compile_seconds
    seconds["solve"] -= selection.compile_seconds
    with timed(seconds, "verify"):
        judge = partial(judged, instance, formulation, selection)
        selection, certificate = _proven(selection, judge, run)
    return Found(selection, certificate, (), seconds)


def _choose_path(
    instance: Instance, formulation: Formulation, options: dict[str, Any], watch: Watch
) -> Solution:
    """Return the formulation's solution, converted to numbers; raise why there is none."""
    name = formulation.name
    solve = partial(formulation.solve, deepcopy(instance), **options)
    try:
        with _answered(watch.interrupt) if formulation.watched else nullcontext():
            found = called(name, Solution, solve)
    except InfeasibleError as error:
        if not instance.caps:
            text = f"formulation {name} says that no path is allowed, and some are: {error}"
            raise SolverError(text) from None
        raise refusal(instance, name, exact=formulation.looks_at_all) from None
    except (NothingFoundError, TimeUpError) as error:
        low = f" (no path is below {watch.bound:.6g})" * isfinite(watch.bound)
        raise (KeyboardInterrupt if watch.interrupted else type(error))(f"{error}{low}") from error
    except SolverError as error:
        if watch.interrupted:
            raise KeyboardInterrupt(str(error)) from error
        raise
    selection = with_numbers(name, found, len(instance.goals))
    if any(len(state) != 1 for state in selection.states):
        raise SolverError(f"formulation {name} returned nonsense: a state is no node of the graph")
    stopped = INTERRUPT if watch.interrupted else selection.stopped
    watch.tell(selection.objective[0], selection.bound[0])  # without a clock there is no log
    return replace(selection, stopped=stopped, trace=watch.trace)


def judged(instance: Instance, formulation: Formulation, found: Solution) -> Certificate:
    """Return the certificate of a path from the multipliers and labels of its formulation."""
    nodes = np.array([state[0] for state in found.states])
    try:
        proof = judge_path(instance, "nodes", nodes, found.objective, _claims(instance, found))
    except OverCapError as error:
        raise SolverError(f"{error}; use a formulation that keeps budgets exactly") from None
    exact = formulation.kind is not FormulationKind.HEURISTIC and not found.stopped
    plain = not instance.caps and all(goal.kind in (SUM, PEAK) for goal in instance.goals)
    if exact and plain and proof.gap > TOLERANCE:
        raise SolverError(
            f"{formulation.name} promises the least, and no more than "
            f"{', '.join(f'{b:.9g}' for b in proof.bounds)} is proven"
        )
    said, value = found.bound[0], proof.values[0]
    if plain and said > proof.bounds[0] + TOLERANCE * abs(value):
        raise SolverError(f"the claimed bound {said:.9g} exceeds {proof.bounds[0]:.9g}")
    pairs = zip(proof.values, proof.bounds, found.bound, strict=True)
    left = [(v - min(v, max(b, said))) / (abs(v) or 1.0) for v, b, said in pairs]
    return replace(proof, claimed_gap=max(left))


def _claims(instance: Instance, found: Solution) -> list[Any]:
    """Return the claimed bound of each goal with its multipliers, as far as they are given.

    Of makespans these are labels, if any, and shares of robot kinds.
    """
    kinds = [goal.kind for goal in instance.goals]
    if instance.asks_time and instance.timed is not None:
        _, firsts = np.unique(instance.timed.kinds, return_index=True)
        first, own = 0 if instance.caps else kinds.index(TIME), [Claim() for _ in kinds]
        for k, proof in enumerate(found.proofs[: len(kinds) - first], start=first):
            if kinds[k] == TIME and len(proof.prices):
                labels = (proof.states[:, 1], proof.labels) if len(proof.labels) else None
                value = None if labels is None else found.bound[k]
                own[k] = Claim(value, shares=proof.prices[:, [0, *(1 + firsts)]], labels=labels)
        return own
    if kinds == [TAIL]:
        return [Claim(weights=np.array(found.prices[0]))] if found.prices else []
    sums, out = [cap.name for cap in instance.caps], list[Any]()
    for goal, prices, bound in zip(instance.goals, found.prices, found.bound, strict=False):
        named = {n: max(p, 0.0) for n, p in zip(sums, prices, strict=False)}
        out.append(Claim(bound if goal.kind == PEAK else None, prices=named))
        if goal.kind == SUM:
            sums.append(goal.name)
    return out if instance.caps else []
