"""Words that say where props stand, and what they bear."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from seqopt.errors import SceneError, did_you_mean
from seqopt.problem._limit_words import number_word
from seqopt.scene._checks import short
from seqopt.scene._props import Prop
from seqopt.scene.scene import Scene

_HOW = "give nodes, as 13,27, or every; then as 13:1e6 (N/m), and after a comma push, capacity=300"


def parse_props(text: str, scene: Scene, where: str = "--props") -> tuple[Prop, ...]:
    """Return props from words, as ``13,27:1e6,push,capacity=300`` or ``every:1e6``.

    ``every`` is a node of each brick, ``all`` are all nodes, ``none`` are none; ``push`` and
    ``capacity`` are of all that are named.
    """
    props, common = list[Prop](), dict[str, object]()
    where = f"{where} {short(text)[1:-1]}"
    for word in text.split(","):
        name, equals, value = word.strip().partition("=")
        if name == "capacity" and equals:
            common["capacity"] = number_word(value, where)
        elif word.strip() == "push":
            common["direction"] = scene.up
        elif word.strip() != "none":
            props += _placed(word.strip(), scene, where)
    try:
        scene.with_props(*props)
        return tuple(replace(prop, **common) for prop in props)  # type: ignore[arg-type]
    except SceneError as error:
        raise SceneError(f"{where}: {error}") from error


def _placed(word: str, scene: Scene, where: str) -> Sequence[Prop]:
    place, colon, stiffness = word.partition(":")
    own = number_word(stiffness, where) if colon else None
    if place == "every":
        return scene.with_centering(own).props
    if place == "all":
        free = (node for brick in scene.placed for node in brick.nodes)
        nodes = tuple(node for node in free if node not in scene.blocked_nodes)
    elif place.isascii() and place.isdecimal():
        nodes = (int(place),)
    else:
        hint = did_you_mean(place, ("every", "all", "push", "none"))
        raise SceneError(f"{where}: {place!r} is no node{hint}; {_HOW}")
    return [Prop(node=node, stiffness=own) for node in nodes]
