"""The problem of support placement over a whole build, as one frozen value."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import chain, pairwise

import numpy as np

from seqopt._showing import Shown
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Engine
from seqopt.engines.registry import Recipe, engine_for, recipe_for
from seqopt.errors import InfeasibleError, MechanismError, ProblemError, SolverError, did_you_mean
from seqopt.graph.formulation import Solution
from seqopt.graph.layers.costs import Budget, Joined, LayeredCosts, ScenarioCosts, largest_of
from seqopt.graph.source import CANDIDATES, Source
from seqopt.problem.criteria import Ranked, RankSum, _counts_every_step
from seqopt.problem.problem import WORST_PEAK, Aim, RobustAim
from seqopt.problem.requirements import (
    Criterion,
    Excess,
    Limit,
    ResponsesAsked,
    SceneFacts,
    _carrying_excesses,
    _excesses,
    _response_along,
    _step_limits,
    pickled,
    robots_of,
)
from seqopt.responses._choices import CHOICE_RESPONSES, Evaluation, StepChoices
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import PROP_EXCESS, _payload_text, robot_response
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.scenarios import require_alike
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.site import _begin_step
from seqopt.sequence.steps import Step
from seqopt.work._workers import hire, map_ordered
from seqopt.work.progress import Progress


def windows(
    schedule: Schedule,
    asked: Sequence[tuple[int, int]],
    wanted: Sequence[Ints] | None = None,
    *,
    alone: bool = False,
) -> Schedule:
    """Return the steps that moves share with the ones before, as a schedule with a move for each.

    ``asked`` (sequence of (int, int)): a move, and the candidate of the move before it; ``wanted``
    (sequence of (c,) int): the candidates of the move that are looked at, by default all;
    ``alone``: whether the steps in which the move alone is open belong to it too.
    """
    moves, steps = [], []
    for n, (k, before) in enumerate(asked):
        move = schedule.moves[k]
        some = range(len(move.candidates)) if wanted is None else wanted[n]
        moves.append(replace(move, candidates=tuple(move.candidates[i] for i in some)))
        takes: dict[object, int | OpenGrip] = {OpenGrip(k): OpenGrip(n)}
        if k:
            takes[OpenGrip(k - 1)] = schedule.moves[k - 1].candidates[before]
        own = [*schedule.steps_of.get((k - 1, k), ())]
        own += schedule.steps_of.get((k,), ()) if alone else ()
        for step in sorted(own, key=lambda step: step.number):
            grips = tuple(takes.get(grip, grip) for grip in step.grips)
            steps.append(replace(step, grips=grips))
    return replace(schedule, steps=tuple(steps), moves=tuple(moves))


@dataclass(frozen=True, repr=False)
class Layers(Source, Shown):
    """Support placement over a whole build; responses, sums and peaks are computed on first use.

    ``criterion``: what a step costs; ``limits``: bounds that no step may exceed, whether or not a
    grip is open in it; ``evaluation``: raw responses of every open step; ``budgets``: caps on
    totals over the build, without scenarios; ``scenes``: scenarios, in all of which limits hold;
    the criterion has the numbers of the nominal scene in them; ``over``: what counts of the values
    in all of them; ``known``: costs in scenarios, where they were computed before.
    """

    kind = CANDIDATES

    criterion: Criterion
    limits: tuple[Limit, ...]
    evaluation: Evaluation
    budgets: tuple[Budget, ...] = ()
    scenes: tuple[Scene, ...] = ()
    over: RobustAim = WORST_PEAK
    known: tuple[ScenarioCosts, ...] = field(default=(), compare=False)

    def __repr__(self) -> str:
        schedule = self.schedule
        counts = f"{len(schedule.steps)} steps, {len(schedule.moves)} moves"
        extras = f"{len(self.limits)} limits, {len(self.budgets)} budgets"
        what = f"{schedule.scene.name!r}, {schedule.method!r}: {counts}"
        if self.scenes:
            extras = f"{len(self.scenes)} scenarios, {self.over}"
        return f"Layers({what}, criterion {self.criterion.name!r}, {extras})"

    @property
    def engine(self) -> Engine:
        """What computes the responses."""
        return self.evaluation.engine

    @property
    def schedule(self) -> Schedule:
        """The steps and moves."""
        return self.evaluation.schedule

    @property
    def method(self) -> str:
        """The name of the schedule."""
        return self.schedule.method

    @property
    def among(self) -> str:
        """The candidates that are kept, in words; empty for all."""
        return self.schedule.left_out

    @property
    def title(self) -> str:
        """What counts over scenarios; empty without."""
        return str(self.over) if self.scenes else ""

    @cached_property
    def alone_in_scene(self) -> Layers:
        """The same problem in the nominal scene."""
        return replace(self, scenes=(), known=()) if self.scenes else self

    @cached_property
    def scenarios(self) -> tuple[Engine, ...]:
        """What computes the responses of every scenario."""
        return tuple(engine_for(self.engine, scene) for scene in self.scenes)

    @property
    def questions(self) -> tuple[str, ...]:
        """What a formulation must answer to choose from it."""
        totals = bool(self.scenes) and self.over.aim is Aim.SUM
        return ("tail" if totals else "goals", "instance")

    @property
    def default_formulation(self) -> str:
        """The name of the formulation that chooses from it if none is named."""
        if self.scenes:
            return "scenario_search" if "tail" in self.questions else "minimax"
        return "labels" if self.budgets else "overlap_dp"

    @property
    def as_layers(self) -> Layers:
        """The same problem in the nominal scene."""
        return self.alone_in_scene

    def chosen_candidates(self, states: Sequence[Sequence[int]]) -> tuple[int, ...]:
        """Return the candidate chosen for every move."""
        pairs = zip(self.candidates, self.chosen_nodes(states), strict=True)
        return tuple(candidates.index(node) for candidates, node in pairs)

    def said(self, objective: Mapping[str, float], gap: float | None, status: str) -> str:
        """Return objective and gap, or status, of a plan in words."""
        if gap is None:
            values = ", ".join(f"{name} {value:.6g}" for name, value in objective.items())
            return f"{values} (claimed), {status}" if values else "not compared with the optimum"
        proven = f"heuristic: {self.among}" if self.among else f"gap {100 * gap:.3g} %"
        (value,) = objective.values()
        return f"objective {value:.6g}, {proven}"

    def described(self, aim: Aim | None, limits: Mapping[str, object]) -> dict[str, object]:
        """Return the settings of the problem for a summary; ``limits``: bounds by name."""
        return {
            "aims": [*self.names_of(aim)],
            "criterion": self.criterion.name,
            **self.criterion.settings,
            "scenarios": len(self.scenes),
            "limits": limits,
            "rules": {},
            "stands": None,
        }

    def spent(
        self, objective: Mapping[str, float], found: Solution
    ) -> dict[str, dict[str, float | None]]:
        """Return cap, use and multiplier of every budget."""
        known = [budget.name for budget in self.budgets if math.isfinite(budget.bound)]
        prices = dict(zip(known, found.prices[0] if found.prices else (), strict=False))
        return {
            budget.name: {
                "bound": budget.bound if math.isfinite(budget.bound) else None,
                "spent": budget.spent(self.chosen_candidates(found.states)),
                "price": prices.get(budget.name),
            }
            for budget in self.budgets
        }

    def step_columns(self, steps: Sequence[Step]) -> dict[str, list[object]]:
        """Return the robots that were chosen for, by step."""
        moves = self.schedule.moves
        robots = {s.number: ";".join(moves[m].robot for m in s.moves) for s in self.schedule.steps}
        return {"optimized_robot": [robots.get(step.number, math.nan) for step in steps]}

    @property
    def models(self) -> int:
        """How many different models were solved, in all scenarios."""
        if self.scenes:
            return sum(costs.models for costs in self.costs_in_scenarios)
        return self.evaluation.models

    def names_of(self, aim: Aim | None) -> tuple[str, ...]:
        """Return what the goal of an aim is called."""
        return (self.title or ("minmax" if aim is Aim.PEAK else "sum"),)

    @property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build is minimized."""
        if self.scenes:
            raise ProblemError(
                f"{self.over}: totals over scenarios are no sum of one cost; take scenario_search, "
                "or minimax with worst-peak"
            )
        return self._sums[0]

    @cached_property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is minimized, of scenarios the largest in any."""
        if self.scenes:
            return largest_of(self.layered(Aim.PEAK))
        return self._peaks[0]

    def layered(self, aim: Aim) -> tuple[LayeredCosts, ...]:
        """Return the costs whose sums or peaks an aim is about, scenario by scenario."""
        return tuple(map(aim.costs, self.costs_in_scenarios))

    @property
    def costs_in_scenarios(self) -> tuple[ScenarioCosts, ...]:
        """What choices cost, scenario by scenario.

        Raises `InfeasibleError` if a step without an open grip exceeds a limit in a scenario;
        `MechanismError`, `SolverError`, `WorkerError` as engines and workers do.
        """
        return self.known or self._in_scenarios[0]

    @cached_property
    def _in_scenarios(self) -> tuple[tuple[ScenarioCosts, ...], float]:
        """The costs in every scenario, and what they took from the first to the last, s."""
        start, resources = time.perf_counter(), self.evaluation.resources
        asked, recipes = self._in_all, [recipe_for(self.engine, scene) for scene in self.scenes]
        progress = Progress("scenarios", len(recipes), resources.progress)
        with hire(resources.executor, resources.workers) as crew:
            if crew is not None:
                pickled((asked, recipes[0]), self.criterion)  # says if tasks cannot be sent
            tasks, each = enumerate(recipes, start=1), partial(_costs_in, asked)
            done = map_ordered(each, tasks, crew, done=lambda *_: progress.add(1))
            with closing(done) as found:
                return tuple(found), time.perf_counter() - start

    @property
    def from_cache(self) -> Iterator[Layers]:
        """The problems whose responses may come from files, one for every scenario."""
        if self.evaluation.resources.cache is None:
            return
        for scene in self.scenes:
            yield _in_scenario(self._in_all, recipe_for(self.engine, scene))
        if not self.scenes:
            yield self

    @property
    def _in_all(self) -> _Asked:
        """Responses needed in all scenarios; the criterion has the nominal scene's numbers."""
        evaluation = self.evaluation
        also = getattr(evaluation.wanted, "also", ())
        wanted = ResponsesAsked(self.criterion, self.limits, also)
        return evaluation.schedule, wanted, evaluation.resources.alone()

    @cached_property
    def _sums(self) -> tuple[LayeredCosts, float]:
        return self._joined(np.add)

    @cached_property
    def _peaks(self) -> tuple[LayeredCosts, float]:
        return self._joined(np.maximum)

    def _joined(self, join: np.ufunc) -> tuple[LayeredCosts, float]:
        """Return the costs of all choices, steps of the same moves joined, and the seconds.

        What steps without an open grip cost is joined to those of the first move.
        """
        joined = Joined([len(move.candidates) for move in self.schedule.moves], join)
        for cost in self.given_costs:
            joined.add_anyway(float(cost))
        seconds = 0.0
        for steps in self.evaluation.levels():
            start = time.perf_counter()
            for choices in steps:
                joined.add(choices.moves, self.step_costs(choices))
            seconds += time.perf_counter() - start
        return joined.layered(), seconds

    @property
    def given(self) -> tuple[Step, ...]:
        """The steps without an open grip, in which bricks stand."""
        return self.evaluation.given

    def given_values(self, response: str) -> Floats:
        """Return a response of every given step (n,), SI units; NaN where a robot does not grip."""
        table = self.evaluation.table_of_given([response])
        return _response_along(self.schedule.scene, table, response)

    @cached_property
    def given_costs(self) -> Floats:
        """What every given step costs (n,); none where the criterion is not defined in them.

        An `InfeasibleError` names one that the criterion does not allow.
        """
        if not (self.given and _counts_every_step(self.criterion)):
            return np.zeros(0)
        found = {name: self.given_values(name) for name in self.criterion.wanted(1)}
        costs = np.zeros(len(self.given))
        for k, step in enumerate(self.given):
            row = {name: values[k : k + 1] for name, values in found.items()}
            costs[k] = self.criterion.costs(row, step.bricks, 1)[0]
            if not np.isfinite(costs[k]):
                raise InfeasibleError(
                    f"criterion {self.criterion.name}: step {step.number}, where no grip is left "
                    "to choose, is not allowed; change the criterion or the schedule"
                )
        return costs

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return how long responses (``respond``) and costs (``rank``) of an aim took, s.

        Of scenarios responses and costs of both aims are one.
        """
        if self.scenes:
            return {"respond": 0.0 if self.known else self._in_scenarios[1]}
        ranked = self._sums[1] if aim is Aim.SUM else self._peaks[1]
        return {"respond": self.evaluation.seconds, "rank": ranked}

    def window_choices(
        self, move: int, before: int, *, alone: bool = True
    ) -> tuple[StepChoices, ...]:
        """Return the steps that a move decides, for its candidates alone.

        ``move``, ``before``: a move, and the candidate chosen for the move before it; ``alone``:
        whether those in which it alone is open are among them. Result: in order, with responses
        (C_k,); those of steps shared with the move before are of that choice. Solved alone where
        the responses of all choices are not known.
        """
        if not self.evaluation.is_kept:
            own = windows(self.schedule, [(move, before)], alone=alone)
            quiet = self.evaluation.resources.alone()
            solved = replace(self.evaluation, schedule=own, resources=quiet).steps
            moves = {step.number: step.moves for step in self.schedule.steps}
            return tuple(replace(each, moves=moves[each.step.number]) for each in solved)
        found = []
        for choices in self._decided.get(move, ()):  # of two open moves the row of the first
            row = before if len(choices.moves) == 2 else slice(None)
            responses = {name: values[row] for name, values in choices.responses.items()}
            found.append(replace(choices, responses=responses))
        return tuple(found)

    def possible_after(self, move: int, before: int) -> Floats:
        """Return zero (C_k,) for candidates that are other nodes than the one before, or infinity.

        Responses do not tell where all candidates are impossible: then nothing is known of any.
        """
        candidates = np.array(self.candidates[move])
        if (move - 1, move) not in self.schedule.steps_of:
            return np.zeros(len(candidates))
        return np.where(candidates == self.candidates[move - 1][before], np.inf, 0.0)

    @cached_property
    def _decided(self) -> Mapping[int, Sequence[StepChoices]]:
        """The steps that each move decides: those in which it is the last that is open."""
        found = defaultdict[int, list[StepChoices]](list)
        for choices in self.evaluation.steps:
            found[choices.moves[-1]].append(choices)
        return found

    @property
    def alone(self) -> LayeredCosts:
        """The costs that a search of one move alone is charged: ranks among its candidates."""
        return self.sums if self.scenes else self.ranked(Ranked.CONDITIONAL).sums

    def ranked(self, ranked: Ranked) -> Layers:
        """Return the same problem with its ranks taken in a way; itself if it has none."""
        return self if getattr(self.criterion, "ranked", ranked) is ranked else self._ranked_else

    @cached_property
    def _ranked_else(self) -> Layers:
        criterion = self.criterion
        assert isinstance(criterion, RankSum)
        (other,) = {*Ranked} - {criterion.ranked}
        return replace(self, criterion=replace(criterion, ranked=other))

    def step_costs(self, choices: StepChoices) -> Floats:
        """Return the costs of a step's choices, (C,) or (C, D), infinite where not allowed."""
        move, criterion = self.schedule.moves[choices.moves[-1]], self.criterion
        bricks = move.bricks  # of ranks, which are those of the move
        if _counts_every_step(criterion) and {*criterion.wanted(1)} <= {*choices.responses}:
            bricks = choices.step.bricks
        costs = criterion.costs(choices.responses, bricks, len(move.candidates))
        known = [~np.isnan(values) for values in choices.responses.values()]
        able = np.any(known, axis=0) if known else True  # all are NaN where arms cannot be
        costs = np.where(np.isfinite(costs) & able, costs, np.inf)
        for limit in self.limits:
            costs[limit.exceeded(choices.responses[limit.response])] = np.inf
        return costs

    def require_possible(self) -> None:
        """Raise an error if no choice can keep a limit: of a grip that is given, or of a carrier.

        Raises `InfeasibleError`, naming the limit, the value and the steps; of scenarios, given
        grips are looked at when costs are computed.
        """
        _require_carried(self.schedule, [self.engine.network.scene, *self.scenes])
        if self.scenes or not (self.limits and self.given):
            return
        table = self.evaluation.table_of_given(limit.response for limit in self.limits)
        for excess in _excesses(self.schedule.scene, table, self.limits):
            raise InfeasibleError(
                f"{excess}, where no grip is left to choose; relax the limit or change the schedule"
            )

    @property
    def candidates(self) -> tuple[tuple[int, ...], ...]:
        """The nodes that can be chosen, move by move."""
        return tuple(move.candidates for move in self.schedule.moves)

    def rows(self, choice: Sequence[int]) -> tuple[tuple[int, ...], ...]:
        """Return a choice, a candidate for every move, as states: the move, and its node."""
        return tuple(enumerate(self.nodes(choice), start=1))

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that a choice, a candidate for every move, stands for."""
        return tuple(m.candidates[c] for m, c in zip(self.schedule.moves, choice, strict=True))

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps of a choice; a `StepError` says which one is impossible."""
        return self.schedule.fill(self.nodes(choice))


