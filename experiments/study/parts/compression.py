"""An observation on the published plan: compression in the place of displacement.

A rule that was found by search: over the three steps that belong to one optimization alone
(release, place, release), round every response, sum it, rank the sums and average the ranks. Before
the crown the responses are ``T_max``, ``M_sup`` and the sum of all robot forces; from it on
``T_max``, ``M_sup``, the moving robot's force and the largest compression ``C_max``, where equation
(3) has ``D_max``.

It was picked among 3.2 million variants and not cross-validated. So it is set beside itself with
``D_max``, over other windows, roundings and ways to join the steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.placement.problem import Problem
from seqopt.placement.ranking import TIED, rank_of
from seqopt.placement.ranks import mean_ranks
from seqopt.responses.choices import StepChoices
from seqopt.study.presets import RESOLUTION
from seqopt.study.published import published_choice

CROWN = 13  # bricks of the arch of Bruun et al. up to its crown
BEFORE = ("T_max", "M_sup", "F_sum")
AFTER = ("T_max", "M_sup", "F_move")  # and one of FOURTH
FOURTH = ("C_max", "D_max")
WINDOWS = {"own steps": 3, "own steps and the reposition before": 4}
JOINS = ("sum of rounded", "rounded sum", "rounded largest", "sum of ranks")
ROUNDED = (1.0, 0.1, 1e-6, 2.0)  # N, N m, 1e-3 mm


@dataclass(frozen=True)
class Rule:
    """How candidates of an optimization are ordered, the choice before it being fixed.

    Parameters
    ----------
    fourth : str
        Which response stands beside tension, moment and force after the crown.
    window : str
        Key of `WINDOWS`: which steps count.
    join : str
        One of `JOINS`: how the values of several steps become one.
    rounded : float
        To how many N, N m or 1e-3 mm.
    """

    fourth: str = "C_max"
    window: str = "own steps"
    join: str = "sum of rounded"
    rounded: float = 1.0


FOUND = Rule()  # the one that the search picked


def rules() -> list[Rule]:
    """Return the rules that are compared."""
    return [Rule(*parts) for parts in product(FOURTH, WINDOWS, JOINS, ROUNDED)]


def order(problem: Problem, choice: tuple[int, ...], move: int, rule: Rule) -> Floats:
    """Return what the candidates of a move cost (C,), infinite where two robots meet."""
    shared = [s for s in problem.evaluation.steps if s.moves == (move - 1, move)]
    own = [s for s in problem.evaluation.steps if s.moves == (move,)][-WINDOWS["own steps"] :]
    before = choice[move - 1] if move else 0
    steps = [_values(s) for s in own]
    if WINDOWS[rule.window] > len(own):
        steps = [{name: v[before] for name, v in _values(s).items()} for s in shared] + steps
    known = [np.isfinite(s.responses["T_max"][before]) for s in shared]
    possible = np.all([np.ones(len(steps[0]["T_max"]), dtype=bool), *known], axis=0)
    crowned = problem.schedule.moves[move].bricks >= CROWN
    names = (*AFTER, rule.fourth) if crowned else BEFORE
    out = np.full(len(possible), np.inf)
    out[possible] = sum(_ranks([s[n][possible] for s in steps], n, rule) for n in names)
    return out


def _values(step: StepChoices) -> dict[str, Floats]:
    """Return the responses of a step, with the sum of all robot forces."""
    found = dict(step.responses)
    robots = [found[f"F_rob{i}"] for i in (1, 2, 3)]
    return found | {"F_sum": np.nansum(robots, axis=0)}


def _ranks(values: list[Floats], name: str, rule: Rule) -> Floats:
    """Return the ranks (C,) of one response over the steps of a window."""
    size = dict(RESOLUTION)[name[0]] * rule.rounded
    steps = np.array(values) / size
    joined: dict[str, Callable[[], Floats]] = {
        "sum of rounded": lambda: mean_ranks(np.round(steps).sum(axis=0)),
        "rounded sum": lambda: mean_ranks(np.round(steps.sum(axis=0))),
        "rounded largest": lambda: mean_ranks(np.round(steps.max(axis=0))),
        "sum of ranks": lambda: np.sum([mean_ranks(row) for row in np.round(steps)], axis=0),
    }
    return joined[rule.join]()


def placed(problem: Problem, rule: Rule) -> pd.DataFrame:
    """Return where the published nodes rank: a row per optimization, with ``alone`` if first."""
    choice, rows = published_choice(problem), []
    for move, node in enumerate(choice):
        costs = order(problem, choice, move, rule)
        others = np.delete(costs, node)
        alone = bool((others > costs[node] * (1 + TIED)).all())
        bricks = problem.schedule.moves[move].bricks
        rows.append({"bricks": bricks, "rank": rank_of(costs, node), "alone": alone})
    return pd.DataFrame(rows)


def compression(problem: Problem, tried: list[Rule]) -> pd.DataFrame:
    """Return how often each rule names the published node alone, first, and among three."""
    rows = []
    for rule in tried:
        table = placed(problem, rule)
        after = table[table["bricks"] >= CROWN]
        row: dict[str, object] = {**vars(rule), "alone": int(table["alone"].sum())}
        row |= {"first": int((table["rank"] == 1).sum())}
        row |= {"among_three": int((table["rank"] <= 3).sum())}
        rows.append(row | {"first_after_crown": int((after["rank"] == 1).sum())})
    return pd.DataFrame(rows)


def beside_displacement(table: pd.DataFrame) -> pd.DataFrame:
    """Return, for every setting, how often either names the published node after the crown."""
    settings = ["window", "join", "rounded"]
    value = "first_after_crown"
    return table.pivot_table(value, index=settings, columns="fourth", aggfunc="first")
