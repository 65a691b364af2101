"""What criteria take from a scene if the user gives no number: its crown, units and scales."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.engines.interface import Engine
from seqopt.errors import MechanismError, StepError
from seqopt.network.network import Network
from seqopt.responses.quantities import RESPONSES, robot_response
from seqopt.responses.table import analyze, force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS

LEVEL = 1e-9  # heights this close, over the height of the structure, are equal
NEVER = math.inf  # the brick count of a crown that is never reached
OWN = " over payload, weight and size"  # what it is named after where no fixed method gives scales
ROUNDED = (
    ("F", 0.0278513762761887),
    ("T", 0.0278513762761887),
    ("C", 0.0278513762761887),
    ("M", 0.11321697673247444),
    ("D", 8.531988813508194),
)
"""What ranks round responses to, by first letter, in the units of `Units`.

About a thirty-sixth of a brick's weight, a ninth of it at a brick's length, and eight times
what a joint gives way under it: 1 N, 1 N m and 1e-6 m on the arch of Bruun et al., whose published
choices speak for such a rounding.
"""


@dataclass(frozen=True)
class Units:
    """A force (N), a moment (N m) and a displacement (m) that grow as a scene's responses do.

    ``force``: the mean weight of a brick; ``moment``: that weight at the mean length of a brick;
    ``displacement``: that weight over the median stiffness of the joints against translation.
    """

    force: float
    moment: float
    displacement: float

    def of(self, response: str) -> float:
        """Return the unit of a response, by its first letter.

        Result: n, N m or m.
        """
        units = {
            "F": self.force,
            "T": self.force,
            "C": self.force,
            "M": self.moment,
            "D": self.displacement,
        }
        return units[response[0]]


def _scene_units(network: Network) -> Units:
    """Return the units of a scene.

    Result: each 1 where the scene has no weight or no stiffness.
    """
    weight = float(np.linalg.norm(network.weight, axis=1).mean()) or 1.0
    length = float(np.mean([max(brick.dimensions) for brick in network.scene.bricks]))
    stiffness = network.springs.translational_stiffness
    middle = float(np.median(stiffness[stiffness > 0])) if stiffness.any() else 1.0
    return Units(weight, weight * length, weight / middle)


def own_scales(network: Network) -> Mapping[str, float]:
    """Return scales that every scene has, for one that no fixed method builds.

    Result: SI units: of grip forces the smallest payload; of ``T_max`` the weight of the structure,
    of ``M_sup`` this at its size, of ``D_max`` what it moves a chain of a joint for every brick.
    """
    scene, units = network.scene, _scene_units(network)
    count = len(scene.bricks)
    size = np.ptp([brick.position for brick in scene.bricks], axis=0).max()
    size += max(max(brick.dimensions) for brick in scene.bricks)
    weight, payload = count * units.force, min(robot.payload for robot in scene.robots)
    forces = {robot_response(robot.name): payload for robot in scene.robots}
    moved = count**2 * units.displacement
    return forces | {
        "F_largest": payload,
        "T_max": weight,
        "M_sup": weight * float(size),
        "D_max": moved,
    }


def crown(scene: Scene) -> float:
    """Return how many bricks are placed when a build reaches its crown.

    The crown is the first of the highest bricks, by their centroids, if the build rises to it and
    comes down again after it.

    Result: `NEVER` where the build ends at its highest level, as that of a wall.
    """
    height = np.array([brick.position for brick in scene.placed]) @ np.array(scene.up)
    level = LEVEL * max(float(np.ptp(height)), *scene.placed[0].dimensions)
    top = int(np.argmax(height >= height.max() - level))
    low = height < height.max() - level
    return top + 1 if low[0] and low[top:].any() else NEVER


@dataclass(frozen=True)
class SceneFacts:
    """What criteria may ask of a scene, each computed when it is first asked for.

    ``engine``: computes the responses of the scene's fixed methods.
    """

    engine: Engine

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the scene's robots."""
        return tuple(robot.name for robot in self.engine.network.scene.robots)

    @cached_property
    def crown(self) -> float:
        """See `crown`."""
        return crown(self.engine.network.scene)

    @cached_property
    def units(self) -> Units:
        """See `_scene_units`."""
        return _scene_units(self.engine.network)

    @property
    def reference(self) -> Mapping[str, float]:
        """The least that any fixed method reaches of each response's largest value, SI units.

        Where no fixed method can build the scene, or none stands on the way: see `own_scales`.
        """
        if not self._reached:
            return own_scales(self.engine.network)
        return {name: min(values[name] for values in self._reached) for name in self._reached[0]}

    @property
    def basis(self) -> str:
        """What is added to the name of a criterion where no fixed method gives scales."""
        return "" if self._reached else OWN

    @cached_property
    def _reached(self) -> tuple[dict[str, float], ...]:
        """The largest responses of every fixed method that can build the scene."""
        found: list[dict[str, float]] = []
        for method in METHODS.values():
            with suppress(StepError, MechanismError):
                found.append(self._largest(method(self.engine.network)))
        return tuple(found)

    def _largest(self, steps: tuple[Step, ...]) -> dict[str, float]:
        """Return the largest responses of a method's steps, SI units."""
        table = analyze(self.engine, steps)
        forces = {
            robot_response(robot.name): float(table[force_column(robot)].abs().max())
            for robot in self.engine.network.scene.robots
        }
        out = {"F_largest": float(np.nanmax([*forces.values()]))}
        for name in ("T_max", "M_sup", "D_max"):
            response = RESPONSES[name]
            out[name] = float(table[response.column].max()) / response.scale
        return out
