"""An integer program of a placement problem: what is written down, and how it is solved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cvxpy as cp
import numpy as np

from formulations.layers.priced_paths import stopped
from formulations.solvers import minimize_whole
from seqopt.arrays import Floats, Terse
from seqopt.graph.formulation import End, Formulation, FormulationKind, Watch
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.solution import Selection
from seqopt.problem.problem import Aim


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
    choice: Callable[[Floats], tuple[int, ...]]
    bound: Callable[[float], float]
    feasible: bool = True


@dataclass(frozen=True, repr=False)
class IntegerProgram(Terse):
    """The ``solve`` of a formulation that is an integer program.

    ``aim``: what it minimizes; ``write``: returns the program of a problem; raises
    `InfeasibleError` if no choice is allowed, or none is within one of the budgets.
    """

    aim: Aim
    write: Callable[[PlacementProblem], WholeProgram] = field(repr=False)

    def __call__(self, problem: PlacementProblem, *, watch: Watch | None = None) -> Selection:
        """Return the choice that the program finds, with a bound.

        Raises `InfeasibleError` if no choice is within all budgets; `SolverError` if the solver
        ends without an optimum, or stops and no choice is at hand.
        """
        written = self.write(problem)
        optimum = minimize_whole(
            written.program, feasible=written.feasible, watch=watch, told=written.bound
        )
        if not np.isfinite(optimum.value):
            return stopped(problem, self.aim, written.bound(optimum.bound))
        choice = written.choice(np.asarray(written.whole.value))
        worth = self.aim.value_of(self.aim.costs(problem), choice)
        bound = written.bound(optimum.bound if optimum.stopped else optimum.value)
        end = End.STOPPED if optimum.stopped else End.DONE
        return Selection(choice, worth, bound, {}, optimum.compile_seconds, end)


def integer_program(
    name: str,
    summary: str,
    aim: Aim,
    write: Callable[[PlacementProblem], WholeProgram],
    *,
    takes_budgets: bool = False,
) -> Formulation:
    """Return the exact formulation that solves what is written down of a problem."""
    solve = IntegerProgram(aim, write)
    return Formulation(
        name, summary, FormulationKind.EXACT, aim, solve, takes_budgets=takes_budgets
    )
