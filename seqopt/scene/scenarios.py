"""Scenarios: random variations of a scene, reproducible by a seed.

The stiffness of a joint is not known before it is made, nor are the exact weight and position of a
brick. A scenario draws all of these at random. Topology, names, nodes, build order and robots stay
those of the scene. The choices of a schedule therefore mean the same in all scenarios.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import TypeVar

import numpy as np

from seqopt.arrays import Floats, Vector
from seqopt.errors import SceneError
from seqopt.scene.checks import short
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.scene import Scene

_End = TypeVar("_End", Joint, Ground)


def stiffened(scene: Scene, translational: Floats, rotational: Floats) -> Scene:
    """Return a scene whose joints and ground ends are stiffer by factors.

    ``translational``, ``rotational`` (J + G,): a factor for every joint, then for every ground end,
    for all three axes; no unit.
    """
    pairs = [*zip(translational.tolist(), rotational.tolist(), strict=True)]

    def stiffer(spring: _End, factors: tuple[float, float]) -> _End:
        (x, y, z), (a, b, c) = spring.translational_stiffness, spring.rotational_stiffness
        t, r = factors
        return replace(
            spring,
            translational_stiffness=(t * x, t * y, t * z),
            rotational_stiffness=(r * a, r * b, r * c),
        )

    count = len(scene.joints)
    joints = map(stiffer, scene.joints, pairs[:count])
    return replace(
        scene, joints=tuple(joints), grounds=tuple(map(stiffer, scene.grounds, pairs[count:]))
    )


def weighed(scene: Scene, factors: Floats) -> Scene:
    """Return a scene whose bricks are heavier by factors.

    ``factors`` (B,): for the density of every brick, in the scene's order; no unit.
    """
    pairs = zip(scene.bricks, factors.tolist(), strict=True)
    return replace(scene, bricks=tuple(replace(b, density=b.density * f) for b, f in pairs))


def shifted(scene: Scene, size: float, rng: np.random.Generator) -> Scene:
    """Return a scene with bricks, joints and ground ends moved up to a size along every axis.

    A brick takes its nodes with it, a ground end its fixed point.

    ``size``: m; every coordinate moves by a uniform draw between minus and plus this.
    """

    def moved(point: Vector, step: Floats) -> Vector:
        x, y, z = (np.array(point) + step).tolist()
        return x, y, z

    def draw() -> Floats:
        return rng.uniform(-size, size, 3)

    grounds = []
    for ground in scene.grounds:
        step = draw()
        grounds.append(
            replace(
                ground, position=moved(ground.position, step), anchor=moved(ground.anchor, step)
            )
        )
    return replace(
        scene,
        bricks=tuple(replace(b, position=moved(b.position, draw())) for b in scene.bricks),
        joints=tuple(replace(j, position=moved(j.position, draw())) for j in scene.joints),
        grounds=tuple(grounds),
    )


MOST = 100_000  # scenarios; more are a slip of the finger
_LARGEST_FACTOR = 1e6


@dataclass(frozen=True)
class Scenarios:
    """Samples of a scene, and how they were drawn.

    ``nominal``: what they are samples of; ``stiffness`` (float, float): least and largest factor of
    a joint's stiffness; ``density``: largest relative change of a brick's density; ``position``:
    largest shift along every axis, m.
    """

    nominal: Scene
    stiffness: tuple[float, float]
    density: float
    position: float
    seed: int
    scenes: tuple[Scene, ...]

    def __repr__(self) -> str:
        low, high = self.stiffness
        return (
            f"<{len(self.scenes)} scenarios of {self.nominal.name}: stiffness times {low:.3g} to "
            f"{high:.3g}, density within {100 * self.density:g} %, position within "
            f"{1000 * self.position:g} mm, seed {self.seed}>"
        )

    @property
    def settings(self) -> dict[str, object]:
        """How they were drawn, ready for JSON."""
        return {
            "count": len(self.scenes),
            "stiffness": list(self.stiffness),
            "density": self.density,
            "position_m": self.position,
            "seed": self.seed,
        }


def scenarios(
    scene: Scene,
    *,
    stiffness: tuple[float, float] = (1 / 3, 3.0),
    density: float = 0.1,
    position: float = 0.002,
    count: int = 30,
    seed: int = 0,
) -> Scenarios:
    """Return random variations of a scene, reproducible by a seed.

    Every joint, ground end, brick and coordinate is drawn on its own. Scenario i depends on the
    seed and i alone: more scenarios leave the first ones as they are, and a spread that is set to
    nothing leaves the others as they are.

    Parameters
    ----------
    scene : Scene
    stiffness : (float, float), optional
        Least and largest factor by which translational and, apart from it, rotational stiffness of
        every joint and ground end are multiplied; log-uniform.
    density : float, optional
        Largest relative change of every brick's density, from 0 to below 1; uniform.
    position : float, optional
        Largest shift of bricks, joints and ground ends along every axis, m; uniform.
    count, seed : int, optional
        How many, and which.

    Returns
    -------
    Scenarios

    Raises
    ------
    SceneError
        If a number is none that can be meant, or a sample is no valid scene.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> scenarios(load_scene("arch25"), count=5, seed=1)  # doctest: +ELLIPSIS
    <5 scenarios of arch25: stiffness times 0.333 to 3, density within 10 %, ... seed 1>
    """
    low, high = _factors(stiffness)
    spread = _from_zero("density", density, most=1.0)
    shift = _from_zero("position", position, most=math.inf)
    number = _whole("count", count, 1, MOST)
    seed = _whole("seed", seed, 0, 2**63)
    drawn = tuple(_sample(scene, (low, high), spread, shift, (seed, i)) for i in range(number))
    return Scenarios(scene, (low, high), spread, shift, seed, drawn)


def _sample(
    scene: Scene,
    factors: tuple[float, float],
    density: float,
    position: float,
    stream: tuple[int, int],
) -> Scene:
    """Return one scenario; each kind of change has random numbers of its own."""
    stiff, heavy, moved = (np.random.default_rng([*stream, kind]) for kind in range(3))
    low, high = map(math.log, factors)
    logs = stiff.uniform(low, high, (2, len(scene.joints) + len(scene.grounds)))
    shares = heavy.uniform(-1.0, 1.0, len(scene.bricks))
    try:
        out = weighed(stiffened(scene, *np.exp(logs)), 1.0 + density * shares)
        return shifted(out, position, moved) if position else out
    except SceneError as error:
        raise SceneError(
            f"scenario {stream[1] + 1} of {scene.name} is not a valid scene ({error}); let "
            "positions, densities and stiffnesses vary less"
        ) from error


def _factors(given: Sequence[float]) -> tuple[float, float]:
    """Return the least and the largest factor."""
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not 1 / _LARGEST_FACTOR <= low <= high <= _LARGEST_FACTOR:
        raise SceneError(
            f"stiffness is {short(given)}; give the least and the largest factor, from "
            f"{1 / _LARGEST_FACTOR:g} to {_LARGEST_FACTOR:g}"
        )
    return low, high


def _from_zero(name: str, given: float, most: float) -> float:
    """Return a number from zero to below a limit."""
    if isinstance(given, bool) or not isinstance(given, Real) or not 0 <= given < most:
        limit = f" to below {most:g}" if math.isfinite(most) else ""
        raise SceneError(f"{name} is {short(given)}; give a number from 0{limit}")
    return float(given)


def _whole(name: str, given: int, least: int, most: int) -> int:
    """Return a whole number between limits."""
    try:
        number = least - 1 if isinstance(given, bool) else operator.index(given)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise SceneError(f"{name} is {short(given)}; give a whole number from {least} to {most}")
    return number
