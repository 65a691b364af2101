"""What a step costs at least: all that is known of one that was not looked at."""

from __future__ import annotations

from seqopt.problem.criteria import RankSum, WeightedSum, WorstRatio
from seqopt.problem.own_criterion import StepCost
from seqopt.problem.ranks import Among, Ranked
from seqopt.problem.requirements import Criterion


def floor_of(criterion: Criterion) -> float | None:
    """Return what a step costs at least, from zero.

    Result: None where costs may be negative, depend on what else is looked at, or are not known.
    """
    match criterion:
        case RankSum(ranked=Ranked.CONDITIONAL, among=Among.ALL):
            weights = [weight for _, weight in (*criterion.before, *criterion.after)]
            return 1.0 if min(weights) >= 0 else None
        case WeightedSum():
            return 0.0 if min(weight for _, weight, _ in criterion.terms) >= 0 else None
        case WorstRatio():
            return 0.0
        case StepCost():
            return criterion.least
        case _:
            return None
