"""That the steps of a plan stand, and by which margins: by the cone program, step by step."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from seqopt.errors import SolverError
from seqopt.graph.states.states import States
from seqopt.problem.standing import Standing, slack
from seqopt.sequence.steps import Step
from seqopt.stability._step_verdicts import each_stability, step_verdicts
from seqopt.stability.assessment import MARGINS, Stability, Verdict

SURE = 1e-3  # rad, or as a share: how far the cone program may be from what forces prove


def proven_margins(problem: States, steps: Sequence[Step]) -> dict[str, float]:
    """Return the worst margins of a plan, as goals count them; every step must stand as demanded.

    Margins are found only where they are asked for: ``bond`` (Pa), ``friction``, and how far
    ``tilt`` is from a right angle (rad); NaN where nothing is proven of a step. A `SolverError`
    names the step that is not proven to stand.
    """
    standing, has_margins = problem.standing, any(goal.of_margins for goal in problem.goals)
    if not (has_margins or (standing and standing.tilt)):
        if standing is not None:
            verdicts = step_verdicts(problem.network, steps, standing.mortar)
            for step, verdict in zip(steps, verdicts, strict=True):
                if verdict is not Verdict.STANDS:
                    raise _falls(step, verdict.value)
        return {}
    results = certified(problem, steps)
    for step, result in zip(steps, results, strict=True):
        tilted = standing is not None and result.tilt < standing.tilt - SURE
        if standing is not None and (tilted or result.verdict is not Verdict.STANDS):
            raise _falls(step, f"{result.verdict.value}, tilt survived {result.tilt:.4g} rad")
    return {
        "bond": float(np.max([result.bond for result in results])),
        "friction": float(np.max([result.friction for result in results])),
        "tilt": float(pi / 2 - np.min([result.tilt for result in results])),
    }


def _falls(step: Step, what: str) -> SolverError:
    return SolverError(f"step {step.number} is not proven to stand as demanded: {what}")


def certified(problem: States, steps: Sequence[Step]) -> tuple[Stability, ...]:
    """Return verdict and margins of every step by the cone program; of equal ones once."""
    mortar = (problem.standing or Standing()).mortar
    for step in steps:
        if (step.bricks, step.grips) not in problem.certified:
            (result,) = each_stability(problem.network, [step], mortar, MARGINS)
            problem.certified[step.bricks, step.grips] = result
    return tuple(problem.certified[step.bricks, step.grips] for step in steps)


def require_margin(name: str, claimed: float, proven: float) -> None:
    """Raise a `SolverError` if a margin is worse than claimed by more than its proven width."""
    if not proven <= claimed + slack(name, claimed):
        raise SolverError(f"{name} is {proven:.6g}, not {claimed:.6g} as claimed")
