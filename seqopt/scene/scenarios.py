"""Scenarios: random variations of a scene, reproducible by a seed.

Stiffnesses, weights and positions vary, those of grips too if that is asked for; topology, names,
build order, robots, forces of loads and movements of ground ends stay, so the choices of a schedule
mean the same in all scenarios. Wind varies as weights do.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError, SceneError
from seqopt.scene._checks import as_vector, short, whole_between
from seqopt.scene.parts import Brick, Ground, Joint, Load, Robot
from seqopt.scene.scene import Scene

_Part = TypeVar("_Part", Brick, Joint, Ground, Load)


def _stiffer(part: Any, **factors: float) -> Any:
    """Return a part with stiffnesses, by name, times factors; what is rigid stays so."""
    own = {name: getattr(part, name) for name in factors}
    scaled = {n: v and tuple((factors[n] * np.array(v)).tolist()) for n, v in own.items()}
    return replace(part, **scaled)


def _stiffened(scene: Scene, translational: Floats, rotational: Floats) -> Scene:
    """Return a scene stiffer by factors (J + G,), one for every joint, then every ground end."""
    springs = (*scene.joints, *scene.grounds)
    factors = zip(springs, translational.tolist(), rotational.tolist(), strict=True)
    out = [
        _stiffer(spring, translational_stiffness=shift, rotational_stiffness=turn)
        for spring, shift, turn in factors
    ]
    joints = len(scene.joints)
    return replace(scene, joints=tuple(out[:joints]), grounds=tuple(out[joints:]))


def weighed(scene: Scene, factors: Floats) -> Scene:
    """Return a scene whose bricks are heavier by factors (B,), in the scene's order; no unit."""
    pairs = zip(scene.bricks, factors.tolist(), strict=True)
    return replace(scene, bricks=tuple(replace(b, density=b.density * f) for b, f in pairs))


def _moved(part: _Part, step: Floats) -> _Part:
    """Return a part somewhere else, m; a load that acts at a centroid stays there."""
    if part.position is None:
        return part
    return replace(part, position=as_vector(np.array(part.position) + step))


def shifted(scene: Scene, size: float, rng: np.random.Generator) -> Scene:
    """Return a scene moved up to a size along every axis, m, uniformly and piece by piece.

    A brick takes its nodes and loads with it, a ground end its fixed point.
    """
    parts = scene.grounds, scene.bricks, scene.joints  # in which order they draw
    ends, steps, gaps = (rng.uniform(-size, size, (len(some), 3)) for some in parts)
    of_brick = {brick.name: step for brick, step in zip(scene.bricks, steps, strict=True)}
    return replace(
        scene,
        grounds=tuple(
            replace(_moved(ground, step), anchor=as_vector(np.array(ground.anchor) + step))
            for ground, step in zip(scene.grounds, ends, strict=True)
        ),
        bricks=tuple(map(_moved, scene.bricks, steps)),
        joints=tuple(map(_moved, scene.joints, gaps)),
        loads=tuple(_moved(load, of_brick[load.brick]) for load in scene.loads),
    )


MOST = 100_000  # scenarios; more are a slip of the finger
_LARGEST_FACTOR = 1e6
_ALIKE = (1.0, 1.0)  # factors of what does not vary


@dataclass(frozen=True)
class Scenarios:
    """Samples of a scene, and how they were drawn.

    ``stiffness``: least and largest factor; ``density``: largest relative change; ``position``:
    largest shift, m; ``grips``: least and largest factor of grips' stiffness.
    """

    nominal: Scene
    stiffness: tuple[float, float]
    density: float
    position: float
    seed: int
    scenes: tuple[Scene, ...]
    grips: tuple[float, float] = _ALIKE

    def __repr__(self) -> str:
        low, high = self.stiffness
        least, most = self.grips
        held = f", grips times {least:.3g} to {most:.3g}" if least < most else ""
        return (
            f"<{len(self.scenes)} scenarios of {self.nominal.name}: stiffness times {low:.3g} to "
            f"{high:.3g}, density within {100 * self.density:g} %, position within "
            f"{1000 * self.position:g} mm{held}, seed {self.seed}>"
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
        } | ({"grips": list(self.grips)} if self.grips != _ALIKE else {})