_Asked = tuple[Schedule, ResponsesAsked, Resources]  # the same in every scenario


def _in_scenario(asked: _Asked, recipe: Recipe) -> Layers:
    """Return the problem of one scenario, by the recipe of its engine."""
    schedule, wanted, resources = asked
    evaluation = Evaluation(recipe.make(), schedule, wanted, resources)
    return Layers(wanted.criterion, wanted.limits, evaluation)


def _costs_in(asked: _Asked, numbered: tuple[int, Recipe]) -> ScenarioCosts:
    """Return what choices cost in one scenario, which is named where that fails."""
    number, problem = numbered[0], _in_scenario(asked, numbered[1])
    evaluation = problem.evaluation
    try:
        problem.require_possible()
        return ScenarioCosts(problem.sums, problem.peaks, evaluation.models, evaluation.seconds)
    except MechanismError as error:
        raise MechanismError(f"scenario {number}: {error}", error.mode) from error
    except SolverError as error:
        raise SolverError(f"scenario {number}: {error}") from error


def in_scenarios(nominal: Layers, scenes: Sequence[Scene], over: RobustAim) -> Layers:
    """Return a problem over scenarios; nothing is computed yet.

    ``nominal``: with an engine of `seqopt.make_engine`; ``scenes``: with the same bricks and nodes.
    Raises `ProblemError` if there is no scenario, or one has other bricks or nodes.
    """
    if not scenes:
        raise ProblemError("there is no scenario; give at least one")
    for i, scene in enumerate(scenes, start=1):
        require_alike(nominal.schedule.scene, scene, i)
    recipe_for(nominal.engine, scenes[0])  # says if engines for other scenes cannot be made
    return replace(nominal, scenes=tuple(scenes), over=over)


