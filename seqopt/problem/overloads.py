"""Payloads and limits, checked in every step of a plan, also where nothing is chosen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from seqopt.problem.requirements import Limit, payload_limits
from seqopt.responses.quantities import RESPONSES, robot_response, steps_in_words
from seqopt.responses.table import force_column
from seqopt.scene.scene import Scene


@dataclass(frozen=True)
class Excess:
    """A limit that some steps of a build exceed.

    ``steps``: numbers of the steps; ``largest``: the largest value in them, SI units; ``robot``:
    whose payload it is; empty for other limits.
    """

    limit: Limit
    steps: tuple[int, ...]
    largest: float
    robot: str = ""

    def __str__(self) -> str:
        where = steps_in_words(self.steps)
        if self.robot:
            return (
                f"{self.robot} holds up to {self.largest:.1f} N, more than its payload of "
                f"{self.limit.bound:g} N ({where})"
            )
        return (
            f"{self.limit.response} is up to {self.largest:.6g} of {self.limit.bound:.6g} ({where})"
        )


def excesses(scene: Scene, table: pd.DataFrame, limits: Sequence[Limit]) -> tuple[Excess, ...]:
    """Return the limits that steps exceed.

    ``table``: responses of the steps, from `seqopt.analyze`; ``limits``: one on ``F_move``, which
    only open steps have, is left out. Result: in the order of the limits.
    """
    out = []
    for limit in limits:
        if limit.response == "F_move":
            continue
        values = _response_along(scene, table, limit.response)
        over = limit.exceeded(values)
        if over.any():
            steps = tuple(int(number) for number in table["step"][over])
            out.append(Excess(limit, steps, float(values[over].max())))
    return tuple(out)


def overloads(scene: Scene, table: pd.DataFrame) -> tuple[Excess, ...]:
    """Return the payloads that steps exceed; see `excesses`.

    ``table``: from `seqopt.analyze`. Result: in the order of the robots.
    """
    names = {robot_response(robot.name): robot.name for robot in scene.robots}
    found = excesses(scene, table, payload_limits(scene))
    return tuple(replace(excess, robot=names[excess.limit.response]) for excess in found)


def _response_along(scene: Scene, table: pd.DataFrame, name: str) -> np.ndarray:
    """Return a response of every step as limits name it.

    ``table``: from `seqopt.analyze`; ``name``: ``T_max``, ``C_max``, ``M_sup``, ``D_max``,
    ``F_largest`` or ``F_`` and a robot's name. Result (steps,): SI units, sizes without sign; NaN
    where the robot does not grip.
    """
    if name == "C_max":
        return np.asarray(np.maximum(-table[RESPONSES["F_min"].column].to_numpy(float), 0.0))
    if name in RESPONSES:
        response = RESPONSES[name]
        return table[response.column].to_numpy(float) / response.scale
    forces = {
        robot_response(robot.name): table[force_column(robot)].abs() for robot in scene.robots
    }
    if name == "F_largest":
        return pd.DataFrame(forces).max(axis=1).to_numpy(float)
    return forces[name].to_numpy(float)
