r"""How long a build takes, by constraint programming (CP-SAT): exact.

A plan is a path through states, so a circuit with an arc from its end to the start, and a loop at
every state that it does not pass. With :math:`y_a \in \{0, 1\}` for every act, which takes
:math:`p_a` to be prepared and :math:`d_a` to be done, whole :math:`T_v` for when state :math:`v` is
reached and :math:`\rho_{v r}` since when robot :math:`r` is free in it,

.. math::

   \min \; C \quad\text{s.t.}\quad & \operatorname{circuit}(y), \qquad
   y_a \Rightarrow T_w \ge T_v + d_a, \quad T_w \ge \rho_{v r} + p_a + d_a, \\
   & y_a \Rightarrow \rho_{w s} \ge \rho_{v s} \; (s \text{ stays free}), \quad
   \rho_{w s} \ge T_v + d_a \; (s \text{ lets go}), \qquad C \ge T_v \text{ at an end},

for every act :math:`a` of robot :math:`r` from :math:`v` to :math:`w`. That no robot does two
things at once follows, and is said as well, since it bounds what is left to decide: over the robots
of a kind,

.. math::

   \lvert K \rvert \, C \ge \sum_a y_a \bigl( d_a \, \#\{ r \in K \text{ holds or acts} \}
   + p_a \, [r_a \in K] \bigr) .

Moves that are on no path which prices allow to end before the first plan are left out. Times are
whole numbers of milliseconds at the most; where durations are not, bounds give way by as much.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np

from formulations.times._labels import Caps, Sweep
from formulations.times._prices import useful
from formulations.times._stages import Asked, Chosen, in_time
from seqopt.arrays import Bools, Ints
from seqopt.errors import ExtraError, ProblemError
from seqopt.graph.paths import distances
from seqopt.graph.timed import NOW
from seqopt.plan.calling.formulation import FormulationKind

FINEST = 1000  # parts of a second
OFTEN = 1000  # acts after which it is asked whether time is over


def _solver() -> ModuleType:
    """Return OR-tools' model of constraint programs; an `ExtraError` names the extra."""
    try:
        from ortools.sat.python import cp_model  # noqa: PLC0415  # an extra
    except ModuleNotFoundError:
        raise ExtraError(
            "makespan_cp needs OR-tools, which is not installed: pip install 'seqopt[cp]'"
        ) from None
    return cp_model


@dataclass(frozen=True, eq=False)
class _Scaled:
    """Acts of the moves that are left, in whole parts of a second.

    ``act`` (a,): numbers of acts; ``prepares``, ``acts`` (a,): what they take; ``parts``: of a
    second; ``slack``: by how much a build may be shorter than its parts say, s.
    """

    act: Ints
    prepares: Ints
    acts: Ints
    parts: int
    slack: float


def _scaled(asked: Asked, kept: Bools) -> _Scaled:
    timed = asked.timed
    act = np.flatnonzero(kept[timed.move])
    move = timed.move[act]
    times = np.stack([timed.prepares[move], timed.acts[move]])
    for parts in (1, 2, 10, 100, FINEST):
        whole = np.rint(times * parts)
        if np.allclose(whole, times * parts, rtol=0.0, atol=1e-9):
            return _Scaled(act, *whole.astype(np.int64), parts, 0.0)
    steps = int(timed.graph.states)
    longest = min(steps, 20 * int(timed.levels.max() + 1))
    return _Scaled(act, *np.floor(times * FINEST).astype(np.int64), FINEST, 2 * longest / FINEST)


