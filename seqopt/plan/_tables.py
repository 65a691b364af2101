"""Tables of a plan: the choice of each move, and its alternatives."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.graph._decision_search import Windows
from seqopt.graph.decisions import Decisions, move_costs, rank_of
from seqopt.problem.problem import Aim
from seqopt.responses._choices import StepChoices


def chosen_table(
    problem: Decisions,
    choice: tuple[int, ...],
    aim: Aim,
    search: Windows | None,
    grips: pd.DataFrame,
) -> pd.DataFrame:
    """Return the choice and its costs, move by move, as of `seqopt.plan.plan.Plan.table`.

    ``search``: the evaluated models, if not all were; ``grips``: of the plan.
    """
    rows = []
    for k, (before, now) in enumerate(pairwise((0, *choice))):
        if search is not None:
            costs = search.costs(k)
            margin = np.delete(costs, now).min(initial=np.inf) - costs[now]
            rows.append({"cost": costs[now], "margin": margin})
        else:
            layered = aim.costs(problem)
            rank = rank_of(move_costs(problem, k, before), now)
            single, shared = layered.single[k][now], layered.shared[k][before, now]
            rows.append({"single_cost": single, "shared_cost": shared, "rank_in_window": rank})
    return moves_table(problem, choice, grips).join(pd.DataFrame(rows))


def moves_table(problem: Decisions, choice: Sequence[int], grips: pd.DataFrame) -> pd.DataFrame:
    """Return the choice, a row per move, as of `seqopt.plan.plan.Plan.table` without costs.

    ``grips``: of the plan, as of `seqopt.responses.table.grips_table`.
    """
    moves, nodes = problem.schedule.moves, problem.nodes(choice)
    brick_of = problem.schedule.scene.brick_of_node
    held = {(row["robot"], row["from_step"]): row for row in grips.to_dict("records")}
    own = [held[move.robot, move.step] for move in moves]
    return pd.DataFrame(
        {
            "move": range(1, len(moves) + 1),
            "step": [move.step for move in moves],
            "to_step": [row["to_step"] for row in own],
            "bricks": [move.bricks for move in moves],
            "robot": [move.robot for move in moves],
            "brick": [brick_of[node].name for node in nodes],
            "node": nodes,
            "largest_force_N": [row["largest_force_N"] for row in own],
            "candidates": [len(move.candidates) for move in moves],
        }
    )


def choice_table(problem: Decisions, choices: StepChoices) -> pd.DataFrame:
    """Return responses and cost of every choice of a step, by its nodes, SI units."""
    axes = next(iter(choices.responses.values())).ndim
    moves = [problem.schedule.moves[m] for m in choices.moves[-axes:]]
    names = [f"{move.robot}_node" for move in moves]
    index = pd.MultiIndex.from_product([move.candidates for move in moves], names=names)
    columns: Mapping[str, Floats] = {**choices.responses, "cost": problem.step_costs(choices)}
    return pd.DataFrame({name: values.ravel() for name, values in columns.items()}, index=index)


def alternatives(
    problem: Decisions, choice: tuple[int, ...], search: Windows | None
) -> pd.DataFrame:
    """Return responses and cost of every evaluated choice, as of `Plan.alternatives`.

    ``search``: the models evaluated along the choice, if not all were.
    """
    parts = []
    for choices, before in _looked_at(problem, choice, search):
        table = choice_table(problem, choices)
        columns = ["node", "second_node"] if before is None else ["second_node"]
        columns = columns[: table.index.nlevels]
        nodes = pd.DataFrame(table.index.to_frame(index=False).to_numpy(), columns=columns)
        if before is not None:
            nodes.insert(0, "node", before)
        nodes.insert(0, "step", choices.step.number)
        parts.append(pd.concat([nodes, table.reset_index(drop=True)], axis=1))
    return pd.concat(parts).sort_values("step", kind="stable", ignore_index=True)


def _looked_at(
    problem: Decisions, choice: tuple[int, ...], search: Windows | None
) -> Iterator[tuple[StepChoices, int | None]]:
    """Yield the evaluated steps and, if the earlier move is fixed, its node."""
    if search is None and not problem.evaluation.streams:
        yield from ((each, None) for each in problem.evaluation.steps)
        return
    nodes, found = problem.nodes(choice), search or Windows(problem, [*choice])
    for k in range(len(problem.schedule.moves)):
        for choices in found.row(k):
            yield choices, nodes[k - 1] if len(choices.moves) == 2 else None
