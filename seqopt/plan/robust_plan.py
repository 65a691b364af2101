"""Solve a problem over scenarios; the answer is checked and becomes a plan."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.errors import SolverError
from seqopt.graph.layers.costs import TINY, LayeredCosts
from seqopt.graph.layers.interface import Aim, CostProblem
from seqopt.graph.scenarios.aims import RobustAim
from seqopt.graph.scenarios.arcs import Choice, scenario_arcs
from seqopt.graph.scenarios.scenarios import ScenarioLayers, largest_of
from seqopt.plan.build import ShownBuild
from seqopt.plan.calling.formulation import Formulation, Selection, find_formulation
from seqopt.plan.calling.selecting import select
from seqopt.plan.calling.watch import Finding, Watch
from seqopt.plan.judge.anew import require_anew
from seqopt.plan.judge.certificate import TOLERANCE, least_peak, least_sum
from seqopt.plan.search.scenario_search import WIDTH, Searched, close_gap
from seqopt.plan.search.scenario_weights import best_weights
from seqopt.plan.tables import moves_table
from seqopt.responses.table import analyze
from seqopt.sequence.steps import Step

CHOOSES = {Aim.PEAK: "minimax", Aim.SUM: "overlap_dp"}  # of one scenario, and of worst peaks


@dataclass(frozen=True, eq=False, repr=False)
class RobustPlan(ShownBuild):
    """A plan for many scenarios, and its value over them.

    ``problem``: what was solved; ``choice``: a candidate for every move; ``steps``: the schedule
    with every move at its chosen node, checked; ``objective``: the value of the aim over the
    scenarios, computed again from their costs; ``bound``: on the objective of any choice;
    ``proven``: the part of the bound that weights of scenarios prove by one dynamic program,
    computed again; of peaks it is the whole bound. The rest was closed by search. ``weights`` (S,):
    of the scenarios, as they prove it; of peaks the scenario where the plan is worst; ``seconds``:
    by stage, s: respond, solve, verify.
    """

    problem: ScenarioLayers
    choice: Choice
    steps: tuple[Step, ...]
    objective: float
    bound: float
    proven: float
    weights: Floats
    seconds: Mapping[str, float] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"RobustPlan({self.problem.aim}, {len(self.weights)} scenarios: {self.worth})"

    @property
    def engine(self) -> Engine:
        """What computes the responses of the nominal scene."""
        return self.problem.nominal.engine

    @property
    def title(self) -> str:
        """The aim over scenarios."""
        return str(self.problem.aim)

    @property
    def worth(self) -> str:
        """The value of the plan, and what is proven about it, in words."""
        return f"objective {self.objective:.6g}, gap {100 * self.gap:.3g} %"

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step in the nominal scene.

        Result: as of `seqopt.analyze`.
        """
        return analyze(self.engine, self.steps)

    @property
    def nodes(self) -> tuple[int, ...]:
        """The node chosen for every move."""
        return self.problem.nominal.nodes(self.choice)

    @property
    def gap(self) -> float:
        """What the bound leaves open, over the size of the objective."""
        left = max(self.objective - self.bound, 0.0)
        return left / max(abs(self.objective), abs(self.bound), TINY)

    @property
    def status(self) -> str:
        """Whether it is ``optimal`` over these scenarios, or ``feasible``."""
        return "optimal" if self.gap <= TOLERANCE else "feasible"

    def table(self) -> pd.DataFrame:
        """Return what was chosen for every move.

        Result: as of `seqopt.plan.tables.moves_table`; forces are those of the nominal
        scene.
        """
        return moves_table(self.problem.nominal, self.choice, self.grips())


def solve_robust(
    problem: ScenarioLayers,
    *,
    time_limit: float = math.inf,
    progress: Callable[[Finding], object] | None = None,
    width: int = WIDTH,
) -> RobustPlan:
    """Return the plan that is best over all scenarios, checked from their costs.

    Peaks are solved exactly by one dynamic program. Totals are bounded by weights of the scenarios,
    found by cuts, and the gap that is left is closed by search as far as ``width`` allows.

    Parameters
    ----------
    problem : ScenarioLayers
        Of `seqopt.graph.scenarios.scenarios.robust`.
    time_limit : float, optional
        After which it stops choosing, with the best choice so far and a bound, s.
    progress : callable, optional
        Told every better choice and bound as it is found.
    width : int, optional
        How many beginnings of choices are kept after every move.

    Returns
    -------
    RobustPlan

    Raises
    ------
    InfeasibleError, SolverError
        If no choice is allowed in all scenarios; an answer is not what it is claimed to be.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> problem = seqopt.optimize(scene, criterion="worst-ratio-published").problem
    >>> robust = seqopt.robust(problem, seqopt.scenarios(scene, count=3, seed=1), "worst-peak")
    >>> seqopt.solve_robust(robust)
    RobustPlan(worst-peak, 3 scenarios: objective 1.29296, gap 0 %)
    """
    layers = problem.layered(problem.aim.aim)
    minimax = find_formulation(CHOOSES[Aim.PEAK])  # loaded before the time is taken
    watch = Watch(time_limit, progress)
    joined = largest_of(layers)  # says if no choice is allowed in all scenarios
    if problem.aim.aim is Aim.PEAK:
        found, weights = _least_peak(minimax, joined, layers)
    else:
        found, weights = _least_total(layers, problem.aim, watch, width)
    return _judged(problem, found, weights, watch.seconds)