def _require_carried(schedule: Schedule, scenes: Sequence[Scene]) -> None:
    """Raise an `InfeasibleError` if a robot has to carry a brick in a scene that is too heavy."""
    steps = (_begin_step(schedule.scene, schedule.begin), *schedule.steps)
    found = [each for scene in scenes for each in _carrying_excesses(scene, steps)]
    if found:
        worst: dict[str, Excess] = {}
        for each in sorted(found, key=lambda each: each.largest):
            worst[each.robot] = each
        enough = (f"--payload {n}={_payload_text(each.largest)}" for n, each in worst.items())
        said = "; ".join(map(str, worst.values()))
        raise InfeasibleError(f"{schedule.method} schedule: {said}; it takes {' '.join(enough)}")


def candidate_layers(
    engine: Engine,
    schedule: Schedule,
    criterion: Criterion,
    limits: Sequence[Limit] = (),
    also: Sequence[str] = (),
    resources: Resources = HERE,
) -> Layers:
    """Return the problem of choosing the open grips of a schedule; nothing is computed yet.

    ``limits``: bounds of all steps, whether or not a grip is open in them. ``also``: responses to
    compute besides those that criterion and limits use. Raises `ProblemError` if there is no such
    response, or no grip is open.
    """
    known = {
        *CHOICE_RESPONSES,
        PROP_EXCESS,
        *map(robot_response, robots_of(engine, schedule, criterion)),
    }
    own = _step_limits(limits, engine.network.scene)
    asked = ResponsesAsked(criterion.for_scene(SceneFacts(engine)), own, tuple(also))
    names = {name for move in schedule.moves for name in asked(move.bricks)}
    if unknown := {name for name in names if not is_tolerance(name)} - known:
        why = f"does not exist{did_you_mean(min(unknown), known)}"
        raise ProblemError(f"response {min(unknown)} {why}; give {', '.join(sorted(known))}")
    schedule.require_pairs()
    return Layers(asked.criterion, asked.limits, Evaluation(engine, schedule, asked, resources))


