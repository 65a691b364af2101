"""Words for grips, props and payloads, as Python and the command line take them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from seqopt.arrays import Vector
from seqopt.errors import SceneError, StepError, did_you_mean
from seqopt.scene._checks import in_words, short
from seqopt.scene.parts import Prop, Robot

_PROPS = (
    "give nodes, as 13,27, or every; then as 13:1e6 (N/m), and after a comma push, capacity=300"
)


def parse_grips(text: str) -> tuple[Any, Any]:
    """Parse stiffnesses of grips: translational, then rotational; None is rigid, and free to turn.

    >>> parse_grips("1e6x1e6x5e5,turning=2e4"), parse_grips("rigid")
    (((1000000.0, 1000000.0, 500000.0), 20000.0), (None, None))
    """
    where = f"grips {short(text)[1:-1]}"
    shift, comma, rest = text.partition(",")
    turning = rest.removeprefix("turning=")
    if comma and (turning == rest or "," in rest):
        raise SceneError(f"{where}: give a stiffness, and after a comma turning=STIFFNESS")
    found = list[Any]()
    for word in (shift, turning):
        try:
            numbers = [] if word in ("", "rigid") else [float(one) for one in word.split("x")]
        except ValueError:
            line = f"{word!r} is no stiffness; give rigid, 1e6 or 1e6x1e6x5e5 (N/m)"
            raise SceneError(f"{where}: {line}") from None
        found.append(None if not numbers else numbers[0] if len(numbers) == 1 else tuple(numbers))
    return found[0], found[1]


def parse_props(text: str, up: Vector, every: Callable[..., Any]) -> tuple[Prop, ...]:
    """Parse props, as ``13,27:1e6,push,capacity=300`` or ``every:1e6``.

    ``push``, which is ``up``, and ``capacity`` are of all that are named; ``every``: returns a
    scene with one at each brick.
    """
    props, common, where = list[Prop](), dict[str, Any](), f"props {short(text)[1:-1]}"
    for word in map(str.strip, text.split(",")):
        place, _, stiffness = word.partition(":")
        known = {"stiffness": (float, "a number of N/m"), "capacity": (float, "a number of N")}
        own = in_words(where, [f"stiffness={stiffness}"], known) if stiffness else {}
        if word.startswith("capacity="):
            common |= in_words(where, [word], known)
        elif word == "push":
            common["direction"] = up
        elif place == "every":
            props += every(**own).props
        elif place.isascii() and place.isdecimal():
            props.append(Prop(node=int(place), **own))
        else:
            hint = did_you_mean(place, ("every", "push"))
            raise SceneError(f"{where}: {place!r} is no node{hint}; {_PROPS}")
    return tuple(replace(prop, **common) for prop in props)


def parse_payloads(robots: Sequence[Robot], payloads: Sequence[float | str]) -> list[Robot]:
    """Return robots with payloads, N: of all, or of one as ``rob1=250``."""
    found, names = [*robots], [robot.name for robot in robots]
    for given in payloads:
        name, equals, value = str(given).rpartition("=")
        if equals and name not in names:
            hint = did_you_mean(name, names)
            raise StepError(f"payload {given}{hint}: give ROBOT=NEWTON, of {', '.join(names)}")
        own = in_words(
            f"payload {given}", [f"payload={value}"], {"payload": (float, "a number of N")}
        )
        found = [replace(robot, **own) if name in ("", robot.name) else robot for robot in found]
    return found
