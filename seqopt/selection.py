"""What a formulation returns, and the check of what it claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from seqopt.errors import SolverError
from seqopt.placement import TINY, Placement, PlacementProblem, ProblemError

TOLERANCE = 1e-6  # of the costs that a choice meets: how far a claim may be from what the data say


class Kind(Enum):
    """What a formulation promises."""

    EXACT = "exact"
    HEURISTIC = "heuristic"
    BOUND = "bound"  # a proven bound; its choice is exact where nothing couples the moves


class Reads(Enum):
    """Which states a formulation looks at."""

    ALL = "all"  # every pair of every shared state
    WINDOW = "window"  # by default, shared states only for choices already made


class Aim(Enum):
    """What is to be least over the build."""

    SUM = "sum"
    PEAK = "peak"


@dataclass(frozen=True)
class Selection:
    """A candidate per move, and what its formulation claims of it.

    Attributes
    ----------
    choice : tuple of int
        Place of the chosen node among each move's candidates.
    objective : float
        Claimed value.
    bound : float
        Claimed lower bound, budgets included; minus infinity if none.
    prices : mapping of str to float
        Dual value of each budget: the rate at which one more unit would lower the bound.
    compile_seconds : float
        Part of the time to solve that went into writing the program down for a solver.
    """

    choice: tuple[int, ...]
    objective: float
    bound: float = -np.inf
    prices: Mapping[str, float] = field(default_factory=dict)
    compile_seconds: float = 0.0


@dataclass(frozen=True)
class Formulation:
    """A way to solve the problem.

    Attributes
    ----------
    name, summary : str
    kind : Kind
    aim : Aim
    solve : callable
        Takes the problem and named options, returns a `Selection`.
    reads : Reads
        Which states it looks at with its default options.
    """

    name: str
    summary: str
    kind: Kind
    aim: Aim
    solve: Callable[..., Selection]
    reads: Reads = Reads.ALL


@dataclass(frozen=True)
class Certificate:
    """A selection checked from the problem's data alone.

    Attributes
    ----------
    objective : float
        Recomputed.
    bound : float
        The least value of any choice, found anew from the data; where budgets forbid choices, the
        least without them.
    gap : float
        Objective less bound, over the size of the costs that the choice meets, signs aside: their
        sum, or the largest for a peak. It has no unit.
    claimed_gap : float
        The same with the formulation's own bound where that is higher; it is not proven, but knows
        the budgets.
    spent : mapping of str to float
        What the selection takes of each budget.
    """

    objective: float
    bound: float
    gap: float
    claimed_gap: float
    spent: Mapping[str, float]


def certify(problem: PlacementProblem, selection: Selection, aim: Aim) -> Certificate:
    """Check a selection from the problem's data, without the solver.

    Raises
    ------
    SolverError
        If the choice is not one candidate per move, is not allowed, exceeds a budget, or is not
        worth what was claimed.
    """
    placement = problem.sums if aim is Aim.SUM else problem.peaks
    value = _value(placement, selection.choice, aim)
    sizes = [abs(part) for part in placement.parts(selection.choice)]
    scale = max(sum(sizes) if aim is Aim.SUM else max(sizes), TINY)
    if not abs(value - selection.objective) <= TOLERANCE * scale:
        raise SolverError(f"the objective is {value:.9g}, not {selection.objective:.9g} as claimed")
    spent = {budget.name: budget.spent(selection.choice) for budget in problem.budgets}
    for budget in problem.budgets:
        if budget.slack(selection.choice) < -TOLERANCE:
            raise SolverError(
                f"the choice takes {spent[budget.name]:.6g} of {budget.name}, more than "
                f"{budget.bound:.6g}; use overlap_mip (the claimed bound is {selection.bound:.9g})"
            )
    bound = least_sum(placement) if aim is Aim.SUM else least_peak(placement)
    highest = value if problem.budgets else bound
    if not selection.bound <= highest + TOLERANCE * scale:  # NaN is no bound
        raise SolverError(f"the claimed bound {selection.bound:.9g} exceeds {highest:.9g}")
    gap, claimed = (max(0.0, value - b) / scale for b in (bound, max(bound, selection.bound)))
    return Certificate(value, bound, gap, claimed, spent)


def _value(placement: Placement, choice: tuple[int, ...], aim: Aim) -> float:
    """Return what a choice is worth, or raise a `SolverError` if it is none."""
    sizes = placement.sizes
    if len(choice) != len(sizes):
        raise SolverError(f"the answer names {len(choice)} candidates for {len(sizes)} moves")
    for k, (place, size) in enumerate(zip(choice, sizes, strict=True), start=1):
        if not 0 <= place < size:
            raise SolverError(f"the answer names candidate {place} of {size} for move {k}")
    value = placement.cost(choice) if aim is Aim.SUM else placement.worst(choice)
    if not np.isfinite(value):
        raise SolverError("the choice is not allowed by the problem; the solver's answer is wrong")
    return value


def least_sum(placement: Placement) -> float:
    """Return the least sum that any choice reaches, budgets aside: forward, layer by layer."""
    reached = np.zeros(1)
    for single, shared in zip(placement.single, placement.shared, strict=True):
        reached = (reached[:, None] + shared).min(axis=0) + single
    return float(reached.min())


def least_peak(placement: Placement) -> float:
    """Return the least worst cost of any choice, by bisection over all costs that occur.

    A value is reached if the choices whose costs do not exceed it connect the first move to the
    last.
    """
    levels = np.unique(np.concatenate([a.ravel() for a in (*placement.single, *placement.shared)]))
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        if _connected(placement, float(levels[middle])):
            high = middle
        else:
            low = middle + 1
    return float(levels[low])


def _connected(placement: Placement, level: float) -> bool:
    reached = np.ones(1, dtype=bool)
    for single, shared in zip(placement.single, placement.shared, strict=True):
        reached = (single <= level) & ((shared <= level) & reached[:, None]).any(axis=0)
    return bool(reached.any())


def formulations() -> dict[str, Formulation]:
    """Return all registered formulations (entry points of the group ``seqopt.formulations``)."""
    found = {entry.name: entry.load() for entry in entry_points(group="seqopt.formulations")}
    return dict(sorted(found.items()))


def formulation(name: str) -> Formulation:
    """Return a formulation by name, or raise a `ProblemError` that lists those there are."""
    known = formulations()
    if name not in known:
        raise ProblemError(
            f"formulation {name!r}: there is no such; give one of {', '.join(known)}"
        )
    return known[name]


def run(
    problem: PlacementProblem, which: Formulation, **options: Any
) -> tuple[Selection, Certificate]:
    """Solve a problem and check the answer; see `check`."""
    selection = which.solve(problem, **options)
    return selection, check(problem, selection, which)


def check(problem: PlacementProblem, selection: Selection, which: Formulation) -> Certificate:
    """Certify a selection, and hold its formulation to what it promises.

    Raises
    ------
    SolverError
        If the certificate fails, or without budgets a formulation that is no heuristic misses the
        optimum.
    """
    certificate = certify(problem, selection, which.aim)
    exact = which.kind is not Kind.HEURISTIC and not problem.budgets
    if exact and certificate.gap > TOLERANCE:
        raise SolverError(
            f"{which.name} promises the optimum {certificate.bound:.9g}, "
            f"but its choice is worth {certificate.objective:.9g}"
        )
    return certificate
