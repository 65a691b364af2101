r"""How long a build takes, by constraint programming (CP-SAT): exact.

A plan is a path through states, step by step. With :math:`y_{i a} \in \{0, 1\}` for every act that
can be step :math:`i`, which takes :math:`p_a` to be prepared and :math:`d_a` to be done, whole
:math:`T_i` for when the step ends and :math:`\rho_{i r}` since when robot :math:`r` is free then,

.. math::

   \min \; T_N \quad\text{s.t.}\quad & \text{what comes to a state leaves it, or ends there}, \qquad
   \textstyle\sum_a y_{i a} \le 1, \qquad T_i \ge T_{i-1} + \sum_a d_a y_{i a}, \\
   & r \text{ takes a grip} \Rightarrow T_i \ge \rho_{i-1, r} + \sum_a (p_a + d_a) \, y_{i a}, \\
   & r \text{ stays free} \Rightarrow \rho_{i r} \ge \rho_{i-1, r}, \qquad
   r \text{ lets go} \Rightarrow \rho_{i r} \ge T_i .

That no robot does two things at once follows, and is a constraint as well, since it bounds what is
left to decide: over the robots of a kind,

.. math::

   \lvert K \rvert \, T_N \ge \sum_{i, a} y_{i a}
   \bigl( d_a \, \#\{ r \in K \text{ holds or acts} \} + p_a \, [r_a \in K] \bigr) .

Moves that are on no path which prices allow to end before the first plan are left out. Times are
whole numbers of milliseconds at the most; where durations are not, bounds give way by as much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from formulations.times._search import in_time
from formulations.times._stages import Asked, Chosen
from seqopt.arrays import Ints
from seqopt.errors import ExtraError, ProblemError
from seqopt.graph._timed import HELD, NOW
from seqopt.graph.formulation import FormulationKind
from seqopt.graph.paths import distances

FINEST = 1000  # parts of a second
WORKERS = 8  # ways to search that take turns


def _solver() -> ModuleType:
    """Return OR-tools' model of constraint programs; an `ExtraError` names the extra."""
    try:
        from ortools.sat.python import cp_model  # noqa: PLC0415  # an extra
    except ModuleNotFoundError:
        raise ExtraError(
            "makespan_cp needs OR-tools, which is not installed, or not for this Python: pip "
            "install 'seqopt[cp]' with Python 3.11 or 3.12"
        ) from None
    return cp_model


@dataclass(frozen=True, eq=False)
class _Scaled:
    """What acts take, in whole parts of a second.

    ``prepares``, ``acts`` (a,): what they take; ``parts``: of a second; ``slack``: by how much a
    build may be longer than its parts say, s.
    """

    prepares: Ints
    acts: Ints
    parts: int
    slack: float


def _scaled(asked: Asked, steps: int) -> _Scaled:
    """Return what acts take, rounded down where it is no whole number; of builds of such steps."""
    timed = asked.timed
    times = np.stack([timed.prepares[timed.move], timed.acts[timed.move]])
    for parts in (1, 2, 10, 100, FINEST):
        whole = np.rint(times * parts)
        if np.allclose(whole, times * parts, rtol=0.0, atol=1e-9):
            return _Scaled(whole[0].astype(np.int64), whole[1].astype(np.int64), parts, 0.0)
    less = np.floor(times * FINEST).astype(np.int64)
    return _Scaled(less[0], less[1], FINEST, 2.0 * steps / FINEST)


def _layers(asked: Asked, most: float) -> tuple[Ints, ...]:
    """Return which moves (m_i,) can be the first, second, … of a build that ends by some time."""
    timed, graph = asked.timed, asked.timed.graph
    move = np.flatnonzero(asked.kept)
    source, target = graph.source[move], graph.target[move]
    costs = [timed.work[move] @ each for each in asked.prices.each]
    before = [np.where(np.arange(graph.states) == 0, 0.0, np.inf) for _ in costs]
    slack, found = 1e-9 * abs(most), list[Ints]()
    while True:
        room = np.ones(len(move), dtype=bool)
        sums = [own[source] + cost for own, cost in zip(before, costs, strict=True)]
        for total, left in zip(sums, asked.prices.left, strict=True):
            room &= total + left[target] <= most + slack
        if not room.any():
            break
        found.append(np.flatnonzero(room))
        before = [np.full(graph.states, np.inf) for _ in costs]
        for own, total in zip(before, sums, strict=True):
            np.minimum.at(own, target[room], total[room])
    on, out = graph.ends.copy(), list[Ints]()
    for every in reversed(found):
        rows = every[on[target[every]]]
        out.append(move[rows])
        on = graph.ends.copy()
        on[source[rows]] = True
    return tuple(out[::-1])


