"""What states cost that depends on who holds, or on the candidates of a level, computed anew.

Such a criterion ranks the choices of open grips, or names single robots. The judge lists the
choices by its own table of holds, asks the engine of all of them, and counts ranks by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, KnownRows
from seqopt.graph.states import States
from seqopt.judge._rule_moves import Choices
from seqopt.judge._step_checks import props_that_hold
from seqopt.judge._twin import exceeds, own_values
from seqopt.problem.amounts import LARGEST, StateArrays
from seqopt.responses._grip_sets import Block, solve_sets
from seqopt.responses.quantities import robot_response

Responses = Mapping[str, Floats]
_Table = tuple[Ints, Floats, Bools]  # codes of choices, values of goals, and what keeps limits


def depends_on_robots(problem: States) -> list[int]:
    """Return the columns of goals that depend on who holds, or on other candidates."""
    beside = problem.asked - {*problem.named}
    return [
        k
        for k, goal in enumerate(problem.goals)
        if (goal.of_criterion and problem.by_robot) or beside & {*goal.responses}
    ]


class LevelTables:
    """Values of goals, and limits on who moves, for all choices of a level; each level once.

    ``evaluator``: `seqopt.judge._states.StateEvaluator` of a schedule.
    """

    def __init__(self, evaluator: Any) -> None:
        self._evaluator, problem = evaluator, evaluator.problem
        self.columns = depends_on_robots(problem)
        self.is_needed = bool(self.columns or any(e.response == "F_move" for e in problem.limits))
        others = [k for k, g in enumerate(problem.goals) if g.states and k not in self.columns]
        beside = [*others, *problem.filters, *(e for e in problem.limits if e.response != "F_move")]
        self.is_enough = self.is_needed and not beside and np.isinf(evaluator.most).all()
        engines = tuple(one.engine for one in problem.each or (problem,))
        key = "tables", engines, problem.goals, problem.weights, problem.limits
        self._known: dict[int, _Table] = problem.judged.setdefault(key, {})
        self._rows: KnownRows = problem.judged.setdefault("rows", KnownRows())

    @property
    def models(self) -> int:
        """How many models were solved for all levels that were asked for."""
        return self._rows.count

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
                value = own_values(goal)
                assert value is not None  # a goal of states has one
                out[:, k] = value(seen)
        return out, ok

    def _responses(self, one: States, level: int, choices: Choices) -> dict[str, Floats]:
        """Return responses (n,) of choices by name, forces of robots among them; NaN of none."""
        names, bricks = tuple(name for name in one.named if name != LARGEST), choices.bricks
        holding, numbers = self._evaluator.grips(choices.states)
        order = np.argsort(numbers, axis=1)
        grips = np.take_along_axis(numbers, order, axis=1)
        props = tuple(n for n, _ in props_that_hold(one.network.scene, bricks, grips.shape[1]))

        def solved(new: Ints) -> Floats:
            block = Block(bricks, grips[new], names, screen=False, props=props)
            return solve_sets(one.engine, block, one.resources)

        codes = grips @ (1 + self._evaluator.numbers.max()) ** np.arange(grips.shape[1])
        rows = self._rows.of((one.engine, bricks, grips.shape[1], names), codes, solved)
        forces = np.zeros(grips.shape)
        np.put_along_axis(forces, order, rows[:, len(names) :], axis=1)
        found = dict(zip(names, rows.T, strict=False))
        found[LARGEST] = forces.max(axis=1, initial=0.0)
        robots = one.network.scene.robots
        none = np.full(len(grips), np.nan)
        by_robot = dict.fromkeys(range(len(robots)), none) | dict(
            zip(holding, forces.T, strict=True)
        )
        moving = none if choices.moves == () else by_robot[choices.moves[-1]]
        own = {robot_response(robots[r].name): force for r, force in by_robot.items()}
        return {**found, **own, "F_move": moving}


def values_by_level(evaluator: Any, rows: Sequence[Ints]) -> Floats:
    """Return values (n, g) of these goals along a path, a row (1, c) for every level."""
    out, tables = np.zeros((len(rows), len(evaluator.problem.goals))), LevelTables(evaluator)
    for k, row in enumerate(rows):
        tables.fill(k + 1, row, out[k : k + 1], np.ones(1, dtype=bool))
    return out


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
