"""What is not modeled beside mortar that cures, and says so."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.problem.problem import Goal
from seqopt.problem.standing import Standing


class _Asked(Protocol):
    """What is asked of a build."""

    @property
    def standing(self) -> Standing | None: ...
    @property
    def goals(self) -> Sequence[Goal]: ...
    @property
    def scenarios(self) -> Sequence[Engine]: ...
    @property
    def network(self) -> Network: ...


def require_for_curing(problem: _Asked) -> None:
    """Raise a `ProblemError` where mortar cures and what is asked beside it is not modeled."""
    if problem.standing is None or problem.standing.curing is None:
        return
    wrong = [str(goal) for goal in problem.goals if goal.of_margins]
    wrong += ["props"] if problem.network.scene.props else []
    wrong += ["scenarios"] if problem.scenarios else []
    if wrong:
        raise ProblemError(f"curing: {wrong[0]} beside it is not modeled; leave one of them out")
