"""The study's search, move by move, solving only the models that it meets.

A formulation is given the costs of all choices, so that its answer can be certified. Where a model
is expensive these costs are the price of the proof. This search asks less: every move's candidates
in the steps where it alone is open, and in the step that it shares with the move before only those
that go with the choice made there (equation 1). It chooses as `rank_search` and the cascade do, and
knows nothing of what it misses.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.placement.criteria import Criterion
from seqopt.placement.formulation import Formulation, Reads
from seqopt.placement.plan import chosen, header, responses_table
from seqopt.placement.problem import Limit, Problem, pose
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import Step


@dataclass(frozen=True)
class Search:
    """A choice made move by move.

    Attributes
    ----------
    schedule : Schedule
        What was searched.
    alone : Problem
        The steps in which one move is open.
    shared : tuple of Problem
        Of every move, the step shared with the move before, whose choice is made; it may be empty.
    choice : tuple of int
        Place of the chosen node among each move's candidates.
    plan : tuple of Step
        The schedule with every move at its chosen node.
    seconds : mapping of str to float
        By stage: respond, rank, verify.
    """

    schedule: Schedule
    alone: Problem
    shared: tuple[Problem, ...]
    choice: tuple[int, ...]
    plan: tuple[Step, ...]
    seconds: Mapping[str, float]

    @property
    def models(self) -> int:
        """How many models were solved."""
        return sum(problem.evaluation.models for problem in (self.alone, *self.shared))

    def costs(self, move: int) -> Floats:
        """Return what the candidates of a move cost after the choices before it."""
        return np.asarray(self.alone.sums.single[move] + self.shared[move].sums.single[0])


def require_search(which: Formulation, options: Mapping[str, object]) -> None:
    """Refuse formulations that do not choose as this search does.

    Raises
    ------
    ProblemError
        If the formulation, with these options, looks at more than one window at a time.
    """
    if which.reads is not Reads.WINDOW or options:
        words = " ".join(f"--option {name}={value}" for name, value in options.items())
        raise ProblemError(
            f"--no-proof: {which.name} {words}".rstrip() + " looks beyond the window of a move; "
            "give cascade or rank_search without options, or leave --no-proof out"
        )


def window(schedule: Schedule, move: int, nodes: Sequence[int]) -> Schedule:
    """Return the step that a move shares with the one before, as a schedule of that move alone.

    Parameters
    ----------
    schedule : Schedule
    move : int
    nodes : sequence of int
        Chosen by the moves before.
    """

    def grip(held: int | OpenGrip | None) -> int | OpenGrip | None:
        if not isinstance(held, OpenGrip):
            return held
        return OpenGrip(0) if held.move == move else nodes[held.move]

    steps = [
        replace(step, grips=tuple(grip(held) for held in step.grips))
        for step in schedule.steps
        if step.moves == (move - 1, move)
    ]
    return replace(schedule, steps=tuple(steps), moves=(schedule.moves[move],))


def search_windows(
    engine: Engine, schedule: Schedule, criterion: Criterion, limits: Sequence[Limit] = ()
) -> Search:
    """Choose every open grip of a build, one move after the other.

    Raises
    ------
    ProblemError
        If a move has no candidate left after the choices before it. Others may have led on.
    """
    start = time.perf_counter()
    single = replace(schedule, steps=tuple(s for s in schedule.steps if len(s.moves) == 1))
    found = Search(schedule, pose(engine, single, criterion, limits), (), (), (), {})
    respond = time.perf_counter() - start
    nodes: list[int] = []
    for k, move in enumerate(schedule.moves):
        before = time.perf_counter()
        shared = pose(engine, window(schedule, k, nodes), criterion, limits)
        respond += time.perf_counter() - before
        found = replace(found, shared=(*found.shared, shared))
        costs = found.costs(k)
        if not np.isfinite(costs).any():
            raise ProblemError(
                f"move {k + 1}, step {move.step}: {move.robot} has no allowed grip after the "
                "choices before it; relax a limit, or let a formulation look at all choices"
            )
        found = replace(found, choice=(*found.choice, int(np.argmin(costs))))
        nodes.append(move.candidates[found.choice[-1]])
    chosen = time.perf_counter()
    plan = schedule.fill(nodes)
    seconds = {
        "respond": respond,
        "rank": chosen - start - respond,
        "verify": time.perf_counter() - chosen,
    }
    return replace(found, plan=plan, seconds=seconds)


def search_summary(found: Search, which: Formulation) -> dict[str, object]:
    """Return what there is to say about a search, but times; nothing bounds its choice."""
    return {
        **header(found.alone, which),
        "status": "unproven",
        "objective": None,
        "bound": None,
        "gap": None,
        "models_evaluated": found.models,
    }


def search_table(found: Search) -> pd.DataFrame:
    """Return a row per move: where, which robot, which node, its cost, and how far to the next."""
    rows = []
    for k, now in enumerate(found.choice):
        costs = found.costs(k)
        margin = np.delete(costs, now).min(initial=np.inf) - costs[now]
        rows.append(chosen(found.schedule, k, now) | {"cost": costs[now], "margin": margin})
    return pd.DataFrame(rows)


def search_responses(found: Search) -> pd.DataFrame:
    """Return raw responses and cost of every choice that was looked at, a row each."""
    parts = [found.alone, *(problem for problem in found.shared if problem.evaluation.states)]
    table = pd.concat([responses_table(problem) for problem in parts])
    return table.sort_values("step", kind="stable", ignore_index=True)
