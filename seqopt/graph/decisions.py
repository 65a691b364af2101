"""Decisions of a build: which candidate every open grip of a schedule takes, one after the other.

A decision is a move with the candidate that is chosen for it. The forced steps behind it are those
in which its move is the last that is open: alone, or beside the move before it. Their costs are
computed brick count by brick count, for all candidates at once, and joined along the chain.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from seqopt._showing import Shown
from seqopt.arrays import Floats, Terse
from seqopt.engines.interface import Engine
from seqopt.errors import (
    InfeasibleError,
    MechanismError,
    NothingFoundError,
    ProblemError,
    SolverError,
    TimeUpError,
    did_you_mean,
)
from seqopt.graph.decision_costs import (
    Budget,
    Compiled,
    Joined,
    LayeredCosts,
    ScenarioCosts,
    best_in_order,
    compile_costs,
    compile_totals,
    largest_of,
)
from seqopt.graph.formulation import Watch
from seqopt.problem.criteria import Ranked, RankSum, _counts_every_step
from seqopt.problem.problem import WORST_PEAK, Aim, AskedBudget, RobustAim
from seqopt.problem.requirements import (
    Criterion,
    Limit,
    ResponsesAsked,
    SceneFacts,
    _carrying_excesses,
    _excesses,
    _response_along,
    _step_limits,
    robots_of,
)
from seqopt.responses._choices import CHOICE_RESPONSES, Evaluation, StepChoices
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import PROP_EXCESS, _payload_text, robot_response
from seqopt.responses.resources import HERE, Resources
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step
from seqopt.work._workers import keep


@dataclass(frozen=True, repr=False)
class Decisions(Shown):
    """What candidates of all moves cost; responses, sums and peaks are computed on first use.

    ``criterion``: what a step costs; ``limits``: bounds that no step may exceed, whether or not a
    grip is open in it; ``evaluation``: raw responses of every open step; ``budgets``: caps on
    totals over the build, given or in words.
    """

    criterion: Criterion
    limits: tuple[Limit, ...]
    evaluation: Evaluation
    budgets: tuple[Budget | AskedBudget, ...] = ()

    def __repr__(self) -> str:
        schedule = self.schedule
        counts = f"{len(schedule.steps)} steps, {len(schedule.moves)} moves"
        extras = f"{len(self.limits)} limits, {len(self.budgets)} budgets"
        what = f"{schedule.scene.name!r}, {schedule.method!r}: {counts}"
        return f"Decisions({what}, criterion {self.criterion.name!r}, {extras})"

    @property
    def engine(self) -> Engine:
        """What computes the responses."""
        return self.evaluation.engine

    @property
    def schedule(self) -> Schedule:
        """The steps and moves."""
        return self.evaluation.schedule

    @property
    def models(self) -> int:
        """How many different models were solved."""
        return self.evaluation.models

    def of(self, engine: Engine) -> Decisions:
        """Return the same decisions by another engine, as of a scenario, without budgets."""
        return replace(self, evaluation=replace(self.evaluation, engine=engine), budgets=())

    @cached_property
    def caps(self) -> tuple[Budget, ...]:
        """The budgets as amounts of candidates and pairs."""
        return tuple(b if isinstance(b, Budget) else self._budget(b) for b in self.budgets)

    def _budget(self, asked: AskedBudget) -> Budget:
        """Return a budget in words; a share is of what the optimum without budgets takes."""
        if asked.response:
            budget = steps_over(self, asked.response, asked.level, asked.bound)
        else:
            budget = travel(self, asked.bound)
        if not asked.share:
            return budget
        free = best_in_order([(self.sums, Aim.SUM)])
        return replace(budget, bound=asked.bound * budget.spent(free))

    @property
    def sums(self) -> LayeredCosts:
        """The costs whose sum over the build is minimized."""
        return self._sums[0]

    @property
    def peaks(self) -> LayeredCosts:
        """The costs whose largest over the build is minimized."""
        return self._peaks[0]

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
        steps, start = self.evaluation.steps, time.perf_counter()
        for choices in steps:
            joined.add(choices.moves, self.step_costs(choices))
        return joined.layered(), time.perf_counter() - start

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
        """Return how long responses (``respond``) and costs (``rank``) of an aim took, s."""
        ranked = self._sums[1] if aim is Aim.SUM else self._peaks[1]
        return {"respond": self.evaluation.seconds, "rank": ranked}

    def window_choices(self, move: int, before: int) -> tuple[StepChoices, ...]:
        """Return the steps that a move decides, in order, for its candidates alone, (C_k,).

        ``move``, ``before``: a move, and the candidate chosen for the move before it, of which the
        responses of those steps are that both share. Solved alone where the responses of all
        choices are not known.
        """
        if not self.evaluation.is_kept:
            return self.evaluation.window(move, before)
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

    @cached_property
    def alone(self) -> LayeredCosts:
        """The costs that a search of one move alone is charged: ranks among its candidates."""
        own, criterion = Ranked.CONDITIONAL, self.criterion
        if not isinstance(criterion, RankSum) or criterion.ranked is own:
            return self.sums
        return replace(self, criterion=replace(criterion, ranked=own)).sums

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

    def require_possible(self, worlds: Sequence[Scene] = ()) -> None:
        """Raise an error if no choice can keep a limit: of a grip that is given, or of a carrier.

        ``worlds``: scenes of scenarios, in which bricks are carried too. Raises `InfeasibleError`,
        naming the limit, the value and the steps.
        """
        schedule, scenes = self.schedule, [self.engine.network.scene, *worlds]
        heavy = [each for scene in scenes for each in _carrying_excesses(scene, schedule.steps)]
        worst = {each.robot: each for each in sorted(heavy, key=lambda each: each.largest)}
        if worst:
            enough = (f"--payload {n}={_payload_text(each.largest)}" for n, each in worst.items())
            said = f"{'; '.join(map(str, worst.values()))}; it takes {' '.join(enough)}"
            raise InfeasibleError(f"{schedule.method} schedule: {said}")
        if worlds or not (self.limits and self.given):  # looked at when their costs are computed
            return
        table = self.evaluation.table_of_given(limit.response for limit in self.limits)
        for excess in _excesses(self.schedule.scene, table, self.limits):
            raise InfeasibleError(
                f"{excess}, where no grip is left to choose; relax the limit or change the schedule"
            )

    def costs_in(self, engines: Sequence[Engine]) -> tuple[ScenarioCosts, ...]:
        """Return costs of candidates by the engine of every scenario, which an error names."""
        out = []
        for number, own in enumerate(map(self.of, engines), start=1):
            try:
                own.require_possible()
                found = own.sums, own.peaks, own.models, own.evaluation.seconds
            except MechanismError as error:
                raise MechanismError(f"scenario {number}: {error}", error.mode) from error
            except SolverError as error:
                raise SolverError(f"scenario {number}: {error}") from error
            out.append(ScenarioCosts(*found))
        return tuple(out)

    def compiled(
        self,
        aim: Aim | None,
        name: str = "",
        *,
        alone: bool = False,
        each: Sequence[ScenarioCosts] = (),
        over: RobustAim = WORST_PEAK,
    ) -> Compiled:
        """Return the graph of decisions whose sums or peaks count.

        ``alone``: whether with what a search of one move alone is charged; of peaks, with their
        parts; ``each``: costs in scenarios, of which the robust aim ``over`` makes one value.
        """
        name, aim, nodes = name or self.schedule.scene.name, aim or Aim.SUM, self.candidates
        if not each:
            costs = aim.costs(self)
            charged = self.alone if aim is Aim.SUM else costs
            return compile_costs(name, costs, aim, self.caps, charged if alone else None, nodes)
        try:
            if over.aim is Aim.SUM:
                return compile_totals(name, [costs.sums for costs in each], over, nodes)
            if aim is Aim.SUM:
                raise ProblemError(
                    f"{over}: totals over scenarios are no sum of one cost; take "
                    "scenario_search, or minimax with worst-peak"
                )
            costs = largest_of([costs.peaks for costs in each])
            found = compile_costs(name, costs, aim, (), costs if alone else None, nodes)
        except InfeasibleError as error:
            raise InfeasibleError(f"over all {len(each)} scenarios, {error}") from error
        (goal,) = found.instance.goals
        named = goal._replace(name=f"{goal.name} ({over})")
        return found._replace(instance=replace(found.instance, goals=(named,)))

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


def pose_decisions(
    engine: Engine,
    schedule: Schedule,
    criterion: Criterion,
    limits: Sequence[Limit] = (),
    also: Sequence[str] = (),
    resources: Resources = HERE,
) -> Decisions:
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
    return Decisions(asked.criterion, asked.limits, Evaluation(engine, schedule, asked, resources))


def steps_over(problem: Decisions, response: str, level: float, bound: float) -> Budget:
    """Return a bound on the number of steps in which a response exceeds a level.

    ``problem``: whose choices the budget is for; ``response``: among those that the problem
    evaluates (``also`` of `seqopt.pose`); ``level``: SI units; ``bound``: how many steps may exceed
    it. Result: each choice, and each pair, takes the number of its steps that exceed the level; the
    first move those without an open grip too, in which no robot takes its grip (``F_move``). Raises
    `ProblemError` if the problem does not evaluate the response.
    """
    joined = Joined([*map(len, problem.candidates)], np.add)
    for choices in problem.evaluation.steps:
        if response not in choices.responses:
            raise ProblemError(
                f"budget on {response}: step {choices.step.number} has only "
                f"{', '.join(choices.responses)}; name it in `also` when the problem is posed"
            )
        joined.add(choices.moves, (choices.responses[response] > level).astype(float))
    if response != "F_move" and problem.given:
        joined.add_anyway(float((problem.given_values(response) > level).sum()))
    return joined.budget(f"steps with {response} over {level:g}", bound)


def travel(problem: Decisions, bound: float) -> Budget:
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
    """Yield robot and both ends of every change of grip."""
    every = zip(*(step.grips for step in schedule.steps), strict=True)
    for robot, grips in zip(schedule.scene.robots, every, strict=True):
        for ends in pairwise(grip for grip in grips if grip is not None):
            if ends[0] != ends[1]:
                yield robot.name, ends


@dataclass(frozen=True, repr=False)
class Windows(Terse):
    """The steps that every move decides, after the choice before it; solved when first asked for.

    ``choice``: the chosen candidate of every move so far.
    """

    problem: Decisions
    choice: list[int] = field(default_factory=list)

    def costs(self, move: int, aim: Aim = Aim.SUM) -> Floats:
        """Return costs (C_k,) of the candidates of a move after the choices before it."""
        before = self.choice[move - 1] if move else 0
        costs = self.problem.possible_after(move, before)
        for choices in self.problem.window_choices(move, before):
            costs = aim.join(costs, self.problem.step_costs(choices))
        return costs

    def so_far(self) -> str:
        """Return the kind of choice, in a few words."""
        if not self.choice:
            return "no move was chosen yet"
        moves = self.problem.schedule.moves
        nodes = (str(moves[k].candidates[i]) for k, i in enumerate(self.choice))
        return f"{len(self.choice)} of {len(moves)} moves were chosen, at nodes {' '.join(nodes)}"


def walk_windows(problem: Decisions, watch: Watch) -> Windows:
    """Choose the candidate of least cost, one move after the other (equation 1 of Bruun et al.).

    Raises `NothingFoundError` if a move has no candidate left after the choices before it, while
    others may have led on; `TimeUpError` if time is over before the last move is chosen;
    `WorkerError`; `KeyboardInterrupt`, with the nodes that were chosen so far as its text.
    """
    found, resources = Windows(problem), problem.evaluation.resources
    try:
        with keep(resources.executor, resources.workers):
            for k, move in enumerate(problem.schedule.moves):
                if watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {found.so_far()}; give more")
                costs = found.costs(k)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after "
                        "the choices before it; relax a limit, or let a formulation look at all "
                        "choices"
                    )
                found.choice.append(int(np.argmin(costs)))
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(found.so_far()) from stop
    return found
