"""What a state of a free schedule has: limits and criteria on anything else are refused."""

from __future__ import annotations

from collections.abc import Sequence

from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.problem.amounts import STATE_RESPONSES, Amount
from seqopt.problem.criteria import RankSum
from seqopt.problem.filters import Filter
from seqopt.problem.requirements import Criterion, Limit, SceneFacts, _step_limits
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import PROP_EXCESS, robot_response


def checked_limits(limits: Sequence[Limit], network: Network) -> tuple[Limit, ...]:
    """Return the limits, checked to be on responses of a state."""
    limits = _step_limits(limits, network.scene)
    robots = {robot_response(robot.name) for robot in network.scene.robots}
    for limit in limits:
        _require(limit.response, {*STATE_RESPONSES, PROP_EXCESS, *robots}, "limit")
    return limits


def check_parts(parts: Sequence[Amount | Filter]) -> None:
    """Raise a `ProblemError` if an amount or a filter asks for a response that no state has."""
    for part in parts:
        for name in part.responses:
            _require(name, {*STATE_RESPONSES}, f"{type(part).__name__.lower()} {part}")


def of_states(engine: Engine, criterion: Criterion) -> Criterion:
    """Return a criterion posed for a scene, if it is about states alone."""
    if isinstance(criterion, RankSum):
        raise ProblemError(
            f"criterion {criterion.name}: it ranks the choices of a move, and a free schedule "
            "has none; take worst-ratio or weighted, or a schedule with open grips, as loop"
        )
    for name in criterion.wanted(1):
        _require(name, {*STATE_RESPONSES}, f"criterion {criterion.name}")
    return criterion.for_scene(SceneFacts(engine))


def _require(name: str, known: set[str], where: str) -> None:
    if name not in known and not is_tolerance(name):
        listed = ", ".join(sorted(known))
        raise ProblemError(f"{where}: a state of a free schedule has no {name}; give {listed}")
