"""The search of Bruun et al., move by move, solving only the models that it needs.

A formulation is given the costs of all choices, so that its answer can be certified. Where a model
is expensive these costs are the price of the proof. This search asks less: every move's candidates
in the steps where it alone is open, and in the step that it shares with the move before only those
that go with the choice made there (equation 1). It chooses as a formulation does that looks at one
window after the other, and knows nothing of what it misses.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace

import numpy as np

from seqopt.arrays import Floats, Terse
from seqopt.engines.interface import Fields, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MemoryShortError, NothingFoundError, TimeUpError
from seqopt.graph.formulation import Watch
from seqopt.graph.layers.costs import Joined
from seqopt.graph.layers.layers import Layers, possible_after, windows
from seqopt.problem.problem import Aim
from seqopt.responses.table import step_fields
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step


@dataclass(frozen=True, repr=False)
class WindowSearch(Terse):
    """What a search move by move looked at, and what it chose.

    ``alone``: the steps in which one move is open; ``shared``: of every move, the steps shared with
    the move before, whose choice is made; it may be empty; ``choice``: the chosen candidate of
    every move; ``fields``: by number, of steps that an engine answered on the way.
    """

    alone: Layers
    shared: tuple[Layers, ...]
    choice: tuple[int, ...]
    fields: Mapping[int, Fields] = field(default_factory=dict, compare=False)

    @property
    def explored(self) -> tuple[Layers, ...]:
        """The problems of which responses were computed."""
        return (self.alone, *(problem for problem in self.shared if problem.evaluation.steps))

    @property
    def met(self) -> list[tuple[Layers, tuple[int, ...]]]:
        """The problems with all steps of the build, and what is chosen in each."""
        each = zip(self.shared, self.choice, strict=True)
        return [(self.alone, self.choice), *((problem, (now,)) for problem, now in each)]

    def costs(self, move: int, aim: Aim = Aim.SUM) -> Floats:
        """Return what the candidates of a move cost after the choices before it, (C_k,)."""
        alone, shared = (aim.costs(part).single for part in (self.alone, self.shared[move]))
        return np.asarray(aim.join(alone[move], shared[0]))


def search_windows(
    problem: Layers, watch: Watch | None = None, *, fields: bool = False
) -> WindowSearch:
    """Choose every open grip of a build, one move after the other, by ascending brick counts.

    ``problem``: its own responses are not computed; ``fields``: whether those of steps are kept
    that an engine has at hand, as the plan asks for them next. Raises `NothingFoundError` if a move
    has no candidate left after the choices before it, while others may have led on; `TimeUpError`
    if time is over before the last move is chosen; `MemoryShortError` if there is not the memory
    for what it looks at; `KeyboardInterrupt`, with the nodes that were chosen so far as its text.
    """
    walk = _Walk(problem, watch or Watch())
    try:
        with closing(walk.levels):
            for k in range(len(problem.schedule.moves)):
                walk.know((k - 1, k))
                walk.shared.append(row_of(walk.whole, k, walk.choice[-1] if k else 0))
                _ = walk.shared[k].sums  # looked at now
                walk.know((k,))
                walk.choose(k)
                if fields:
                    walk.note()
            walk.know(())
            if fields:
                walk.note()
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(walk.so_far()) from stop
    return WindowSearch(walk.alone, tuple(walk.shared), tuple(walk.choice), walk.fields)


class _Walk:
    """A search on its way: what was looked at, and what is chosen."""

    def __init__(self, problem: Layers, watch: Watch) -> None:
        self.alone, self._schedule, self._watch = alone_steps(problem), problem.schedule, watch
        work = replace(problem.evaluation, more_work=self.alone.evaluation.work)
        self.whole = replace(problem, evaluation=work)  # of which little is asked at a time
        if self.alone.evaluation.streams:
            raise MemoryShortError(
                "the responses of steps with one open grip do not fit into the memory that may be "
                "used; take near candidates only, or raise max_memory"
            )
        self.levels = self.alone.evaluation.levels()
        self._own = Joined([len(move.candidates) for move in self._schedule.moves], np.add)
        self.shared: list[Layers] = []
        self.choice: list[int] = []
        self.fields: dict[int, Fields] = {}
        self._noted = 0  # steps
        self._known = 0.0  # bricks up to which steps with one open grip are

    def know(self, moves: tuple[int, ...]) -> None:
        """Look at steps with one open grip up to the bricks of given moves; of none, at all."""
        steps = self._schedule.steps_of.get(moves, ())
        last = max((step.bricks for step in steps), default=0) if moves else math.inf
        while self._known < last:
            found = next(self.levels, None)
            if found is None:
                self._known = math.inf
                return
            if self._watch.over:
                raise TimeUpError(f"{self._watch.seconds:.3g} s: {self.so_far()}; give more")
            for choices in found:
                self._own.add(choices.moves, self.alone.step_costs(choices))
            self._known = found[-1].step.bricks

    def _node(self, k: int) -> int:
        return self._schedule.moves[k].candidates[self.choice[k]]

    def choose(self, k: int) -> None:
        """Choose the candidate of a move that costs least."""
        move = self._schedule.moves[k]
        costs = self._own.single(k) + self.shared[k].sums.single[0]
        if k:
            costs = np.where(possible_after(self._schedule, k, self.choice[-1]), costs, np.inf)
        if not np.isfinite(costs).any():
            raise NothingFoundError(
                f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after the "
                "choices before it; relax a limit, or let a formulation look at all choices"
            )
        self.choice.append(int(np.argmin(costs)))

    def note(self) -> None:
        """Ask for all fields of steps that are chosen, where an engine has them at hand now."""
        engine, steps, chosen = self.whole.engine, self._schedule.steps, len(self.choice)
        for step in steps[self._noted :]:
            if any(move >= chosen for move in step.moves):
                return
            self._noted += 1
            if isinstance(engine, ComplianceEngine) and engine._recalls(step.bricks):
                grips = (self._node(g.move) if isinstance(g, OpenGrip) else g for g in step.grips)
                known = Step(step.number, step.kind, step.bricks, tuple(grips))
                self.fields[step.number] = step_fields(engine, known, Want.ALL)

    def so_far(self) -> str:
        """Return what is chosen, in a few words."""
        if not self.choice:
            return "no move was chosen yet"
        chosen = " ".join(str(self._node(k)) for k in range(len(self.choice)))
        moves = f"{len(self.choice)} of {len(self._schedule.moves)} moves"
        return f"{moves} were chosen, at nodes {chosen}"


def alone_steps(problem: Layers) -> Layers:
    """Return the problem of the steps in which one move is open."""
    steps = tuple(step for step in problem.schedule.steps if len(step.moves) == 1)
    return posed_anew(problem, replace(problem.schedule, steps=steps))


def row_of(problem: Layers, move: int, before: int) -> Layers:
    """Return the problem of the steps shared with the move before, whose candidate is given."""
    few = replace(problem.evaluation, resources=problem.evaluation.resources.alone())
    schedule = windows(problem.schedule, [(move, before)])
    return posed_anew(replace(problem, evaluation=few), schedule)


def posed_anew(problem: Layers, schedule: Schedule) -> Layers:
    """Return the problem of another schedule, everything else being the same."""
    return replace(problem, evaluation=replace(problem.evaluation, schedule=schedule))
