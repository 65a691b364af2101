"""Plans within the linear range where feasible, by a model whose assumptions their steps keep.

An optimal plan within the range is optimal among those within it: the range is first checked for
the steps of the plan, and becomes a constraint of the problem only if they violate it.
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
    """Return whether displacements exceed the linear range."""
    return moved.share > 1 + LIMIT_TOLERANCE


def keeping(found: Found, moved: Moved, again: Callable[[], Found]) -> tuple[Found, str]:
    """Return a result within the linear range, and a reason if there is none.

    ``moved``: displacements of ``found``; ``again``: solves with the range as a constraint. If it
    raises an error, ``found`` is returned, with the reason in words.
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
    """Return the engines whose responses are constrained: of all scenarios, or of the scene."""
    return plan.graph.scenarios or (plan.engine,)


def measured(plan: Plan, clock: Clock) -> Plan:
    """Return a plan with its largest displacement, if it can be computed in time."""
    known = {} if plan.search is None or plan.graph.scenarios else plan.search.fields

    def largest() -> Moved | None:
        each = (most_moved(engine, plan.steps, known) for engine in engines_of(plan))
        return max(each, key=lambda moved: moved.share)

    moved = clock.spare(RANGE, largest, None)
    if moved is None and clock.left_out[RANGE] == INTERRUPT:
        return interrupted(plan)
    return replace(plan, moved=moved)


def interrupted(plan: Plan) -> Plan:
    """Return a plan marked as stopped by an interrupt."""
    return replace(plan, selection=replace(plan.selection, stopped=INTERRUPT))


def best_within(problem: Problem, solved: Callable[[Problem], Plan], clock: Clock) -> Plan:
    """Return the best plan within the linear range, or the best of all if none is feasible.

    ``solved``: solves the problem, with or without the constraint; ``clock``: shared by both
    solves. If the second is interrupted, the first plan is returned.
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
    """Return a plan, or that of the next engine if steps exceed the elastic limits of joints.

    Candidates are compared with joints that never fail; within the limits a more detailed engine
    gives the same responses. The plan stays if solving again is much work or fails: it reports
    the limits that its steps exceed.
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
