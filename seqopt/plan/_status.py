"""What is known of a plan, and of the order that it is for."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import isfinite

from seqopt.graph.orders import AllOrders, OrderSelection
from seqopt.plan.calling.formulation import End
from seqopt.plan.judge.certificate import TOLERANCE
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import length_text

ENDS = {"": End.DONE, "interrupt": End.INTERRUPTED}  # of searches over states


class Status(StrEnum):
    """What is known of a plan."""

    OPTIMAL = "optimal"  # proven
    CLAIMED = "claimed optimal"  # the formulation says so; less is proven
    FEASIBLE = "feasible"  # it ended early, is a heuristic, or its bound leaves something open
    UNPROVEN = "unproven"  # no proof was asked for


@dataclass(frozen=True, repr=False)
class FoundOrder:
    """The build order of a plan, and what is known of all others.

    ``problem``: among which orders it was sought; ``selection``: what the formulation claims;
    ``proven``: whether it is proven that no order stays below the bound; else it is claimed.
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
        """What no order stays below, and whether that is proven, in words."""
        if not isfinite(self.selection.bound):
            return "others are not looked at yet"
        claimed = "" if self.proven else " (claimed, not proven)"
        goal = self.problem.states.goals[0]
        if is_tolerance(goal.response):  # of which more is better
            return f"no order above {length_text(goal.shown(self.selection.bound))}{claimed}"
        return f"no order below {self.selection.bound:.6g}{claimed}"
