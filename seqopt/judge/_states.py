"""States that a better plan could pass: responses, limits and stability, computed anew.

Nothing that a search keeps is believed; what this judge computed once for a grip set it keeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.graph.graph import strictly_below, tied
from seqopt.graph.states import States
from seqopt.judge._candidates import LevelTables, depends_on_robots
from seqopt.judge._rule_moves import RuleTables, ScheduleTables, Transitions
from seqopt.judge._step_checks import props_that_hold
from seqopt.judge._twin import exceeds, own_values, twin_of
from seqopt.problem.amounts import LARGEST, NONE, MoveArrays, StateArrays
from seqopt.problem.requirements import LIMIT_TOLERANCE
from seqopt.responses._grip_sets import Block, solve_sets
from seqopt.sequence.rules import _RuleBook
from seqopt.sequence.schedule import Schedule
from seqopt.stability.standing import Standing, StandingSets

Tables: TypeAlias = RuleTables | ScheduleTables
"""What rules or a schedule allow, level by level."""


class Answers(NamedTuple):
    """What the engine answers of grip sets.

    ``values`` (S, g): of every goal; zero of one that is about moves or margins; ``forces`` (S, r):
    of the grips, N; ``fit`` (S,): which hang together and are within all limits; ``models``: how
    many were solved for them.
    """

    values: Floats
    forces: Floats
    fit: Bools
    models: int


def ask(problem: States, bricks: int, grips: Ints, most: float = np.inf) -> Answers:
    """Return the engine's responses to grip sets (S, r), nodes held.

    ``most``: over scenarios, what the first goal takes more of in one is not asked of the next.
    """
    if not problem.each:
        return _ask_engine(problem, bricks, grips)
    out = np.zeros((len(grips), len(problem.goals)))
    forces, fit, models = np.zeros(grips.shape), np.ones(len(grips), dtype=bool), 0
    for number, each in enumerate(problem.each):
        rows = np.flatnonzero(fit & (out[:, 0] <= most))
        found = ask(each, bricks, grips[rows])
        out[rows] = problem.joined(out[rows], found.values, number)
        forces[rows], fit[rows] = np.maximum(forces[rows], found.forces), found.fit
        models += found.models
    return Answers(out, forces, fit, models)


def _ask_engine(problem: States, bricks: int, grips: Ints) -> Answers:
    names = tuple(name for name in problem.named if name != LARGEST)
    held = tuple(n for n, _ in props_that_hold(problem.network.scene, bricks, grips.shape[1]))
    block = Block(bricks, grips, names, screen=False, props=held)
    rows = solve_sets(problem.engine, block, problem.resources)
    found, forces = dict(zip(names, rows.T, strict=False)), rows[:, len(names) :]
    found[LARGEST] = forces.max(axis=1, initial=0.0)
    fit = np.asarray(np.isfinite(rows).all(axis=1))
    for limit in problem.limits:
        fit &= ~exceeds(limit, found.get(limit.response, np.zeros(len(grips))))
    free = ((0, 0), (0, len(problem.network.scene.robots) - grips.shape[1]))
    nodes = problem.network.scene.grip_kinds.split(grips)[0]
    nodes, borne = np.pad(nodes, free, constant_values=NONE), np.pad(forces, free)
    most = np.full(borne.shape, np.inf)
    seen = StateArrays(bricks, nodes, found, borne, most, fit, problem.criterion, grips)
    for each in problem.filters:  # without a twin nothing is refused: a bound stays one
        left = np.flatnonzero(fit)
        if len(left):
            fit[left] = ~each.refuted_again(seen.only(left))
    seen = seen._replace(possible=fit)
    elsewhere = depends_on_robots(problem)  # values of these are written by `LevelTables`
    own = [
        own_values(goal) if goal.states is not None and k not in elsewhere else None
        for k, goal in enumerate(problem.goals)
    ]
    zeros = np.zeros(len(grips))  # of what is not about states
    values = np.column_stack([zeros if value is None else value(seen) for value in own])
    return Answers(values, forces, fit & np.isfinite(values).all(axis=1), len(grips))


class Filter(NamedTuple):
    """Upper limits of states.

    ``values``: of goals; the first that is about no margin bounds states, if it is about a worst
    step; ``margins``: of first goals, with which states must stand, as demanded; None does not
    ask; ``strict``: whether states must be below that value, not at most at it; ``steps``: of
    paths through a state, counted to it and at least from there.
    """

    values: Sequence[float] = ()
    margins: Sequence[float] | None = None
    strict: bool = False
    steps: float = np.inf


class Reachable(NamedTuple):
    """States of a part that pass a filter.

    ``codes`` (n,); ``states`` (n, c); ``values`` (n, g): of goals; ``onward``: transitions from
    them, by their rows; ``spent`` (n,): the fewest steps to each, where they are limited.
    """

    codes: Ints
    states: Ints
    values: Floats
    onward: list[Transitions]
    spent: Floats


class StateEvaluator:
    """The states of one schedule: which are feasible, and the values of goals in them.

    ``tables``: what rules allow; ``margins``: how many goals are about margins; they come first.
    """

    def __init__(self, problem: States) -> None:
        self.problem, scene, rules = problem, problem.network.scene, problem.rules
        robots = range(len(scene.robots))
        most, own = (
            [largest_load(problem, r, stand=stand) for r in robots] for stand in (False, True)
        )
        self.tables: Tables
        if isinstance(rules, Schedule):
            asked = rules, problem.network
            self.tables = ScheduleTables(*asked, parks=problem.parks, worlds=problem.worlds)
        else:
            book = _RuleBook(problem.network, rules, problem.worlds)
            groups = interchangeable(book, most, timed=problem.is_timed)
            self.tables = RuleTables(book, groups, parks=problem.parks)
        team, nodes, kinds = list(self.tables.team), self.tables.nodes, scene.grip_kinds
        self.margins = sum(goal.margins is not None for goal in problem.goals)
        self.most, self._loads = np.array(most)[team], np.array(own)
        self._payload = self._loads[team]
        more = [kind * kinds.span for kind in range(len(kinds.turns))]
        self.numbers = np.concatenate([nodes + each for each in more])  # of grips, by place
        self._beyond = len(nodes) * kinds.of_robot[team]
        self._standing = dict[Standing, tuple[StandingSets, ...]]()
        twins = (twin_of(goal) for goal in problem.goals if not goal.is_peak)
        self._to_go = next((twin.to_go for twin in twins if twin and twin.to_go), None)
        self._levels = LevelTables(self)
        self._models = 0

    @property
    def models(self) -> int:
        """How often the engine was asked of a grip set, in any scenario."""
        return self._models + self._levels.models

    def least(self) -> tuple[float, ...]:
        """Return lower bounds of goals, from the one end that builds have and from counted steps.

        Every move to that end is a cut. Minus infinity where nothing is known.
        """
        goals, tables = self.problem.goals, self.tables
        end = dict(tables.certain()).get(tables.last)
        last = np.full(len(goals), -np.inf if end is None else 0.0)
        if end is not None and tables.bricks_at(tables.last):
            last = self.valued(tables.last, end, Filter())[0][0]
        out = np.where([goal.is_peak for goal in goals], last, -np.inf)
        for k, twin in enumerate(map(twin_of, goals)):
            if twin is not None and twin.to_go is not None:
                out[k] = twin.to_go(tables, tables.first, tables.start())[0]
        return tuple(out.tolist())

    def bars(self, margins: Sequence[float]) -> bool:
        """Return whether a state that every plan passes is infeasible, or lacks such margins."""
        asked = Filter((), margins)
        return any(not self.valued(*state, asked)[1].all() for state in self.tables.certain())

    def reachable(self, level: int, entries: Ints, spent: Floats, asked: Filter) -> Reachable:
        """Return the states that pass and are reached from entries (n, c) on the same level.

        ``spent`` (n,): steps to entries. Those to which the fewest steps lead come first, so that
        no state is looked at twice where steps are limited; where they are not, all are zero.
        """
        limited, onward = np.isfinite(asked.steps), list[Transitions]()
        codes, states, values = self.tables.codes(entries[:0]), entries[:0], np.zeros((0, 0))
        steps, ok, left = np.zeros(0), np.zeros(0, dtype=bool), np.zeros(0, dtype=bool)
        fresh = entries
        while True:
            own = self.tables.codes(fresh)
            first = np.lexsort((spent, own))
            first = first[np.unique(own[first], return_index=True)[1]]
            if limited and self._to_go is not None:
                to_go = self._to_go(self.tables, level, fresh[first])
                first = first[spent[first] + to_go <= asked.steps]
            at, known = places(codes, own[first])
            steps[at[known]] = np.minimum(steps[at[known]], spent[first[known]])
            new = first[~known]
            found, passes = self.valued(level, fresh[new], asked)
            codes, states = np.concatenate([codes, own[new]]), np.concatenate([states, fresh[new]])
            values = np.concatenate([values.reshape(-1, found.shape[1]), found])
            steps, ok = np.concatenate([steps, spent[new]]), np.concatenate([ok, passes])
            left = np.concatenate([left, passes])
            if not left.any():
                break
            rows = np.flatnonzero(left & (steps == steps[left].min()))
            left[rows] = False
            moves = [
                move._replace(source=rows[move.source])
                for move in self.tables.successors(level, states[rows])
            ]
            onward += moves
            within = [move for move in moves if move.level == level]
            fresh = np.concatenate([entries[:0], *(move.states for move in within)])
            spent = np.concatenate([steps[:0], *(steps[m.source] + limited for m in within)])
        number = np.cumsum(ok) - 1
        onward = [move._replace(source=number[move.source]) for move in onward]
        return Reachable(codes[ok], states[ok], values[ok], onward, steps[ok])

    def valued(self, level: int, states: Ints, asked: Filter) -> tuple[Floats, Bools]:
        """Return values of goals in states (n, g), and which states pass a filter (n,)."""
        goals, bricks, k = self.problem.goals, self.tables.bricks_at(level), self.margins
        if not bricks:
            return np.zeros((len(states), len(goals))), np.ones(len(states), dtype=bool)
        below = np.inf
        if len(asked.values) > k and goals[k].is_peak:
            below = (strictly_below if asked.strict else tied)(asked.values[k])
        values, ok = np.zeros((len(states), len(goals))), np.ones(len(states), dtype=bool)
        if not self._levels.is_enough:
            held, payload = self._held(states, self.most, self._beyond)
            values, forces, ok = self._answers(bricks, held, np.inf if k else below)
            ok &= (forces <= payload).all(axis=1)
        self._levels.fill(level, states, values, ok)
        ok &= np.isfinite(values).all(axis=1) & (values[:, k : k + 1] <= below).all(axis=1)
        if asked.margins is not None:
            ok[ok] = self.may_stand(level, states[ok], asked.margins)
        return values, ok

    def grips(self, states: Ints) -> tuple[list[int], Ints]:
        """Return which robots hold in states of one step, and the numbers of their grips (n, r)."""
        columns = np.flatnonzero((states[:, : self.tables.robots] > 0).any(axis=0))
        beyond = np.broadcast_to(self._beyond, self.most.shape)[columns]
        return [self.tables.team[c] for c in columns], self.numbers[states[:, columns] + beyond]

    def demands(self, margins: Sequence[float]) -> tuple[Standing, ...]:
        """Return the stability requirements of states, with values of the first goals, margins."""
        base = self.problem.standing or Standing()
        pairs = zip(self.problem.goals, margins, strict=False)
        own = (base.demanding(goal.name, max(value, 0.0)) for goal, value in pairs)
        return (*self.problem.demands, *own)

    def may_stand(self, level: int, states: Ints, margins: Sequence[float]) -> Bools:
        """Return which states (n, c) are not proven to fall, or to lack margins of first goals."""
        (held, payload), out = self.held_to_stand(states), np.ones(len(states), dtype=bool)
        bricks = self.tables.bricks_at(level)
        for demand in self.demands(margins) if bricks else ():  # an empty site stands
            if demand not in self._standing:
                networks = [p.network for p in self.problem.each or (self.problem,)]
                sets = (StandingSets(network, demand, self._loads) for network in networks)
                self._standing[demand] = tuple(sets)
            for known in self._standing[demand]:
                out[out] = known.may_stand(bricks, held[out], payload[out])
        return out

    def held_to_stand(self, states: Ints) -> tuple[Ints, Floats]:
        """Return places held, ascending, and the largest forces there, where states must stand."""
        return self._held(states, self._payload)

    def _held(self, states: Ints, most: Floats, beyond: Ints | int = 0) -> tuple[Ints, Floats]:
        """Return places held, ascending, and the most that those may carry who hold them, (n, r).

        ``beyond`` (r,): how far places of robots' grips come after those of the nodes.
        """
        grips = states[:, : self.tables.robots].clip(min=0)
        grips = np.where(grips > 0, grips + beyond, 0)
        order = np.argsort(grips, axis=1, kind="stable")
        return np.take_along_axis(grips, order, axis=1), most[order]

    def _answers(self, bricks: int, held: Ints, below: float) -> tuple[Floats, Floats, Bools]:
        """Return values (n, g), forces (n, r) and feasibility (n,) of places held.

        Over scenarios they are those of the first that exceeds a value of the first goal.
        """
        values = np.zeros((len(held), len(self.problem.goals)))
        forces, fit = np.zeros(held.shape), np.zeros(len(held), dtype=bool)
        count = np.count_nonzero(held, axis=1)
        for grips in np.unique(count).tolist():
            rows = np.flatnonzero(count == grips)
            places = held[rows, held.shape[1] - grips :]
            codes = places @ len(self.numbers) ** np.arange(grips)
            _, first, again = np.unique(codes, return_index=True, return_inverse=True)
            found = ask(self.problem, bricks, self.numbers[places[first]], below)
            values[rows], fit[rows] = found.values[again], found.fit[again]
            forces[rows, held.shape[1] - grips :] = found.forces[again]
            self._models += found.models
        return values, forces, fit

    def amounts(self, values: Floats, found: Transitions) -> Floats:
        """Return the values (m, g) of goals of moves to states with such values."""
        out = values.copy()
        moves = MoveArrays(np.full(len(found.distance), float(found.regrip)), found.distance)
        for k, goal in enumerate(self.problem.goals):
            if goal.moves is not None and (own := own_values(goal)) is not None:
                out[:, k] = own(moves)
        return out


def places(codes: Ints, wanted: Ints, order: Ints | None = None) -> tuple[Ints, Bools]:
    """Return where wanted codes (n,) are among codes (m,), all different, and which are there.

    ``order``: in which codes ascend.
    """
    if not len(codes):
        return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=bool)
    order = np.argsort(codes, kind="stable") if order is None else order
    at = order[np.searchsorted(codes, wanted, sorter=order).clip(max=len(codes) - 1)]
    return at, codes[at] == wanted


def largest_load(problem: States, robot: int, *, stand: bool) -> float:
    """Return the most that a robot of the scene may carry, or has to hold with, N."""
    rules, own = problem.rules, problem.network.scene.robots[robot]
    kept = rules.keeps_payloads(stands=stand)
    most = min(own.payload if kept else np.inf, problem.caps.get(own.name, np.inf))
    return float(most * (1 + LIMIT_TOLERANCE))


def interchangeable(
    book: _RuleBook, most: Sequence[float], *, timed: bool = False
) -> list[tuple[int, ...]]:
    """Return the robots that could change places, group by group; ``timed``: also in time."""
    scene, last = book.network.scene, len(book.network.inner)
    groups: dict[object, list[int]] = {}
    for r in book.team:
        may = tuple(book.places(r, b) for b in range(1, last + 1))
        nodes = tuple(book.newest_nodes[r, b] for b in range(1, last + 1))
        own = scene.robots[r]
        grip = (own.stiffness, own.rotational_stiffness, own.payload)  # tolerances are of these
        arm = own.arm and r  # no other robot is where it is
        takes = own.durations if timed else None
        key = (book.reached[r, last], nodes, may, most[r], grip, arm, takes)
        groups.setdefault(key, []).append(r)
    return [tuple(group) for group in groups.values() if len(group) > 1]
