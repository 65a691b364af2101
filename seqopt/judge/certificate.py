"""Certificates of optimality: a selection checked from the problem's data alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arrays import Floats, FrozenValue
from seqopt.errors import FileError, SolverError
from seqopt.graph.formulation import End, Formulation, FormulationKind, as_formulation
from seqopt.graph.layers.costs import TINY, LayeredCosts, _array_by_array
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.layers import Layers
from seqopt.graph.scenarios import ScenarioLayers
from seqopt.graph.solution import Selection
from seqopt.network.network import Network
from seqopt.problem.problem import Aim
from seqopt.responses._blocks import packed, remade
from seqopt.responses._choices import Evaluation
from seqopt.responses.quantities import CHOSEN_BY

if TYPE_CHECKING:
    from seqopt.graph.layers._partial_costs import PartialCosts

SAME = 1e-5  # over its largest, that a response may differ: ten times what a screen may err


def _require_anew(
    problem: Layers, choice: Sequence[int], met: Sequence[tuple[Layers, Sequence[int]]] = ()
) -> None:
    """Raise an error if a choice leads to other responses than its problem has from a cache.

    ``choice``: a candidate for every move; ``met`` (sequence of (Layers, sequence of int)): where
    its own responses are not computed: problems with all of its steps, and the choices in these.
    Raises `FileError` if a response of a step is another one when it is computed anew.
    """
    evaluation, cache = problem.evaluation, problem.evaluation.resources.cache
    if cache is None:
        return
    schedule = problem.schedule
    chosen = tuple(
        replace(move, candidates=(move.candidates[i],))
        for move, i in zip(schedule.moves, choice, strict=True)
    )
    engine = remade(packed(problem.engine))
    anew = Evaluation(engine, replace(schedule, moves=chosen), evaluation.wanted)
    found = dict(_met(anew, [0] * len(chosen)))
    kept: dict[int, Mapping[str, float]] = {}
    for part, mine in met or [(problem, choice)]:
        kept |= _met(part.evaluation, mine)
    sizes = _sizes(engine.network, [*kept.values(), *found.values()])
    for step, responses in found.items():
        for name, value in responses.items():
            there = kept[step][name]
            if not np.isclose(there, value, rtol=0.0, atol=SAME * sizes[name], equal_nan=True):
                raise FileError(
                    f"cache {cache}: {name} of step {step} is {there:.6g} in a file, and "
                    f"{value:.6g} when it is computed; delete the folder"
                )


def _met(
    evaluation: Evaluation, choice: Sequence[int]
) -> Iterator[tuple[int, Mapping[str, float]]]:
    """Yield the responses that a choice meets, by step."""
    for choices in chain.from_iterable(evaluation.levels()):
        at = tuple(choice[move] for move in choices.moves)
        yield choices.step.number, {n: float(v[at]) for n, v in choices.responses.items()}


def _sizes(network: Network, steps: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return what each response is compared with: rounding of forces is no response of its own."""
    force = float(np.linalg.norm(network.weight, axis=1).sum())
    floors = {"N": force, "Nm": force * float(np.ptp(network.node_position, axis=0).max())}
    sizes: dict[str, float] = {}
    for name, value in chain.from_iterable(step.items() for step in steps):
        unit = CHOSEN_BY[name].column.split("_")[-1] if name in CHOSEN_BY else "N"
        sizes[name] = float(np.fmax(sizes.get(name, floors.get(unit, 0.0)), abs(value)))
    return sizes


TOLERANCE = 1e-6  # of the costs that a choice meets: how far a claim may be from what the data say


def _known_gap(gap: float) -> float:
    """Return a gap as people read it: below the tolerance of proofs there is none."""
    return 0.0 if gap <= TOLERANCE else gap


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(FrozenValue):
    """The values of a plan and bounds on all others, from the problem's data alone.

    Attributes
    ----------
    values : tuple of float
        The value of every goal, recomputed; of candidates one, in the unit of the criterion.
    bounds : tuple of float
        What no plan stays below, goals before it being at their values, computed again from the
        data; minus infinity where nothing is proven.
    gap : float
        What is left between them, over the size of the values: of the costs that a choice of
        candidates meets, their sum or the largest. It has no unit; infinite where nothing is
        proven. Margins of stability leave what `seqopt.problem.standing.NARROW` says.
    claimed_gap : float
        The same with the formulation's own bound if that is higher; it is not proven.
    spent : mapping of str to float
        The amount that the plan uses of each budget.
    states : int
        How many states the proof looked at, where it is about states.

    Examples
    --------
    >>> import seqopt
    >>> proof = seqopt.optimize("arch25", criterion="worst-ratio-published").certificate
    >>> round(proof.objective, 3), round(proof.bound, 3), proof.gap
    (57.941, 57.941, 0.0)
    """

    values: tuple[float, ...]
    bounds: tuple[float, ...]
    gap: float
    claimed_gap: float
    spent: Mapping[str, float] = field(default_factory=dict)
    states: int = 0

    def __repr__(self) -> str:
        values = f"objective {self.objective:.6g}, no choice below {self.bound:.6g}"
        return f"<Certificate: {values}, gap {100 * _known_gap(self.gap):.3g} %>"

    @property
    def objective(self) -> float:
        """The value of the first goal."""
        return self.values[0]

    @property
    def bound(self) -> float:
        """What no plan stays below in the first goal."""
        return self.bounds[0]


