"""Props: grips without a robot, as of centering, falsework and struts.

A prop holds its node from when its brick stands until the finished structure is let go: then it is
struck with the last grips of robots. So bricks that stand, and whether a robot holds any, say which
props do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from seqopt.arrays import Terse, Vector
from seqopt.errors import SceneError
from seqopt.scene._checks import check, positive, settle, unless_none, vector, whole
from seqopt.scene.parts import Brick, Robot, _each_way

_NEAR = 1.0  # of a node from where a prop is said to be, over the smallest side of its brick


@dataclass(frozen=True, kw_only=True, repr=False)
class Prop(Terse):
    """What holds a node of a brick that stands, as a robot would, and stays there.

    Parameters
    ----------
    node : int, optional
        The inner node that it holds.
    position : Vector, optional
        In place of a node: a point, m; the nearest node is held.
    stiffness : float or Vector, optional
        As of a `Robot`, N/m; rigid by default.
    direction : Vector, optional
        In which it pushes, of any length, if it cannot pull; by default it does both.
    capacity : float, optional
        Largest force that it bears, N; by default any.

    Examples
    --------
    >>> Prop(node=13, direction=(0, 0, 2))
    Prop(node=13, direction=(0, 0, 1))
    """

    node: int = None  # type: ignore[assignment]  # that next to the position
    position: Vector | None = None
    stiffness: float | Vector | None = None
    direction: Vector | None = None
    capacity: float | None = None

    def __post_init__(self) -> None:
        check(self, "prop", node=unless_none(whole), position=unless_none(vector))
        if (self.node is None) == (self.position is None):
            raise SceneError("prop: give the node that it holds, or a position near one")
        newtons = unless_none(partial(positive, unit="N"))
        ways = unless_none(partial(_each_way, unit="N/m, or none if rigid"))
        check(self, self.label, stiffness=ways, direction=unless_none(vector), capacity=newtons)
        if self.direction is not None:
            size = math.hypot(*self.direction)
            if not size > 0:
                given = list(self.direction)
                raise SceneError(f"{self.label}: direction is {given}; give one that is not zero")
            x, y, z = self.direction  # no zero with a minus
            settle(self, direction=(x / size + 0.0, y / size + 0.0, z / size + 0.0))

    @property
    def label(self) -> str:
        """What messages call it."""
        return f"prop at {f'node {self.node}' if self.position is None else list(self.position)}"

    @property
    def as_robot(self) -> Robot:
        """A robot that gives way and carries as much."""
        payload = math.nextafter(math.inf, 0) if self.capacity is None else self.capacity
        return Robot(name=self.label, payload=payload, stiffness=self.stiffness)


def settled_props(props: Sequence[Prop], bricks: Mapping[int, Brick]) -> tuple[Prop, ...]:
    """Return props, those given by a position at the nearest nodes of bricks."""
    out = dict[int, Prop]()
    for given in props:
        prop = given
        if (at := prop.position) is not None:
            away, node = min((math.dist(b.node_position(n), at), n) for n, b in bricks.items())
            most = _NEAR * min(bricks[node].dimensions)
            if away > most:
                raise SceneError(
                    f"{prop.label}: the nearest node, {node}, is {away:.3g} m away; give a point "
                    f"at most {most:.3g} m from one"
                )
            prop = replace(prop, node=node, position=None)
        if prop.node not in bricks:
            known = f"{min(bricks)} to {max(bricks)}"
            raise SceneError(f"{prop.label}: there is no such node; give one of {known}")
        if prop.node in out:
            raise SceneError(f"{prop.label}: another one holds it; give each its own node")
        out[prop.node] = prop
    return tuple(out.values())