def scenarios(
    scene: Scene,
    *,
    stiffness: tuple[float, float] = (1 / 3, 3.0),
    density: float = 0.1,
    position: float = 0.002,
    grips: tuple[float, float] = _ALIKE,
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
    grips : (float, float), optional
        Least and largest factor of the stiffness of grips, the same for all robots of one
        compliance, with the joints of arms; log-uniform. Rigid grips stay rigid.
    count, seed : int, optional
        How many, and which.

    Returns
    -------
    Scenarios

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> scenarios(load_scene("arch25"), count=5, seed=1)  # doctest: +ELLIPSIS
    <5 scenarios of arch25: stiffness times 0.333 to 3, density within 10 %, ... seed 1>
    """
    factors, held = _factors("stiffness", stiffness), _factors("grips", grips)
    for name, given, most in (("density", density, 1.0), ("position", position, math.inf)):
        if isinstance(given, bool) or not isinstance(given, Real) or not 0 <= given < most:
            limit = f" to below {most:g}" if math.isfinite(most) else ""
            raise SceneError(f"{name} is {short(given)}; give a number from 0{limit}")
    number = whole_between("count", count, 1, MOST)
    seed = whole_between("seed", seed, 0, 2**63)
    drawn = Scenarios(scene, factors, float(density), float(position), seed, (), held)
    return replace(drawn, scenes=tuple(_sample(drawn, i) for i in range(number)))


def _sample(of: Scenarios, number: int) -> Scene:
    """Return one scenario, by number; each kind of change has random numbers of its own."""
    scene = of.nominal
    stiff, heavy, moved, held = (np.random.default_rng([of.seed, number, k]) for k in range(4))
    (low, high), (least, most) = (map(math.log, ends) for ends in (of.stiffness, of.grips))
    logs = stiff.uniform(low, high, (2, len(scene.joints) + len(scene.grounds)))
    grips, robots = np.exp(held.uniform(least, most, len(scene.grip_kinds.turns))), list[Robot]()
    kinds = scene.grip_kinds.of_robot if least < most else ()
    for robot, kind in zip(scene.robots, kinds, strict=False):  # props follow
        factor = float(grips[kind])
        arm = robot.arm and _stiffer(robot.arm, joint_stiffness=factor)
        grip = _stiffer(robot, stiffness=factor, rotational_stiffness=factor)
        robots.append(replace(grip, arm=arm))
    shares = heavy.uniform(-1.0, 1.0, len(scene.bricks))
    try:
        out = weighed(_stiffened(scene, *np.exp(logs)), 1.0 + of.density * shares)
        out = out.with_robots(*robots) if robots else out
        return shifted(out, of.position, moved) if of.position else out
    except SceneError as error:
        raise SceneError(
            f"scenario {number + 1} of {scene.name} is not a valid scene ({error}); let "
            "positions, densities and stiffnesses vary less"
        ) from error


def _factors(name: str, given: Sequence[float]) -> tuple[float, float]:
    try:
        low, high = (float(value) for value in given)
    except (TypeError, ValueError):
        low, high = math.nan, math.nan
    if not 1 / _LARGEST_FACTOR <= low <= high <= _LARGEST_FACTOR:
        raise SceneError(
            f"{name} is {short(given)}; give the least and the largest factor, from "
            f"{1 / _LARGEST_FACTOR:g} to {_LARGEST_FACTOR:g}"
        )
    return low, high


def require_alike(nominal: Scene, scene: Scene, number: int) -> None:
    """Raise a `ProblemError` if a scenario differs in more than stiffness, density, position."""
    if not isinstance(scene, Scene):
        raise ProblemError(f"scenario {number}: {short(scene)} is not a scene")

    def meant(it: Scene) -> tuple[object, ...]:
        joints = tuple(joint.bricks for joint in it.joints)
        ends = tuple((ground.brick, ground.closes_with) for ground in it.grounds)
        nodes = tuple((brick.name, brick.nodes) for brick in it.placed)
        robots = tuple(robot.name for robot in it.robots)
        props = tuple(prop.node for prop in it.props)
        return joints, ends, nodes, robots, props, it.blocked_nodes, (*it.grip_kinds.of_robot,)

    if meant(nominal) != meant(scene):
        raise ProblemError(
            f"scenario {number}: it has other bricks, nodes, joints, robots or props, or another "
            f"build order than {nominal.name}, or other robots share a compliance; vary "
            "stiffnesses, densities and positions alone"
        )
