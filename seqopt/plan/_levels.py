"""Plans at the cheapest level of detail that is enough for their own steps.

Candidates are compared by joints that never fail. Where the best plan's own steps keep within the
elastic limits of joints, a more detailed engine would answer the same for them, as every plan says
of itself. Where they do not, the problem is solved again by joints that open, if that is little
work.
"""

from __future__ import annotations

from collections.abc import Callable

from seqopt.engines.registry import _chooser_of
from seqopt.errors import SeqoptError
from seqopt.graph.formulation import End
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.work._clock import Clock

LIMITS = "whether joints stay within their elastic limits"
MOST = 250  # models up to which a problem is solved again: one may take a second where joints open


def at_sufficient_level(plan: Plan, solved: Callable[[Problem], Plan], clock: Clock) -> Plan:
    """Return a plan, or the one of the next engine where steps leave the elastic limits of joints.

    ``solved``: solves a problem, as far as there is time. The plan stays where that is much work,
    or fails; it says itself which limits its steps leave.
    """
    chooser, problem = _chooser_of(plan.engine), plan.problem
    if chooser is None or not isinstance(problem, Problem) or plan.ended is End.INTERRUPTED:
        return plan

    def found() -> Plan:
        kept = plan.models > MOST or plan._within.keeps_limits(plan.steps)
        return plan if kept else solved(problem.but(engine=chooser))

    try:
        return clock.spare(LIMITS, found, plan)
    except SeqoptError:
        return plan
