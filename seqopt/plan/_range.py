"""Plans within the linear range wherever any keeps it, by a model that is enough for their steps.

A plan that is the best of all and keeps the range is the best that keeps it: so the range is asked
of the plan's own steps first, and becomes a limit of the problem only where they leave it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from seqopt.engines.interface import Engine
from seqopt.engines.registry import _chooser_of
from seqopt.errors import InfeasibleError, SeqoptError, message_of
from seqopt.graph.formulation import End
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import LIMIT_TOLERANCE
from seqopt.responses._grip_sets import Moved, most_moved
from seqopt.work._clock import INTERRUPT, Clock

RANGE = "how far it leaves the linear range"  # what it is called where there was no time for it
JOINT_LIMITS = "whether joints stay within their elastic limits"
MOST_MODELS = 250  # up to which a problem is solved again: one may take a second where joints open
NONE_KEEPS = "no plan keeps it"
UNKNOWN = "whether any plan keeps it is not known"
INTERRUPTED = f"{UNKNOWN} (interrupted)"
Found = TypeVar("Found")


def leaves(moved: Moved) -> bool:
    """Return whether nodes move farther than the linear range allows."""
    return moved.share > 1 + LIMIT_TOLERANCE


def keeping(found: Found, moved: Moved, again: Callable[[], Found]) -> tuple[Found, str]:
    """Return what was found if it keeps the range, or what is found within it.

    ``moved``: by what was found; ``again``: finds it within the range. Where nothing is found, the
    first stays, with a few words that say why.
    """
    if not leaves(moved):
        return found, ""
    try:
        return again(), ""
    except InfeasibleError:
        return found, NONE_KEEPS
    except SeqoptError as error:
        return found, f"{UNKNOWN} ({message_of(error)})"


def engines_of(plan: Plan) -> Sequence[Engine]:
    """Return what computes responses where limits hold: of all scenarios, or of the scene."""
    return plan.graph.scenarios or (plan.engine,)


def measured(plan: Plan, clock: Clock) -> Plan:
    """Return a plan with how far its steps move nodes, as far as there is time to know it."""
    moved = clock.spare(RANGE, lambda: most_moved(engines_of(plan), plan.steps), None)
    if moved is None and clock.left_out[RANGE] == INTERRUPT:
        return interrupted(plan)
    return replace(plan, moved=moved)


def interrupted(plan: Plan) -> Plan:
    """Return a plan after which somebody asked for an end."""
    return replace(plan, selection=replace(plan.selection, stopped=INTERRUPT))


def best_within(problem: Problem, solved: Callable[[Problem], Plan], clock: Clock) -> Plan:
    """Return the best plan of a problem that keeps the linear range, or of all where none does.

    ``solved``: returns the best plan of the problem itself, or of the same with the limit;
    ``clock``: of both. An interrupt of the second leaves the first.
    """
    plan = measured(solved(problem), clock)
    if problem.says_range or plan.moved is None:
        return plan
    if plan.ended is End.INTERRUPTED:
        return replace(plan, beyond=INTERRUPTED * leaves(plan.moved))
    try:
        found, why = keeping(
            plan, plan.moved, lambda: measured(solved(problem.within_range(1.0)), clock)
        )
    except KeyboardInterrupt:
        found, why = interrupted(plan), INTERRUPTED
    return replace(found, beyond=why)


def at_sufficient_level(plan: Plan, solved: Callable[[Problem], Plan], clock: Clock) -> Plan:
    """Return a plan, or the one of the next engine where steps leave the elastic limits of joints.

    Candidates are compared by joints that never fail; within these limits a more detailed engine
    would answer the same. The plan stays where solving again is much work, or fails: it says itself
    which limits its steps leave.
    """
    chooser, problem = _chooser_of(plan.engine), plan.problem
    if chooser is None or not isinstance(problem, Problem) or plan.ended is End.INTERRUPTED:
        return plan

    def found() -> Plan:
        kept = plan.models > MOST_MODELS or plan._within.keeps_limits(plan.steps)
        return plan if kept else solved(problem.but(engine=chooser))

    try:
        return clock.spare(JOINT_LIMITS, found, plan)
    except SeqoptError:
        return plan
