"""Whether a problem, a formulation and its options fit together."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real

import numpy as np

from seqopt.errors import ProblemError
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.plan.calling.formulation import Formulation, as_formulation, formulations
from seqopt.scene.checks import short


def require_fit(
    problem: PlacementProblem, formulation: Formulation | str, options: Mapping[str, object]
) -> None:
    """Raise an error unless a formulation can solve a problem and has the given options.

    Raises `ProblemError` if the problem has budgets that the formulation does not take, or an
    option is not its own.
    """
    formulation = as_formulation(formulation)
    if problem.budgets and not formulation.takes_budgets:
        able = [name for name, other in formulations(formulation.on).items() if other.takes_budgets]
        raise ProblemError(
            f"{formulation.name}: the budget {problem.budgets[0].name!r} couples all moves; "
            f"use {' or '.join(able)}"
        )
    for name in options:
        if name not in formulation.options:
            known = ", ".join(formulation.options) or "no options"
            raise ProblemError(f"option {name}: {formulation.name} has {known}")


def require_time(formulation: Formulation, time_limit: float) -> None:
    """Raise an error unless a time limit is one, and the formulation can keep it.

    ``time_limit``: s. Raises `ProblemError` if it is no time, or the formulation takes none.
    """
    if not isinstance(time_limit, Real) or not time_limit >= 0:
        raise ProblemError(f"time_limit is {short(time_limit)}; give seconds from 0")
    if np.isfinite(time_limit) and not formulation.watched:
        raise ProblemError(f"{formulation.name} takes no time limit; leave it out")


def require_proof(proof: object) -> None:
    """Raise an error where a lazy search is to leave out the proof, which is all it is for.

    Raises `ProblemError`.
    """
    if not proof:
        raise ProblemError("a lazy search proves what it finds; leave out lazy, or ask for a proof")
