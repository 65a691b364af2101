"""Scenes described in a few words: ``arch:span=2,rise=0.7``, ``wall:columns=6,courses=4``."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, get_type_hints

from seqopt.arrays import Vector
from seqopt.errors import SceneError, did_you_mean
from seqopt.scene.library.arch_form import ArchForm, arch
from seqopt.scene.library.barrel_vault import barrel_vault
from seqopt.scene.library.chain import chain
from seqopt.scene.library.dome import dome
from seqopt.scene.library.dome_shape import DomeShape
from seqopt.scene.library.wall import WallShape, wall
from seqopt.scene.scene import Scene


@dataclass(frozen=True)
class Kind:
    """A kind of scene that a few words describe.

    Attributes
    ----------
    about : str
        What it is, and an example.
    make : callable
        Makes the scene.
    shape : type, optional
        Of the numbers that it takes as one value; by default it takes them one by one.
    """

    about: str
    make: Callable[..., Scene]
    shape: type | None = None

    def hints(self) -> dict[str, Any]:
        """Return the numbers that it takes, by name, and what each is."""
        names = (
            [field.name for field in fields(self.shape)]
            if self.shape is not None
            else list(inspect.signature(self.make).parameters)
        )
        hints = get_type_hints(self.shape or self.make)
        return {name: hints[name] for name in names if hints[name] in READ}


KINDS = {
    "arch": Kind("an arch by span and rise: arch:span=2,rise=0.7,curve=catenary", arch, ArchForm),
    "barrel": Kind("one of the eight tested barrel vaults: barrel:test=3", barrel_vault),
    "chain": Kind("an arch of any number of bricks that turn evenly: chain:bricks=40", chain),
    "dome": Kind("a dome: dome:courses=6,around=20,bond=herringbone", dome, DomeShape),
    "wall": Kind("a wall in running bond: wall:columns=6,courses=4,corbel=0.02", wall, WallShape),
}


def _vector(text: str) -> Vector:
    x, y, z = map(float, text.split("x"))
    return x, y, z


READ: dict[Any, Callable[[str], Any]] = {
    int: int,
    int | None: int,
    float: float,
    str: str,
    Vector: _vector,
}
EXAMPLE = {int: "12", int | None: "12", float: "0.5", str: "a word", Vector: "0.2x0.1x0.06"}


def scene_by_words(words: str) -> Scene:
    """Return the scene that a few words describe.

    Parameters
    ----------
    words : str
        A key of `KINDS`, a colon, and ``name=value`` of its numbers, parted by commas; three
        lengths as ``0.2x0.1x0.06``. Lengths in m, angles in rad, densities in kg/m³.

    Raises
    ------
    SceneError
        If there is no such kind or number, or it makes no scene.

    Examples
    --------
    >>> scene_by_words("wall:columns=4,courses=3")
    <Scene wall 4 x 3: 12 bricks, 23 joints, 4 ground ends, 3 robots>
    """
    name, _, rest = words.partition(":")
    if (kind := KINDS.get(name)) is None:
        raise SceneError(f"scene {words}: {name!r} is not known; give one of {', '.join(KINDS)}")
    hints = kind.hints()
    given: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        key, _, text = part.partition("=")
        if key not in hints or key in given:
            hint = did_you_mean(key, hints)
            what = "is given twice" if key in given else f"is none of its numbers{hint}"
            raise SceneError(f"scene {words}: {key!r} {what}; give {', '.join(hints)}")
        try:
            given[key] = READ[hints[key]](text)
        except ValueError:
            raise SceneError(
                f"scene {words}: {key} is {text!r}; give it as {EXAMPLE[hints[key]]}"
            ) from None
    try:
        scene = kind.make(kind.shape(**given)) if kind.shape else kind.make(**given)
        return replace(scene, provenance=f"{scene.provenance} In words: {words}.")
    except OverflowError as error:
        raise SceneError(f"scene {words}: its numbers are too large; give smaller ones") from error
    except TypeError as error:  # a number without a default is missing
        lacking = ", ".join(_required(kind) - given.keys())
        if not lacking:
            raise
        raise SceneError(f"scene {words}: {lacking} is missing; {kind.about}") from error


def _required(kind: Kind) -> set[str]:
    """Return the numbers that must be given."""
    parameters = inspect.signature(kind.shape or kind.make).parameters
    return {
        name
        for name, parameter in parameters.items()
        if parameter.default is inspect.Parameter.empty
    }