def steps_over(problem: Layers, response: str, level: float, bound: float) -> Budget:
    """Return a bound on the number of steps in which a response exceeds a level.

    ``problem``: whose choices the budget is for; ``response``: among those that the problem
    evaluates (``also`` of `seqopt.pose`); ``level``: SI units; ``bound``: how many steps may exceed
    it. Result: each choice, and each pair, takes the number of its steps that exceed the level; the
    first move those without an open grip too, in which no robot takes its grip (``F_move``). Raises
    `ProblemError` if the problem does not evaluate the response.
    """
    joined = Joined([*map(len, problem.candidates)], np.add)
    for choices in chain.from_iterable(problem.evaluation.levels()):
        if response not in choices.responses:
            raise ProblemError(
                f"budget on {response}: step {choices.step.number} has only "
                f"{', '.join(choices.responses)}; name it in `also` when the problem is posed"
            )
        joined.add(choices.moves, (choices.responses[response] > level).astype(float))
    if response != "F_move" and problem.given:
        joined.add_anyway(float((problem.given_values(response) > level).sum()))
    return joined.budget(f"steps with {response} over {level:g}", bound)


def travel(problem: Layers, bound: float) -> Budget:
    """Return a cap on the straight distances of robots from grip to grip over the whole build.

    ``problem``: whose choices the budget is for; ``bound``: m. Result: each choice takes the
    distances between its node and given ones before and after it, each pair that between its two
    nodes; the first move those between given nodes too; m. Raises `ProblemError` if a robot goes
    from the grip of a move to that of another one that is not the next.
    """
    joined, at = (
        Joined([*map(len, problem.candidates)], np.add),
        problem.schedule.scene.node_position,
    )
    for robot, ends in _ways(problem.schedule):
        moves = [end.move for end in ends if isinstance(end, OpenGrip)]
        nodes = [
            problem.schedule.moves[end.move].candidates if isinstance(end, OpenGrip) else (end,)
            for end in ends
        ]
        first, second = ([*map(at, own)] for own in nodes)
        way = np.array([[math.dist(a, b) for b in second] for a in first])
        if not moves:
            joined.add_anyway(float(way[0, 0]))
        elif len(moves) == 1:
            joined.add((moves[0],), way.ravel())
        elif moves[1] == moves[0] + 1:
            joined.add((moves[0], moves[1]), way)
        else:
            raise ProblemError(
                f"budget travel: {robot} goes from the grip of move {moves[0] + 1} to that of move "
                f"{moves[1] + 1}, and candidates are chosen move by move; name an aim, as minmax"
            )
    return joined.budget("robot travel [m]", bound)


_Grip = int | OpenGrip


def _ways(schedule: Schedule) -> Iterator[tuple[str, tuple[_Grip, _Grip]]]:
    """Yield robot and both ends of every change of grip, also from where the build begins."""
    scene, site = schedule.scene, schedule.begin
    before = () if site is None else (site.stays or site.holds(scene), site.holds(scene))
    every = zip(*before, *(step.grips for step in schedule.steps), strict=True)
    for robot, grips in zip(scene.robots, every, strict=True):
        for ends in pairwise(grip for grip in grips if grip is not None):
            if ends[0] != ends[1]:
                yield robot.name, ends
