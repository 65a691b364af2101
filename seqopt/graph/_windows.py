"""Candidates of one move after the choice before it: a decision at a time, and no others solved."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

import numpy as np

from seqopt.arrays import Floats, Terse
from seqopt.engines.interface import Fields, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MemoryShortError, NothingFoundError, TimeUpError
from seqopt.graph.decisions import Decisions
from seqopt.graph.formulation import Watch
from seqopt.problem.problem import Aim
from seqopt.responses._choices import StepChoices
from seqopt.responses.table import step_fields
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step


@dataclass(frozen=True, repr=False)
class Windows(Terse):
    """The steps that every move decides, after the choice before it; solved when first asked for.

    ``choice``: the chosen candidate of every move so far; ``fields``: by number, of steps that an
    engine had at hand on the way; ``rows``: by move, the steps that are solved.
    """

    problem: Decisions
    choice: list[int] = field(default_factory=list)
    fields: dict[int, Fields] = field(default_factory=dict, compare=False)
    rows: dict[int, tuple[StepChoices, ...]] = field(default_factory=dict, compare=False)

    def row(self, move: int) -> tuple[StepChoices, ...]:
        """Return the steps that a move decides, with responses of its candidates, (C_k,)."""
        if move not in self.rows:
            before = self.choice[move - 1] if move else 0
            self.rows[move] = self.problem.window_choices(move, before)
        return self.rows[move]

    def costs(self, move: int, aim: Aim = Aim.SUM) -> Floats:
        """Return what the candidates of a move cost after the choices before it, (C_k,)."""
        costs = self.problem.possible_after(move, self.choice[move - 1] if move else 0)
        for choices in self.row(move):
            costs = aim.join(costs, self.problem.step_costs(choices))
        return costs

    def so_far(self) -> str:
        """Return what is chosen, in a few words."""
        if not self.choice:
            return "no move was chosen yet"
        moves = self.problem.schedule.moves
        nodes = (str(moves[k].candidates[i]) for k, i in enumerate(self.choice))
        return f"{len(self.choice)} of {len(moves)} moves were chosen, at nodes {' '.join(nodes)}"


def walk_windows(problem: Decisions, watch: Watch) -> Windows:
    """Choose what costs least, one move after the other (equation 1 of Bruun et al.).

    Raises `NothingFoundError` if a move has no candidate left after the choices before it, while
    others may have led on; `TimeUpError` if time is over before the last move is chosen;
    `MemoryShortError`, `WorkerError` as `Evaluation.levels`; `KeyboardInterrupt`, with the nodes
    that were chosen so far as its text.
    """
    alone = alone_steps(problem)
    few = replace(problem.evaluation, more_work=alone.evaluation.work)
    found, noted = Windows(replace(problem, evaluation=few)), 0
    try:
        with closing(_decided(found.problem, alone, found.choice)) as rows:
            for k, row in enumerate(rows):
                if watch.over:
                    raise TimeUpError(f"{watch.seconds:.3g} s: {found.so_far()}; give more")
                found.rows[k] = row
                move, costs = problem.schedule.moves[k], found.costs(k)
                if not np.isfinite(costs).any():
                    raise NothingFoundError(
                        f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after "
                        "the choices before it; relax a limit, or let a formulation look at all "
                        "choices"
                    )
                found.choice.append(int(np.argmin(costs)))
                noted = _note_fields(found, noted)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(found.so_far()) from stop
    return found


def _decided(
    problem: Decisions, alone: Decisions, choice: Sequence[int]
) -> Generator[tuple[StepChoices, ...], None, None]:
    """Yield the steps that moves decide, one move after the other, by ascending brick counts.

    ``choice``: grows between two moves. Sets that several moves meet are solved once.
    """
    if alone.evaluation.streams:
        raise MemoryShortError(
            "the responses of steps with one open grip do not fit into the memory that may be "
            "used; take near candidates only, or raise max_memory"
        )
    steps_of, own = problem.schedule.steps_of, defaultdict[int, list[StepChoices]](list)
    known, last = 0, problem.schedule.steps[-1].bricks
    with closing(alone.evaluation.levels()) as levels:
        for k in range(len(problem.schedule.moves)):
            shared = tuple[StepChoices, ...]()
            for moves in ((k - 1, k), (k,)):
                most = max((step.bricks for step in steps_of.get(moves, ())), default=0)
                while known < most:
                    found = next(levels, ())
                    known = found[-1].step.bricks if found else last + 1
                    for each in found:
                        own[each.moves[0]].append(each)
                if moves[0] < k and k:
                    shared = problem.window_choices(k, choice[-1], alone=False)
            yield tuple(sorted((*shared, *own.pop(k, ())), key=lambda each: each.step.number))


def alone_steps(problem: Decisions) -> Decisions:
    """Return the problem of the steps in which one move is open."""
    steps = tuple(step for step in problem.schedule.steps if len(step.moves) == 1)
    return posed_anew(problem, replace(problem.schedule, steps=steps))


def posed_anew(problem: Decisions, schedule: Schedule) -> Decisions:
    """Return the problem of another schedule, everything else being the same."""
    return replace(problem, evaluation=replace(problem.evaluation, schedule=schedule))


def _note_fields(found: Windows, noted: int) -> int:
    """Keep all fields of steps that are chosen, where an engine has them at hand; count these."""
    problem, choice = found.problem, found.choice
    engine, moves = problem.engine, problem.schedule.moves
    for step in problem.schedule.steps[noted:]:
        if any(move >= len(choice) for move in step.moves):
            break
        noted += 1
        if isinstance(engine, ComplianceEngine) and engine._recalls(step.bricks):
            nodes = (
                moves[g.move].candidates[choice[g.move]] if isinstance(g, OpenGrip) else g
                for g in step.grips
            )
            known = Step(step.number, step.kind, step.bricks, tuple(nodes))
            found.fields[step.number] = step_fields(engine, known, Want.ALL)
    return noted
