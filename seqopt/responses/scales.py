"""Scales of a scene's responses: its units, its crown, and what fixed methods reach of each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.engines.interface import Engine
from seqopt.engines.registry import recipe_of
from seqopt.errors import MechanismError, StepError
from seqopt.responses._tolerance import COLUMN, is_tolerance, misfits_along
from seqopt.responses.quantities import EXCESS_COLUMN, PROP_EXCESS, RESPONSES, robot_response
from seqopt.responses.table import _analyzed, _Columns, force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.methods import METHODS

LEVEL = 1e-9  # heights this close, over the height of the structure, are equal
NEVER = math.inf  # the brick count of a crown that is never reached
OWN = " over payload, weight and size"  # what it is named after where no fixed method gives scales
SCALED = ("F_largest", "M_sup", "T_max", "D_max")  # responses to which fixed methods give scales


@dataclass(frozen=True, eq=False, repr=False)
class Units:
    """A force, a moment and a displacement that grow as a scene's responses do."""

    force: float  # N; the mean weight of a brick
    moment: float  # N m; that weight at the mean length of a brick
    displacement: float  # m; that weight over the median translational stiffness of the joints

    def of(self, response: str) -> float:
        """Return the unit of a response, by its first letter: N, N m or m."""
        return {"M": self.moment, "D": self.displacement}.get(response[0], self.force)


def crown(scene: Scene) -> float:
    """Return how many bricks are placed when a build reaches its crown.

    The crown is the first of the highest bricks, by their centroids, if the build rises to it and
    comes down again after it: `NEVER` where the build ends at its highest level, as that of a wall.
    """
    height = np.array([brick.position for brick in scene.placed]) @ np.array(scene.up)
    level = LEVEL * max(float(np.ptp(height)), *scene.placed[0].dimensions)
    low = height < height.max() - level
    top = int(np.argmin(low))
    return top + 1 if low[0] and low[top:].any() else NEVER


@dataclass(frozen=True, eq=False, repr=False)
class SceneFacts:
    """Numbers of a scene that criteria use, each computed when it is first needed."""

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
        """The units of the scene, each 1 where it has no weight or no stiffness."""
        network = self.engine.network
        weight = float(np.linalg.norm(network.weight, axis=1).mean()) or 1.0
        length = float(np.mean([max(brick.dimensions) for brick in network.scene.bricks]))
        stiffness = network.springs.translational_stiffness
        middle = float(np.median(stiffness[stiffness > 0])) if stiffness.any() else 1.0
        return Units(weight, weight * length, weight / middle)

    @property
    def reference(self) -> Mapping[str, float]:
        """The least that any fixed method reaches of each response's largest value, SI units.

        Where no fixed method can build the scene, or none stands on the way: `own_scales`.
        """
        if not self._reached:
            return self.own_scales
        return {name: min(values[name] for values in self._reached) for name in SCALED}

    @property
    def own_scales(self) -> Mapping[str, float]:
        """Scales that every scene has, SI units: of grip forces the smallest payload.

        Of ``T_max`` it is the weight, of ``M_sup`` this at the scene's size, of ``D_max`` what it
        moves a chain of a joint for every brick.
        """
        scene = self.engine.network.scene
        size = np.ptp([brick.position for brick in scene.bricks], axis=0).max()
        size += max(max(brick.dimensions) for brick in scene.bricks)
        weight = len(scene.bricks) * self.units.force
        names = [*map(robot_response, self.robots), "F_largest"]
        return dict.fromkeys(names, min(robot.payload for robot in scene.robots)) | {
            "T_max": weight,
            "M_sup": weight * float(size),
            "D_max": len(scene.bricks) ** 2 * self.units.displacement,
        }

    @property
    def basis(self) -> str:
        """What is added to the name of a criterion where no fixed method gives scales."""
        return "" if self._reached else OWN

    @cached_property
    def _reached(self) -> list[dict[str, float]]:
        """The largest responses of every fixed method that can build the scene without props."""
        engine, found, recipe = self.engine, [], recipe_of(self.engine)
        if recipe is not None and engine.network.scene.props:
            engine = recipe.make(engine.network.scene.with_props())
        network = engine.network
        for method in METHODS.values():
            with suppress(StepError, MechanismError):
                table = _analyzed(engine, method(network))
                along = ((name, _response_along(network.scene, table, name)) for name in SCALED)
                found.append({name: float(np.nanmax(values)) for name, values in along})
        return found


def _response_along(scene: Scene, table: _Columns, name: str) -> np.ndarray:
    """Return a response of every step (steps,) as limits name it, but ``F_move``.

    They are in SI units, sizes without sign, NaN where the robot does not grip.
    """
    if name == "C_max":
        least = np.asarray(table[RESPONSES["F_min"].column], dtype=float)
        return np.asarray(np.maximum(-least, 0.0))
    if is_tolerance(name):
        return misfits_along(table[COLUMN])
    if name == PROP_EXCESS:
        return np.asarray(table[EXCESS_COLUMN], dtype=float)
    if name in RESPONSES:
        response = RESPONSES[name]
        return np.asarray(table[response.column], dtype=float) / response.scale
    columns = {robot_response(robot.name): force_column(robot) for robot in scene.robots}
    asked = columns.values() if name == "F_largest" else [columns[name]]
    forces = np.abs([np.asarray(table[column], dtype=float) for column in asked])
    return np.asarray(np.fmax.reduce(forces))
