"""Compile a problem to an instance: its complete graph, goals and caps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from seqopt._registry import offered
from seqopt.arrays import Ints
from seqopt.contact.mortar import Mortar
from seqopt.engines.registry import DEFAULT
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph._spaces import build_space
from seqopt.graph.formulation import find_formulation
from seqopt.graph.graph import PEAK, SUM, TAIL, TIME, Graph, _on_paths, _Target, contracted
from seqopt.graph.space import Explorer, Visited
from seqopt.graph.states import States
from seqopt.instances.model import Instance, _by_goal, _Cap
from seqopt.plan.solve import graph_of, without_shares
from seqopt.problem.criteria import Criterion
from seqopt.problem.problem import Aim, Problem
from seqopt.problem.requirements import Filter, Limit
from seqopt.scene.scene import Scene
from seqopt.sequence.part import Part
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.stability.standing import Standing
from seqopt.work import Clock, Tell
from seqopt.workflow import Robust, Search, pose_build

SEARCH = Search()  # it is frozen


def instance(  # noqa: PLR0913  # every question is a word of its own
    scene: Scene | str | Path,
    schedule: Schedule | Part | Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    engine: str = DEFAULT,
    *,
    aim: str | None = None,
    limits: Sequence[Limit | Filter | str] | str = (),
    budgets: Sequence[str] | str = (),
    stands: Standing | Mortar | str | None = None,
    robust: Robust | None = None,
    order: str | Sequence[int] | None = None,
    mortar: Mortar | str | None = None,
    robots: int | Sequence[str] | None = None,
    candidates: str | None = None,
    rules: FreeRules | Sequence[str] | str = (),
    search: Search = SEARCH,
    below: float = np.inf,
    progress: Tell | None = None,
) -> Instance:
    """Return the graph of what `seqopt.optimize` would solve, for the same question.

    Parameters
    ----------
    scene, schedule, criterion, formulation, engine, aim, limits, budgets, stands : optional
        As of `optimize`.
    robust, order, mortar, robots, candidates, rules, search : optional
        As of `optimize`; of a search its time counts alone.
    below : float, optional
        Leave out states of which the first aim, a worst step, takes more; plans that are better
        than this stay.
    progress : callable, optional
        Called with the progress.

    Returns
    -------
    Instance

    Raises
    ------
    InfeasibleError, ProblemError
        As of `compile_instance`.

    Examples
    --------
    >>> instance("chain:bricks=7", "free", aim="minmax,steps", below=40.0)
    <Instance 'chain 7': 1613 nodes, 6405 arcs, minmax, steps>
    """
    asked, clock = locals(), Clock(search.time_limit)
    with clock.needed("posing the problem"):
        problem = pose_build(asked)
    if progress is not None:
        progress("computing all that arcs take")
    own = None if formulation is None else find_formulation(formulation).aim
    with clock.needed("writing down the graph"):
        return compile_instance(problem, aim=own, below=below)


def compile_instance(
    problem: Problem,
    *,
    name: str = "",
    aim: Aim | None = None,
    below: float = np.inf,
    facts: Mapping[str, Any] | None = None,
) -> Instance:
    """Return the instance of a problem: the graph that its formulations search, whole.

    Parameters
    ----------
    problem : Problem
        From `seqopt.pose`.
    name : str, optional
        What it is called; by default as its scene.
    aim : Aim, optional
        Of candidates of moves: whether to minimize the sum of their costs or the largest; by
        default as of the formulation that usually solves the problem.
    below : float, optional
        Where states are chosen: those of which the first aim takes more are left out. A path that
        is better than this stays.
    facts : mapping, optional
        Where it comes from, to be kept in its file; the version is added.

    Returns
    -------
    Instance
        Only nodes and arcs that are on a path from the start to an end.

    Raises
    ------
    InfeasibleError
        If no path leads to an end.
    ProblemError
        If nothing is known of a limit like ``below``, or a cost is negative.

    Examples
    --------
    >>> import seqopt
    >>> problem = seqopt.optimize("chain:bricks=7", "free", aim="minmax,steps").problem
    >>> seqopt.compile_instance(problem, below=40.0)
    <Instance 'chain 7': 1613 nodes, 6405 arcs, minmax, steps>
    """
    name = name or problem.engine.network.scene.name
    problem = without_shares(problem)
    instance = _of_states(name, graph_of(problem, aim), below)
    return replace(instance, facts={"seqopt": version("seqopt"), **(facts or {})})


def _of_states(name: str, states: States, below: float) -> Instance:
    """Return the instance of a graph of states.

    Where robots have names its arcs are decisions, with the forced steps behind them.
    """
    visited, rows = _explored(name, states, below)
    graph, timed = visited.graph, None
    names, goals, caps = _targets(states, len(graph.peaks))
    if states.rules.names_robots() and not states.is_timed:
        if not states.totals and states.goals[0].of_criterion:
            own = [states.candidates.charges(level, each) for level, _, each in visited.states]
            graph = replace(graph, alone=np.concatenate(own)[graph.target])
        short = contracted(graph.only(_on_paths(graph)))
        small, rows = short.graph, rows[short.kept]
        rows[:, 0] = np.unique(rows[:, 0], return_inverse=True)[1]  # levels of decisions
    else:
        if states.is_timed:
            timed = offered("timed_graph")(states, visited)
            every = [k for k, goal in enumerate(states.goals) if not goal.in_time]
            peaks = tuple(graph.peaks[k] for k in every)
            graph = replace(graph, amounts=graph.amounts[:, every], peaks=peaks)
        small, kept = _pruned(graph)
        rows = rows[kept]
        if timed is not None:
            timed = timed.only(kept, _by_goal(small, (goals, caps)))
    arrays = small.source, small.target, small.ends, names, small.amounts
    return Instance(name, *arrays, goals, caps, rows, timed, small.alone)


def _explored(name: str, states: States, below: float) -> tuple[Visited, Ints]:
    """Return the states and moves that a plan may take, and what the states stand for."""
    if below < np.inf and (states.totals or not states.goals[0].is_peak):
        raise ProblemError("below: the first aim is no worst step; leave it out")
    if states.paths:
        raise ProblemError(f"instance: no resource is in it; leave {states.paths[0]} out")
    if states.is_timed and states.standing is not None and states.standing.curing is not None:
        raise ProblemError("instance: how mortar cures is not in it; leave curing out")
    demanded = bool(states.demands) or any(goal.margins for goal in states.goals)
    space = build_space(states, standing=demanded)
    found = Explorer(space)
    found.rise(below)
    if not found.whole:
        raise InfeasibleError(f"instance {name}: no plan is allowed")
    found.refine()
    visited = found.graph()
    return visited, np.concatenate([space.rows(key, own) for _, key, own in visited.states])


def _pruned(graph: Graph) -> tuple[Graph, Ints]:
    """Return the subgraph of states and moves on paths to ends, and which states these are."""
    small = graph.only(_on_paths(graph))
    if not len(small.source):
        raise InfeasibleError("no path leads to an end")
    kept, rows = np.unique([small.source, small.target], return_inverse=True)
    source, target = rows.reshape(2, -1).astype(np.int32)
    return replace(small, source=source, target=target, ends=graph.ends[kept]), kept


def _targets(
    states: States, count: int
) -> tuple[tuple[str, ...], tuple[_Target, ...], tuple[_Cap, ...]]:
    """Return the names of columns, ``count``, goals and caps of a problem of states."""
    if states.totals:
        tail = _Target(str(states.over), TAIL, tuple(range(count)), states.over.most(count))
        return tuple(f"cost {k}" for k in range(count)), (tail,), ()
    names, goals, caps = list[str](), list[_Target](), list[_Cap]()
    bounds = (*[None] * len(states.aims), *states.budgets)
    for goal, bound in zip(states.goals, bounds, strict=True):
        name, column = str(goal), None if goal.in_time else len(names)
        names += [] if goal.in_time else [name]
        if bound is not None:
            caps.append(_Cap(name, column, bound))
            continue
        kind = TIME if goal.in_time else PEAK if goal.is_peak else SUM
        goals.append(_Target(name, kind, () if column is None else (column,)))
    return tuple(names), tuple(goals), tuple(caps)
