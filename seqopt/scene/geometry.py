"""Checks that the geometry of a scene can be computed with.

A joint at an inner node would make an edge without length, a brick very far from the origin would
lose its size to rounding, and an enormous weight would overflow. Such values are refused. Values
that are merely unusual get a warning (`seqopt.scene.doubts`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from seqopt.arrays import Vector
from seqopt.errors import SceneError
from seqopt.scene.parts import Brick, Ground, Joint

AT_NODE = 1e-6  # distance treated as zero, over the length of the brick
FAR = 1e9  # of a position from the origin, over the smallest dimension: digits are lost beyond
SIZES = (1e-9, 1e9)  # m; dimensions that a brick may have
HEAVY = 1e100  # N, N/m, N m/rad; squares of what is beyond overflow, of its inverse vanish


def check_bricks(bricks: Sequence[Brick], gravity: Vector) -> None:
    """Require bricks that have a size, a place and a weight.

    Parameters
    ----------
    bricks : sequence of Brick
    gravity : Vector
        m/s².

    Raises
    ------
    SceneError
        Naming the brick.
    """
    pull = math.hypot(*gravity)
    for brick in bricks:
        where, smallest = f"brick {brick.name}", min(brick.dimensions)
        if not SIZES[0] <= smallest <= max(brick.dimensions) <= SIZES[1]:
            raise SceneError(
                f"{where}: dimensions are {list(brick.dimensions)}; "
                f"give meters, from {SIZES[0]:g} to {SIZES[1]:g}"
            )
        if max(map(abs, brick.position)) > FAR * smallest:
            raise SceneError(
                f"{where}: position is {list(brick.position)}, so far out that its size is lost "
                "to rounding; move the scene to the origin"
            )
        if pull and not 1 / HEAVY <= brick.mass * pull <= HEAVY:
            raise SceneError(
                f"{where}: it weighs {brick.mass * pull:g} N; correct its density "
                f"{brick.density:g} kg/m³ or the scene's gravity {pull:g} m/s²"
            )


def check_springs(springs: Sequence[Joint | Ground], bricks: Mapping[int, Brick]) -> None:
    """Require joints and ground ends whose edges have a length.

    Parameters
    ----------
    springs : sequence of Joint or Ground
    bricks : mapping of int to Brick
        By name.

    Raises
    ------
    SceneError
        Naming the joint or ground end.
    """
    farthest = FAR * max(max(brick.dimensions) for brick in bricks.values())
    for spring in springs:
        ends = spring.bricks if isinstance(spring, Joint) else (spring.brick,)
        where = (
            f"joint {spring.bricks}"
            if isinstance(spring, Joint)
            else f"ground end of brick {ends[0]}"
        )
        points = {"position": spring.position}
        if isinstance(spring, Ground):
            points["anchor"] = spring.anchor
        for name, point in points.items():
            if max(map(abs, point)) > farthest:
                raise SceneError(f"{where}: {name} is {list(point)}; move it to its bricks")
        stiffness = (*spring.translational_stiffness, *spring.rotational_stiffness)
        stiffest = max(stiffness)
        softest = min(filter(None, stiffness), default=1.0)
        if stiffest > HEAVY or softest < 1 / HEAVY:
            wrong = stiffest if stiffest > HEAVY else softest
            raise SceneError(
                f"{where}: a stiffness is {wrong:g}; give 0, or from {1 / HEAVY:g} to {HEAVY:g}"
            )
        for brick in (bricks[end] for end in ends):
            _check_edges(where, spring, brick)


def _check_edges(where: str, spring: Joint | Ground, brick: Brick) -> None:
    """Require a joint off the nodes of a brick, and a stub with a length."""
    near = AT_NODE * brick.dimensions[0]
    for node in brick.nodes:
        if math.dist(brick.node_position(node), spring.position) <= near:
            raise SceneError(
                f"{where}: position is that of node {node} of brick {brick.name}; "
                "give a point between the faces that it joins"
            )
    if isinstance(spring, Ground) and math.dist(spring.anchor, spring.position) <= near:
        raise SceneError(f"{where}: anchor and position are one point; give the stub a length")
