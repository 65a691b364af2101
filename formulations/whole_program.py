"""An integer program of a placement problem: what is written down, and how it is solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cvxpy as cp
import numpy as np

from formulations.solvers import minimize_whole
from seqopt.arrays import Floats
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import CostProblem, PlacementProblem
from seqopt.plan.calling.formulation import End, Selection, Watch
from seqopt.plan.calling.priced_paths import ACCURACY, LayeredFlow, layered_flow, stopped
from seqopt.problem.problem import Aim

Choice = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class WholeProgram:
    """A program with whole variables, and what its solution means.

    ``program``: costs are scaled; ``whole``: those that a choice is read from; ``choice``: returns
    the choice that their values stand for; ``bound``: returns a lower bound in the unit of the
    costs for the value of the program, lower by what the solver may be off; ``feasible``: whether a
    choice is known to be allowed.
    """

    program: cp.Problem
    whole: cp.Variable
    choice: Callable[[Floats], Choice]
    bound: Callable[[float], float]
    feasible: bool = True


def solve_whole(
    problem: PlacementProblem, written: WholeProgram, aim: Aim, watch: Watch | None = None
) -> Selection:
    """Return the choice that a program finds.

    ``problem``: its costs are asked what the choice is worth; ``aim``: what it minimizes;
    ``watch``: says when to stop, and is told what is found. Result: with a bound. Raises
    `InfeasibleError` if no choice is within all budgets; `SolverError` if the solver ends without
    an optimum, or stops and no choice is at hand.
    """
    optimum = minimize_whole(
        written.program, feasible=written.feasible, watch=watch or Watch(), told=written.bound
    )
    if not np.isfinite(optimum.value):
        return stopped(problem, aim, written.bound(optimum.bound))
    choice = written.choice(np.asarray(written.whole.value))
    worth = aim.worth(aim.costs(problem), choice)
    bound = written.bound(optimum.bound if optimum.stopped else optimum.value)
    end = End.STOPPED if optimum.stopped else End.DONE
    return Selection(choice, worth, bound, {}, optimum.compile_seconds, end)


def largest_of_each(sizes: Sequence[int]) -> Callable[[Floats], Choice]:
    """Return what reads a choice from assignments of the candidates of every move.

    ``sizes``: how many candidates every move has.
    """
    ends = np.cumsum(sizes)[:-1]
    return lambda picks: tuple(int(np.argmax(part)) for part in np.split(picks, ends))


def below(scale: float, least: float = 0.0) -> Callable[[float], float]:
    """Return what turns the value of a program into a bound.

    ``scale``: by which costs are divided; ``least``: what was taken off them before.
    """
    return lambda value: least + scale * (value - ACCURACY * max(abs(value), 1.0))


def worst_pairs(costs: LayeredCosts) -> tuple[list[Floats], float]:
    """Return the worst cost of every pair of every move, and the least of them if negative.

    Results: ``worst`` (list of (C_k-1, C_k) float); ``least``: else zero.
    """
    worst = [np.maximum(d, c) for d, c in zip(costs.shared, costs.single, strict=True)]
    return worst, min(0.0, *(float(part.min()) for part in worst))


def flow_of_peaks(problem: PlacementProblem) -> tuple[LayeredFlow, Callable[[float], float]]:
    """Return the flow whose arcs cost the worst of every pair, and what bounds the least of these.

    ``problem``: its peaks are used. Results: ``flow``: of costs that are none below zero;
    ``bound``: of `WholeProgram`. Raises `InfeasibleError` if no choice is allowed.
    """
    worst, least = worst_pairs(problem.peaks)
    nothing = tuple(np.zeros(size) for size in problem.peaks.sizes)
    flow = layered_flow(CostProblem(LayeredCosts(nothing, tuple(p - least for p in worst))))
    return flow, lambda value: least + flow.bound(value)
