"""Formulations against enumeration, where costs tie, are badly scaled, infeasible or malformed.

Every registered formulation solves small problems of random whole costs, whose exact answer
enumeration finds. What comes back is

- answered: certified, and off the optimum by no more than the gap that its certificate states;
- infeasible: no choice is allowed, or none keeps the budgets;
- refused: the input is malformed, or the formulation does not take budgets;
- failed: the solver ended without an answer, or the certificate found its answer wrong. The linear
  program ends so where its flow mixes choices under a budget; its bound stands;
- wrong: anything else, as "infeasible" or a refusal without ground, a bound above the optimum or no
  optimum where one is promised.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, product
from typing import NamedTuple
from unittest.mock import patch

import numpy as np

from experiments.harness.layers import LayeredCosts
from experiments.harness.scenes import half_circle
from formulations import solvers
from seqopt.arrays import Floats
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import Formulation, FormulationKind, formulations
from seqopt.plan.solve import pose
from seqopt.problem.criteria import Criterion, WorstRatio
from seqopt.problem.problem import Aim
from seqopt.problem.requirements import Limit
from seqopt.sequence.methods import three_robot_loop
from seqopt.study import EQUATIONS, RESOLUTION
from tests.layered import Budget, Costs, of_layers
from tests.layered import answer as claimed_answer

COARSE = replace(
    EQUATIONS, name="coarse", resolution=tuple((name, 100 * size) for name, size in RESOLUTION)
)
FORCE = WorstRatio("force", (("F_largest", 1.0),))


@dataclass(frozen=True)
class Size:
    """How large the problems are: moves, candidates of each, bricks of the arch."""

    moves: int
    candidates: int
    bricks: int

    @property
    def sizes(self) -> tuple[int, ...]:
        """The candidates of every move."""
        return (self.candidates,) * self.moves


Rng = np.random.Generator
Case = Callable[[Size, Rng], Costs]


def keeps(budget: Budget, choice: tuple[int, ...]) -> bool:
    """Return whether a choice is within a budget, up to rounding of the amounts that it takes."""
    taken = budget.amounts.parts(choice)
    size = max(abs(budget.bound), sum(map(abs, taken)))
    return bool(sum(taken) <= budget.bound + 1e-9 * min(size, 1e300))


def enumerated(problem: Costs, aim: Aim) -> tuple[float, list[tuple[int, ...]]]:
    """Return the best value over all combinations within limits and budgets, and who reaches it."""
    worth = problem.sums.cost if aim is Aim.SUM else problem.peaks.worst
    values: dict[tuple[int, ...], float] = {
        choice: worth(choice)
        for choice in product(*map(range, problem.sums.sizes))
        if all(keeps(budget, choice) for budget in problem.budgets)
    }
    best = min(values.values(), default=np.inf)
    if not np.isfinite(best):
        return np.inf, []
    first = next(choice for choice, value in values.items() if value == best)
    size = max(abs(part) for part in problem.sums.parts(first))
    return best, [c for c, value in values.items() if value - best <= 1e-12 * size]


def costs(sizes: tuple[int, ...], draw: Callable[[tuple[int, ...]], Floats]) -> Costs:
    """Return a problem with costs drawn by shape; nothing is shared before the first move."""
    shared = (np.zeros((1, sizes[0])), *(draw(pair) for pair in pairwise(sizes)))
    return Costs(LayeredCosts(tuple(draw((size,)) for size in sizes), shared))


def whole(sizes: tuple[int, ...], rng: Rng, scale: float = 1.0, least: int = 0) -> Costs:
    """Return a problem with random whole costs, times a scale."""
    return costs(sizes, lambda shape: scale * rng.integers(least, 10, shape).astype(float))


def mixed(size: Size, rng: Rng) -> Costs:
    """Return a problem with costs from 1e-9 to 1e9; the best choice has only small ones."""

    def draw(shape: tuple[int, ...]) -> Floats:
        return np.asarray(rng.integers(1, 10, shape) * 10.0 ** rng.choice([-9, 9], shape))

    return costs(size.sizes, draw)


def rounded(size: Size, rng: Rng) -> Costs:
    """Return costs that are equal but for the rounding of their sums, the larger ones first."""
    same = rng.permutation([0.1 + 0.2, *[0.3] * (size.candidates - 1)])
    return costs(size.sizes, lambda shape: np.broadcast_to(same, shape))


def one_left(size: Size, rng: Rng) -> Costs:
    """Return a problem in which one candidate per move is allowed."""
    problem = whole(size.sizes, rng)
    kept = rng.integers(size.candidates, size=size.moves)
    single = tuple(
        np.where(np.arange(size.candidates) == k, cost, np.inf)
        for k, cost in zip(kept, problem.sums.single, strict=True)
    )
    return Costs(LayeredCosts(single, problem.sums.shared))


def dead_end(size: Size, rng: Rng) -> Costs:
    """Return a problem whose candidates are all allowed, but no pair of the last two moves is."""
    sums = whole(size.sizes, rng).sums
    none = np.full_like(sums.shared[-1], np.inf)
    return Costs(LayeredCosts(sums.single, (*sums.shared[:-1], none)))


def altered(size: Size, rng: Rng, value: float) -> Costs:
    """Return a problem with one cost replaced."""
    sums = whole(size.sizes, rng).sums
    first = sums.single[0].copy()
    first[0] = value
    return Costs(LayeredCosts((first, *sums.single[1:]), sums.shared))


def capped(size: Size, rng: Rng, amount: float, share: float) -> Costs:
    """Return a problem with a budget of which candidate ``j`` takes ``j`` times an amount.

    The bound is a share of what the best choice without it takes; the dearest candidates take least
    or the budget would bind nothing.
    """
    problem = whole(size.sizes, rng)
    takes = tuple(
        amount * np.argsort(np.argsort(-single)).astype(float) for single in problem.sums.single
    )
    budget = Budget("use", takes, tuple(np.zeros_like(s) for s in problem.sums.shared), np.inf)
    spent = budget.spent(enumerated(problem, Aim.SUM)[1][0])
    return replace(problem, budgets=(replace(budget, bound=share * spent),))


def opposed(size: Size, rng: Rng, total: float) -> Costs:
    """Return a problem with two budgets that every candidate takes one or the other of.

    Their bounds add up to the number of moves times ``total``.
    """
    problem = whole(size.sizes, rng)
    first = tuple((np.arange(n) % 2).astype(float) for n in size.sizes)
    second = tuple(1.0 - amounts for amounts in first)
    none = tuple(np.zeros_like(s) for s in problem.sums.shared)
    bound = 0.5 * size.moves * total
    budgets = (Budget("odd", first, none, bound), Budget("even", second, none, bound))
    return replace(problem, budgets=budgets)


def arch(size: Size, criterion: Criterion, limits: tuple[Limit, ...] = ()) -> Costs:
    """Return the problem of the three-robot loop on a small arch."""
    engine = ComplianceEngine(half_circle(size.bricks))
    return of_layers(pose(engine, three_robot_loop(engine.network), criterion, limits=limits))


def tight(size: Size, _: Rng) -> Costs:
    """Return a problem whose limit is the least force with which it can be built."""
    least, __ = enumerated(arch(size, FORCE), Aim.PEAK)
    return arch(size, FORCE, (Limit("F_largest", least),))


CASES: dict[str, Case] = {
    "ranks tie after rounding": lambda size, _: arch(size, COARSE),
    "equal costs": lambda size, _: costs(size.sizes, lambda shape: np.full(shape, 5.0)),
    "all costs zero": lambda size, _: costs(size.sizes, np.zeros),
    "equal but for rounding": rounded,
    "one move": lambda size, rng: whole((size.candidates,), rng),
    "one candidate per move": lambda size, rng: whole((1,) * size.moves, rng),
    "one candidate left by limits": one_left,
    "limit met exactly": tight,
    "limit nobody meets": lambda size, _: arch(size, FORCE, (Limit("F_largest", 0.0),)),
    "no pair allowed": dead_end,
    "all costs infinite": lambda size, _: costs(size.sizes, lambda shape: np.full(shape, np.inf)),
    "one cost infinite": lambda size, rng: altered(size, rng, np.inf),
    "one cost NaN": lambda size, rng: altered(size, rng, np.nan),
    "one cost -inf": lambda size, rng: altered(size, rng, -np.inf),
    "costs 1e-9 and 1e9": mixed,
    "costs 1e308": lambda size, rng: whole(size.sizes, rng, 1e307, 9),
    "budget binds exactly": lambda size, rng: capped(size, rng, 0.1, 1.0),
    "budget binds": lambda size, rng: capped(size, rng, 1.0, 0.6),
    "budget leaves one choice": lambda size, rng: capped(size, rng, 1.0, 0.0),
    "budget cannot be met": lambda size, rng: capped(size, rng, 1.0, -1.0),
    "budgets met by mixtures only": lambda size, rng: opposed(size, rng, 1.0),
    "budgets not met by mixtures": lambda size, rng: opposed(size, rng, 0.9),
    "budget amount NaN": lambda size, rng: capped(size, rng, np.nan, 1.0),
}
MALFORMED = {"one cost NaN", "one cost -inf", "costs 1e308", "budget amount NaN"}
FULL, SMALL = Size(5, 4, 7), Size(3, 3, 6)
CLOSE = 1e-6  # relative: values this close are equal
SCALES = tuple(10.0**power for power in range(-12, 13, 3))
MOVES = (2, 3, 4, 5, 6)
ENDS = {
    "infeasible": "infeasible",
    "nearly optimal": "optimal_inaccurate",
    "nearly infeasible": "infeasible_inaccurate",
    "limit reached": "user_limit",
    "nothing": "None",
}  # as a solver may end on a problem that has an optimum
UNANSWERED = ("infeasible", "refused", "failed")


class Cell(NamedTuple):
    """A value of an axis, and the problem that it stands for."""

    axis: str
    value: str
    case: Case
    size: Size
    said: str | None = None  # what solvers end with, whatever they are asked


def cells(*, quick: bool) -> Iterator[Cell]:
    """Yield all cells, or few and small ones."""
    size = SMALL if quick else FULL
    for scale in SCALES[:: 4 if quick else 1]:
        scaled, used = partial(_scaled, scale=scale), partial(capped, amount=scale, share=0.6)
        yield Cell("scale of costs", f"{scale:g}", scaled, size)
        yield Cell("scale of a budget's amounts", f"{scale:g}", used, size)
    for moves in MOVES[: 2 if quick else None]:
        yield Cell("moves", f"{moves}", _scaled, Size(moves, size.candidates, 0))
    for name, case in CASES.items():
        yield Cell("costs and budgets", name, case, size)
    for said, status in ENDS.items():
        yield Cell("a solver says", said, _scaled, size, status)


def _scaled(size: Size, rng: Rng, scale: float = 1.0) -> Costs:
    return whole(size.sizes, rng, scale)


def answer(problem: Costs, formulation: Formulation) -> dict[str, object]:
    """Return what a formulation makes of a problem: value, claimed bound, the gap it states."""
    row: dict[str, object] = {"bound": np.nan, "message": ""}
    try:
        claimed = claimed_answer(problem, formulation, proof=False)
    except (InfeasibleError, ProblemError, SolverError) as error:
        names: dict[type, str] = {InfeasibleError: "infeasible", ProblemError: "refused"}
        return row | {"status": names.get(type(error), "failed"), "message": str(error)}
    except Exception as error:  # a traceback is what this looks for
        return row | {"status": "wrong", "message": repr(error)}
    row |= {"bound": claimed.bound, "choice": claimed.choice}
    try:
        certificate = claimed_answer(problem, formulation).certificate
    except SolverError as error:
        return row | {"status": "failed", "message": str(error)}
    value, stated = certificate.objective, certificate.gap  # type: ignore[attr-defined]
    return row | {"status": "answered", "objective": value, "stated": stated}


def judge(problem: Costs, formulation: Formulation) -> dict[str, object]:
    """Return the answer with its status and its true error, as enumeration has them."""
    best, winners = enumerated(problem, formulation.aim or Aim.SUM)
    row = answer(problem, formulation)
    room = CLOSE * abs(best)
    if row["status"] == "infeasible" and winners:
        return row | {"status": "wrong"}
    if row["status"] == "refused" and not (problem.budgets and not formulation.takes_budgets):
        return row | {"status": "wrong"}
    if float(str(row["bound"])) > best + room:
        return row | {"status": "wrong", "message": "bound above the optimum"}
    if row["status"] != "answered":
        return row
    value, stated = float(str(row["objective"])), float(str(row["stated"]))
    error = (value - best) / abs(value) if value != best else 0.0  # as a gap is measured
    relaxed = formulation.kind is FormulationKind.BOUND and problem.budgets
    exact = formulation.kind is not FormulationKind.HEURISTIC and not relaxed
    most = CLOSE if exact else stated + CLOSE
    right = bool(winners) and -CLOSE <= error <= most
    return row | {
        "error": max(error, 0.0),
        "stated": most,
        "status": "answered" if right else "wrong",
    }


@contextmanager
def solvers_saying(status: str | None) -> Iterator[None]:
    """Let every solver end with a status, whatever it is asked."""
    if status is None:
        yield
        return

    end = "kInfeasible" if status == ENDS["infeasible"] else status
    with (
        patch("cvxpy.Problem.solve", lambda *_, **__: None),
        patch("cvxpy.Problem.status", status),
        patch.object(solvers, "_end", lambda *_: end),
    ):
        yield


def rows(cell: Cell, seeds: Iterable[int]) -> Iterator[dict[str, object]]:
    """Yield what every formulation makes of the draws of a cell."""
    for seed in seeds:
        found: dict[str, dict[str, object]]
        try:
            problem = cell.case(cell.size, np.random.default_rng(seed))
            with solvers_saying(cell.said):
                found = {n: judge(problem, f) for n, f in formulations("costs").items()}
        except ProblemError as error:  # before any formulation
            status = "refused" if cell.value in MALFORMED else "wrong"
            found = {n: {"status": status, "message": str(error)} for n in formulations("costs")}
        for name, row in found.items():
            own = {"axis": cell.axis, "value": cell.value, "method": name, "case": str(seed)}
            silent = row["status"] in UNANSWERED and not str(row["message"]).strip()
            yield own | row | ({"status": "wrong"} if silent else {})
