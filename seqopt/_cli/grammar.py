"""Parsers of words of the command line: payloads, grips, mortars, props, numbers."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

from seqopt.contact.mortar import MORTARS, Mortar, find_mortar
from seqopt.errors import ProblemError, SceneError, StepError, did_you_mean
from seqopt.problem.requirements import number_word, split_word
from seqopt.scene._checks import short
from seqopt.scene.parts import Prop
from seqopt.scene.scene import Scene

PROPS = "give nodes, as 13,27, or every; then as 13:1e6 (N/m), and after a comma push, capacity=300"


def parse_count(number: int | str, where: str, most: int, least: int = 1) -> int:
    """Parse an integer within bounds; ``where``: argument, for messages."""
    text = str(number)
    if not (text.isascii() and text.isdecimal()) or not least <= int(text[:12]) <= most:
        raise ProblemError(f"{where} {text}: give a whole number from {least} to {most}")
    return int(text)


def with_payload(text: str, scene: Scene) -> Scene:
    """Return a scene with payloads from words: ``250``, N each, or ``rob1=250``."""
    name, equals, value = text.rpartition("=")
    names = [robot.name for robot in scene.robots]
    if equals and name not in names:
        hint = did_you_mean(name, names)
        raise StepError(f"--payload {text}{hint}: give ROBOT=NEWTON, of {', '.join(names)}")
    most = number_word(value, f"--payload {text}")
    said = (replace(r, payload=most) if name in ("", r.name) else r for r in scene.robots)
    return scene.with_robots(*said)


def with_grips(grips: float | str, scene: Scene) -> Scene:
    """Return a scene with grip stiffness from a word: ``rigid``, ``1e6`` or ``1e6x1e6x5e5``, N/m.

    ``turning=1e4`` after a comma is the rotational stiffness.
    """
    text = str(grips)
    where = f"--grips {short(text)[1:-1]}"
    shift, *rest = text.split(",")
    ways: list[tuple[float, ...] | None] = [None, None]
    for at, word in enumerate((shift, *(part.removeprefix("turning=") for part in rest))):
        if at > 1 or (at and word == rest[0]):
            raise SceneError(f"{where}: give a stiffness, and after a comma turning=STIFFNESS")
        try:
            numbers = [float(number) for number in word.split("x")]
        except ValueError:
            numbers = []
        if at == 0 and word == "rigid":
            continue
        if len(numbers) not in (1, 3):
            raise SceneError(f"{where}: {word!r} is no stiffness; give rigid, 1e6 or 1e6x1e6x5e5")
        ways[at] = (*numbers,) * (3 // len(numbers))
    try:
        return scene.with_grips(*ways)  # type: ignore[arg-type]
    except SceneError as error:
        raise SceneError(f"{where}: {str(error).partition(': ')[2]}") from None


def parse_numbers(
    where: str,
    texts: Iterable[str],
    known: Collection[str] | None = None,
    *,
    zero: bool = False,
    advice: str = "",
) -> dict[str, float]:
    """Parse positive numbers from ``NAME=VALUE``, by name; by default any name is accepted."""
    out: dict[str, float] = {}
    for text in texts:
        name, value = split_word(text)
        if known is not None and name not in known:
            hint, names = did_you_mean(name, known), ", ".join(known)
            raise ProblemError(f"{where} {text} does not exist{hint}; give one of {names}{advice}")
        out[name] = number_word(value, f"{where} {text}", zero=zero)
    return out


def parse_mortar(text: str | Mortar, where: str) -> Mortar:
    """Parse a mortar; ``where``: argument, for messages."""
    if isinstance(text, Mortar):  # of Python
        return text
    try:
        return find_mortar(text)
    except SceneError as error:
        hint = did_you_mean(text.partition("=")[0], (*MORTARS, "bond"))
        known = f"give {', '.join(MORTARS)}, or bond=STRENGTH (Pa), zero or more"
        raise ProblemError(f"{where} {text}{hint}: {known}") from error


def parse_props(text: str, scene: Scene) -> tuple[Prop, ...]:
    """Parse props, as ``13,27:1e6,push,capacity=300`` or ``every:1e6``.

    ``every`` is a node of each brick, ``all`` are all nodes, ``none`` are none; ``push`` and
    ``capacity`` are of all that are named.
    """
    props, common = list[Prop](), dict[str, object]()
    where = f"--props {short(text)[1:-1]}"
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
        raise SceneError(f"{where}: {place!r} is no node{hint}; {PROPS}")
    return [Prop(node=node, stiffness=own) for node in nodes]
