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
from seqopt.times._graph import TimedGraph
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
    """Return the instance of a graph of states."""
    if below < np.inf and (states.totals or not states.goals[0].is_peak):
        raise ProblemError("below: the first aim is no worst step; leave it out")
    if states.paths:
        raise ProblemError(f"instance: no resource is in it; leave {states.paths[0]} out")
    demanded = bool(states.demands) or any(goal.margins for goal in states.goals)
    space = build_space(states, standing=demanded)
    found = Explorer(space)
    found.rise(below)
    if not found.whole:
        raise InfeasibleError(f"instance {name}: no plan is allowed")
    found.refine()
    visited = found.graph()
    if states.totals:
        count = len(visited.graph.peaks)
        tail = _Target(str(states.over), TAIL, tuple(range(count)), states.over.most(count))
        asked: Any = [f"cost {k}" for k in range(count)], (tail,), ()
    else:
        asked = _targets(states)
    rows = np.concatenate([space.rows(key, own) for _, key, own in visited.states])
    timed = None
    whole = visited.graph
    if states.rules.names_robots() and not states.is_timed:
        return _of_decisions(name, states, visited, rows, asked)
    if states.is_timed:
        if states.standing is not None and states.standing.curing is not None:
            raise ProblemError("instance: how mortar cures is not in it; leave curing out")
        timed = offered("timed_graph")(states, visited)
        every = [k for k, goal in enumerate(states.goals) if not goal.in_time]
        peaks = tuple(whole.peaks[k] for k in every)
        whole = Graph(whole.source, whole.target, whole.amounts[:, every], peaks, whole.ends)
    small, kept = _pruned(whole)
    names, goals, caps = asked
    if timed is not None:  # of the nodes that are kept
        on = np.isin(np.arange(whole.states), kept)
        arcs = on[whole.source] & on[whole.target]
        acts = arcs[timed.move]
        timed = TimedGraph(
            _by_goal(small, (goals, caps)),
            *(timed.levels[on], timed.free[on], timed.alike[on], timed.kinds),
            (np.cumsum(arcs) - 1)[timed.move[acts]],
            *(timed.column[acts], timed.origin[acts]),
            *(timed.prepares[arcs], timed.acts[arcs], timed.work[arcs], timed.longest),
        )
    arrays = small.source, small.target, small.ends
    return Instance(name, *arrays, tuple(names), small.amounts, goals, caps, rows[kept], timed)


def _pruned(graph: Graph) -> tuple[Graph, Ints]:
    """Return the subgraph of states and moves on paths to ends, and which states these are."""
    small = graph.only(_on_paths(graph))
    if not len(small.source):
        raise InfeasibleError("no path leads to an end")
    on = np.isin(np.arange(graph.states), [small.source, small.target])
    number = (np.cumsum(on) - 1).astype(np.int32)
    rows = number[small.source], number[small.target]
    return replace(small, source=rows[0], target=rows[1], ends=graph.ends[on]), np.flatnonzero(on)


def _of_decisions(name: str, states: States, visited: Visited, rows: Ints, asked: Any) -> Instance:
    """Return the instance whose arcs are decisions, with the forced steps behind them."""
    graph, (names, goals, caps) = visited.graph, asked
    if not states.totals and states.goals[0].of_criterion:
        own = [states.candidates.charges(level, each) for level, _, each in visited.states]
        graph = replace(graph, alone=np.concatenate(own)[graph.target])
    short = contracted(graph.only(_on_paths(graph)))
    rows, small = rows[short.kept], short.graph
    rows[:, 0] = np.unique(rows[:, 0], return_inverse=True)[1]  # levels of decisions
    arrays = small.source, small.target, small.ends, tuple(names), small.amounts
    return Instance(name, *arrays, goals, caps, rows, alone=small.alone)


def _targets(states: States) -> tuple[list[str], tuple[_Target, ...], tuple[_Cap, ...]]:
    """Return the names of columns, goals and caps of a problem of states."""
    names, goals, caps = list[str](), list[_Target](), list[_Cap]()
    bounds = (*[None] * len(states.aims), *states.budgets)
    for goal, bound in zip(states.goals, bounds, strict=True):
        is_time = goal.in_time
        column = None if is_time else len(names)
        if not is_time:
            names.append(str(goal))
        if bound is None:
            kind = TIME if is_time else PEAK if goal.is_peak else SUM
            goals.append(_Target(str(goal), kind, () if column is None else (column,)))
        else:
            caps.append(_Cap(str(goal), column, bound))
    return names, tuple(goals), tuple(caps)
