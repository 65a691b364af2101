"""What is known of a plan, of the order that it is for, and of the postures of its robots."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from typing import TYPE_CHECKING, Any

from seqopt.graph.formulation import End
from seqopt.judge.certificate import TOLERANCE, _known_gap
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import length_text

if TYPE_CHECKING:
    from seqopt.graph.orders import AllOrders, OrderSelection

ENDS = {"": End.DONE, "interrupt": End.INTERRUPTED}  # of searches over states


class Status(StrEnum):
    """What is known of a plan."""

    OPTIMAL = "optimal"  # proven
    OUTSIDE = "optimal in the linear model alone"  # or claimed so; it does not hold of the plan
    CLAIMED = "claimed optimal"  # the formulation says so; less is proven
    FEASIBLE = "feasible"  # it ended early, is a heuristic, or its bound leaves something open
    UNPROVEN = "unproven"  # no proof was asked for, or it was left out


def bare_summary(plan: Any) -> dict[str, object]:
    """Return the summary of a plan of an instance, or of costs alone: a path without steps."""
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
        "gap": plan.gap,
        "claimed_gap": None if proof is None or plan.gap is None else _known_gap(proof.claimed_gap),
        "budgets": {} if proof is None else dict(proof.spent),
        "nodes_of_path": [*plan.nodes],
        "seconds": dict(plan.seconds),
    }


@dataclass(frozen=True, repr=False)
class FoundOrder:
    """The build order of a plan, and what is known of all others.

    ``problem``: among which orders it was sought; ``selection``: what the formulation claims;
    ``proven``: whether the lower bound of all orders is proven; else it is claimed.
    """

    problem: AllOrders
    selection: OrderSelection
    proven: bool

    def __repr__(self) -> str:
        return f"<FoundOrder of {len(self.selection.order)} bricks: {self.bound_said}>"

    @property
    def gap(self) -> float:
        """What the bound leaves open, over the value."""
        value = self.selection.objective
        return max(0.0, value - self.selection.bound) / max(abs(value), TOLERANCE)

    @property
    def status(self) -> Status:
        """What is known of the order: whether none is better."""
        if self.gap > TOLERANCE:
            return Status.FEASIBLE
        return Status.OPTIMAL if self.proven else Status.CLAIMED

    def described(self) -> dict[str, object]:
        """Return what the summary of a plan says of the order, ready for JSON."""
        found = self.selection
        return {
            "order": [*found.order],
            "orders": self.problem.among.value,
            "order_status": str(self.status),
            "order_bound": found.bound if isfinite(found.bound) else None,
            "order_bound_proven": self.proven,
            "order_evaluated": found.evaluated,
            "order_stopped": found.stopped,
        }

    @property
    def bound_said(self) -> str:
        """The lower bound of all orders, and whether it is proven, in words."""
        if not isfinite(self.selection.bound):
            return "others are not looked at yet"
        claimed = "" if self.proven else " (claimed, not proven)"
        goal = self.problem.states.goals[0]
        if is_tolerance(goal.name):  # of which more is better
            return f"no order above {length_text(goal.shown(self.selection.bound))}{claimed}"
        return f"no order below {self.selection.bound:.6g}{claimed}"