def certify(problem: PlacementProblem, selection: Selection, aim: Aim) -> Certificate:
    """Check a selection from the problem's data, without the solver.

    ``problem``: what was solved; ``selection``: what a formulation claims; ``aim``: whether the sum
    or the peak of the costs was minimized. Raises `SolverError` if the choice is not one candidate
    per move, is not allowed, exceeds a budget, or is not worth what was claimed.
    """
    costs = aim.costs(problem)
    value = _value(costs, selection.choice, aim)
    sizes = [abs(part) for part in costs.parts(selection.choice)]
    scale = max(sum(sizes) if aim is Aim.SUM else max(sizes), TINY)
    _require_claimed(value, selection, scale)
    spent = {budget.name: budget.spent(selection.choice) for budget in problem.budgets}
    for budget in problem.budgets:
        if budget.slack(selection.choice) < -TOLERANCE:
            raise SolverError(
                f"the choice takes {spent[budget.name]:.6g} of {budget.name}, more than "
                f"{budget.bound:.6g}; use a formulation that keeps budgets exactly "
                f"(the claimed bound is {selection.bound:.9g})"
            )
    bound = least(costs, aim)
    if value < bound - TOLERANCE * scale:
        raise SolverError(
            f"the least value computed again, {bound:.9g}, lies above that of the choice, "
            f"{value:.9g}: the costs changed while they were judged"
        )
    highest = value if problem.budgets else bound
    if not selection.bound <= highest + TOLERANCE * scale:  # NaN is no bound
        raise SolverError(f"the claimed bound {selection.bound:.9g} exceeds {highest:.9g}")
    if problem.budgets and aim is Aim.SUM:
        from seqopt.judge._budget_proof import least_within  # noqa: PLC0415  # few have any

        bound = max(bound, least_within(problem, value, selection.prices, scale))
    gap, claimed = (max(0.0, value - b) / scale for b in (bound, max(bound, selection.bound)))
    return Certificate((value,), (bound,), gap, claimed, spent)


def certify_partial(costs: PartialCosts, selection: Selection, objective: float) -> Certificate:
    """Check a selection of which not all pairs are known, from those that are.

    ``costs``: what was looked at; ``selection``: what is claimed; ``objective``: the costs of the
    steps that the selection meets, solved again. Raises `SolverError` if the selection is not worth
    what was claimed, or its bound is not that of the pairs.
    """
    from seqopt.graph.layers._partial_costs import least_possible  # noqa: PLC0415  # few are lazy

    scale = max(abs(objective), TINY)
    _require_claimed(objective, selection, scale)
    bound = least_possible(costs)
    if not selection.bound <= bound + TOLERANCE * scale:
        raise SolverError(f"the claimed bound {selection.bound:.9g} exceeds {bound:.9g}")
    bound = min(bound, objective)
    gap = (objective - bound) / scale
    if selection.end is End.DONE and gap > TOLERANCE:
        raise SolverError(
            f"the value of the choice is {objective:.9g}, and no more than {bound:.9g} is proven"
        )
    return Certificate((objective,), (bound,), gap, gap)


def _require_claimed(value: float, selection: Selection, scale: float) -> None:
    """Raise a `SolverError` unless a value is what is claimed; NaN never is."""
    if not abs(value - selection.objective) <= TOLERANCE * scale:
        raise SolverError(f"the objective is {value:.9g}, not {selection.objective:.9g} as claimed")