class _Program:
    """The program of a build in time that is to end before a first one."""

    def __init__(self, asked: Asked, cp: ModuleType, kept: Bools, scaled: _Scaled) -> None:
        self._asked, self._kept, self._scaled, self._cp = asked, kept, scaled, cp
        self._model: Any = cp.CpModel()
        timed = asked.timed
        most = asked.first.value if asked.first.path else asked.caps.time
        most = min(most, asked.caps.time, float(timed.work[:, 0].sum() + timed.prepares.sum()))
        self._most = int(np.floor(most * scaled.parts + 1e-6))
        better = 1 if asked.first.path and most == asked.first.value else 0
        self._end = self._model.new_int_var(0, self._most - better, "")
        graph = timed.graph.only(kept)
        acts = timed.acts[kept] * scaled.parts
        self._soon = np.floor(distances(graph, acts))
        self._late = self._most - np.floor(distances(graph, acts, back=True))

    def build(self) -> bool:
        """Write the program down; return whether time was not over before it was done."""
        timed, model, scaled = self._asked.timed, self._model, self._scaled
        used = np.isfinite(self._soon) & (self._soon <= self._late)
        self._when = {v: self._time(v) for v in np.flatnonzero(used).tolist()}
        self._since: dict[tuple[int, int], Any] = {
            (v, c): model.new_int_var(0, self._most, "")
            for v in self._when
            for c in np.flatnonzero(timed.free[v]).tolist()
        }
        model.add(self._when[0] == 0)
        self.taken = [model.new_bool_var("") for _ in scaled.act]
        arcs = []
        for number, act in enumerate(scaled.act.tolist()):
            if number % OFTEN == 0 and self._asked.watch.over:
                return False
            move = int(timed.move[act])
            pair = int(timed.graph.source[move]), int(timed.graph.target[move])
            if {*pair} <= self._when.keys():
                arcs.append((*pair, self.taken[number]))
                self._take(number, act, pair)
            else:
                model.add(self.taken[number] == 0)
        for v in self._when:
            if v:
                arcs.append((v, v, model.new_bool_var("")))
            if timed.graph.ends[v]:
                over = model.new_bool_var("")
                arcs.append((v, 0, over))
                model.add(self._end >= self._when[v]).only_enforce_if(over)
        model.add_circuit(arcs)
        self._share()
        model.minimize(self._end)
        return True

    def _time(self, v: int) -> Any:
        return self._model.new_int_var(int(self._soon[v]), int(self._late[v]), "")

    def _take(self, number: int, act: int, pair: tuple[int, int]) -> None:
        """Say what follows from an act."""
        before, after = pair
        model, taken, timed = self._model, self.taken[number], self._asked.timed
        own, column = int(self._scaled.acts[number]), int(timed.column[act])
        when = self._when[after]
        model.add(when >= self._when[before] + own).only_enforce_if(taken)
        if column >= 0:
            ready = self._since[before, column] + int(self._scaled.prepares[number])
            model.add(when >= ready + own).only_enforce_if(taken)
        for c, origin in enumerate(timed.origin[act].tolist()):
            if origin == NOW:
                now = self._when[before] + own
                model.add(self._since[after, c] >= now).only_enforce_if(taken)
            elif origin >= 0:
                since = self._since[after, c] >= self._since[before, origin]
                model.add(since).only_enforce_if(taken)

    def _share(self) -> None:
        """Say that no robot does two things at once, and that sums stay within caps."""
        model, timed, scaled = self._model, self._asked.timed, self._scaled
        move = timed.move[scaled.act]
        for k, size in enumerate(timed.sizes.tolist()):
            work = np.floor(timed.work[move, k] * scaled.parts + 1e-9).astype(np.int64).tolist()
            model.add(sum(w * t for w, t in zip(work, self.taken, strict=True)) <= size * self._end)
        for column, cap in self._asked.caps.sums:
            each = timed.graph.amounts[move, column]
            if not np.array_equal(each, np.rint(each)):
                raise ProblemError(
                    "makespan_cp: it keeps totals that are whole numbers, as steps and regrips; "
                    "take makespan_labels"
                )
            whole = each.astype(np.int64).tolist()
            model.add(sum(w * t for w, t in zip(whole, self.taken, strict=True)) <= int(cap))

    def solve(self) -> tuple[Bools, float, bool]:
        """Return which acts are taken, what no build stays below, s, and whether it is proven.

        None are where no build is better.
        """
        solver: Any = self._cp.CpSolver()
        if np.isfinite(self._asked.watch.left):
            solver.parameters.max_time_in_seconds = max(0.01, self._asked.watch.left)
        solver.parameters.num_workers = 1  # the same answer every time
        solver.parameters.linearization_level = 2
        ended = solver.solve(self._model)
        none = np.zeros(len(self.taken), dtype=bool)
        if ended == self._cp.INFEASIBLE:
            return none, np.inf, True
        bound = solver.best_objective_bound / self._scaled.parts - self._scaled.slack
        if ended not in (self._cp.OPTIMAL, self._cp.FEASIBLE):
            return none, bound, False
        found = np.array([solver.boolean_value(each) for each in self.taken])
        return found, bound, ended == self._cp.OPTIMAL


def _least(asked: Asked) -> Chosen:
    """Return the path of least makespan."""
    cp, first = _solver(), asked.first
    most = min(first.value, asked.caps.time)
    kept = useful(asked.timed, asked.prices, asked.kept, most) if np.isfinite(most) else asked.kept
    scaled = _scaled(asked, kept)
    program = _Program(asked, cp, kept, scaled)
    if not program.build():
        return first._replace(late=True)
    taken, bound, done = program.solve()
    bound = max(bound, asked.prices.bound)
    if taken.any():
        first = _path(asked, asked.timed.move[scaled.act[taken]])
    if done and scaled.slack == 0.0:
        bound = first.value
    return Chosen(first.path, first.value, min(bound, first.value), late=not done)


def _path(asked: Asked, moves: Ints) -> Chosen:
    """Return the path of moves with its exact makespan."""
    kept = np.zeros(len(asked.kept), dtype=bool)
    kept[moves] = True
    caps = Caps(sums=asked.caps.sums)
    swept = Sweep(asked.timed, asked.prices, kept, caps).run(asked.watch)
    return Chosen(swept.path, swept.best, asked.prices.bound)


FORMULATION = in_time(
    "makespan_cp",
    "circuit of states with times, by constraint programming",
    FormulationKind.EXACT,
    _least,
)
