"""How reliable the ranking of each move is: ties, margins, reversals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from seqopt.arrays import Bools, Floats
from seqopt.graph.layers.costs import TINY, LayeredCosts, _least_to_go, _to_go
from seqopt.graph.layers.layers import Layers
from seqopt.problem.criteria import Ranked, RankSum, WeightedSum, WorstRatio
from seqopt.problem.requirements import Criterion
from seqopt.responses._choices import StepChoices

TIED_SUMS = 1e-9  # sums of ranks this close, relative to the least, are equal


@dataclass(frozen=True)
class GapParts:
    """The gap of a choice to the exact optimum, split in two parts.

    ``short_sight``: against an exact optimum of the conditional objective, both charged as the
    problem does: what is lost by not looking ahead. Negative where looking ahead would not have
    served. ``objective``: what that optimum itself gives up: the change of objective.
    """

    short_sight: float
    objective: float

    @property
    def gap(self) -> float:
        """Both parts."""
        return self.short_sight + self.objective


def under(problem: Layers, ranked: Ranked) -> Layers | None:
    """Return a problem with its ranks taken another way.

    ``problem``: whose responses are shared. Result: None if the criterion has no ranks, or
    responses are not kept that others would need.
    """
    if not isinstance(problem.criterion, RankSum):
        return None
    if problem.criterion.ranked is ranked:
        return problem
    if problem.evaluation.streams:
        return None
    criterion = replace(problem.criterion, ranked=ranked)
    return problem.others.setdefault(criterion, replace(problem, criterion=criterion))


def under_both(problem: Layers, choice: Sequence[int]) -> dict[str, float | None]:
    """Return the value of a choice under both objectives.

    ``choice``: a candidate for every move. Result (dict of str to (float or None)): ``pairs`` and
    ``conditional``; None if the criterion has no ranks.
    """
    found = {ranked.value: under(problem, ranked) for ranked in Ranked}
    return {name: None if p is None else p.sums.cost(choice) for name, p in found.items()}


def split_gap(problem: Layers, choice: Sequence[int]) -> GapParts | None:
    """Return the gap of a choice, in two parts.

    ``problem``: its sums are what choices are charged; ``choice``: a candidate for every move.
    Result: over the sum of the costs that the choice meets; None if the criterion has no ranks, or
    no choice is allowed.
    """
    conditional = under(problem, Ranked.CONDITIONAL)
    if conditional is None:
        return None
    charged = problem.sums
    there, best = (_least_among_least(first, charged) for first in (conditional.sums, charged))
    scale = max(sum(map(abs, charged.parts(choice))), TINY)
    if not np.isfinite([there, best]).all():
        return None
    return GapParts((charged.cost(choice) - there) / scale, (there - best) / scale)


def _least_among_least(first: LayeredCosts, second: LayeredCosts) -> float:
    """Return the least second cost of the choices whose first cost is least.

    ``first``, ``second``: of the same choices. Result: infinite if no choice is allowed.
    """
    total, kept = np.zeros(1), _on_a_least_path(first.arcs())
    for single, shared, mask in zip(second.single, second.shared, kept, strict=True):
        total = np.where(mask, total[:, None] + shared + single, np.inf).min(axis=0)
    return float(total.min())


def _on_a_least_path(arcs: Sequence[Floats], size: float = TINY) -> list[Bools]:
    """Return which pairs (C_{k-1}, C_k) lie on a path of least cost, move by move.

    ``arcs`` (sequence of (C_{k-1}, C_k) float): what a pair and its later choice cost together;
    ``size``: of costs: what `TIED_SUMS` is at least relative to.
    """
    reached = [np.zeros(1)]
    for arc in arcs:
        reached.append((reached[-1][:, None] + arc).min(axis=0))
    least = float(reached[-1].min())
    most = least + TIED_SUMS * max(abs(least), size)
    ends = zip(reached[:-1], arcs, _least_to_go(arcs)[1:], strict=True)
    out = []
    for before, arc, after in ends:
        whole = before[:, None] + (arc + after)
        out.append(np.isfinite(whole) & (whole <= most))
    return out


TIED = 1e-9  # costs this close, relative to the largest, are equal
TERMS = {RankSum: ("before", "after"), WeightedSum: ("terms",), WorstRatio: ("limits",)}


def move_costs(problem: Layers, move: int, before: int, without: int | None = None) -> Floats:
    """Return the costs of a move's candidates, the choice before it being fixed.

    The search of a single move (equation 1 of Bruun et al.): each step of the window is ranked over
    the candidates of this move alone.

    ``problem``: whose responses are evaluated if they are not yet; ``move``, ``before``: a move,
    and the candidate chosen for the move before it; ``without``: a candidate to leave out, which
    then costs infinity. Result (C_k,).
    """
    total = np.zeros(len(problem.schedule.moves[move].candidates))
    for choices in problem.window_choices(move, before):
        total += problem.step_costs(_without(problem.faced(choices, before), without))
    if without is not None:
        total[without] = np.inf
    return total


def rank_of(costs: Floats, chosen: int) -> int:
    """Return the rank of a candidate: 1 if none costs less.

    ``costs`` (C,): equal if they differ by less than ``TIED`` of the largest; ``chosen``: index of
    the candidate.
    """
    return int((costs < costs[chosen] - _tie(costs)).sum()) + 1


def _tie(costs: Floats) -> float:
    return TIED * float(np.abs(costs[np.isfinite(costs)]).max(initial=0.0))


def rank_moves(problem: Layers, choice: Sequence[int]) -> pd.DataFrame:
    """Return where the chosen candidates rank, and how reliable the first rank of each move is.

    ``choice``: a candidate for every move. Result: a row per move. Columns: ``move``, ``step``,
    ``bricks``, ``robot``, ``node`` (chosen), ``rank`` (1 if none is better), ``winner`` (the node
    that ranks first), ``margin`` (cost from first to second), ``tied`` (candidates that share the
    first rank), ``turned_by_candidates`` (others whose absence changes the winner) and
    ``turned_by_criteria`` (responses whose absence does).
    """
    return pd.DataFrame([*map(partial(_reliability, problem, choice), range(len(choice)))])


def _reliability(problem: Layers, choice: Sequence[int], k: int) -> dict[str, object]:
    """Return the row of a move in `rank_moves`."""
    before, candidates = (0, *choice)[k], problem.schedule.moves[k].candidates
    costs = move_costs(problem, k, before)
    winner = int(np.argmin(costs))
    turned, dropped = _turning(problem, k, before, costs)
    return _chosen(problem, choice, k) | {
        "rank": rank_of(costs, choice[k]),
        "winner": candidates[winner],
        "margin": float(np.delete(costs, winner).min(initial=np.inf) - costs[winner]),
        "tied": int((costs <= costs[winner] + _tie(costs)).sum()),
        "turned_by_candidates": " ".join(str(candidates[j]) for j in turned),
        "turned_by_criteria": " ".join(dropped),
    }


def _chosen(problem: Layers, choice: Sequence[int], k: int) -> dict[str, object]:
    """Return the columns that all tables have of a move."""
    move = problem.schedule.moves[k]
    what = {"move": k + 1, "step": move.step, "bricks": move.bricks, "robot": move.robot}
    return {**what, "node": move.candidates[choice[k]]}


def _turning(problem: Layers, move: int, before: int, costs: Floats) -> tuple[list[int], list[str]]:
    """Return the candidates and the responses without which another candidate would win."""
    winner = int(np.argmin(costs))

    def turns(other: Layers, without: int | None = None) -> bool:
        return int(np.argmin(move_costs(other, move, before, without))) != winner

    some = [int(j) for j in np.flatnonzero(np.isfinite(costs)) if j != winner]
    less = _without_one(problem.criterion, problem.schedule.moves[move].bricks)
    responses = [name for name, left in less if turns(replace(problem, criterion=left))]
    return [j for j in some if turns(problem, j)], responses


def _without(choices: StepChoices, candidate: int | None) -> StepChoices:
    """Return a step in which one candidate of its last move is impossible."""
    if candidate is None:
        return choices
    responses = {}
    for name, values in choices.responses.items():
        responses[name] = values.copy()
        responses[name][..., candidate] = np.nan
    return replace(choices, responses=responses)


def _without_one(criterion: Criterion, bricks: int) -> Iterator[tuple[str, Criterion]]:
    """Yield every criterion with one of its responses left out, and its name."""
    names, fields = criterion.wanted(bricks), TERMS.get(type(criterion), ())
    for name in names if fields and len(names) > 1 else ():
        terms = {field: getattr(criterion, field) for field in fields}
        left = {field: tuple(t for t in terms[field] if t[0] != name) for field in fields}
        posed: Any = criterion
        yield name, replace(posed, **{field: left[field] or terms[field] for field in fields})


def rank_choice(problem: Layers, choice: Sequence[int]) -> pd.DataFrame:
    """Return where chosen nodes rank, move by move, the choice before each being fixed.

    ``choice``: a candidate for every move. Result: a row per move. Columns: ``move``, ``step``,
    ``bricks``, ``robot``, ``node``, ``candidates`` (how many there are), ``first_in_window`` (the
    node that ranks first), and three ranks: ``rank_in_window`` of the move alone, ``rank_overlap``
    with the least sum of costs to the end of the build added, ``rank_peak`` with the least worst
    cost to the end.
    """
    sums = _to_go(problem.sums.single, problem.sums.shared, np.add)
    peaks = _to_go(problem.peaks.single, problem.peaks.shared, np.maximum)
    rows = []
    for k, (before, now) in enumerate(pairwise((0, *choice))):
        window, candidates = move_costs(problem, k, before), problem.schedule.moves[k].candidates
        worst = np.maximum(problem.peaks.shared[k][before], peaks[k])
        ranks = {
            "candidates": len(candidates),
            "first_in_window": candidates[int(window.argmin())],
            "rank_in_window": rank_of(window, now),
            "rank_overlap": rank_of(problem.sums.shared[k][before] + sums[k], now),
            "rank_peak": rank_of(worst, now),
        }
        rows.append(_chosen(problem, choice, k) | ranks)
    return pd.DataFrame(rows)