def _value(costs: LayeredCosts, choice: tuple[int, ...], aim: Aim) -> float:
    """Return the value of a choice, or raise a `SolverError` if it is not a valid choice."""
    sizes = costs.sizes
    if len(choice) != len(sizes):
        raise SolverError(f"the answer names {len(choice)} candidates for {len(sizes)} moves")
    for k, (index, size) in enumerate(zip(choice, sizes, strict=True), start=1):
        if not 0 <= index < size:
            raise SolverError(f"the answer names candidate {index} of {size} for move {k}")
    value = aim.value_of(costs, choice)
    if not np.isfinite(value):
        raise SolverError("the choice is not allowed by the problem; the solver's answer is wrong")
    return value


def least(costs: LayeredCosts, aim: Aim) -> float:
    """Return the least value of any choice, budgets aside; infinite if none is allowed."""
    return least_sum(costs) if aim is Aim.SUM else least_peak(costs)


def least_sum(costs: LayeredCosts) -> float:
    """Return the least sum of any choice, forward, budgets aside; infinite if none is allowed."""
    reached = np.zeros(1)
    for single, shared in zip(costs.single, costs.shared, strict=True):
        reached = (reached[:, None] + shared).min(axis=0) + single
    return float(reached.min())


def least_peak(costs: LayeredCosts) -> float:
    """Return the least worst cost of any choice, by bisection over all costs that occur.

    A value is reached if the choices whose costs do not exceed it connect the first move to the
    last.

    Result: infinite if no choice is allowed.
    """
    levels = np.unique(np.concatenate([a.ravel() for a in (*costs.single, *costs.shared)]))
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        if _connected(costs, float(levels[middle])):
            high = middle
        else:
            low = middle + 1
    return float(levels[low])


def _connected(costs: LayeredCosts, level: float) -> bool:
    reached = np.ones(1, dtype=bool)
    for single, shared in zip(costs.single, costs.shared, strict=True):
        reached = (single <= level) & ((shared <= level) & reached[:, None]).any(axis=0)
    return bool(reached.any())


def judge(
    problem: PlacementProblem, selection: Selection, formulation: Formulation | str
) -> Certificate:
    """Certify a selection, and check what its formulation promises.

    ``problem``: what was solved; ``selection``: what the formulation claims; ``formulation``: what
    made the selection. Raises `SolverError` if the certificate fails, or without budgets a
    formulation that is no heuristic and ran to its end misses the optimum.
    """
    formulation = as_formulation(formulation)
    if formulation.aim is None:
        assert isinstance(problem, ScenarioLayers)  # others have no totals in scenarios
        return _certify_scenarios(problem, selection)
    certificate = certify(problem, selection, formulation.aim)
    promises = formulation.kind is not FormulationKind.HEURISTIC and selection.end is End.DONE
    if promises and not problem.budgets and certificate.gap > TOLERANCE:
        raise SolverError(
            f"{formulation.name} promises the optimum {certificate.bound:.9g}, "
            f"but the value of its choice is {certificate.objective:.9g}"
        )
    return certificate


def _certify_scenarios(problem: ScenarioLayers, selection: Selection) -> Certificate:
    """Check a choice by its totals in every scenario, and the bound that its weights prove.

    ``selection``: its prices are the weights of scenarios. Raises `SolverError` if the choice is
    not worth what is claimed, weights do not fit the aim, or a bound is above the value.
    """
    layers = problem.layered(Aim.SUM)
    weights = [selection.prices.get(str(i), 0.0) for i in range(1, len(layers) + 1)]
    proven = _proven(problem, layers, weights)
    value = problem.aim.value(problem.values(selection.choice, Aim.SUM))
    scale = max(abs(value), abs(selection.objective), TINY)
    _require_claimed(value, selection, scale)
    claimed = max(proven, selection.bound)
    if claimed > value + TOLERANCE * scale:
        raise SolverError(f"the bound is {claimed:.9g}, above the objective {value:.9g}")
    gaps = [max(0.0, value - bound) / scale for bound in (proven, claimed)]
    return Certificate((value,), (min(proven, value),), gaps[0], gaps[1])


def _proven(
    problem: ScenarioLayers, layers: tuple[LayeredCosts, ...], weights: Sequence[float]
) -> float:
    """Return the bound that weights prove, by a judge that shares nothing with the search."""
    used = [weight for weight in weights if weight > 0]
    most = problem.aim.most(len(layers)) * (1 + 1e-9)
    if abs(sum(used) - 1.0) > 1e-9 or max(used) > most:
        raise SolverError("the weights of scenarios do not fit the aim; the bound is none")

    def weighed(*costs: Floats) -> Floats:  # infinite also where a scenario without weight is
        parts = [weight * each for weight, each in zip(weights, costs, strict=True) if weight > 0]
        return np.where(np.isfinite(costs).all(axis=0), sum(parts), np.inf)

    return least_sum(_array_by_array(weighed, *layers))
