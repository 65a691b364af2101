"""States that a better plan could pass: responses, limits and stability, computed anew.

Nothing that a search keeps is believed; what this judge computed once for a grip set it keeps. Some
criteria depend on who holds, or rank the choices of a level. For these the judge lists the choices
by its own table of holds, asks the engine of all of them, and counts ranks by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, KnownRows
from seqopt.graph.graph import strictly_below, tied
from seqopt.graph.states import States
from seqopt.judge._rule_moves import Choices, RuleTables, ScheduleTables, Transitions
from seqopt.judge.certificate import _own_values, _twin_of, exceeds
from seqopt.problem.amounts import LARGEST, NONE, MoveArrays, StateArrays
from seqopt.problem.requirements import LIMIT_TOLERANCE
from seqopt.responses._grip_sets import Block, ScenarioSets, solve_sets
from seqopt.responses.quantities import robot_response
from seqopt.scene.parts import Prop
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import _RuleBook
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step
from seqopt.stability.standing import Standing, StandingSets

Tables: TypeAlias = RuleTables | ScheduleTables
"""What rules or a schedule allow, level by level."""
Responses = Mapping[str, Floats]
_Table = tuple[Ints, Floats, Bools]  # codes of choices, values of goals, and what keeps limits


def _block(problem: States, bricks: int, grips: Ints) -> Block:
    """Return the question for the named responses of grip sets (S, r)."""
    names = tuple(name for name in problem.named if name != LARGEST)
    props = tuple(n for n, _ in props_that_hold(problem.network.scene, bricks, grips.shape[1]))
    return Block(bricks, grips, names, screen=False, props=props)


def _solve(problem: States, bricks: int, grips: Ints) -> Floats:
    """Return the named responses of grip sets (S, r), and then the forces of their grips."""
    return solve_sets(problem.engine, _block(problem, bricks, grips), problem.resources)


def _solve_to_round(problem: States, bricks: int, grips: Ints) -> Floats:
    """Return the same, so that what ranks round them to is certain: six digits where these do."""
    block = replace(_block(problem, bricks, grips), screen=True, errors=True)
    rows, errors = np.hsplit(solve_sets(problem.engine, block, problem.resources), 2)
    units: Any = problem.criterion.settings["resolution"]
    unit = np.array([units[name[0]] for name in block.names] + [units["F"]] * grips.shape[1])
    size = np.abs(np.where(np.isfinite(rows), rows, 0.0)) / unit
    close = (np.abs(size % 1.0 - 0.5) <= errors / unit).any(axis=1)
    rows[close] = _solve(problem, bricks, grips[close])
    return rows


def _by_name(problem: States, rows: Floats) -> tuple[dict[str, Floats], Floats]:
    """Return responses by name and forces (S, r), of what `_solve` returned."""
    names = [name for name in problem.named if name != LARGEST]
    found, forces = dict(zip(names, rows.T, strict=False)), rows[:, len(names) :]
    return found | {LARGEST: forces.max(axis=1, initial=0.0)}, forces


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
        twins = (_twin_of(goal) for goal in problem.goals if not goal.is_peak)
        self._to_go = next((twin.to_go for twin in twins if twin and twin.to_go), None)
        self._levels = LevelTables(self)
        self._together = ScenarioSets(problem.scenarios, problem.resources)
        self._models = 0

    @property
    def models(self) -> int:
        """How often the engine was asked of a grip set, in any scenario."""
        return self._models + self._levels.rows.count

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
        for k, twin in enumerate(map(_twin_of, goals)):
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
            found, borne, able = self._ask(bricks, self.numbers[places[first]], below)
            values[rows], fit[rows] = found[again], able[again]
            forces[rows, held.shape[1] - grips :] = borne[again]
        return values, forces, fit

    def _ask(self, bricks: int, grips: Ints, most: float) -> tuple[Floats, Floats, Bools]:
        """Return values (S, g), forces (S, r) and feasibility (S,) of grip sets by the engine.

        ``most``: over scenarios, what the first goal takes more of in one is not asked of the next.
        """
        problem = self.problem
        if not problem.each:
            self._models += len(grips)
            return self._ask_engine(problem, bricks, grips, _solve(problem, bricks, grips))
        values, ahead = np.zeros((len(grips), len(problem.goals))), 0
        forces, fit = np.zeros(grips.shape), np.ones(len(grips), dtype=bool)
        for number, each in enumerate(problem.each):
            rows = np.flatnonzero(fit & (values[:, 0] <= most))
            if not len(rows):
                break
            if number == ahead:  # of one scenario, then of three, nine and so on together
                ahead, base = min(3 * number + 1, len(problem.each)), rows
                block = _block(each, bricks, grips[rows])
                known = self._together.solve(range(number, ahead), block)
            if number in known:
                found = known[number][np.searchsorted(base, rows)]
            else:
                found = _solve(each, bricks, grips[rows])
            own, borne, fit[rows] = self._ask_engine(each, bricks, grips[rows], found)
            values[rows] = problem.joined(values[rows], own, number)
            forces[rows] = np.maximum(forces[rows], borne)
            self._models += len(rows)
        return values, forces, fit

    def _ask_engine(
        self, problem: States, bricks: int, grips: Ints, rows: Floats
    ) -> tuple[Floats, Floats, Bools]:
        """Return the same of one scenario; ``rows``: as of `_solve`."""
        (found, forces), scene = _by_name(problem, rows), problem.network.scene
        fit = np.asarray(np.isfinite(rows).all(axis=1))
        for limit in problem.limits:
            fit &= ~exceeds(limit, found.get(limit.response, np.zeros(len(grips))))
        free = ((0, 0), (0, len(scene.robots) - grips.shape[1]))
        nodes = np.pad(scene.grip_kinds.split(grips)[0], free, constant_values=NONE)
        borne, most = np.pad(forces, free), np.full(nodes.shape, np.inf)
        seen = StateArrays(bricks, nodes, found, borne, most, fit, problem.criterion, grips)
        for each in problem.filters:  # without a twin nothing is refused: a bound stays one
            left = np.flatnonzero(fit)
            if len(left):
                fit[left] = ~each.refuted_again(seen.only(left))
        seen, values = seen._replace(possible=fit), np.zeros((len(grips), len(problem.goals)))
        for k, goal in enumerate(problem.goals):  # of no moves; others `LevelTables` writes
            if goal.states is not None and k not in self._levels.columns:
                value = _own_values(goal)
                values[:, k] = 0.0 if value is None else value(seen)
        return values, forces, fit & np.isfinite(values).all(axis=1)

    def of_steps(self, steps: Sequence[Step]) -> Floats:
        """Return values (n, g) of goals that depend on other choices, a row for every step."""
        out = np.zeros((len(steps), len(self.problem.goals)))
        for k, step in enumerate(steps):
            row = self.tables.row(step.grips)
            self._levels.fill(k + 1, row, out[k : k + 1], np.ones(1, dtype=bool))
        return out

    def amounts(self, values: Floats, found: Transitions) -> Floats:
        """Return the values (m, g) of goals of moves to states with such values."""
        out = values.copy()
        moves = MoveArrays(np.full(len(found.distance), float(found.regrip)), found.distance)
        for k, goal in enumerate(self.problem.goals):
            if goal.moves is not None and (own := _own_values(goal)) is not None:
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


def props_that_hold(scene: Scene, bricks: int, robots: int) -> list[tuple[int, Prop]]:
    """Return props by the numbers of their grips, with so many bricks and robots that hold."""
    if not robots and bricks >= len(scene.build_order):
        return []
    kinds, first, out = scene.grip_kinds, len(scene.robots), []
    stand = {node for brick in scene.placed[:bricks] for node in brick.nodes}
    for i, prop in enumerate(scene.props):
        if prop.node in stand:
            kind = int(kinds.of_robot[first + i]) if len(kinds.turns) > 1 else 0
            out.append((prop.node + kinds.span * kind, prop))
    return out


def depends_on_robots(problem: States) -> list[int]:
    """Return the columns of goals that depend on who holds, or on other candidates."""
    beside = problem.asked - {*problem.named}
    return [
        k
        for k, goal in enumerate(problem.goals)
        if (goal.of_criterion and problem.by_robot) or beside & {*goal.responses}
    ]


class LevelTables:
    """Values of goals, and limits on who moves, for all choices of a level; each level once."""

    def __init__(self, evaluator: StateEvaluator) -> None:
        self._evaluator, problem = evaluator, evaluator.problem
        self.columns = depends_on_robots(problem)
        self.is_needed = bool(self.columns or any(e.response == "F_move" for e in problem.limits))
        others = [k for k, g in enumerate(problem.goals) if g.states and k not in self.columns]
        beside = [*others, *problem.filters, *(e for e in problem.limits if e.response != "F_move")]
        self.is_enough = self.is_needed and not beside and np.isinf(evaluator.most).all()
        ranks = "resolution" in problem.criterion.settings and not problem.limits
        ranks &= all(problem.goals[k].of_criterion for k in self.columns)
        self._solve = _solve_to_round if self.is_enough and ranks else _solve
        engines = tuple(one.engine for one in problem.each or (problem,))
        key = "tables", engines, problem.goals, problem.weights, problem.limits
        self._known: dict[int, _Table] = problem.judged.setdefault(key, {})
        self.rows: KnownRows = problem.judged.setdefault("rows", KnownRows())

    def fill(self, level: int, states: Ints, values: Floats, ok: Bools) -> None:
        """Write the values (n, g) of these goals, and which states (n,) keep the limits."""
        if not self.is_needed or not len(states):
            return
        if level not in self._known:
            self._known[level] = self._table(level)
        codes, known, kept = self._known[level]
        if not len(codes):
            ok[:] = False
            return
        own = self._evaluator.tables.codes(states.clip(min=0))
        at = np.searchsorted(codes, own).clip(max=len(codes) - 1)
        values[:, self.columns] = known[at]
        ok &= kept[at] & (codes[at] == own)  # a hint may name what is no choice

    def _table(self, level: int) -> _Table:
        """Return codes of the choices of a level, ascending, values of goals, and what is kept."""
        problem, tables = self._evaluator.problem, self._evaluator.tables
        choices = tables.choices(level)
        out = np.zeros((len(choices.states), len(problem.goals)))
        ok = np.ones(len(choices.states), dtype=bool)
        for number, one in enumerate(problem.each or (problem,)):
            own, kept = self._values(one, level, choices)
            out, ok = problem.joined(out, own, number), ok & kept
        codes = tables.codes(choices.states)
        order = np.argsort(codes)
        return codes[order], out[order][:, self.columns], ok[order]

    def _values(self, one: States, level: int, choices: Choices) -> tuple[Floats, Bools]:
        """Return values (n, g) of choices in one scenario, and which keep limits on who moves."""
        found = self._responses(one, level, choices)
        fit = np.ones(len(choices.states), dtype=bool)
        for name in one.named:
            fit &= np.isfinite(found[name])
        ok = np.ones(len(choices.states), dtype=bool)
        for limit in (each for each in one.limits if each.response == "F_move"):
            ok &= ~exceeds(limit, found["F_move"])
        out, none = np.zeros((len(ok), len(one.goals))), np.zeros((len(ok), 0))
        held, rows = choices.states[:, :0], choices.states
        seen = StateArrays(choices.bricks, held, found, none, none, fit, one.criterion, rows)
        for k in self.columns:
            goal = one.goals[k]
            if goal.of_criterion and one.is_relative:
                out[:, k] = _relative(one.criterion, found, choices)
            else:
                value = _own_values(goal)
                assert value is not None  # a goal of states has one
                out[:, k] = value(seen)
        return out, ok

    def _responses(self, one: States, level: int, choices: Choices) -> dict[str, Floats]:
        """Return responses (n,) of choices by name, forces of robots among them; NaN of none."""
        holding, numbers = self._evaluator.grips(choices.states)
        order, bricks, count = np.argsort(numbers, axis=1), choices.bricks, numbers.shape[1]
        grips = np.take_along_axis(numbers, order, axis=1)
        codes = grips @ (1 + self._evaluator.numbers.max()) ** np.arange(count)
        key = one.engine, bricks, count, tuple(one.named), self._solve
        rows = self.rows.of(key, codes, lambda new: self._solve(one, bricks, grips[new]))
        found, sorted_forces = _by_name(one, rows)
        forces = np.zeros(grips.shape)
        np.put_along_axis(forces, order, sorted_forces, axis=1)
        robots, none = one.network.scene.robots, np.full(len(grips), np.nan)
        by_robot = dict.fromkeys(range(len(robots)), none)
        by_robot |= zip(holding, forces.T, strict=True)
        moving = none if choices.moves == () else by_robot[choices.moves[-1]]
        own = {robot_response(robots[r].name): force for r, force in by_robot.items()}
        return {**found, **own, "F_move": moving}


def _relative(criterion: Any, found: Responses, choices: Choices) -> Floats:
    """Return costs (n,) among the choices of a level; zero where no grip is open."""
    if not choices.moves:
        return np.zeros(len(choices.states))
    weights = criterion.settings.get("weights", {}).get("from_crown_on")
    if weights is None:
        shaped = {name: choices.spread(values) for name, values in found.items()}
        return np.asarray(
            criterion.costs(shaped, choices.decided_at, choices.sizes[-1])[choices.possible]
        )
    settings = criterion.settings
    if settings["crown"] is None or choices.decided_at < settings["crown"]:
        weights = settings["weights"]["before_crown"]
    total = np.zeros(len(choices.states))
    for name, weight in weights.items():
        rounded = np.round(found[name] / settings["resolution"][name[0]])
        total += weight * _ranks(rounded, choices, by_row=settings["ranked"] == "conditional")
    return np.asarray(total / sum(weights.values()))


def _ranks(values: Floats, choices: Choices, *, by_row: bool) -> Floats:
    """Return mean ranks of whole numbers among all choices (n,), scaled to those of one move.

    ``by_row``: of two moves among the candidates of the later one, given the one before.
    """
    count, known = choices.sizes[-1], np.isfinite(values)
    if not known.any():
        return np.full(len(values), 0.5 * (count + 1))
    if by_row:
        rows = np.atleast_2d(choices.spread(values))
        ranks = np.array([_mean_ranks(row) for row in rows])
        return np.asarray(ranks.reshape(choices.possible.shape)[choices.possible])
    out = _mean_ranks(values)
    if len(choices.sizes) > 1:
        out = (out - 0.5) * count / known.sum() + 0.5
    return out


def _mean_ranks(values: Floats) -> Floats:
    """Return ranks from 1, ties sharing the mean of theirs; NaN of what is no number."""
    known, out = np.isfinite(values), np.full(len(values), np.nan)
    _, place, times = np.unique(values[known], return_inverse=True, return_counts=True)
    out[known] = (np.cumsum(times) - 0.5 * (times - 1))[place]
    return out
