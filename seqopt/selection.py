"""What a formulation returns, and the check of what it claims."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib.metadata import entry_points
from typing import Any

import numpy as np

from seqopt.errors import SolverError
from seqopt.network import Floats
from seqopt.placement import Placement, PlacementProblem, ProblemError

TOLERANCE = 1e-6  # of the objective, or 1: how far a claim may be from what the data say


class Kind(Enum):
    """What a formulation promises."""

    EXACT = "exact"
    HEURISTIC = "heuristic"
    BOUND = "bound"  # a proven bound; its choice is exact where nothing couples the moves


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
    potentials : tuple of (C_k,) float, optional
        Cost to go from each candidate, its own single cost included, or less: a proof of a bound.
    bound : float
        Claimed lower bound; minus infinity if none.
    prices : mapping of str to float
        What one more unit of each budget would save.
    """

    choice: tuple[int, ...]
    objective: float
    potentials: tuple[Floats, ...] = ()
    bound: float = -np.inf
    prices: Mapping[str, float] = field(default_factory=dict)


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
    """

    name: str
    summary: str
    kind: Kind
    aim: Aim
    solve: Callable[..., Selection]


@dataclass(frozen=True)
class Certificate:
    """A selection checked from the problem's data alone.

    Attributes
    ----------
    objective : float
        Recomputed.
    bound : float
        The best lower bound that the data prove: from potentials, or for a peak from the lack of
        any path below it. Minus infinity if none is proven.
    gap : float
        Objective less bound, over the larger of the objective's size and 1.
    spent : mapping of str to float
        What the selection takes of each budget.
    """

    objective: float
    bound: float
    gap: float
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
    sizes = placement.sizes
    choice = selection.choice
    if len(choice) != len(sizes) or any(not 0 <= c < n for c, n in zip(choice, sizes, strict=True)):
        raise SolverError(f"no incumbent: {list(choice)} is not one candidate per move of {sizes}")
    value = placement.cost(choice) if aim is Aim.SUM else placement.worst(choice)
    if not np.isfinite(value):
        raise SolverError("the choice is not allowed by the problem; the solver's answer is wrong")
    scale = max(abs(value), 1.0)
    if not abs(value - selection.objective) <= TOLERANCE * scale:
        raise SolverError(f"the objective is {value:.9g}, not {selection.objective:.9g} as claimed")
    spent = {budget.name: budget.spent(choice) for budget in problem.budgets}
    for budget in problem.budgets:
        if spent[budget.name] > budget.bound + TOLERANCE * max(abs(budget.bound), 1.0):
            raise SolverError(f"the choice takes {spent[budget.name]:.6g} of {budget.name}, "
                              f"more than {budget.bound:.6g}")  # fmt: skip
    bound = (
        proven_sum(placement, selection.potentials)
        if aim is Aim.SUM
        else proven_peak(placement, value)
    )
    if bound > value + TOLERANCE * scale:
        raise SolverError(
            f"a bound of {bound:.9g} above the value {value:.9g} of an allowed choice"
        )
    return Certificate(value, bound, max(0.0, value - bound) / scale, spent)


def proven_sum(placement: Placement, potentials: tuple[Floats, ...]) -> float:
    """Return the lower bound on the sum that potentials prove, minus infinity if none.

    Wherever a potential exceeds what the next ones allow, the excess is charged to the bound.
    """
    if len(potentials) != len(placement.single):
        return -np.inf
    excess = 0.0
    for k, (single, potential) in enumerate(zip(placement.single, potentials, strict=True)):
        if potential.shape != single.shape or np.isnan(potential).any():
            return -np.inf
        rest = np.zeros(len(single))
        if k + 1 < len(potentials):
            rest = (placement.shared[k + 1] + potentials[k + 1]).min(axis=1)
        allowed = single + rest
        finite = np.isfinite(allowed)
        excess += max(0.0, float((potential[finite] - allowed[finite]).max(initial=0.0)))
    return float((placement.shared[0][0] + potentials[0]).min()) - excess


def proven_peak(placement: Placement, value: float) -> float:
    """Return the value if no choice stays strictly below it, else minus infinity."""
    reached = np.ones(1, dtype=bool)
    for single, shared in zip(placement.single, placement.shared, strict=True):
        reached = (single < value) & ((shared < value) & reached[:, None]).any(axis=0)
    return -np.inf if reached.any() else value


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
    """Solve a problem and check the answer."""
    selection = which.solve(problem, **options)
    return selection, certify(problem, selection, which.aim)
