"""The makespan as an amount of whole builds, with its twin for the judge."""

from typing import Any

from seqopt.errors import ProblemError, StepError
from seqopt.judge.certificate import PathTwin
from seqopt.problem.amounts import Amount
from seqopt.times._clock import TimedRows, claimed_time, path_makespan
from seqopt.times._step_check import makespan_of_steps
from seqopt.times._steps import have_speeds, require_durations

TWIN = PathTwin(makespan_of_steps, TimedRows, path_makespan, claimed_time)


def _check(problem: Any) -> None:
    """Raise a `ProblemError` unless it is known how long those take who take part."""
    scene, rules = problem.network.scene, problem.rules
    try:
        require_durations(scene, rules.team(scene))
    except StepError as error:
        raise ProblemError(f"makespan: {error}") from None


makespan = Amount("makespan", unit="s", twin=TWIN, needs_stays=have_speeds, check=_check)
