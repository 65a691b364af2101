"""Optimality status of a plan, of its build order, and of the postures of its robots."""

from __future__ import annotations

from enum import StrEnum
from math import isfinite
from typing import Any

from seqopt.graph.formulation import End
from seqopt.judge.certificate import _known_gap
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import length_text

ENDS = {"": End.DONE, "interrupt": End.INTERRUPTED}  # of searches over states


class Status(StrEnum):
    """Optimality status of a plan."""

    OPTIMAL = "optimal"  # proven
    OUTSIDE = "optimal in the linear model alone"  # or claimed so; it does not hold of the plan
    CLAIMED = "claimed optimal"  # the formulation says so; less is proven
    FEASIBLE = "feasible"  # it ended early, is a heuristic, or its bound leaves something open
    UNPROVEN = "unproven"  # no proof was asked for, or it was left out


def bare_summary(plan: Any) -> dict[str, object]:
    """Return the summary of a plan without steps: of an instance, or of given costs."""
    proof = plan.certificate
    known: dict[str, object] = getattr(plan.problem, "facts_of", dict)()
    bounds = () if proof is None else proof.bounds
    names = [name for name in plan.goals if name in plan.objective]
    return {
        "formulation": plan.formulation.name,
        "kind": plan.formulation.kind.value,
        **known,
        "status": str(plan.status),
        "ended": plan.ended.value,
        "stopped": plan.stopped,
        "objective": plan.objective,
        "bound": {n: b if isfinite(b) else None for n, b in zip(names, bounds, strict=False)},
        "bound_rests_on": rests_on(plan),
        "gap": plan.gap,
        "claimed_gap": None if proof is None or plan.gap is None else _known_gap(proof.claimed_gap),
        "budgets": {} if proof is None else dict(proof.spent),
        "nodes_of_path": [*plan.nodes],
        "seconds": dict(plan.seconds),
    }


def rests_on(plan: Any) -> dict[str, str]:
    """Return what the lower bound of each goal rests on; empty without a proof."""
    proof, names = plan.certificate, plan.graph.names_of(plan.formulation.aim)
    found = () if proof is None else plan.graph.bounded(proof.rests_on)
    return dict(zip(names, map(str, found), strict=False))


def order_bound(plan: Any) -> tuple[float, bool]:
    """Return the lower bound of the first goal over all orders, and whether that is proven."""
    proof, claimed = plan.certificate, plan.selection.bound[0]
    proven = proof is not None and isfinite(proof.bounds[0])
    return (proof.bounds[0], True) if proven else (claimed, False)


def order_facts(plan: Any) -> dict[str, object]:
    """Return the entries of a summary about the optimized order, ready for JSON."""
    bound, proven = order_bound(plan)
    return {
        "order": [*plan.order],
        "orders": plan.problem.orders.value,
        "order_status": str(plan.status),
        "order_bound": bound if isfinite(bound) else None,
        "order_bound_proven": proven,
        "order_evaluated": plan.selection.effort[0],
        "order_stopped": plan.selection.stopped,
    }


def order_bound_said(plan: Any) -> str:
    """Describe the lower bound over all orders, and whether it is proven."""
    bound, proven = order_bound(plan)
    if not isfinite(bound):
        return "others are not looked at yet"
    claimed, goal = "" if proven else " (claimed, not proven)", plan.graph.goals[0]
    if is_tolerance(goal.name):  # of which more is better
        return f"no order above {length_text(goal.shown(bound))}{claimed}"
    return f"no order below {bound:.6g}{claimed}"
