"""Why a free schedule is impossible: the brick at which it stops, and what would help."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import chain, combinations

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import InfeasibleError, NothingFoundError, SeqoptError, SolverError
from seqopt.graph._budgets import within_budgets
from seqopt.graph._explore import Explorer
from seqopt.graph._orders import TooManySetsError
from seqopt.graph.instance import Instance, _Cap
from seqopt.graph.paths import distances, least_sum, tied
from seqopt.graph.states.explored import STEPS, WORST, barred, with_margin
from seqopt.graph.states.states import States
from seqopt.judge._budget_proof import is_kept, least_within
from seqopt.judge._proof import Proof, TooManyPartsError
from seqopt.plan._remedies import LateError, Look, Remedies, stops_of
from seqopt.problem.amounts import Amount

PROVEN = 1 - 1e-6  # of a choice that costs nothing and is said to cost this much: there is none


def smallest_conflict(instance: Instance) -> tuple[_Cap, ...]:
    """Return the smallest set of caps proven infeasible together; empty if none is found."""
    counts, nothing = range(1, len(instance.caps) + 1), np.zeros(instance.arcs)
    for some in chain.from_iterable(combinations(instance.caps, count) for count in counts):
        own = instance.graph, nothing, _limited(some), 1.0
        if least_within(*own, laid_down=instance.is_layered)[0] >= PROVEN:
            return some
    return ()


def _limited(caps: Sequence[_Cap]) -> list[tuple[int, float]]:
    return [(cap.column, cap.most) for cap in caps if cap.column is not None]


def claimed(name: str, why: str, *, exact: bool) -> InfeasibleError | NothingFoundError:
    """Return an unproven infeasibility error; ``exact``: the formulation searches all plans."""
    if exact:
        return InfeasibleError(f"claimed by {name}, and not proven: {why}")
    return NothingFoundError(f"{name} found none, and there may be one: {why}")


def refusal(instance: Instance, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names the caps in conflict; a `SolverError` if a path is feasible.

    ``name``, ``exact``: of the formulation that claims infeasibility, as of `claimed`.
    """
    found = smallest_conflict(instance)
    limited, laid_down = _limited(instance.caps), instance.is_layered
    if not found and is_kept(instance.graph, limited, laid_down=laid_down):
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


ALLOWED = "says that no plan is allowed, and some are"


def confirmed(
    problem: States, name: str, seconds: float = np.inf, *, exact: bool = True, explain: bool = True
) -> SeqoptError:
    """Return the error that explains why a problem is infeasible, after proving that it is.

    ``name``, ``exact``: of the formulation that claims so, as of `claimed`; ``seconds``: limit of
    proof and search for remedies, s, after which the error is called claimed; ``explain``: whether
    remedies are sought. Result: a `SolverError` if a plan is feasible, a `NothingFoundError` if
    the stability of some states is undecided.
    """
    end, capped = time.perf_counter() + seconds, problem.goals[len(problem.aims) :]
    goals = (*STEPS, *_of_criterion(problem), *capped)
    steps = replace(_with_any_margin(problem), goals=goals)
    try:
        hint = None
        if barred(steps) is None:
            found = Look(end)(steps)
            if found.whole and problem.paths:
                kept = ", ".join(map(str, problem.paths))
                return claimed(name, f"no plan keeps {kept}; leave it out", exact=exact)
            if found.whole and capped:
                return _over_budget(steps, found, name, exact=exact)
            if found.whole:
                return SolverError(f"formulation {name} {ALLOWED}")
            hint = {level: rows for level, _, rows in found.graph().states}
        proven = Proof(steps, hint).is_impossible()
    except (LateError, TooManySetsError, TooManyPartsError):
        proven = False
    bare = replace(problem, goals=problem.aims, budgets=(), orders=None)
    why = "no plan is allowed"
    if explain:
        why = _why_impossible(bare, end - time.perf_counter())
    if problem.orders is not None:
        why = f"no order of the bricks has a plan; in the scene's own, {why}"
    if proven:
        return InfeasibleError(why)
    undecided = sum(each.stability.undecided for each in steps.each or (steps,) if each.demands)
    if undecided:
        return NothingFoundError(f"{undecided} grip sets neither stand nor fall for sure: {why}")
    return claimed(name, why, exact=exact)


