"""Answers of formulations: called, read as numbers, and judged by their claims.

A formulation gets a copy of what it is judged by: nothing that it changes counts. What it raises or
returns that cannot be read is its failure, never a verdict.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from math import inf, isfinite
from typing import Any, NamedTuple, TypeVar

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Floats, Ints
from seqopt.errors import (
    InfeasibleError,
    NothingFoundError,
    ProblemError,
    SeqoptError,
    SolverError,
    TimeUpError,
    message_of,
)
from seqopt.graph._spaces import barred, steps_in_hands
from seqopt.graph.formulation import Formulation, FormulationKind, LabelProof, Run, Solution, Watch
from seqopt.graph.states import States
from seqopt.judge._schedules import judge_schedule, ordered
from seqopt.judge.certificate import Certificate
from seqopt.scene._checks import LARGEST_NUMBER, short
from seqopt.sequence.steps import Step
from seqopt.work import _keep

INFEASIBLE = Later("seqopt.plan._infeasible")  # seldom needed
COUNTED = ("each", "stability")  # of a problem: they know what was computed
CLOSE = 1e-6  # over a value: how far a bound may be above it by rounding
Result = TypeVar("Result")


class Found(NamedTuple):
    """What was chosen: claimed solution, certificate, checked steps, run times by stage, s."""

    selection: Solution
    certificate: Certificate | None
    steps: tuple[Step, ...]
    seconds: dict[str, float]


def called(name: str, kind: type[Result], solve: Callable[[], object]) -> Result:
    """Call ``solve`` of the formulation ``name`` and return its answer, of type ``kind``.

    Raises `SolverError` if it raises anything but an error of seqopt or an interrupt, or returns
    another type.
    """
    try:
        found = solve()
    except (SeqoptError, MemoryError, KeyboardInterrupt):
        raise
    except BaseException as error:  # foreign code may raise any error, exits too
        raise SolverError(f"formulation {name} failed: {message_of(error)}") from error
    if not isinstance(found, kind):
        raise SolverError(
            f"formulation {name} returned a {type(found).__name__}, not a {kind.__name__}"
        )
    return found


@contextmanager
def readable(name: str) -> Iterator[None]:
    """Raise a `SolverError` for errors of reading the answer of the formulation ``name``."""
    try:
        yield
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as error:
        raise SolverError(f"formulation {name} returned nonsense: {message_of(error)}") from error


def with_numbers(name: str, found: Solution, goals: int) -> Solution:
    """Return the answer of the formulation ``name`` with all entries converted to numbers.

    Raises `SolverError` if one cannot be converted, or values and bounds are not one per goal.
    """
    with readable(name):
        states = tuple(tuple(map(_whole, state)) for state in found.states)
        objective, bound = (tuple(map(float, part)) for part in (found.objective, found.bound))
        if not len(objective) == len(bound) == goals or not states:
            raise ValueError(
                f"{len(states)} states, {len(objective)} values and {len(bound)} bounds for "
                f"{goals} goals"
            )
        if not all(b <= v + CLOSE * abs(v) for v, b in zip(objective, bound, strict=True)):
            raise ValueError("a value or bound is NaN, or a bound is above its value")
        if not isinstance(found.stopped, str):
            raise TypeError(f"{type(found.stopped).__name__} where a text belongs")
        if not 0 <= (seconds := float(found.compile_seconds)) < np.inf:
            raise ValueError(f"compile_seconds is {seconds}")
        sets, models = map(_whole, found.effort)
        motions = tuple(np.array(each, dtype=float) for each in found.motions)
        if any(each.ndim != 2 or each.shape[1] != 6 or not len(each) for each in motions):
            raise ValueError("motions are none: give rows of six numbers")
        return replace(
            found,
            states=states,
            objective=objective,
            bound=bound,
            visited=tuple(map(_wholes, found.visited)),
            prices=tuple(tuple(map(float, each)) for each in found.prices),
            grips=tuple(tuple(map(_whole, row)) for row in found.grips),
            proofs=tuple(
                LabelProof(_wholes(rows), *(np.array(each, dtype=float) for each in numbers))
                for rows, *numbers in found.proofs
            ),
            starts=tuple(map(float, found.starts)),
            ends=float(found.ends),
            motions=motions,
            trace=(),
            compile_seconds=seconds,
            order=tuple(map(_whole, found.order)),
            effort=(sets, models),
        )


def _whole(given: object) -> int:
    """Return an integer within the range of int64; raise a `ValueError` otherwise."""
    number = operator.index(given)  # type: ignore[arg-type]  # raises what `readable` tells
    if abs(number) > LARGEST_NUMBER:
        raise ValueError(f"{short(number)} stands for no node or brick")
    return number


def _wholes(given: object) -> Ints:
    """Return an integer array of rows; raise a `ValueError` if an entry is no integer."""
    out = np.asarray(given)
    whole = out.dtype.kind in "iuf" and out.ndim == 2
    if not whole or not ((np.abs(out) <= LARGEST_NUMBER) & (out % 1 == 0)).all():
        raise ValueError(f"{out.dtype} of shape {out.shape} where rows of whole numbers belong")
    return out.astype(np.int64)


def find(problem: States, formulation: Formulation, run: Run) -> Found:
    """Find states of a build by a formulation, certified if a proof is requested.

    Raises `InfeasibleError`, which says why, if no choice is feasible; `ProblemError` if graph,
    formulation and options are incompatible; `SolverError` if the answer fails its check.
    """
    options = check_run(formulation, run)
    start = time.perf_counter()
    reported: dict[str, Any] = {} if run.progress is None else {"progress": run.progress}
    watch = Watch(min(run.left, options.get("seconds", inf)), run.progress)
    limit = {"watch": watch} if formulation.watched else {"seconds": run.left}
    limit = limit if formulation.watched or isfinite(run.left) else {}
    with _keep(problem.resources.executor, problem.resources.workers):
        with run.clock.needed("finding a first plan"):
            options = {**options, **reported, **limit}
            selection = _choose_states(formulation, problem, options, run)
        stopped = run.clock.why(selection.stopped)
        selection = replace(selection, stopped=stopped, trace=watch.trace)
        solved = time.perf_counter()
        if run.proof and run.progress is not None:
            run.progress("proving that no plan is better")
        twin = replace(problem, answers={})  # it knows nothing that was computed for the search
        space = ordered(twin, selection.order).space
        steps = steps_in_hands(space, selection.states, selection.grips)
        hint = dict(enumerate(selection.visited, start=twin.space.first))
        exact = formulation.kind is FormulationKind.EXACT
        judge = partial(judge_schedule, twin, selection, steps, hint, exact=exact)
        selection, certificate = _proven(selection, judge, run)
    problem.certified.update(twin.certified)
    written = selection.compile_seconds
    seconds = {"compile": written, "solve": solved - start - written}
    seconds["verify"] = time.perf_counter() - solved
    return Found(selection, certificate, steps, seconds)


def check_run(formulation: Formulation, run: Run) -> dict[str, Any]:
    """Return the options of a run; a `ProblemError` if its formulation does not take its limits."""
    if isfinite(run.time_limit) and not (formulation.watched or "seconds" in formulation.options):
        raise ProblemError(f"{formulation.name} takes no time limit; leave it out")
    return formulation.parse_options(run.options)


def _proven(
    selection: Solution, judge: Callable[[], Certificate], run: Run
) -> tuple[Solution, Certificate | None]:
    """Return a solution with its certificate, if one is requested and there is time for it."""
    if not run.proof:
        return selection, None
    certificate, stopped = run.clock.tried(judge)
    return replace(selection, stopped=stopped or selection.stopped), certificate


def _for_search(problem: States) -> States:
    """Return a copy for a formulation: what it changes is its own, and the judge keeps its own."""
    own = replace(problem, judged={})
    known = {key: vars(problem)[key] for key in COUNTED if key in vars(problem)}
    if "each" in known:
        known["each"] = tuple(map(_for_search, known["each"]))
    vars(own).update(known)
    return own


def _choose_states(
    formulation: Formulation, problem: States, options: Mapping[str, Any], run: Run
) -> Solution:
    """Return the formulation's solution, converted to numbers; raise why there is none.

    Without proof, a formulation with a window walks decision by decision, where its goals are
    steps' costs, and nothing is asked of whole builds, of whether they stand, or of scenarios.
    """
    start, name, exact = time.perf_counter(), formulation.name, formulation.looks_at_all
    limit = min(run.left, float(options.get("seconds", inf)))
    if barred(problem) is not None:  # what every plan passes is asked before any is sought
        raise INFEASIBLE.confirmed(replace(problem), name, limit, explain=run.explains)
    alone, rules = formulation.window_options, problem.rules
    walks = not run.proof and alone is not None
    walks &= formulation.parse_options(run.options) in ({}, alone)
    beside = problem.scenarios or problem.budgets or problem.demands or problem.paths
    walks &= all(goal.of_criterion for goal in problem.aims) and not beside
    if walks and rules.names_robots():
        return walk(problem, Watch(run.left))
    own = _for_search(problem)
    try:
        selection = called(name, Solution, partial(formulation.solve, own, **options))
    except InfeasibleError as error:
        left = limit - (time.perf_counter() - start)
        asked = replace(problem), name, left
        why = INFEASIBLE.confirmed(*asked, exact=exact, explain=run.explains)
        standing = problem.standing
        if type(why) is SolverError and standing is not None and standing.curing is not None:
            text = (
                f"{error} in which all states stand while mortar cures, though some are once it "
                "has; more robots may help, or mortar with some bond from 0 s on"
            )
            why = INFEASIBLE.claimed(name, text, exact=exact)
        raise why from None
    vars(problem).update({key: vars(own)[key] for key in COUNTED if key in vars(own)})
    return with_numbers(name, selection, len(problem.goals))


def walk(problem: States, watch: Watch) -> Solution:
    """Return the plan of a search of one decision after the other; its value is not claimed.

    Raises `NothingFoundError` if no candidate is left after the choices before it, while others may
    have led on; `TimeUpError` if time is over; `KeyboardInterrupt`, with the number of steps that
    are decided as its text.
    """
    space, resources = problem.space, problem.resources
    path, state = list[tuple[int, ...]](), space.start()
    try:
        with _keep(resources.executor, resources.workers):
            while len(path) < space.levels:
                if watch.over:
                    so_far = f"{watch.seconds:.3g} s: {_so_far(problem, path)}"
                    raise TimeUpError(f"{so_far}; give more time")
                costs, trail = _branches(problem, len(path), state)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"step {len(path) + 1}: no grip is allowed after the choices before it; "
                        "relax a limit, or let a formulation look at all choices"
                    )
                best = int(np.argmin(costs))
                path += [(len(path) + k, *rows[best].tolist()) for k, rows in enumerate(trail, 1)]
                state = trail[-1][best : best + 1]
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(_so_far(problem, path)) from stop
    return Solution(tuple(path), (np.nan,) * len(problem.goals), (-np.inf,) * len(problem.goals))


def _branches(problem: States, level: int, state: Ints) -> tuple[Floats, list[Ints]]:
    """Return the costs (k,) of a state's successors up to the next decision, and all their states.

    ``state`` (1, c); of every level passed the states (k, c).
    """
    costs, trail = np.zeros(1), list[Ints]()
    while level < problem.space.levels and len(costs):
        reached = trail[-1] if trail else state
        few = [reached[:1], reached] if trail else [reached]  # most decisions show in one state
        for some in few:
            ((moves, _),) = problem.space.onward(level, some)
            if trail and (np.bincount(moves.source) > 1).any():
                return costs, trail
        level += 1
        trail = [*(rows[moves.source] for rows in trail), moves.states]
        own = problem.candidates.of_branches(level, moves.states)
        costs = costs[moves.source] + own
    return costs, trail


def _so_far(problem: States, path: list[tuple[int, ...]]) -> str:
    """Return how far a build is decided, in words."""
    if not path:
        return "no grip was chosen yet"
    return f"the grips of {len(path)} of {problem.space.levels} steps were chosen"
