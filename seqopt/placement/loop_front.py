"""The Pareto set of a schedule with open grips: which nodes to take for all responses at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.engines.interface import Engine
from seqopt.placement.criteria import WorstRatio
from seqopt.placement.free_front import rounded_up, rounding_steps
from seqopt.placement.free_goals import LARGEST
from seqopt.placement.problem import Problem, pose
from seqopt.placement.requirements import Limit
from seqopt.responses.quantities import CHOSEN_BY
from seqopt.responses.table import analyze, force_column
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step


class LoopFront:
    """The choices of a schedule, all of whose worst responses are to be small at once.

    Parameters
    ----------
    engine : Engine
    schedule : Schedule
        Whose open grips are chosen.
    names : sequence of str
        Responses: ``F_largest``, and those of `seqopt.responses.quantities.CHOSEN_BY`.
    limits : sequence of Limit, optional
        What no open step may exceed.
    rounding : mapping of str to float, optional
        What responses are rounded up to multiples of, SI units; none by default.

    Raises
    ------
    ProblemError
        If there is no such response, or a rounding is no positive number.
    """

    def __init__(
        self,
        engine: Engine,
        schedule: Schedule,
        names: Sequence[str],
        limits: Sequence[Limit] = (),
        rounding: Mapping[str, float] | None = None,
    ) -> None:
        self._names = tuple(names)
        self._round, self._rounding = rounding_steps(self._names, rounding), rounding
        ones = WorstRatio("front", tuple((name, 1.0) for name in names))
        self._problem: Problem = pose(engine, schedule, ones, limits)

    def __repr__(self) -> str:
        return f"<LoopFront of {self._problem.schedule}: {', '.join(self._names)}>"

    def anew(self) -> LoopFront:
        """Return the same problem with nothing known of it, for its judge."""
        posed = self._problem
        return LoopFront(posed.engine, posed.schedule, self._names, posed.limits, self._rounding)

    @property
    def names(self) -> tuple[str, ...]:
        """The responses."""
        return self._names

    @cached_property
    def _costs(self) -> tuple[tuple[Floats, ...], tuple[Floats, ...]]:
        """By move, worst responses of its candidates alone, (C, k), and of pairs, (C, D, k)."""
        sizes = [len(move.candidates) for move in self._problem.schedule.moves]
        none = np.full(len(self._names), -np.inf)
        single = [np.tile(none, (size, 1)) for size in sizes]
        pairs = zip([1, *sizes[:-1]], sizes, strict=True)
        shared = [np.tile(none, (*pair, 1)) for pair in pairs]
        for choices in self._problem.evaluation.steps:
            values = np.stack([choices.responses[name] for name in self._names], axis=-1)
            forbidden = ~np.isfinite(self._problem.step_costs(choices))
            values = np.where(np.isfinite(values), values, np.inf)
            values[forbidden] = np.inf
            target = single if len(choices.moves) == 1 else shared
            at = choices.moves[-1]
            target[at] = np.maximum(target[at], rounded_up(values, self._round))
        return tuple(single), tuple(shared)

    @cached_property
    def _floor(self) -> Floats:
        """Worst responses of the steps in which nothing is open, (k,)."""
        closed = [
            Step(s.number, s.kind, s.bricks, s.grips)  # type: ignore[arg-type]
            for s in self._problem.schedule.steps
            if not s.moves
        ]
        if not closed:
            return np.full(len(self._names), -np.inf)
        return self._worst(closed)

    def best_below(self, bounds: Floats) -> tuple[Floats, object] | None:
        """Return a choice that none beats among those below bounds.

        Parameters
        ----------
        bounds : (k,) float

        Returns
        -------
        point : (k,) float
        choice : tuple of int
            None for both where there is no choice.
        """
        if not (self._floor < bounds).all():
            return None
        single, shared = self._costs
        allowed = [np.asarray((s < bounds).all(axis=-1)) for s in single]
        paired = [np.asarray((s < bounds).all(axis=-1)) for s in shared]
        point = np.zeros(len(bounds))
        for k in range(len(bounds)):
            least = self._least(k, allowed, paired)
            if not np.isfinite(least):
                return None
            point[k] = least = max(
                least, self._floor[k]
            )  # less in a step that is open gains nothing
            allowed = [ok & (s[..., k] <= least) for ok, s in zip(allowed, single, strict=True)]
            paired = [ok & (s[..., k] <= least) for ok, s in zip(paired, shared, strict=True)]
        return point, _first(allowed, paired)

    def _least(self, k: int, allowed: Sequence[Bools], paired: Sequence[Bools]) -> float:
        """Return the smallest worst value of a response over allowed choices, move by move."""
        reached = np.full(1, -np.inf)
        for a, p, s, d in zip(allowed, paired, *self._costs, strict=True):
            pair = np.where(p, np.maximum(reached[:, None], d[..., k]), np.inf)
            reached = np.maximum(pair.min(axis=0), np.where(a, s[:, k], np.inf))
        return float(reached.min())

    def is_empty_below(self, bounds: Floats) -> bool:
        """Return whether there is no choice below bounds, move by move from the last one.

        Parameters
        ----------
        bounds : (k,) float
        """
        open_to = None
        for single, shared in zip(*(part[::-1] for part in self._costs), strict=True):
            fits = (single < bounds).all(axis=-1)
            fits = fits if open_to is None else fits & open_to
            open_to = ((shared < bounds).all(axis=-1) & fits).any(axis=1)
        return bool(open_to is not None and not open_to.any()) or not (self._floor < bounds).all()

    def steps(self, plan: object) -> tuple[Step, ...]:
        """Return the checked steps of a choice."""
        return self._problem.steps(plan)  # type: ignore[arg-type]

    def values(self, steps: Sequence[Step], claimed: Floats) -> Floats:
        """Return the worst responses of a sequence, from those of its steps.

        Parameters
        ----------
        steps : sequence of Step
        claimed : (k,) float
            Not needed for responses.

        Returns
        -------
        (k,) float
        """
        return self._worst(steps)

    def _worst(self, steps: Sequence[Step]) -> Floats:
        table = analyze(self._problem.engine, steps)
        robots = self._problem.schedule.scene.robots
        forces = table[[force_column(robot) for robot in robots]].abs().max(axis=1)
        out = []
        for name in self._names:
            if name == LARGEST:
                out.append(float(forces.max()))
            elif name == "C_max":
                out.append(max(0.0, -float(table["F_min_N"].min())))
            else:
                out.append(float(table[CHOSEN_BY[name].column].max()) / CHOSEN_BY[name].scale)
        return rounded_up(np.array(out), self._round)


def _first(allowed: Sequence[Bools], paired: Sequence[Bools]) -> tuple[int, ...]:
    """Return the first choice all of whose parts are allowed."""
    left = [allowed[-1]]
    for a, p in zip(reversed(allowed[:-1]), reversed(paired[1:]), strict=True):
        left.append(a & (p & left[-1]).any(axis=1))
    choice: list[int] = []
    for ok, p in zip(reversed(left), paired, strict=True):
        choice.append(int(np.argmax(ok & p[choice[-1] if choice else 0])))
    return tuple(choice)
