"""One placement problem from scene to checked plan, with the time of every stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.placement.certificate import Certificate, check_selection
from seqopt.placement.costs import PlacementProblem
from seqopt.placement.criteria import Criterion
from seqopt.placement.formulation import Aim, Formulation, Selection
from seqopt.placement.problem import Limit, Problem, pose
from seqopt.placement.ranking import move_costs, rank_of
from seqopt.responses.table import analyze
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step

Result = TypeVar("Result")


@dataclass(frozen=True)
class Posed:
    """A problem with its costs computed, and the seconds that took by stage."""

    problem: Problem
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class Outcome:
    """A problem solved and checked.

    Attributes
    ----------
    problem : Problem
    which : Formulation
    selection : Selection
    certificate : Certificate
    plan : tuple of Step
        The schedule with every move at its chosen node.
    seconds : mapping of str to float
        By stage: respond, rank, compile (writing a program down for a solver), solve, verify.
    """

    problem: Problem
    which: Formulation
    selection: Selection
    certificate: Certificate
    plan: tuple[Step, ...]
    seconds: Mapping[str, float]


def prepare(
    engine: Engine, schedule: Schedule, criterion: Criterion, limits: Sequence[Limit] = ()
) -> Posed:
    """Pose a problem and compute its costs."""
    seconds: dict[str, float] = {}
    problem = _timed(seconds, "respond", lambda: pose(engine, schedule, criterion, limits))
    _timed(seconds, "rank", lambda: (problem.sums, problem.peaks))
    return Posed(problem, seconds)


def optimize(posed: Posed, which: Formulation, **options: Any) -> Outcome:
    """Solve a posed problem by one formulation, check the answer and fill in the plan."""
    seconds = dict(posed.seconds)
    problem = posed.problem
    selection = _timed(seconds, "solve", lambda: which.solve(problem, **options))
    seconds["compile"] = selection.compile_seconds
    seconds["solve"] -= selection.compile_seconds

    def verify() -> tuple[Certificate, tuple[Step, ...]]:
        plan = problem.schedule.fill(problem.nodes(selection.choice))
        return check_selection(problem, selection, which), plan

    certificate, plan = _timed(seconds, "verify", verify)
    return Outcome(problem, which, selection, certificate, plan, seconds)


def summary(outcome: Outcome) -> dict[str, object]:
    """Return what there is to say about an outcome, but times, ready for JSON."""
    certificate = outcome.certificate
    return {
        **header(outcome.problem, outcome.which),
        "status": "optimal" if certificate.gap <= 1e-6 else "feasible",
        "objective": certificate.objective,
        "bound": certificate.bound,
        "gap": certificate.gap,
        "models_evaluated": outcome.problem.evaluation.models,
    }


def header(problem: Problem, which: Formulation) -> dict[str, object]:
    """Return what was asked, ready for JSON."""
    cascading, overlap = problem.paper_models
    return {
        "scene": problem.schedule.scene.name,
        "method": problem.schedule.method,
        "formulation": which.name,
        "kind": which.kind.value,
        "aim": which.aim.value,
        "criterion": problem.criterion.name,
        "models_paper_count": {"cascading": cascading, "overlap": overlap},
    }


def chosen(schedule: Schedule, move: int, place: int) -> dict[str, object]:
    """Return a move and the node that a candidate stands for, a row."""
    asked = schedule.moves[move]
    node = asked.candidates[place]
    return {
        "move": move + 1,
        "step": asked.step,
        "bricks": asked.bricks,
        "robot": asked.robot,
        "brick": schedule.scene.brick_of_node[node].name,
        "node": node,
        "candidates": len(asked.candidates),
    }


def selection_table(outcome: Outcome) -> pd.DataFrame:
    """Return a row per move: where, which robot, which node, what it costs, how it ranks."""
    rows, before = [], 0
    placement = outcome.problem.sums if outcome.which.aim is Aim.SUM else outcome.problem.peaks
    for k, now in enumerate(outcome.selection.choice):
        rows.append(
            chosen(outcome.problem.schedule, k, now)
            | {
                "single_cost": placement.single[k][now],
                "shared_cost": placement.shared[k][before, now],
                "rank_in_window": rank_of(move_costs(outcome.problem, k, before), now),
            }
        )
        before = now
    return pd.DataFrame(rows)


def plan_table(engine: Engine, schedule: Schedule, plan: Sequence[Step]) -> pd.DataFrame:
    """Return a plan with the columns of Table A.1 and the robot that each move optimizes."""
    table = analyze(engine, plan)
    open_at = {step.number: step.moves for step in schedule.steps}
    moves = schedule.moves
    table["optimized_robot"] = [
        ";".join(moves[m].robot for m in open_at[number]) for number in table["step"]
    ]
    return table


def responses_table(problem: Problem) -> pd.DataFrame:
    """Return raw responses and cost of every choice in every open state, a row each."""
    parts = []
    for state in problem.evaluation.states:
        table = problem.table(state)
        nodes = pd.DataFrame(
            table.index.to_frame(index=False).to_numpy(),
            columns=["node", "second_node"][: len(state.moves)],
        )
        step = pd.Series(state.step.number, index=nodes.index, name="step")
        parts.append(pd.concat([step, nodes, table.reset_index(drop=True)], axis=1))
    return pd.concat(parts, ignore_index=True)


def _timed(seconds: dict[str, float], stage: str, call: Callable[[], Result]) -> Result:
    start = time.perf_counter()
    result = call()
    seconds[stage] = time.perf_counter() - start
    return result


def run(
    problem: PlacementProblem, which: Formulation, **options: Any
) -> tuple[Selection, Certificate]:
    """Solve a problem and check the answer; see `check`."""
    selection = which.solve(problem, **options)
    return selection, check_selection(problem, selection, which)
