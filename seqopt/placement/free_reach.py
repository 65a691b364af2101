"""Whether states that a better free schedule could pass lead to an end: many at a time.

Where goals are worst values and numbers of steps, all that matters of the way to a state is how
long it was. States are therefore met in the order of steps, those of one step and brick count
together, each once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from seqopt.arrays import Bools, Floats, Ints
from seqopt.placement.free_answers import Answers, ask
from seqopt.placement.free_goals import Goal, Measure
from seqopt.placement.free_problem import FreeProblem
from seqopt.placement.free_tables import RuleTables
from seqopt.placement.standing_proof import StandingProof


def counts_alone(goals: Sequence[Goal]) -> bool:
    """Return whether goals are worst values and numbers of steps alone.

    Parameters
    ----------
    goals : sequence of Goal

    Returns
    -------
    bool
    """
    return all(goal.measure in (Measure.PEAK, Measure.STEPS) for goal in goals)


class Reach:
    """Looks for an end through states that are within bounds.

    Parameters
    ----------
    problem : FreeProblem
    tables : RuleTables
    payload : (r,) float
        The most that every robot of the team may carry, N.
    stands : StandingProof

    Attributes
    ----------
    states : int
        How many states the last search passed.
    """

    def __init__(
        self, problem: FreeProblem, tables: RuleTables, payload: Floats, stands: StandingProof
    ) -> None:
        self._problem, self._tables = problem, tables
        self._payload, self._stands = payload, stands
        self._known: dict[tuple[int, int], tuple[pd.Index[int], Answers]] = {}
        self.states = 0

    def finds_end(self, most: Sequence[float]) -> bool:
        """Return whether a plan takes no more of the first goals than bounds say.

        Parameters
        ----------
        most : sequence of float
            Of as many goals, which `counts_alone` accepts.

        Returns
        -------
        bool
        """
        goals = zip(self._problem.goals, most, strict=False)
        longest = min((m for goal, m in goals if goal.measure is Measure.STEPS), default=np.inf)
        reached, seen = {0: self._tables.start()}, dict[int, Ints]()
        self.states, steps = 1, 0
        while reached and steps + 1 <= longest:
            steps += 1
            following: dict[int, list[Ints]] = {}
            for bricks, states in reached.items():
                for after, rows in self._tables.follow(bricks, states):
                    following.setdefault(after, []).append(rows)
            reached = {}
            for bricks, parts in sorted(following.items()):
                fresh, seen[bricks] = self._fresh(np.concatenate(parts), seen.get(bricks))
                if not len(fresh):
                    continue
                states = fresh[self._allowed(bricks, fresh, most)]
                if self._tables.ends(bricks, states).any():
                    return True
                self.states += len(states)
                reached[bricks] = states
        return False

    def _fresh(self, states: Ints, seen: Ints | None) -> tuple[Ints, Ints]:
        """Return the states that were not seen before, each once, and the codes of all seen."""
        codes, first = np.unique(self._tables.codes(states), return_index=True)
        if seen is None or not len(seen):
            return states[first], codes
        new = seen[np.searchsorted(seen, codes).clip(max=len(seen) - 1)] != codes
        return states[first[new]], np.sort(np.concatenate([seen, codes[new]]), kind="stable")

    def _allowed(self, bricks: int, states: Ints, most: Sequence[float]) -> Bools:
        """Return which states take no more than bounds say, are carried, and stand if they must."""
        grips = states[:, : self._tables.robots]
        order = np.argsort(grips, axis=1)
        held, payload = np.take_along_axis(grips, order, axis=1), self._payload[order]
        ok = np.ones(len(states), dtype=bool)
        count = np.count_nonzero(held, axis=1)
        for taken in np.unique(count).tolist():
            rows = np.flatnonzero(count == taken)
            free = held.shape[1] - taken
            found, at = self._answers(bricks, held[rows, free:])
            ok[rows] = found.fit[at] & (found.forces[at] <= payload[rows, free:]).all(axis=1)
            for k, (goal, bound) in enumerate(zip(self._problem.goals, most, strict=False)):
                if goal.measure is Measure.PEAK:
                    ok[rows] &= found.worth[at, k] <= bound
        rows = np.flatnonzero(ok)
        ok[rows] = self._stands.allows_rows(bricks, held[rows], payload[rows], most)
        return ok

    def _answers(self, bricks: int, held: Ints) -> tuple[Answers, Ints]:
        """Return what is known of grip sets of one size, and the rows of those asked for."""
        codes = np.zeros(len(held), dtype=np.int64)
        for column in held.T:
            codes = codes * len(self._tables.nodes) + column
        key = bricks, held.shape[1]
        index, known = self._known.get(key, (pd.Index(codes[:0]), None))
        distinct, first = np.unique(codes, return_index=True)
        fresh = first[index.get_indexer(pd.Index(distinct)) < 0]
        if known is None or len(fresh):
            more = ask(self._problem, bricks, self._tables.nodes[held[fresh]])
            index = index.append(pd.Index(codes[fresh]))
            parts = [more] if known is None else [known, more]
            known = Answers(*map(np.concatenate, zip(*parts, strict=True)))
            self._known[key] = index, known
        return known, np.asarray(index.get_indexer(pd.Index(codes)))
