"""The proof that no free schedule is better: a graph of its own, and what no path stays below.

The graph is built anew by a second version of the rules, with responses that the engine computes
again. Which states a search visited may be told, so that many are looked at together; states that
this leaves out are found all the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph._budgets import budget_bounds, is_beyond
from seqopt.graph.duality import lexicographic_bounds
from seqopt.graph.graph import Graph
from seqopt.graph.paths import (
    FAILS,
    PASSES,
    _lazy_path,
    lexicographic,
    reached,
    strictly_below,
    tied,
)
from seqopt.graph.solution import StatePath
from seqopt.graph.states._visits import move_amounts
from seqopt.graph.states.states import States
from seqopt.judge._answers import alike, ask, near, screens
from seqopt.judge._rule_moves import Follows, RuleTables, ScheduleTables
from seqopt.judge._standing_proof import StandingProof
from seqopt.judge._twin import Twin
from seqopt.problem.problem import Measure
from seqopt.problem.requirements import LIMIT_TOLERANCE
from seqopt.responses._grip_sets import KnownRows
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence._rule_check import RuleBook
from seqopt.sequence.rules import Payload
from seqopt.sequence.schedule import Schedule

FEW = 500  # grip sets of which all digits take no longer than to ask some of them twice


Tables: TypeAlias = RuleTables | ScheduleTables
"""What rules or a schedule allow, level by level."""


class Asked(NamedTuple):
    """What states must keep to.

    ``values``: of goals; the first that is about no margin bounds states, if it is about a worst
    step; ``margins``: with which states must stand, as is demanded and by the first goals; None
    does not ask; ``exact``: whether all values have all digits, or those that decide about these;
    ``strict``: whether states must take less of that goal, not the same.
    """

    values: Sequence[float] = ()
    margins: Sequence[float] | None = None
    exact: bool = False
    strict: bool = False


class Closed(NamedTuple):
    """States of one level that may be passed.

    ``codes`` (n,); ``states`` (n, c); ``values`` (n, g): what goals take of them; ``follows``: what
    the rules allow after them, by rows of these states.
    """

    codes: Ints
    states: Ints
    values: Floats
    follows: list[Follows]


class Passable:
    """Which states may be passed, with responses that the engine computes again.

    ``margins``: how many goals are about margins; they come first.
    """

    def __init__(self, problem: States) -> None:
        self.problem = problem
        most, own = _loads(problem, stand=False), _loads(problem, stand=True)
        self.tables = _tables(problem, most)
        self.stands = StandingProof(problem, own)
        self._most = np.array([most[r] for r in self.tables.team])
        self._payload = np.array([own[r] for r in self.tables.team])
        self._known = KnownRows()
        kinds, nodes = problem.network.scene.grip_kinds, self.tables.nodes
        more = [kind * kinds.span for kind in range(len(kinds.turns))]
        self._numbers = np.concatenate([nodes + each for each in more])  # of grips, by place
        self._beyond = len(nodes) * kinds.of_robot[list(self.tables.team)]
        self.margins = sum(goal.of_margins for goal in problem.goals)
        self._exact = not screens(problem)  # whether all digits count

    def least(self) -> tuple[float, ...]:
        """Return what goals take at least of any plan, for its end and the count of its steps.

        Every move to the one end that builds have is a cut. Minus infinity where nothing is known.
        """
        goals, tables = self.problem.goals, self.tables
        end, counted = dict(tables.certain()).get(tables.last), float(tables.least_steps())
        last = np.full((1, len(goals)), -np.inf if end is None else 0.0)
        if end is not None and tables.bricks_at(tables.last):
            bricks, held = tables.bricks_at(tables.last), self._held(end, self._most, self._beyond)
            last = self._answers(bricks, held[0], Asked(exact=True), np.inf)[0]
        known = {Measure.PEAK: last[0], Measure.STEPS: np.full(len(goals), counted)}
        none = np.full(len(goals), -np.inf)
        return tuple(float(known.get(goal.measure, none)[k]) for k, goal in enumerate(goals))

    def bars(self, margins: Sequence[float]) -> bool:
        """Return whether a state that every plan passes is not allowed, or lacks such margins."""
        asked = Asked((), margins, exact=True)
        return any(not self.valued(*state, asked)[1].all() for state in self.tables.certain())

    def closed(self, level: int, entries: Ints, asked: Asked) -> Closed:
        """Return the states that are reached from some without placing a brick.

        ``entries`` (n, c): some of them perhaps more than once; ``asked``: as of `valued`, which
        says which ones may be passed.
        """
        seen, count, fresh = np.zeros(0, dtype=np.int64), 0, entries
        parts = [Closed(seen, entries[:0], np.zeros((0, len(self.problem.goals))), [])]
        while len(fresh):
            own, at = np.unique(self.tables.codes(fresh), return_index=True)
            new = ~np.isin(own, seen, assume_unique=True)
            seen, rows = np.concatenate([seen, own[new]]), fresh[at[new]]
            values, ok = self.valued(level, rows, asked)
            follows = [
                move._replace(source=move.source + count)
                for move in self.tables.follow(level, rows[ok])
            ]
            parts.append(Closed(own[new][ok], rows[ok], values[ok], follows))
            count += int(ok.sum())
            inner = [move.states for move in follows if move.level == level]
            fresh = np.concatenate([entries[:0], *inner])
        return Closed(
            np.concatenate([part.codes for part in parts]),
            np.concatenate([part.states for part in parts]),
            np.concatenate([part.values for part in parts]),
            [move for part in parts for move in part.follows],
        )

    def valued(self, level: int, states: Ints, asked: Asked) -> tuple[Floats, Bools]:
        """Return what goals take of states (n, g), and which a better plan could pass (n,)."""
        goals = self.problem.goals
        if not self.tables.bricks_at(level):
            return np.zeros((len(states), len(goals))), np.ones(len(states), dtype=bool)
        held, payload = self._held(states, self._most, self._beyond)
        most, margins = asked.values, asked.margins
        k, below = self.margins, np.inf
        if len(most) > k and goals[k].measure is Measure.PEAK:
            below = strictly_below(most[k]) if asked.strict else tied(most[k])
        values, forces, ok = self._answers(self.tables.bricks_at(level), held, asked, below)
        ok &= (forces <= payload).all(axis=1) & (values[:, k : k + 1] <= below).all(axis=1)
        if margins is not None:
            ok[ok] = self.may_stand(level, states[ok], margins)
        return values, ok

    def _held(self, states: Ints, most: Floats, beyond: Ints | int = 0) -> tuple[Ints, Floats]:
        """Return nodes held, ascending, and the most that those may carry who hold them, (n, r).

        ``beyond`` (r,): how far places of robots' grips come after those of the nodes.
        """
        grips = states[:, : self.tables.robots].clip(min=0)
        grips = np.where(grips > 0, grips + beyond, 0)
        order = np.argsort(grips, axis=1, kind="stable")
        return np.take_along_axis(grips, order, axis=1), most[order]

    def may_stand(self, level: int, states: Ints, margins: Sequence[float]) -> Bools:
        """Return which states (n, c) are not proven to fall, or to lack margins of first goals."""
        held = self._held(states, self._payload)
        return self.stands.allows_rows(self.tables.bricks_at(level), *held, margins)

    def held_by(self, states: Ints) -> tuple[Ints, Floats]:
        """Return nodes that robots hold where states must stand, ascending, and the most forces."""
        return self._held(states, self._payload)

    def recalled(self, level: int, states: Ints, margins: Sequence[float]) -> Ints:
        """Return the same by what is known: -1 where it is proven, else 0 or 1."""
        held = self._held(states, self._payload)
        return self.stands.recalled_rows(self.tables.bricks_at(level), *held, margins)

    def _answers(
        self, bricks: int, held: Ints, asked: Asked, below: float
    ) -> tuple[Floats, Floats, Bools]:
        """Return values, forces of grips and what is within limits, of rows of nodes held.

        Over scenarios they are those of the first that exceeds a value of the first goal.
        """
        below = np.inf if self.margins else below
        goals, robots = len(self.problem.goals), held.shape[1]
        out = np.zeros((len(held), goals + robots + 1))
        count = np.count_nonzero(held, axis=1)
        for taken in np.unique(count).tolist():
            rows = np.flatnonzero(count == taken)
            nodes = held[rows, robots - taken :]
            codes = nodes @ len(self._numbers) ** np.arange(taken)

            def compute(new: Ints, nodes: Ints = nodes) -> Floats:
                return self._computed(bricks, self._numbers[nodes[new]], asked, below)

            key = (bricks, taken, below, asked.exact, *asked.values)
            found = self._known.of(key, codes, compute)
            out[rows, :goals] = found[:, :goals]
            out[rows, goals + robots - taken :] = found[:, goals:]
        return out[:, :goals], out[:, goals:-1], out[:, -1] > 0

    def _computed(self, bricks: int, grips: Ints, asked: Asked, below: float) -> Floats:
        """Return values, forces and what is within limits of grip sets, side by side.

        Six digits are enough of what is not close to a value or a payload that decides.
        """
        exact = asked.exact or self._exact or len(grips) <= FEW
        found: Floats = np.column_stack(ask(self.problem, bricks, grips, below, rough=not exact))
        if not exact:
            goals = len(self.problem.goals)
            close = near(found[:, goals:-1], self._most)
            for k, value in enumerate(asked.values):
                if self.problem.goals[k].measure is Measure.PEAK:
                    close |= near(found[:, [k]], np.array([value]))
            found[close] = np.column_stack(ask(self.problem, bricks, grips[close], below))
        return found

    def moved(self, values: Floats, found: Follows) -> Floats:
        """Return what goals take of moves to states with such values, (m, g)."""
        taken = np.column_stack([np.full(len(found.way), float(found.regrip)), found.way])
        return move_amounts(self.problem, values, taken)


def _tables(problem: States, most: Mapping[int, float]) -> Tables:
    """Return what rules or a schedule allow."""
    if isinstance(problem.rules, Schedule):
        return ScheduleTables(
            problem.rules, problem.network, parks=problem.parks, worlds=problem.worlds
        )
    book = RuleBook(problem.network, problem.rules, problem.worlds)
    return RuleTables(book, alike(book, most, timed=problem.is_timed), parks=problem.parks)


def _loads(problem: States, *, stand: bool) -> dict[int, float]:
    """Return the most that every robot of the scene may carry, or has to hold with, N."""
    out, rules = {}, problem.rules
    kept = stand if isinstance(rules, Schedule) else rules.payload is Payload.KEPT
    for r, robot in enumerate(problem.network.scene.robots):
        cap = min(robot.payload if kept else np.inf, problem.caps.get(robot.name, np.inf))
        out[r] = cap * (1 + LIMIT_TOLERANCE)
    return out


BELOW = 1e-9  # by how much a plan must be better, over the size of the value
Hint = Mapping[int, Ints]  # states that a search visited, by brick count


class Proof:
    """What no free schedule stays below, by independent rules and new responses.

    ``hint`` (mapping of int to (n, c) int): states that are likely to be passed, by brick count, as
    of `seqopt.sequence._rule_space.FreeSpace`; only time depends on them; ``states``: how many
    states a better plan could pass.
    """

    def __init__(self, problem: States, hint: Hint | None = None) -> None:
        self._passable = Passable(problem)
        self._told = {} if hint is None else _rows(problem, self._passable, hint)
        self.states = 0

    def bounds(self, values: Sequence[float]) -> tuple[float, ...]:
        """Return what no plan stays below in every goal, those before it being at their values.

        ``values``: of every goal; what is said of margins of stability means nothing. Result:
        infinite where there is no plan.
        """
        least = self._passable.least()
        if self._is_better(values, least) is None:
            self.states = 1  # a cut before the end alone
            return least
        if self._is_cut(values):
            return tuple(values)
        out = self._of_paths(Asked(values))
        if self._is_better(values, out) is not None:
            out = self._of_paths(Asked(values, exact=True))
        return out

    def _is_cut(self, values: Sequence[float]) -> bool:
        """Return whether states strictly below the one worst value there is reach no end."""
        if [goal.measure for goal in self._passable.problem.goals] != [Measure.PEAK]:
            return False
        graph = Levels(self._passable, self._told, Asked(values, strict=True)).graph()
        seen = reached(graph)
        self.states = int(seen.sum())
        return not graph.ends[seen].any()

    def _of_paths(self, asked: Asked) -> tuple[float, ...]:
        """Return bounds by the paths of states that are not proven to fall."""
        levels = Levels(self._passable, self._told, asked)
        graph, values = levels.graph(), asked.values
        while True:
            out = lexicographic_bounds(graph, values)
            better = self._is_better(values, out) is not None
            fallen = self._fallen(levels, graph, values) if better else ()
            if not len(fallen):
                self.states = int(reached(graph).sum())
                return out
            graph = graph.only(~np.isin(graph.target, fallen))

    def budget_bounds(
        self, values: Sequence[float], claimed: Sequence[float], prices: Sequence[Sequence[float]]
    ) -> tuple[float, ...]:
        """Return the same for plans within budgets, by prices that a formulation gives."""
        caps, margins = self._passable.problem.budgets, values[: self._passable.margins]
        stand = margins if self._passable.stands.asked(margins) else None
        levels = Levels(self._passable, self._told, Asked(values, stand, exact=True))
        self.states = sum(map(len, levels.states))
        return budget_bounds(levels.graph(), values, claimed, (caps, prices))

    def timed_bounds(
        self, twin: Twin, values: Sequence[float], found: StatePath
    ) -> tuple[float, ...]:
        """Return the same for measures of whole paths, by their twin, of a path that is claimed."""
        passable = self._passable
        levels = Levels(passable, self._told, Asked(values, exact=True))
        graph, bounds = levels.graph(), twin.bounds(levels, values, found)
        while True:
            out = (*values[: passable.margins], *bounds(graph))
            early = [b < v - BELOW * abs(v) for b, v in zip(out, values, strict=False)]
            fell = self._fallen(levels, graph, values) if any(early) else ()
            if not len(fell):
                self.states = int(reached(graph).sum())
                return out
            graph = graph.only(~np.isin(graph.target, fell))

    def is_impossible(self, margins: Sequence[float] = ()) -> bool:
        """Return whether no plan is allowed, or none in which all states have such margins.

        States must stand if that is demanded.

        ``margins``: of the first goals.
        """
        caps = self._passable.problem.budgets
        if self._passable.bars(margins):
            self.states = max(self.states, 1)
            return True
        if self._passable.stands.asked(margins) and not caps:
            return self._cuts(margins)
        graph = Levels(self._passable, self._told, Asked((), margins)).graph()
        self.states = max(self.states, graph.states)
        return is_beyond(graph, caps) if caps else not graph.ends[reached(graph)].any()

    def stops_at(self, values: Sequence[float] = ()) -> int | None:
        """Return with how many bricks every plan ends that is as good, at the latest, unfinished.

        ``values``: of goals; of the first alone, if it is about a worst step, or of none. States
        with fewer bricks are all that this depends on. Result: None where a plan may be as good.
        """
        levels, tables = Levels(self._passable, {}, Asked(values, ())), self._passable.tables
        parts = np.repeat(levels.levels, [*map(len, levels.states)])
        graph = levels.graph()
        seen = reached(graph)
        if graph.ends[seen].any():
            return None
        return tables.bricks_at(min(int(parts[seen].max()) + 1, tables.last))

    def _cuts(self, margins: Sequence[float]) -> bool:
        """Return whether states that are proven to fall, or to lack margins, leave no path.

        Which are asked is of no account: without those that fall, no end may be reached.
        """
        passable, levels = self._passable, Levels(self._passable, {}, Asked())
        graph = levels.graph()
        parts = np.repeat(np.arange(len(levels.states)), [*map(len, levels.states)])
        starts = np.searchsorted(parts, np.arange(len(levels.states)))
        known = np.zeros(graph.states, dtype=np.int64)
        known[0] = PASSES

        def of(part: int, rows: Ints) -> tuple[int, Ints, Sequence[float]]:
            return levels.levels[part], levels.states[part][rows - starts[part]], margins

        def ask(part: int, rows: Ints) -> Ints:
            return np.where(passable.may_stand(*of(part, rows)), PASSES, FAILS)

        def recall(part: int, rows: Ints) -> Ints:
            return passable.recalled(*of(part, rows))

        _lazy_path(graph, parts, known, ask, recall)
        left = reached(graph, (known != FAILS)[graph.target])
        self.states = max(self.states, int(left.sum()))
        return not graph.ends[left].any()

    def _is_better(self, values: Sequence[float], bounds: Sequence[float]) -> int | None:
        """Return the first goal whose bound leaves room for a better plan; None if none does."""
        room = [not b >= v - BELOW * abs(v) for v, b in zip(values, bounds, strict=False)]
        return next((k for k in range(self._passable.margins, len(room)) if room[k]), None)

    def _fallen(self, levels: Levels, graph: Graph, values: Sequence[float]) -> Ints:
        """Return the states of a path that would be better that are proven to fall."""
        passable, first, out = self._passable, 0, [np.zeros(0, dtype=np.int64)]
        margins = values[: passable.margins]
        if not passable.stands.asked(margins):
            return out[0]
        try:
            path = np.array(lexicographic(graph).path)
        except InfeasibleError:
            return out[0]
        for level, rows in zip(levels.levels, levels.states, strict=True):
            own = path[(path >= first) & (path < first + len(rows))]
            if len(own):
                out.append(own[~passable.may_stand(level, rows[own - first], margins)])
            first += len(rows)
        return np.concatenate(out)


class Levels:
    """The states that a better plan could pass, level by level, and the moves between them."""

    def __init__(self, passable: Passable, told: Mapping[int, Ints], asked: Asked) -> None:
        self.passable, self._asked = passable, asked
        self.levels, self.states = list[int](), list[Ints]()
        none = np.zeros(0, dtype=np.int64)  # it may end where it begins
        self._moves = [(none, none, np.zeros((0, len(passable.problem.goals))))]
        self._ends: list[Bools] = []
        self._count, tables, start = 0, passable.tables, passable.tables.start()
        coming = self._begin(tables.first, start)
        for level in range(max(1, tables.first), tables.last + 1):
            now = [pair for pair in coming if pair[1].level == level]
            later = [pair for pair in coming if pair[1].level > level]
            fresh = [start[:0], told.get(level, start[:0]), *(move.states for _, move in now)]
            coming = [*later, *self._close(level, np.concatenate(fresh), now)]

    def _begin(self, level: int, start: Ints) -> list[tuple[Ints, Follows]]:
        """Add the state in which the build begins, whatever it takes; return what follows it."""
        self.levels.append(level)
        self.states.append(start)
        self._ends.append(np.zeros(1, dtype=bool))
        self._count += 1
        return [(move.source, move) for move in self.passable.tables.follow(level, start)]

    def _close(
        self, level: int, entries: Ints, coming: list[tuple[Ints, Follows]]
    ) -> list[tuple[Ints, Follows]]:
        """Add the states of a level; return the moves that place the next one."""
        part, tables = self.passable.closed(level, entries, self._asked), self.passable.tables
        moves = [(follows.source + self._count, follows) for follows in part.follows]
        order = np.argsort(part.codes, kind="stable")
        for source, move in [*coming, *(pair for pair in moves if pair[1].level == level)]:
            wanted = tables.codes(move.states)
            at = np.searchsorted(part.codes, wanted, sorter=order)
            kept = at < len(part.codes)
            kept[kept] = part.codes[order[at[kept]]] == wanted[kept]
            target = order[at[kept]]
            taken = move._replace(way=move.way[kept])
            amounts = self.passable.moved(part.values[target], taken)
            self._moves.append((source[kept], self._count + target, amounts))
        self._count += len(part.states)
        self.levels.append(level)
        self.states.append(part.states)
        self._ends.append(tables.ends(level, part.states))
        return [pair for pair in moves if pair[1].level > level]

    def graph(self) -> Graph:
        """Return them as a graph; the moves are then used up."""
        source, target, amounts = map(np.concatenate, zip(*self._moves, strict=True))
        self._moves.clear()
        peaks = tuple(goal.measure is Measure.PEAK for goal in self.passable.problem.goals)
        rows = source.astype(np.int32), target.astype(np.int32)
        return Graph(*rows, amounts, peaks, np.concatenate(self._ends))


def _rows(problem: States, passable: Passable, hint: Hint) -> dict[int, Ints]:
    """Return states of a search as rows of the tables, by brick count.

    Raises `SolverError` if a row is no state: it has too few numbers, or names no node.
    """
    tables, columns = passable.tables, [r for kind in problem.space.kinds for r in kind.robots]
    order = [columns.index(r) for r in tables.team]
    width, nodes = tables.start().shape[1], len(node_numbers(problem.network))
    out = {}
    for bricks, rows in hint.items():
        if rows.shape[1] != width or (np.abs(rows[:, : len(order)]) > nodes).any():
            raise SolverError(f"states that were visited with {bricks} bricks are none")
        own = rows[:, [*order, *range(len(order), width)]].astype(tables.start().dtype)
        out[bricks] = tables.in_order(own)
    return out