def _over_budget(problem: States, found: Explorer, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names the least value of each budget; without budgets plans exist."""
    graph, states = found.graph()
    if not problem.is_timed:
        with suppress(InfeasibleError, NothingFoundError):
            spent = within_budgets(graph, problem.budgets).values[-len(problem.budgets) :]
            pairs = zip(problem.goals[-len(spent) :], spent, strict=True)
            one = ", ".join(f"{goal} {value:.6g}" for goal, value in pairs)
            return SolverError(f"formulation {name} {ALLOWED}: {one}")
    words, proven = [], False
    for k, cap in enumerate(problem.budgets, start=len(problem.aims)):
        if problem.goals[k].in_time:  # what it is at best takes a search
            twin = problem.goals[k].twin
            least = -np.inf if twin is None else twin.least(problem.network, problem.rules)
            if least > tied(cap):
                proven = True
                words.append(f"makespan is at least {least:.6g} s, and {cap:g} s are allowed")
                continue
            words.append(f"{cap:g} s of makespan are allowed; --aim makespan finds the least")
            continue
        least = distances(graph, graph.amounts[:, k])[graph.ends].min()
        alone = " by itself" if least <= tied(cap) else ""
        words.append(f"{problem.goals[k]} is at least {least:.6g}{alone}, and {cap:g} is allowed")
    proven = proven or Proof(problem, {level: rows for level, _, rows in states}).is_impossible()
    why = f"{problem.title}: no plan is within all budgets; {', '.join(words)}"
    return InfeasibleError(why) if proven else claimed(name, why, exact=exact)


def _with_any_margin(problem: States) -> States:
    """Return the problem with every margin goal also as a constraint at its worst value."""
    for name in (goal.name for goal in problem.goals if goal.margins):
        problem = with_margin(problem, name, WORST[name])
    return problem


def _of_criterion(problem: States) -> tuple[Amount, ...]:
    """Return the goals evaluated by the criterion, whose values may be infinite."""
    return tuple(goal for goal in problem.aims if goal.of_criterion)


def _why_impossible(problem: States, seconds: float = np.inf) -> str:
    """Return one line: the brick at which all builds stop, and remedies found within ``seconds``.

    Of an engine with a ``rigid`` one the latter is used: loads tried here may be far beyond the
    capacity of joints, where discrete elements take seconds per state.
    """
    engine = getattr(problem.engine, "rigid", problem.engine)
    problem = _with_any_margin(replace(problem, engine=engine))
    look = Look(time.perf_counter() + seconds)
    where = "no plan is allowed"
    try:
        steps = replace(problem, goals=STEPS)
        if _of_criterion(problem) and barred(steps) is None and look(steps).whole:
            return f"{problem.title}: criterion {problem.criterion.name} allows no plan"
        state = barred(steps)
        finished = state is not None and _is_bare_end(problem, *state)
        if state is None:
            where = stops_of(problem).where(look(steps).reached)
        else:
            where = _barred_said(problem, *state)
        return f"{problem.title}: {where}{Remedies(problem, look).said(finished=finished)}"
    except LateError:
        return f"{problem.title}: {where}; time was over before it was known what helps, give more"


def _barred_said(problem: States, level: int, state: Ints) -> str:
    """Describe the infeasible state that every plan passes, and the violated constraint."""
    each, falls = problem.each or (problem,), False
    what = f"step {level} of {problem.space.levels}, in which no grip is open,"
    if _is_bare_end(problem, level, state):
        what = "the finished structure, which nobody holds,"
    for one in each:
        if not one.values(level, state)[1].all():
            return f"{what} {_excess_said(one, level, state)}"
        states, demanded = one.responses(level, state)[0], one.every_filter if one.demands else ()
        falls |= any(f.refuted(states).any() for f in demanded if f.expensive)
    how = "does not stand" if falls else "is not proven to stand"
    demand = next(iter(problem.demands), None)
    return f"{what} {how}{'' if demand is None else f' {demand.said}'}"


def _is_bare_end(problem: States, level: int, state: Ints) -> bool:
    """Return whether a state is the finished structure without grips."""
    whole = problem.space.bricks_at(level) == len(problem.network.inner)
    return whole and not problem.space.grips(state).any()


def _excess_said(problem: States, level: int, state: Ints) -> str:
    """Describe the limits that a state exceeds."""
    states, _ = problem.responses(level, state)
    found = states.responses
    named = ((each, found[each.response]) for each in problem.limits if each.response in found)
    over = [
        f"{each.label}={each.shown(float(value[0])):.6g} instead of {each.shown(each.bound):g}"
        for each, value in named
        if each.exceeded(value).any()
    ]
    for each in problem.filters if not over else ():
        if not each.proven(states).all():
            falls = each.refuted(states).any()
            return f"{'does not' if falls else 'is not proven to'} pass the filter {each.name}"
    return f"has {' and '.join(over)}" if over else "asks more of robots than they carry"
