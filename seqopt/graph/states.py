"""The problem of the free schedule: which robot does what next, and where, over a whole build."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from seqopt._registry import Later, Shown
from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.engines.registry import engine_for, recipe_of
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, as_formulation
from seqopt.network.network import Network, build_network
from seqopt.problem.amounts import (
    LARGEST,
    NONE,
    STATE_RESPONSES,
    SUM,
    Amount,
    StateArrays,
    judged_by,
)
from seqopt.problem.criteria import (
    CandidateCosts,
    Criterion,
    RankSum,
    _counts_every_step,
    state_costs,
)
from seqopt.problem.problem import (
    WORST_PEAK,
    Aim,
    Orders,
    RobustAim,
    _goals,
    check_parts,
    checked_limits,
    of_states,
    robot_responses,
)
from seqopt.problem.requirements import Filter, Limit, Resource, filters_of
from seqopt.responses._grip_sets import BAND, HERE, GripSets, Resources, ScenarioSets, _near
from seqopt.responses.quantities import PROP_EXCESS, robot_response
from seqopt.scene._checks import as_float, short
from seqopt.scene.scene import Order, Scene
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Grips, Site, Step
from seqopt.stability.standing import Standing, StandingSets, counted

if TYPE_CHECKING:
    from seqopt.graph.formulation import Solution
    from seqopt.sequence._space import FreeSpace, ScheduleSpace
    from seqopt.stability.assessment import Stability

_Valued = Callable[[Ints], tuple[Floats, Bools]]


@dataclass(frozen=True, repr=False)
class States(Shown):
    """The states of a build and the moves between them; everything is computed when first needed.

    ``rules``: which moves are possible: those that rules allow, or those that choose the open grips
    of a schedule, however many are open in a step; ``criterion``: for the goals that name no
    response; ``goals``: what to minimize, the most important first; ``standing``: stability
    requirement of all states; ``settled``: margins that are required as well; ``budgets``: caps on
    the sums of as many last goals, which are constraints, not objectives; ``scenarios``: engines of
    the same scene in other states of the world: the largest value over them counts, and limits and
    stability hold in all; ``over``: aggregation of their totals, if the goal is a sum; ``weights``:
    of the scenarios in it, in place of the largest; ``resources``: workers of grip sets, which the
    proof does not use; ``orders``: which orders of the bricks are searched, by default the scene's
    own alone: values keep its scales; ``paths``: resources that plans must keep; ``answers``:
    responses of grip sets that were computed, by engine and names, shared by all problems that are
    derived from one; ``judged``: what the judge computed again, which no formulation is given.
    """

    engine: Engine
    rules: FreeRules | Schedule
    criterion: Criterion
    goals: tuple[Amount, ...]
    limits: tuple[Limit, ...] = ()
    standing: Standing | None = None
    settled: tuple[Standing, ...] = ()
    budgets: tuple[float, ...] = ()
    scenarios: tuple[Engine, ...] = ()
    over: RobustAim = WORST_PEAK
    weights: tuple[float, ...] = ()
    resources: Resources = HERE
    filters: tuple[Filter, ...] = ()
    orders: Orders | None = None
    paths: tuple[Resource, ...] = ()
    answers: dict[object, Any] = field(default_factory=dict, compare=False)
    judged: dict[object, Any] = field(default_factory=dict, compare=False)

    def __repr__(self) -> str:
        parts = [repr(self.network.scene.name)]
        parts += [repr(self.method)] if self.method != FREE else []
        parts += [f"{len(self.scenarios)} scenarios"] if self.scenarios else []
        parts += [f"{self.orders.value} orders"] if self.orders is not None else []
        caps = zip(self.names[len(self.aims) :], self.budgets, strict=True)
        parts += [*self.names[: len(self.aims)], *(f"{goal} <= {cap:g}" for goal, cap in caps)]
        return f"States({', '.join(parts)}, {len(self.limits)} limits)"

    @cached_property
    def each(self) -> tuple[States, ...]:
        """The problem of every single scenario; empty without scenarios."""
        alone = replace(self, scenarios=(), over=WORST_PEAK, weights=())
        return tuple(replace(alone, engine=engine) for engine in self.scenarios)

    @property
    def totals(self) -> bool:
        """Whether totals of scenarios count, not the worst steps in any."""
        first = next(iter(self.goals), SUM)
        return self.over.aim is Aim.SUM and first.states is not None and not first.is_peak

    @property
    def names(self) -> tuple[str, ...]:
        """What every goal is called."""
        return (str(self.over),) if self.totals else tuple(map(str, self.goals))

    @property
    def alone_in_scene(self) -> States:
        """Itself: its engine is that of the nominal scene."""
        return self

    def at(self, order: Order) -> States:
        """Return the problem of one order of the bricks, by name; itself where it is given: ()."""
        if not order:
            return self
        made = list[Engine]()
        for engine in (self.engine, *self.scenarios):
            recipe = recipe_of(engine)
            assert recipe is not None  # as is required where orders are sought
            made.append(recipe.make(build_network(engine.network.scene, order)))
        return replace(self, engine=made[0], scenarios=tuple(made[1:]), orders=None)

    @property
    def network(self) -> Network:
        """Of the scene that is built."""
        return self.engine.network

    @property
    def free_rules(self) -> FreeRules:
        """Its rules, if moves follow from any; a `ProblemError` says where they do not."""
        return self.rules.free()

    @property
    def among(self) -> str:
        """The candidates that are kept, in words; empty for all."""
        return self.rules.left_out

    @property
    def method(self) -> str:
        """The name of the schedule, or ``free``."""
        return self.rules.method

    @property
    def title(self) -> str:
        """What it is about, where plans stand beside each other."""
        return f"{self.method} schedule"

    @property
    def begin(self) -> Site | None:
        """Where the build begins; None for the empty site."""
        return self.rules.begin

    @property
    def questions(self) -> tuple[str, ...]:
        """What a formulation must answer to choose from it."""
        if self.orders is not None:
            return ("order",)
        if self.is_timed or self.paths:
            return ("time",) * self.is_timed + ("resource",) * bool(self.paths)
        return ("tail",) if self.totals else ("goals",)

    @property
    def default_formulation(self) -> str:
        """The name of the formulation that chooses from it if none is named."""
        others = dict.fromkeys(("time", "resource"), "makespan_labels")
        return ({"order": "order_search"} | others).get(self.questions[0], "schedule_search")

    def formulation(self, named: Formulation | str | None) -> Formulation:
        """Return the formulation that chooses from it; a `ProblemError` if it does not fit."""
        return as_formulation(named or self.default_formulation, *self.questions)

    def in_display_units(self, values: Sequence[float]) -> dict[str, float]:
        """Return values of the first goals by their names; of a tilt the critical one, degrees."""
        found = zip(self.names, self.goals, values, strict=False)
        return {name: goal.shown(value) for name, goal, value in found}

    def bounded(self, bounds: Sequence[Any]) -> Sequence[Any]:
        """Return the bounds of goals, without those of budgets."""
        return bounds[: max(1, len(self.aims))]

    def settles(self, *, exact: bool) -> bool:
        """Return whether a judged exact search is optimal, up to the proven width of margins."""
        beside = self.budgets or self.totals or self.is_timed or self.paths
        return exact and any(goal.margins for goal in self.aims) and not beside

    def described(self, limits: Mapping[str, object]) -> dict[str, object]:
        """Return the settings of the problem for a summary; ``limits``: bounds by name."""
        stands = None
        if self.standing is not None:
            sets = counted(one.stability for one in self.each or (self,))
            stands = {**self.standing.described(), **sets}
        return {
            "aims": [*self.names][: max(1, len(self.aims))],
            **judged_by(self.goals or (SUM,), self.criterion),
            "scenarios": len(self.scenarios),
            "limits": limits,
            **({"filters": [*map(str, self.filters)]} if self.filters else {}),
            **({"resources": [*map(str, self.paths)]} if self.paths else {}),
            "rules": self.rules.described(self.network.scene),
            "stands": stands,
        }

    def spent(
        self, objective: Mapping[str, float], found: Solution
    ) -> dict[str, dict[str, float | None]]:
        """Return cap, use and multiplier, if one is known, of every budget."""
        capped = zip(self.names[len(self.aims) :], self.budgets, strict=True)
        prices = found.prices[0] if found.prices else (None,) * len(self.budgets)
        return {
            name: {"bound": cap, "spent": objective[name], "price": price}
            for (name, cap), price in zip(capped, prices, strict=False)
        }

    def chosen_nodes(
        self, steps: Sequence[Step], states: Sequence[Sequence[int]]
    ) -> tuple[int, ...]:
        """Return the node chosen for every move; a `ProblemError` where rules have none."""
        return self.rules.chosen(steps)

    @cached_property
    def space(self) -> FreeSpace | ScheduleSpace:
        """Its states and moves."""
        from seqopt.sequence._space import ScheduleSpace, free_space  # noqa: PLC0415  # candidates need none

        network, rules, caps, parks = self.network, self.rules, self.caps, self.parks
        if isinstance(rules, Schedule):  # its robots are never alike
            return ScheduleSpace(network, rules, caps, parks, self.worlds)
        return free_space(
            network, rules, caps, parks=parks, timed=self.is_timed, worlds=self.worlds
        )

    @property
    def worlds(self) -> tuple[Scene, ...]:
        """The scenes of its scenarios."""
        return tuple(engine.network.scene for engine in self.scenarios)

    @property
    def is_timed(self) -> bool:
        """Whether the makespan is a goal or has a budget."""
        return any(goal.in_time for goal in self.goals)

    @property
    def parks(self) -> bool:
        """Whether it counts where a free robot was last: for its travel, or the time of it."""
        return any(goal.tracks_free_robots(self.network.scene) for goal in self.goals)

    @cached_property
    def caps(self) -> Mapping[str, float]:
        """Limits on single robots, by name, N."""
        own = {robot_response(robot.name): robot.name for robot in self.network.scene.robots}
        caps = [(own[e.response], e.bound) for e in self.limits if e.response in own]
        return {name: min(cap for other, cap in caps if other == name) for name, _ in caps}

    @cached_property
    def asked(self) -> frozenset[str]:
        """The responses that goals, criterion, filters and limits name."""
        parts: tuple[Amount | Filter, ...] = (*self.goals, *self.filters)
        names = {name for part in parts for name in part.responses}
        if any(goal.of_criterion for goal in self.goals):
            for bricks in range(1, 1 + len(self.network.inner)):
                names.update(self.criterion.wanted(bricks))
        return frozenset(names.union(limit.response for limit in self.limits))

    @cached_property
    def named(self) -> tuple[str, ...]:
        """Those of a state, independent of which robot holds where."""
        return tuple(name for name in (*STATE_RESPONSES, PROP_EXCESS) if name in self.asked)

    @property
    def by_robot(self) -> bool:
        """Whether costs of states depend on the other candidates, or on which robot holds where."""
        of_robots = {*robot_responses(self.rules, self.network.scene)} & {*self.criterion.wanted(1)}
        asked = bool(of_robots) or self.is_relative
        return asked and any(goal.of_criterion for goal in self.goals)

    @property
    def is_relative(self) -> bool:
        """Whether only steps with an open grip have costs, such as ranks among candidates."""
        return not _counts_every_step(self.criterion)

    @property
    def aims(self) -> tuple[Amount, ...]:
        """The goals that are minimized."""
        return self.goals[: len(self.goals) - len(self.budgets)]

    @property
    def sets(self) -> GripSets:
        """Responses of grip sets, those of the engine that are named; the forces come with them."""
        return self._sets(screen=False)

    @property
    def screened(self) -> GripSets:
        """Responses in single precision, to search by: enough for worst values, and for ranks."""
        whole = any(goal.states and not goal.has_few_digits for goal in self.goals)
        return self._sets(screen=self._by_ranks or not (self.filters or whole or self.is_relative))

    def _sets(self, *, screen: bool) -> GripSets:
        names = tuple(name for name in self.named if name != LARGEST)
        key = id(self.engine), names, screen
        if key not in self.answers:
            self.answers[key] = GripSets(self.engine, names, self.resources, screen=screen)
        return self.answers[key]  # type: ignore[no-any-return]

    @property
    def models(self) -> int:
        """How many grip sets were solved."""
        if self.each:
            return sum(problem.models for problem in self.each)
        again = self.screened.solved_by(self.sets) if self._by_ranks else 0
        return self.sets.solved + self.six_digit_models - again

    @property
    def six_digit_models(self) -> int:
        """How many of them were solved in single precision: enough to search by."""
        if self.each:
            return sum(problem.six_digit_models for problem in self.each)
        return self.screened.solved * (self.screened is not self.sets)

    @property
    def nbytes(self) -> int:
        """How much memory the responses of grip sets take."""
        if self.each:
            return sum(problem.nbytes for problem in self.each)
        return self.sets.nbytes + self.screened.nbytes

    def fitting(self, seen: StateArrays) -> Bools:
        """Return which states pass the filters, (n,); stability is evaluated later."""
        fits = seen.possible.copy()
        for each in self.every_filter:
            if each.passes and not each.expensive:  # a filter without a test is kept by all moves
                fits &= each.proven(seen)
        for each in self.filters if fits.any() else ():
            if each.expensive:
                rows = np.flatnonzero(fits)
                fits[rows] = each.proven(seen.only(rows))
        return fits

    def seen(self, level: int, states: Ints, *, rough: bool = False) -> StateArrays:
        """Return states (n, c) as amounts and filters see them, before any filter is asked.

        ``rough``: whether single precision is enough, except close to a limit.
        """
        held, most = _ascending(self._columns(states), self._caps)
        bricks = self.space.bricks_at(level)
        answers, forces = (self.screened if rough else self.sets).answers(bricks, held)
        if rough and self.screened is not self.sets:
            close = self._close(bricks, self._by_name(level, states, answers, forces), forces, most)
            if close.any():
                answers[close], forces[close] = self.sets.answers(bricks, held[close])
        fits = np.asarray(np.isfinite(np.column_stack([answers, forces])).all(axis=1))
        found = self._by_name(level, states, answers, forces)
        nodes = self._node_numbers[states[:, : self.space.robots].clip(min=0)]
        return StateArrays(bricks, nodes, found, forces, most, fits, self.criterion, states)

    def _of_robots(self, level: int, states: Ints, forces: Floats) -> dict[str, Floats]:
        """Return the force of each robot (n,), and of the one whose move is the last; NaN of none.

        ``forces`` (n, r): in the order of the places held.
        """
        held, own = self._columns(states), np.full(forces.shape, np.nan)
        np.put_along_axis(own, np.argsort(held, axis=1, kind="stable"), forces, axis=1)
        own[held == 0] = np.nan
        names = [robot_response(self.network.scene.robots[robot].name) for robot in self.robots]
        columns = self.space.open_columns(level)
        moving = own[:, columns[-1]] if columns else np.full(len(states), np.nan)
        return {**dict(zip(names, own.T, strict=True)), "F_move": moving}

    def costs(self, level: int, seen: StateArrays) -> Floats:
        """Return the criterion of states (n,).

        Ranks are those among all candidates of the level, before limits and filters are asked.
        """
        if not self.is_relative:
            return state_costs(self.criterion, seen.responses, seen.bricks, seen.possible)
        return self.candidates.among(level, seen.rows)

    @cached_property
    def _by_candidates(self) -> bool:
        """Whether costs of candidates are all that is asked of states."""
        asked = self.limits or self.filters or not np.isinf(self._caps).all()
        goals = all(goal.of_criterion for goal in self.goals)
        return goals and self.is_relative and not asked

    @cached_property
    def candidates(self) -> CandidateCosts:
        """Costs of states among the candidates of the grips that are open."""
        return CandidateCosts(self)

    @cached_property
    def _node_numbers(self) -> Ints:
        return np.array([NONE, *self.network.scene.placed_nodes])

    @property
    def every_filter(self) -> tuple[Filter, ...]:
        """All that states must pass: rules, standing, payloads, arms, limits, and others."""
        return filters_of(self)

    @cached_property
    def _by_ranks(self) -> bool:
        """Whether ranks among candidates, and limits, are all that is asked of states."""
        goals = all(goal.of_criterion for goal in self.goals)
        return goals and isinstance(self.criterion, RankSum) and not self.filters

    def _by_name(
        self, level: int, states: Ints, answers: Floats, forces: Floats
    ) -> dict[str, Floats]:
        """Return the responses of states (n,) by name."""
        found = dict(zip(self.sets.names, answers.T, strict=True))
        found[LARGEST] = forces.max(axis=1, initial=0.0)
        return found | (
            self._of_robots(level, states, forces) if self.asked - {*self.named} else {}
        )  # those of single robots

    def _close(
        self, bricks: int, found: Mapping[str, Floats], forces: Floats, most: Floats
    ) -> Bools:
        """Return which states single precision may round or limit otherwise, (n,)."""
        close = _near(forces, np.where(np.isfinite(most), most, np.nan)).any(axis=1)
        if isinstance(self.criterion, RankSum):
            close |= self.criterion.is_close(found, bricks, BAND)
        for limit in self.limits:
            if limit.response in found:
                close |= _near(found[limit.response], limit.counted)
        return np.asarray(close)

    def values(
        self, level: int, states: Ints, *, rough: bool = False, most: float = np.inf
    ) -> tuple[Floats, Bools]:
        """Return the values of goals in states, and which states are within all limits.

        ``states`` (n, c); ``rough``: whether single precision is enough; ``most``: over scenarios,
        a state in which the first goal is larger is not evaluated further: its values are then
        lower bounds, from some scenarios. Results: ``values`` (n, g): a column for every goal; zero
        for one that is about moves, or about margins; ``within`` (n,).
        """
        if self.each:
            asked = [partial(p.values, level, rough=rough) for p in self.each]
            return self._worst(asked, level, states, most, rough=rough)
        bricks = self.space.bricks_at(level)
        out = np.zeros((len(states), len(self.goals)))
        if not bricks:  # the empty site, where a take-down ends
            return out, np.ones(len(states), dtype=bool)
        if self._by_candidates:
            out[:] = self.candidates.among(level, states)[:, None]
            return out, np.asarray(np.isfinite(out).all(axis=1))
        found = self.seen(level, states, rough=rough)
        within = self.fitting(found)
        found = found._replace(possible=within)
        for column, goal in enumerate(self.goals):
            if goal.of_criterion:
                out[:, column] = np.where(within, self.costs(level, found), np.inf)
            elif goal.states is not None:
                out[:, column] = goal.value(found)
        within &= np.isfinite(out).all(axis=1)
        out[~within] = np.inf
        return out, within

    def standing_values(
        self, level: int, states: Ints, *, most: float = np.inf
    ) -> tuple[Floats, Bools]:
        """Return values, margins among them, and feasibility with the stability requirement.

        Stability and margins are evaluated last, of states that are otherwise feasible.

        ``states`` (n, c); ``most``: as of `values`. Results: ``values`` (n, g); ``within`` (n,).
        """
        if self.each:
            asked = [partial(p.standing_values, level) for p in self.each]
            return self._worst(asked, level, states, most, rough=False)
        out, within = self.values(level, states)
        if self.demands:
            rows = np.flatnonzero(within)
            within[rows] = self.stand(level, states[rows])
        if bricks := self.space.bricks_at(level):
            for column, goal in enumerate(self.goals):
                if goal.margins is not None:
                    rows = np.flatnonzero(within)
                    held = self.held_to_stand(states[rows])
                    out[rows, column] = goal.margins(self.stability, bricks, *held)[:, 1]
        within &= np.isfinite(out).all(axis=1)
        return out, within

    def stand(self, level: int, states: Ints) -> Bools:
        """Return which states (n, c) are proven to meet the stability requirement, (n,)."""
        if self.each:
            return np.asarray(np.all([p.stand(level, states) for p in self.each], axis=0))
        bricks = self.space.bricks_at(level)
        return np.asarray(self.stability.stand(bricks, *self.held_to_stand(states)))

    def recalled(self, level: int, states: Ints) -> Ints:
        """Return verdicts that known proofs imply, (n,): 1 stands, -1 falls, 0 open."""
        if self.each:
            return np.asarray(np.min([p.recalled(level, states) for p in self.each], axis=0))
        bricks = self.space.bricks_at(level)
        return self.stability.recalled(bricks, *self.held_to_stand(states))

    def _worst(
        self, asked: Sequence[_Valued], level: int, states: Ints, most: float, *, rough: bool
    ) -> tuple[Floats, Bools]:
        """Return values (n, g) over scenarios, evaluated where none before excludes the state.

        The responses of one scenario, then of three, nine and so on are computed together.
        """
        out = np.zeros((len(states), len(self.goals)))
        within, ahead = np.ones(len(states), dtype=bool), 0
        bricks, key = self.space.bricks_at(level), ("together", *map(id, self.scenarios))
        sets = [one.screened if rough else one.sets for one in self.each]
        for number, values in enumerate(asked):
            rows = np.flatnonzero(within & (out[:, 0] <= most))
            if not len(rows):
                break
            if number == ahead:
                ahead = min(3 * number + 1, len(asked))
                if bricks and not self.each[0]._by_candidates:
                    if key not in self.answers:
                        self.answers[key] = ScenarioSets(self.scenarios, self.resources)
                    held = np.sort(self.each[0]._columns(states[rows]), axis=1)
                    self.answers[key].fill(range(number, ahead), sets, bricks, held)
            found, ok = values(states[rows])
            out[rows], within[rows] = self.joined(out[rows], found, number), ok
        out[~within] = np.inf
        return out, within

    def joined(self, before: Floats, values: Floats, number: int) -> Floats:
        """Return values (n, g) over scenarios with those of one more, the scenario of a number."""
        if self.weights:
            weight = self.weights[number]  # what is infinite in any scenario stays so
            return before + (weight * values if weight else np.where(values < np.inf, 0.0, np.inf))
        return np.maximum(before, values)

    @cached_property
    def stability(self) -> StandingSets:
        """Cached verdicts and margins of grip sets."""
        mortar = self.standing or Standing()
        return StandingSets(self.network, mortar, self._payloads, self.demands)

    def share_proofs(self, other: States) -> None:
        """Share proofs of stability with a problem of the same scenes."""
        for one, shared in zip(self.each or (self,), other.each or (other,), strict=True):
            one.stability.share(shared.stability)

    @property
    def demands(self) -> tuple[Standing, ...]:
        """All stability requirements of states."""
        return self.settled if self.standing is None else (self.standing, *self.settled)

    @cached_property
    def certified(self) -> dict[tuple[int, Grips], Stability]:
        """Cached verdicts of the cone program, by brick count and grips."""
        return {}

    @property
    def robots(self) -> list[int]:
        """The robot of every column of a state; those that are alike have any of theirs."""
        return [robot for kind in self.space.kinds for robot in kind.robots]

    @cached_property
    def _caps(self) -> Floats:
        """The largest force of the robot of every column of a state, N."""
        kinds = self.space.kinds
        return np.concatenate([np.full(len(kind.robots), kind.cap) for kind in kinds])

    @cached_property
    def _beyond(self) -> Ints:
        """Offset of the places of grips from those of nodes, of the robot of every column, (r,)."""
        of_robot = self.network.scene.grip_kinds.of_robot
        return np.asarray(2 * len(self.network.inner) * of_robot[self.robots])

    @cached_property
    def _payloads(self) -> Floats:
        """What the robot of every column may carry where states must stand, N."""
        if not self.rules.keeps_payloads(stands=True):
            return self._caps
        payloads = np.array([self.network.scene.robots[robot].payload for robot in self.robots])
        return np.asarray(np.minimum(payloads, self._caps))

    def _columns(self, states: Ints) -> Ints:
        """Return the place of the grip of every column, (n, r), 0 for none."""
        held = states[:, : len(self._caps)].clip(min=0)
        return np.where(held > 0, held + self._beyond, 0) if self._beyond.any() else held

    def held_to_stand(self, states: Ints) -> tuple[Ints, Floats]:
        """Return nodes held, ascending, and payloads, (n, r), for stability: no kinds of grips."""
        return _ascending(states[:, : len(self._caps)].clip(min=0), self._payloads)

    def in_scene(self, scene: Scene) -> States:
        """Return the problem in another scene, as of other robots."""
        engine = engine_for(self.engine, scene)
        return replace(self, engine=engine, rules=self.rules.in_scene(engine.network.scene))

    def carrying(self, payload: float) -> States:
        """Return the problem with one payload, N, of every robot."""

        def strong(scene: Scene) -> Scene:
            return scene.with_robots(*(replace(r, payload=payload) for r in scene.robots))

        worlds = tuple(engine_for(e, strong(e.network.scene)) for e in self.scenarios)
        return replace(self.in_scene(strong(self.network.scene)), scenarios=worlds)


def _ascending(held: Ints, most: Floats) -> tuple[Ints, Floats]:
    """Return places held (n, r) in ascending order, and the payloads of their robots."""
    order = np.argsort(held, axis=1, kind="stable")
    return np.take_along_axis(held, order, axis=1), np.asarray(most[order])


def build_states(
    engine: Engine,
    rules: FreeRules | Schedule,
    criterion: Criterion,
    goals: Sequence[Amount] | str = "minmax",
    limits: Sequence[Limit] = (),
    stands: Standing | Mortar | str | None = None,
) -> States:
    """Return the problem of the free schedule of an engine's scene.

    ``goals``: see `parse_goals`; ``stands``: that every state does, robots within payload, with
    this mortar: ``"dry"``, ``"bond=3e3"`` (Pa). Nothing is computed yet, except scales that a
    criterion takes from the scene. Raises `ProblemError` if goals, criterion or limits use a
    response that a state does not have, or ranks among choices.

    >>> import seqopt
    >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    >>> build_states(engine, FreeRules(), seqopt.CRITERIA["worst-ratio"], "minmax,steps")
    States('arch25', minmax, steps, 0 limits)
    """
    named = _goals(goals, least=1)
    rules = rules.in_scene(engine.network.scene)
    limits = checked_limits(limits, engine.network, rules)
    if any(goal.of_criterion for goal in named):
        criterion = of_states(engine, criterion, rules)
    return _asked(States(engine, rules, criterion, named, limits, Standing.of(stands)))


def within(problem: States, caps: Mapping[Amount | str, float]) -> States:
    """Return a problem whose plans keep totals over the build within caps.

    ``caps``: amounts or their names, and how much each may be. Raises `ProblemError` if something
    is no total, or a cap is no number from 0.

    >>> import seqopt
    >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    >>> problem = build_states(engine, FreeRules(), seqopt.CRITERIA["worst-ratio"])
    >>> within(problem, {"regrips": 3})
    States('arch25', minmax, regrips <= 3, 0 limits)
    """
    goals = [_goals(each if isinstance(each, str) else (each,))[0] for each in caps]
    for goal, cap in zip(goals, caps.values(), strict=True):
        if goal.is_peak or goal.of_criterion:
            raise ProblemError(
                f"budget {goal}: it is no total of moves or of a response; give steps, regrips, "
                "travel, makespan or sum(RESPONSE), or set a limit"
            )
        if not 0 <= as_float(cap) < np.inf:
            raise ProblemError(f"budget {goal}={short(cap)}: give a number from 0")
    if problem.budgets:
        raise ProblemError("the problem has budgets already; give all of them at once")
    caps_of = tuple(float(cap) for cap in caps.values())
    return _asked(replace(problem, goals=(*problem.goals, *goals), budgets=caps_of))


def over_scenarios(
    problem: States, scenes: Sequence[Scene], over: RobustAim = WORST_PEAK
) -> States:
    """Return a problem whose worst values count in any of some scenarios, or totals over them.

    The criterion keeps the numbers of the scene that it was posed for. A `ProblemError` names a
    goal that is no worst value, or not the one sum of which totals are made.
    """
    sums = [goal for goal in problem.goals if goal.states and not goal.is_peak]
    if over.aim is Aim.SUM and problem.goals != (*sums,)[:1]:
        raise ProblemError(
            f"robust aim {over}: it is made of one sum alone; leave other aims and budgets out, or "
            "give worst-peak"
        )
    if over.aim is Aim.PEAK and sums:
        raise ProblemError(
            f"aim {sums[0]}: the worst total of scenarios is no total of worst states; give "
            "worst-total, or take worst values"
        )
    for number, scene in enumerate(scenes, start=1):  # of a module that others do without
        Later("seqopt.scene.scenarios").require_alike(problem.network.scene, scene, number)
    engines = tuple(engine_for(problem.engine, scene) for scene in scenes)
    return _asked(replace(problem, scenarios=engines, over=over))


def _asked(problem: States) -> States:
    """Return the problem after checks of goals, stability and curing; raises `ProblemError`."""
    if problem.standing is not None or any(goal.margins for goal in problem.goals):
        _ = problem.stability  # what cannot be asked is refused now
    check_parts(problem.goals, problem.network.scene, problem.rules)
    for goal in problem.goals:
        if goal.check is not None:
            goal.check(problem)
    if problem.standing is None or problem.standing.curing is None:
        return problem
    wrong = [str(goal) for goal in problem.goals if goal.margins]
    wrong += ["props"] if problem.network.scene.props else []
    wrong += ["scenarios"] if problem.scenarios else []
    if wrong:
        raise ProblemError(f"curing: {wrong[0]} beside it is not modeled; leave one of them out")
    return problem
