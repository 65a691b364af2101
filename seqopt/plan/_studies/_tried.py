"""The best plan of problems that are alike, such as those of other bases or props."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf

from seqopt.errors import InfeasibleError, NothingFoundError, TimeUpError
from seqopt.graph.formulation import End
from seqopt.plan.plan import Plan
from seqopt.problem.problem import Problem
from seqopt.work.progress import Tell

_SAME = 1e-9  # over the size of a value
_Outcome = tuple[str, tuple[float, ...]]  # of a problem, in words, and its values or bounds


class Tried:
    """The best plan so far of problems that are alike, and what became of each."""

    def __init__(self, problem: Problem, solved: Callable[[Problem], Plan], tell: Tell) -> None:
        self._problem, self._solved, self._tell = problem, solved, tell
        self._best: tuple[float, ...] = ()
        self._plan: Plan | None = None
        self._of: Problem | None = None
        self._rows: list[dict[str, object]] = []
        self._left: list[tuple[float, ...]] = []  # bounds of sets whose best plan is not proven
        self._over = False  # whether somebody ended it before all were looked at

    def _none(self, why: str) -> InfeasibleError | NothingFoundError:
        """Return the error that says why there is no plan, or that none was found."""
        return (
            NothingFoundError(f"{why} as far as is known") if self._left else InfeasibleError(why)
        )

    def _open(self, error: NothingFoundError) -> tuple[str, tuple[float, ...]]:
        """Return what to say of a problem of which no plan was found: it may have any."""
        self._left.append((-inf,))
        return f"no plan was found: {error}", (-inf,)

    @property
    def _proven(self) -> bool:
        """Whether no set that was looked at allows a better plan."""
        return not (self._over or any(is_below(bound, self._best) for bound in self._left))

    def _in_time(self, outcome: Callable[[], _Outcome]) -> _Outcome | None:
        """Return what became of a problem; None if it is interrupted and an incumbent exists."""
        try:
            return outcome()
        except (TimeUpError, KeyboardInterrupt):
            if self._plan is None:
                raise
            self._over = True
            return None

    def _kept(self, problem: Problem, plan: Plan) -> tuple[str, tuple[float, ...]]:
        """Take a plan that is better than those before; return what to say of it."""
        proof, bound = plan.certificate, bound_of(plan)
        value = () if proof is None else proof.values
        self._over |= plan.ended is End.INTERRUPTED
        if is_below(bound, value):
            self._left.append(bound)
        if self._plan is None or is_below(value, self._best):
            self._plan, self._of, self._best = plan, problem, value
        return "solved", value

    def _named(self, bound: tuple[float, ...]) -> dict[str, float]:
        pairs = zip(self._problem.goals, bound, strict=False)
        return {str(goal): goal.shown(value) for goal, value in pairs}


def bound_of(plan: Plan) -> tuple[float, ...]:
    """Return the lower bounds of a plan's goals; of arms those with any posture of the table."""
    if plan.arms is not None and plan.arms.bounds:
        return plan.arms.bounds
    return () if plan.certificate is None else plan.certificate.bounds


def is_below(one: Sequence[float], other: Sequence[float]) -> bool:
    """Return whether values are better, the first that differs counts."""
    for a, b in zip(one, other, strict=False):
        if a != b and not abs(a - b) <= _SAME * max(abs(a), abs(b), _SAME) < inf:
            return a < b
    return False
