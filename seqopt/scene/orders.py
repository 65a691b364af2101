"""Build orders other than the scene's own, from any end."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import networkx as nx

from seqopt.errors import SceneError, did_you_mean
from seqopt.scene.checks import short, wholes
from seqopt.scene.scene import Scene

Order = tuple[int, ...]
_PART = re.compile(r"(-?\d+)(?:\.\.(-?\d+))?")


def from_all_ends(scene: Scene) -> Order:
    """Return the order that builds from all ground ends at once.

    Result: bricks by how many joints lie between them and the nearest ground end, those of one
    number in turn from one ground end to the next; then those that no joint ties to any.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> from_all_ends(load_scene("arch25"))[:5]
    (1, 25, 2, 24, 3)
    """
    graph: nx.Graph[int] = nx.Graph([joint.bricks for joint in scene.joints])
    graph.add_nodes_from(scene.build_order)
    far: dict[int, tuple[int, int]] = {}
    for end, ground in enumerate(scene.grounds):
        for brick, joints in nx.single_source_shortest_path_length(graph, ground.brick).items():
            far[brick] = min(far.get(brick, (joints, end)), (joints, end))
    last = (len(scene.bricks), len(scene.grounds))
    return tuple(sorted(scene.build_order, key=lambda name: far.get(name, last)))


def _reversed(scene: Scene) -> Order:
    return scene.build_order[::-1]


ORDERS: dict[str, Callable[[Scene], Order]] = {"reversed": _reversed, "ends": from_all_ends}
"""Orders by name: the scene's own from its last brick on, and from all ground ends at once."""


def parse_order(scene: Scene, text: str) -> Order:
    """Return an order from words.

    ``text``: a key of `ORDERS`, or names of bricks with commas between them, runs as ``1..12`` or
    ``25..13``.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> parse_order(load_scene("arch25"), "1..12,25..13")[11:14]
    (12, 25, 24)
    """
    if text in ORDERS:
        return ORDERS[text](scene)
    out: list[int] = []
    for part in text.split(","):
        found = _PART.fullmatch(part.strip())
        if found is None:
            hint = did_you_mean(text, (*ORDERS, "search"))
            raise SceneError(
                f"order {short(text)}{hint}: give {', '.join(ORDERS)}, or names of bricks as "
                "1,2,5..9"
            )
        first, last = int(found[1]), int(found[2] or found[1])
        if abs(last - first) > len(scene.bricks):
            raise SceneError(f"order {short(text)}: {part} are more bricks than the scene has")
        step = 1 if last >= first else -1
        out += range(first, last + step, step)
    return tuple(out)


def in_order(scene: Scene, order: Sequence[int] | str | None) -> Scene:
    """Return a scene whose bricks are placed in an order.

    ``order``: names of all bricks, or words as `parse_order` takes them; None for the scene's own.
    Raises `SceneError` if a brick is missing, unknown or named twice.

    Examples
    --------
    >>> from seqopt.scene.scene_file import load_scene
    >>> in_order(load_scene("arch25"), "reversed").placed[0].name
    25
    """
    if order is None:
        return scene
    if isinstance(order, str):
        given = parse_order(scene, order)
    else:
        given = wholes(f"scene {scene.name}: order", order)
    _require_all(scene, given)
    return replace(scene, build_order=given)


def _require_all(scene: Scene, order: Iterable[int]) -> None:
    """Raise an error unless an order names every brick once."""
    left = {*scene.build_order}
    for name in order:
        if name not in left:
            why = "occurs twice" if name in scene.build_order else "is no brick"
            raise SceneError(f"scene {scene.name}: order: {name} {why}; name every brick once")
        left.remove(name)
    if left:
        raise SceneError(
            f"scene {scene.name}: order: {len(left)} bricks are missing, {min(left)} among them; "
            "name every brick once"
        )
