"""A choice for whoever has to stop before finding one of his own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import SolverError, TimeUpError
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import End, Selection
from seqopt.problem.aims import Aim


def stopped(
    problem: PlacementProblem, aim: Aim = Aim.SUM, bound: float = -np.inf, why: str = ""
) -> Selection:
    """Return an allowed choice that took no search, with a bound that took none.

    ``aim``: what to minimize; ``bound``: a better one that is known; ``why``: what to say where no
    choice within the budgets is at hand. Result: with the cheapest candidate of each move that
    leads on; where budgets forbid it, with the choice that takes least of one of them. Raises
    `InfeasibleError` if no choice is allowed; `SolverError` if none of these is within all budgets.
    """
    costs = aim.costs(problem)
    for choice in _choices(problem, costs):
        if all(budget.slack(choice) >= 0 for budget in problem.budgets):
            value = aim.worth(costs, choice)
            return Selection(choice, value, max(bound, at_least(costs, aim)), end=End.STOPPED)
    known = f" (no choice is below {bound:.6g})" if np.isfinite(bound) else ""
    if why:
        raise SolverError(
            f"{why} before any choice within all budgets was found; give it more time"
        )
    raise TimeUpError(f"no choice within all budgets was found yet{known}; give more")


def at_least(costs: LayeredCosts, aim: Aim) -> float:
    """Return what each move costs at least, together: a bound that takes no search."""
    if aim is Aim.SUM:
        arcs = (shared + single for shared, single in zip(costs.shared, costs.single, strict=True))
        return sum(float(arc.min()) for arc in arcs)
    return max(float(part.min()) for part in (*costs.single, *costs.shared))


def _choices(problem: PlacementProblem, costs: LayeredCosts) -> Iterator[tuple[int, ...]]:
    """Yield the cheapest way on, and the ways that take least of each budget."""
    good = costs.continuable()
    choice: list[int] = []
    for k, (single, shared) in enumerate(zip(costs.single, costs.shared, strict=True)):
        now = np.where(good[k], single + shared[choice[-1] if choice else 0], np.inf)
        choice.append(int(np.argmin(now)))
    yield tuple(choice)
    for budget in problem.budgets:
        arcs = [
            np.where(np.isfinite(shared + single), takes + own, np.inf)
            for shared, single, takes, own in zip(
                costs.shared, costs.single, budget.shared, budget.single, strict=True
            )
        ]
        yield _least(arcs)


def _least(arcs: list[Floats]) -> tuple[int, ...]:
    """Return the choice whose pairs are together least."""
    rest = [np.zeros(arcs[-1].shape[1])]
    for arc in reversed(arcs[1:]):
        rest.insert(0, (arc + rest[0]).min(axis=1))
    choice: list[int] = []
    for arc, ahead in zip(arcs, rest, strict=True):
        choice.append(int(np.argmin(arc[choice[-1] if choice else 0] + ahead)))
    return tuple(choice)