class _Program:
    """The program of a build in time that is to end before a first one."""

    def __init__(self, asked: Asked, cp: ModuleType, scaled: _Scaled, most: float) -> None:
        self._asked, self._scaled, self._cp, self._most = asked, scaled, cp, most
        self._model: Any = cp.CpModel()
        self.taken: list[tuple[Any, int]] = []  # whether a move is taken, and which

    def build(self, layers: Sequence[Ints]) -> bool:
        """Write the program down; return whether time was not over before it was done."""
        timed, model = self._asked.timed, self._model
        columns = range(timed.free.shape[1])
        parts = self._scaled.parts
        better = 1 if self._asked.first.path else 0
        last = int(np.floor(self._most * parts + 1e-6)) - better
        now, since = model.new_constant(0), [model.new_constant(0) for _ in columns]
        here: dict[int, list[Any]] = {0: [model.new_constant(1)]}
        over: list[Any] = []  # whether the build is over by then
        self._end = model.new_int_var(0, last, "end")
        soon, left = self._around()
        first = np.searchsorted(timed.move, np.arange(len(timed.graph.source) + 1))
        for moves in layers:
            if self._asked.watch.over:
                return False
            acts = np.concatenate([np.arange(first[m], first[m + 1]) for m in moves.tolist()])
            taken = [model.new_bool_var("") for _ in acts]
            self.taken += [*zip(taken, timed.move[acts].tolist(), strict=True)]
            source = timed.graph.source[timed.move[acts]].tolist()
            target = timed.graph.target[timed.move[acts]].tolist()
            ended = [model.new_bool_var("") for _ in [v for v in here if timed.graph.ends[v]]]
            self._conserve(here, source, (taken, ended))
            over += ended
            model.add(sum(taken) + sum(over) == 1)
            after = model.new_int_var(0, last, "")
            fresh = [model.new_int_var(0, last, "") for _ in columns]
            self._pass_on((now, since), (after, fresh), acts, taken)
            model.add(after >= sum(t * y for t, y in zip(soon[target], taken, strict=True)))
            rest = sum(t * y for t, y in zip(left[target], taken, strict=True))
            model.add(self._end >= after + rest)
            now, since, here = after, fresh, {}
            for v, each in zip(target, taken, strict=True):
                here.setdefault(v, []).append(each)
        ended = [model.new_bool_var("") for _ in [v for v in here if timed.graph.ends[v]]]
        self._conserve(here, [], ([], ended))
        model.add(self._end >= now)
        self._share()
        model.minimize(self._end)
        return True

    def _around(self) -> tuple[Ints, Ints]:
        """Return when states are reached at the earliest, and what is left after them at least.

        Both follow from prices: nobody is free for longer before than a preparation takes.
        """
        timed, prices, parts = self._asked.timed, self._asked.prices, self._scaled.parts
        graph = timed.graph.only(self._asked.kept)
        soon, left = np.zeros(graph.states), np.zeros(graph.states)
        for each, rest in zip(prices.each, prices.left, strict=True):
            before = distances(graph, timed.work[self._asked.kept] @ each)
            ahead = timed.free @ (each[1:][timed.kinds] * timed.longest)
            soon = np.maximum(soon, np.where(np.isfinite(before), before, 0.0))
            left = np.maximum(left, np.where(np.isfinite(rest), rest - ahead, 0.0))
        less = self._scaled.slack  # what rounding down may have taken
        whole = (np.ceil((own - less) * parts - 1e-6).clip(min=0.0) for own in (soon, left))
        first, then = (own.astype(np.int64) for own in whole)
        return first, then

    def _conserve(
        self, here: dict[int, list[Any]], source: list[int], out: tuple[list[Any], list[Any]]
    ) -> None:
        """Say that what comes to a state leaves it, or the build is over there."""
        taken, ended = out
        leave: dict[int, list[Any]] = {}
        for v, each in zip(source, taken, strict=True):
            leave.setdefault(v, []).append(each)
        ends = [v for v in here if self._asked.timed.graph.ends[v]]
        for v, each in zip(ends, ended, strict=True):
            leave.setdefault(v, []).append(each)
        for v, come in here.items():
            self._model.add(sum(come) == sum(leave.get(v, [])))

    def _pass_on(
        self,
        before: tuple[Any, list[Any]],
        after: tuple[Any, list[Any]],
        acts: Ints,
        taken: list[Any],
    ) -> None:
        """Say when a step ends, and since when robots are free after it."""
        timed, model, scaled = self._asked.timed, self._model, self._scaled
        (now, since), (then, fresh) = before, after
        column, origin = timed.column[acts], timed.origin[acts]
        own = scaled.acts[acts].tolist()
        model.add(then >= now + sum(a * y for a, y in zip(own, taken, strict=True)))
        both = (scaled.acts + scaled.prepares)[acts].tolist()
        for c in range(len(since)):
            mine = np.flatnonzero(column == c).tolist()
            if mine:
                is_own = self._any(mine, taken)
                length = sum(both[i] * taken[i] for i in mine)
                model.add(then >= since[c] + length).only_enforce_if(is_own)
            for o in np.unique(origin[:, c]).tolist():
                if o == HELD:
                    continue
                is_from = self._any(np.flatnonzero(origin[:, c] == o).tolist(), taken)
                what = then if o == NOW else since[o]
                model.add(fresh[c] >= what).only_enforce_if(is_from)

    def _any(self, which: list[int], taken: list[Any]) -> Any:
        """Return whether one of some acts is taken: no more than one of a step is."""
        out = self._model.new_bool_var("")
        self._model.add(sum(taken[i] for i in which) == out)
        return out

    def _share(self) -> None:
        """Say that no robot does two things at once, and that sums stay within caps."""
        model, timed, scaled = self._model, self._asked.timed, self._scaled
        move = np.array([m for _, m in self.taken], dtype=np.int64)
        taken = [each for each, _ in self.taken]
        for k, size in enumerate(timed.sizes.tolist()):
            work = np.floor(timed.work[move, k] * scaled.parts + 1e-9).astype(np.int64).tolist()
            model.add(sum(w * t for w, t in zip(work, taken, strict=True)) <= size * self._end)
        for column, cap in self._asked.caps.sums:
            each = timed.graph.amounts[move, column]
            if not np.array_equal(each, np.rint(each)):
                raise ProblemError(
                    "makespan_cp: it keeps totals that are whole numbers, as steps and regrips; "
                    "take makespan_labels"
                )
            whole = each.astype(np.int64).tolist()
            model.add(sum(w * t for w, t in zip(whole, taken, strict=True)) <= int(cap))

    def solve(self) -> tuple[Ints, float, bool]:
        """Return the chosen moves, the lower bound, s, and whether it is proven.

        None are where no build is better.
        """
        solver: Any = self._cp.CpSolver()
        if np.isfinite(self._asked.watch.left):
            solver.parameters.max_time_in_seconds = max(0.01, self._asked.watch.left)
        solver.parameters.num_workers = WORKERS
        solver.parameters.interleave_search = True  # the same answer every time
        ended = solver.solve(self._model)
        none = np.zeros(0, dtype=np.int64)
        if ended == self._cp.INFEASIBLE:
            return none, np.inf, True
        bound = solver.best_objective_bound / self._scaled.parts - self._scaled.slack
        if ended not in (self._cp.OPTIMAL, self._cp.FEASIBLE):
            return none, bound, False
        found = np.array([m for each, m in self.taken if solver.boolean_value(each)])
        return found, bound, ended == self._cp.OPTIMAL


def _least(asked: Asked) -> Chosen:
    cp, first = _solver(), asked.first
    most = min(first.value, asked.caps.time)
    if not np.isfinite(most):
        return first._replace(late=True)  # nothing says how long builds may take
    layers = _layers(asked, most)
    scaled = _scaled(asked, len(layers))
    program = _Program(asked, cp, scaled, most)
    if not program.build(layers):
        return first._replace(late=True)
    moves, bound, done = program.solve()
    bound = max(bound, asked.prices.bound)
    if len(moves):
        kept = np.zeros(len(asked.kept), dtype=bool)
        kept[moves] = True
        first = min(first, asked.by(kept), key=lambda each: each.value)
    if done and scaled.slack == 0.0:
        bound = first.value
    return Chosen(first.path, first.value, min(bound, first.value), late=not done)


FORMULATION = in_time(
    "makespan_cp",
    "circuit of states with times, by constraint programming",
    FormulationKind.EXACT,
    _least,
)
