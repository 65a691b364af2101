"""Engines of a scene in other states of the world: its scenarios."""

from __future__ import annotations

from seqopt.engines.interface import Engine
from seqopt.engines.registry import Recipe, make_engine, recipe_of
from seqopt.errors import ProblemError
from seqopt.scene.checks import short
from seqopt.scene.scene import Scene


def recipe_for(engine: Engine, scene: Scene) -> Recipe:
    """Return how to make an engine for another scene; a `ProblemError` where nobody knows."""
    recipe = recipe_of(engine)
    if recipe is None:
        raise ProblemError(
            f"engine {type(engine).__name__}: scenarios need engines of their own; take "
            "one of seqopt.make_engine"
        )
    return Recipe(recipe.engine, scene, recipe.options)


def engine_for(engine: Engine, scene: Scene) -> Engine:
    """Return an engine of the same kind and settings for another scene."""
    recipe = recipe_for(engine, scene)
    return make_engine(recipe.engine, recipe.scene, **recipe.options)  # type: ignore[arg-type]


def require_alike(nominal: Scene, scene: Scene, number: int) -> None:
    """Raise an error if the choices of a schedule do not mean the same in a scenario."""
    if not isinstance(scene, Scene):
        raise ProblemError(f"scenario {number}: {short(scene)} is not a scene")

    def meant(it: Scene) -> tuple[object, ...]:
        joints = tuple(joint.bricks for joint in it.joints)
        ends = tuple((ground.brick, ground.closes_with) for ground in it.grounds)
        nodes = tuple((brick.name, brick.nodes) for brick in it.placed)
        robots = tuple(robot.name for robot in it.robots)
        return joints, ends, nodes, robots, it.blocked_nodes

    if meant(nominal) != meant(scene):
        raise ProblemError(
            f"scenario {number}: it has other bricks, nodes, joints, robots or another build order "
            f"than {nominal.name}; vary stiffnesses, densities and positions alone"
        )