def _judged(problem: ScenarioLayers, found: Searched, weights: Floats, taken: float) -> RobustPlan:
    """Return the plan of a choice, checked; the time it took to find is given, s."""
    start, layers = time.perf_counter(), problem.layered(problem.aim.aim)
    proven = _proven(largest_of(layers), layers, problem.aim, weights)
    objective = _checked(problem, layers, found, proven)
    bound = min(max(found.bound, proven), objective)
    steps = problem.steps(found.choice)
    for scenario in problem.from_cache:
        require_anew(scenario, found.choice)
    seconds = {**problem.seconds, "solve": taken, "verify": time.perf_counter() - start}
    return RobustPlan(
        problem, found.choice, steps, objective, bound, min(proven, bound), weights, seconds
    )


def _least_peak(
    minimax: Formulation, joined: LayeredCosts, layers: tuple[LayeredCosts, ...]
) -> tuple[Searched, Floats]:
    """Return the choice whose worst peak is least; both maxima are one."""
    chosen = select(minimax, CostProblem(joined))
    weights = np.zeros(len(layers))
    weights[_worst_scenario(joined, layers, chosen.choice)] = 1.0
    return Searched(chosen.choice, chosen.objective, chosen.bound), weights


def _worst_scenario(joined: LayeredCosts, layers: tuple[LayeredCosts, ...], choice: Choice) -> int:
    """Return the first scenario in which a choice meets the largest cost that it meets in any."""
    move, is_shared = divmod(int(np.argmax(joined.parts(choice))), 2)
    now, before = choice[move], choice[move - 1] if move else 0
    if is_shared:
        return int(np.argmax([each.shared[move][before, now] for each in layers]))
    return int(np.argmax([each.single[move][now] for each in layers]))


def _least_total(
    layers: tuple[LayeredCosts, ...], aim: RobustAim, watch: Watch, width: int
) -> tuple[Searched, Floats]:
    """Return the best choice found."""
    arcs = scenario_arcs(layers, aim)
    weighed = best_weights(arcs, watch)
    return close_gap(arcs, weighed, watch, width), weighed.weights


def best_choice(costs: LayeredCosts, aim: Aim) -> Selection:
    """Return the best choice of one scenario, not checked."""
    return select(find_formulation(CHOOSES[aim]), CostProblem(costs))


def _proven(
    joined: LayeredCosts, layers: tuple[LayeredCosts, ...], aim: RobustAim, weights: Floats
) -> float:
    """Return the bound that weights prove, by a judge that shares nothing with the search."""
    if aim.aim is Aim.PEAK:
        return least_peak(joined)
    used = [(w, each) for w, each in zip(weights, layers, strict=True) if w > 0]
    apart = abs(sum(w for w, _ in used) - 1.0)
    if apart > 1e-9 or max(w for w, _ in used) > aim.most(len(layers)) * (1 + 1e-9):
        raise SolverError("the weights of scenarios do not fit the aim; the bound is none")
    moves = range(len(joined.single))
    shut = [(np.isinf(joined.single[k]), np.isinf(joined.shared[k])) for k in moves]
    single, shared = [], []
    for k in moves:
        open_single = sum(w * np.where(shut[k][0], 0.0, each.single[k]) for w, each in used)
        open_shared = sum(w * np.where(shut[k][1], 0.0, each.shared[k]) for w, each in used)
        single.append(np.where(shut[k][0], np.inf, open_single))
        shared.append(np.where(shut[k][1], np.inf, open_shared))
    return least_sum(LayeredCosts(tuple(single), tuple(shared)))


def _checked(
    problem: ScenarioLayers, layers: tuple[LayeredCosts, ...], found: Searched, proven: float
) -> float:
    """Return the value of a choice from the scenarios' costs, if it is as claimed."""
    worth = problem.aim.aim.worth
    value = problem.aim.value(np.array([worth(each, found.choice) for each in layers]))
    size = max(abs(value), abs(found.value), TINY)
    if not abs(value - found.value) <= TOLERANCE * size:
        raise SolverError(f"the objective is {value:.9g}, not {found.value:.9g} as claimed")
    if max(proven, found.bound) > value + TOLERANCE * size:
        raise SolverError(
            f"the bound is {max(proven, found.bound):.9g}, above the objective {value:.9g}"
        )
    return value
