"""The proof that no free schedule is better: the states that a better one could pass.

Worst values and numbers of steps are proven for many states at once, by tables of the rules; what
else adds up over a build is proven state by state.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from seqopt.placement.free_answers import ask
from seqopt.placement.free_goals import Measure
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.free_reach import Reach, counts_alone
from seqopt.placement.free_tables import RuleTables
from seqopt.placement.requirements import LIMIT_TOLERANCE
from seqopt.placement.standing import slack
from seqopt.placement.standing_proof import StandingProof
from seqopt.sequence.free_check import RuleBook
from seqopt.sequence.free_rules import Ending, Payload
from seqopt.sequence.steps import Grips, StepKind

BELOW = 1e-9  # by how much a plan must be better, over the size of the value
ROUNDING = 1e-12  # by how much it may be worse in a goal before, likewise
REMEMBERED = 50_000  # states of which what follows is kept
State = tuple[int, Grips, int, Grips]  # bricks, grips, regrips since the last, where robots were
Label = tuple[float, ...]  # what the goals that add up took so far
Known = dict[State, list[Label]]
GripSet = tuple[int, ...]
Move = tuple[State, Label, StepKind, State]


class Proof:
    """Looks for plans that are better than claimed, by independent rules and new responses.

    Parameters
    ----------
    problem : FreeProblem

    Attributes
    ----------
    states : int
        How many states were looked at for the first goal.
    """

    def __init__(self, problem: FreeProblem) -> None:
        self._problem = problem
        self._book = RuleBook(problem.network, problem.rules)
        self._parks = any(goal.measure is Measure.TRAVEL for goal in problem.goals)
        self._groups = self._alike()
        self._most = self._loads()
        self._worth: dict[tuple[int, GripSet], tuple[Label, dict[int, float]] | None] = {}
        self._stands = StandingProof(problem, self._most)
        self._follows: dict[State, list[tuple[StepKind, State]]] = {}
        self.states = 0

    def finds_better(self, values: Label, k: int) -> bool:
        """Return whether a plan keeps the goals before one at their values and takes less of it.

        Parameters
        ----------
        values : tuple of float
            Of every goal.
        k : int
            Which goal is to be less.

        Returns
        -------
        bool
        """
        if self._problem.goals[k].of_margins and values[k] == 0:
            return False
        most = [value + ROUNDING * abs(value) for value in values[:k]]
        most.append(self.bound(values, k))
        if counts_alone(self._problem.goals[: k + 1]):
            found = self._reach.finds_end(most)
            self.states += self._reach.states if not k else 0
            return found
        return self._finds_end(most)

    @cached_property
    def _reach(self) -> Reach:
        """For goals that leave nothing to remember of a way but its length."""
        payload = np.array([self._most[r] for r in self._book.team])
        tables = RuleTables(self._book, self._groups)
        return Reach(self._problem, tables, payload, self._stands)

    def _finds_end(self, most: list[float]) -> bool:
        """Return whether a plan takes no more than bounds say, state by state."""
        k = len(most) - 1
        none: Grips = (None,) * len(self._problem.network.scene.robots)
        known: Known = {(0, none, 0, none): [(0.0,) * (k + 1)]}
        for bricks in range(len(self._problem.network.inner) + 1):
            following: Known = {}
            work = [(state, label) for state, labels in known.items() for label in labels]
            while work:
                moves = [(s, label, *move) for s, label in work for move in self._after(s)]
                self._solve({(s[0], _held(s)) for *_, s in moves})
                labels = [self._add(label, s, kind, after, most) for s, label, kind, after in moves]
                work = []
                for after, new in self._standing(moves, labels, most):
                    if not _keep(following if after[0] > bricks else known, after, new):
                        continue
                    if self._book.ends(after[0], after[1]):
                        return True
                    if after[0] == bricks:
                        work.append((after, new))
            self.states += len(known) if not k else 0
            known = following
        return False

    def bound(self, values: Label, k: int) -> float:
        """Return what a plan must stay below to be better in a goal.

        Parameters
        ----------
        values : tuple of float
        k : int

        Returns
        -------
        float
        """
        value, goal = values[k], self._problem.goals[k]
        if goal.of_margins:
            return max(0.0, value - slack(goal.response, value))
        less = float(np.nextafter(value, -np.inf))  # of none there is no share
        return min(less, value - BELOW * abs(value))

    def _standing(
        self, moves: list[Move], labels: list[Label | None], most: list[float]
    ) -> Iterator[tuple[State, Label]]:
        """Yield the states that may be passed, and what goals took on the way to them."""
        found = [(move[3], new) for move, new in zip(moves, labels, strict=True) if new is not None]
        stand = self._stands.allows([(after[0], after[1]) for after, _ in found], most)
        yield from (pair for pair, ok in zip(found, stand, strict=True) if ok)

    def _add(
        self, label: Label, before: State, kind: StepKind, after: State, most: list[float]
    ) -> Label | None:
        """Return what goals took after a step; None if it is more than they may, or not allowed."""
        found = self._worth[after[0], _held(after)]
        if found is None or not self._carried(after[1], found[1]):
            return None
        out = []
        for goal, value, taken, bound in zip(
            self._problem.goals, found[0], label, most, strict=False
        ):
            total = max(taken, value) if goal.measure is Measure.PEAK else taken + value
            if goal.measure is Measure.STEPS:
                total = taken + 1
            elif goal.measure is Measure.REGRIPS:
                total = taken + (kind is StepKind.REPOSITION)
            elif goal.measure is Measure.TRAVEL:
                total = taken + self._way(before, after)
            if total + (self._to_go(after) if goal.measure is Measure.STEPS else 0) > bound:
                return None
            out.append(0.0 if goal.measure is Measure.PEAK else total)
        return tuple(out)

    def _to_go(self, state: State) -> int:
        """Return the least steps after a state: each brick left takes a robot that is free."""
        left = len(self._problem.network.inner) - state[0]
        held = sum(node is not None for node in state[1])
        ends = self._problem.rules.ending is not Ending.HELD and (held > 0 or left > 0)
        return left + max(0, held + left - len(self._book.team)) + ends

    def _after(self, state: State) -> list[tuple[StepKind, State]]:
        """Return the steps that are possible from a state, alike ones once."""
        if state in self._follows:
            return self._follows[state]
        bricks, grips, regrips, stays = state
        found: dict[State, StepKind] = {}
        for kind, count, after, taken in self._book.follow(bricks, grips, regrips):
            rest = stays
            if self._parks:
                rest = tuple(s if g is None else g for g, s in zip(after, stays, strict=True))
            counted = taken if self._problem.rules.regrips is not None else 0
            found.setdefault(self._sorted(count, after, counted, rest), kind)
        out = [(kind, after) for after, kind in found.items()]
        if len(self._follows) < REMEMBERED:
            self._follows[state] = out
        return out

    def _sorted(self, bricks: int, grips: Grips, regrips: int, stays: Grips) -> State:
        """Return a state in which robots that could change places stand in the order of grips."""
        new, rest = list(grips), list(stays)
        for group in self._groups:
            pairs = [(-1 if grips[r] is None else grips[r], stays[r] or -1) for r in group]
            order = sorted(range(len(group)), key=pairs.__getitem__)
            for r, i in zip(group, order, strict=True):
                new[r], rest[r] = grips[group[i]], stays[group[i]]
        return bricks, tuple(new), regrips, tuple(rest)

    def _alike(self) -> list[tuple[int, ...]]:
        """Return the robots that could change places, group by group."""
        scene, last = self._problem.network.scene, len(self._problem.network.inner)
        groups: dict[object, list[int]] = {}
        for r in self._book.team:
            name = scene.robots[r].name
            may = not self._problem.rules.placers or name in self._problem.rules.placers
            nodes = [self._book.newest_nodes[r, b] for b in range(1, last + 1)]
            key = (self._book.reached[r, last], tuple(nodes), may, self._loads()[r])
            groups.setdefault(key, []).append(r)
        return [tuple(group) for group in groups.values() if len(group) > 1]

    def _loads(self) -> dict[int, float]:
        """Return the most that every robot may carry, N."""
        out = {}
        for r, robot in enumerate(self._problem.network.scene.robots):
            kept = self._problem.rules.payload is Payload.KEPT
            cap = min(robot.payload if kept else np.inf, self._problem.caps.get(robot.name, np.inf))
            out[r] = cap * (1 + LIMIT_TOLERANCE)
        return out

    def _carried(self, grips: Grips, forces: dict[int, float]) -> bool:
        held = ((r, node) for r, node in enumerate(grips) if node is not None)
        return all(forces[node] <= self._most[r] for r, node in held)

    def _way(self, before: State, after: State) -> float:
        """Return how far the robot went that took a grip: places may have changed, ways not."""
        scene = self._problem.network.scene
        fresh = [n for n in after[1] if n is not None and n not in before[1]]
        if not fresh:
            return 0.0
        left = [s for g, s in zip(after[1], after[3], strict=True) if g is None]
        stayed = [s for g, s in zip(before[1], before[3], strict=True) if g is None]
        for stay in left:
            stayed.remove(stay)
        if stayed[0] is None:
            return 0.0
        ends = [scene.node_position(node) for node in (stayed[0], fresh[0])]
        return float(np.linalg.norm(np.array(ends[0]) - np.array(ends[1])))

    def _solve(self, asked: Iterable[tuple[int, GripSet]]) -> None:
        """Ask the engine for the grip sets that are not known yet."""
        alike: dict[tuple[int, int], list[GripSet]] = {}
        for bricks, held in sorted(asked):
            if (bricks, held) not in self._worth:
                alike.setdefault((bricks, len(held)), []).append(held)
        for (bricks, count), sets in alike.items():
            grips = np.array(sets, dtype=np.int64).reshape(len(sets), count)
            found = ask(self._problem, bricks, grips)
            rows = zip(sets, found.worth.tolist(), found.forces.tolist(), found.fit, strict=True)
            for held, worth, forces, fits in rows:
                known = (tuple(worth), dict(zip(held, forces, strict=True))) if fits else None
                self._worth[bricks, held] = known


def _held(state: State) -> GripSet:
    return tuple(sorted(node for node in state[1] if node is not None))


def _keep(known: Known, state: State, label: Label) -> bool:
    """Keep a label unless one that is known takes no more of anything; say which."""
    labels = known.get(state, [])
    if any(all(a <= b for a, b in zip(old, label, strict=True)) for old in labels):
        return False
    better = [o for o in labels if not all(a <= b for a, b in zip(label, o, strict=True))]
    known[state] = [*better, label]
    return True
