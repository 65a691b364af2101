"""An independent proof that states stand, for the judge of free schedules."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.errors import SolverError
from seqopt.graph.states.states import States
from seqopt.problem.standing import Standing, StandingSets, slack
from seqopt.sequence.steps import Step
from seqopt.stability._step_verdicts import each_stability, step_verdicts
from seqopt.stability.assessment import MARGINS, Stability, Verdict

SURE = 1e-3  # rad, or as a share: how far the cone program may be from what forces prove


class StandingProof:
    """Says which states a better plan could pass: what stands, and by which margin at best.

    ``payload``: the most that every robot may carry, N.
    """

    def __init__(self, problem: States, payload: dict[int, float]) -> None:
        self._problem, self._payload = problem, payload
        self._sets: dict[Standing, tuple[StandingSets, ...]] = {}

    def asked(self, margins: Sequence[float]) -> tuple[Standing, ...]:
        """Return what is demanded of states where the first goals, margins, have values."""
        base = self._problem.standing
        pairs = zip(self._problem.goals, margins, strict=False)
        own = ((base or Standing()).demanding(g.response, max(v, 0.0)) for g, v in pairs)
        return (*self._problem.demands, *own)

    def allows_rows(
        self, bricks: int, held: Ints, payload: Floats, margins: Sequence[float]
    ) -> Bools:
        """Return which states are not proven to fall, or to lack a margin.

        ``held`` (S, r): nodes held, ascending, as places in build order counted from 1; zeros for
        none; ``payload`` (S, r): largest force of each, N; ``margins``: of the first goals. Result
        (S,).
        """
        out = np.ones(len(held), dtype=bool)
        for demand in self.asked(margins) if bricks else ():  # an empty site stands
            for known in self._known(demand):
                out[out] = known.may_stand(bricks, held[out], payload[out])
        return out

    def recalled_rows(
        self, bricks: int, held: Ints, payload: Floats, margins: Sequence[float]
    ) -> Ints:
        """Return -1 where the same is known without asking, else 0 or 1."""
        known = [one for demand in self.asked(margins) for one in self._known(demand)]
        if not bricks:
            return np.ones(len(held), dtype=np.int64)
        return np.asarray(np.min([one.recalled(bricks, held, payload) for one in known], axis=0))

    def _known(self, asked: Standing) -> tuple[StandingSets, ...]:
        """Return what is known of a demand in every scenario."""
        if asked not in self._sets:
            loads = np.array(list(self._payload.values()))
            problems = self._problem.each or (self._problem,)
            self._sets[asked] = tuple(StandingSets(p.network, asked, loads) for p in problems)
        return self._sets[asked]


def proven_margins(problem: States, steps: Sequence[Step]) -> dict[str, float]:
    """Return the margins of a plan by the cone program, and require that every step stands.

    Margins are found only where they are asked for: the worst ``bond``, ``friction`` and ``tilt``
    of any step, as goals count them. A `SolverError` names the step that is not proven to stand as
    is demanded.
    """
    standing = problem.standing
    if not (any(goal.of_margins for goal in problem.goals) or (standing and standing.tilt)):
        demanded = standing or Standing()
        verdicts = step_verdicts(problem.network, steps, demanded.mortar)
        for step, verdict in zip(steps, verdicts, strict=True):
            if verdict is not Verdict.STANDS:
                raise _falls(step, verdict.value)
        return {}
    results = certified(problem, steps)
    for step, result in zip(steps if standing else (), results, strict=bool(standing)):
        enough = standing is None or not result.tilt < standing.tilt - SURE
        if not (result.verdict is Verdict.STANDS and enough):
            raise _falls(step, f"{result.verdict.value}, tilt survived {result.tilt:.4g} rad")
    return _worst_margins(results)


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


def _worst_margins(results: Sequence[Stability]) -> dict[str, float]:
    """Return the worst margins of any step, as goals count them.

    Result: ``bond`` (Pa), ``friction``, and how far ``tilt`` is from a right angle (rad); NaN where
    nothing is proven of a step.
    """
    tilts = [result.tilt for result in results]
    return {
        "bond": float(np.max([result.bond for result in results])),
        "friction": float(np.max([result.friction for result in results])),
        "tilt": float(pi / 2 - np.min(tilts)),
    }


def require_margin(name: str, claimed: float, proven: float) -> None:
    """Raise an error if a margin is worse than claimed by more than brackets are wide.

    ``name``: one of `seqopt.problem.standing.MARGINS`. Raises `SolverError`, with both values.
    """
    if not proven <= claimed + slack(name, claimed):
        raise SolverError(f"{name} is {proven:.6g}, not {claimed:.6g} as claimed")
