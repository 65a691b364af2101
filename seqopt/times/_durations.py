"""How long robots take for what they do, as values and in words."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import partial

from seqopt.arrays import Terse
from seqopt.errors import SceneError, did_you_mean
from seqopt.scene._checks import check, finite, in_words
from seqopt.scene.scene import Scene

_seconds = partial(finite, least=0.0, wanted="seconds, zero or more")
_METERS = "a positive number of m/s, or none if ways take no time"
_speed = partial(finite, least=1e-12, wanted=_METERS)


@dataclass(frozen=True, kw_only=True, repr=False)
class Durations(Terse):
    """How long a robot takes; none of these is assumed where it is not given.

    Parameters
    ----------
    fetch : float
        To take the next brick and bring it: a robot that is free does it before it places, while
        others hold and act, s.
    place : float
        To put the brick in its place; it then holds it, s.
    approach : float
        To come to a brick that stands: a robot that is free does it before it grips, s.
    grip : float
        To take hold of it, s.
    release : float
        To let go, s.
    speed : float, optional
        At which it goes from the node that it held last to the next one, in a straight line, before
        it places or grips, m/s; by default such ways take no time of their own.

    Examples
    --------
    >>> print(Durations(fetch=30.0, place=10.0, approach=10.0, grip=5.0, release=5.0))
    fetch=30,place=10,approach=10,grip=5,release=5
    """

    fetch: float
    place: float
    approach: float
    grip: float
    release: float
    speed: float | None = None

    def __post_init__(self) -> None:
        names = [name for name in NAMES if name != "speed"]
        check(self, "durations", **dict.fromkeys(names, _seconds), speed=_speed)

    def __str__(self) -> str:
        said = [(name, getattr(self, name)) for name in NAMES]
        return ",".join(f"{name}={value:g}" for name, value in said if value is not None)


NAMES = tuple(field.name for field in fields(Durations))
EXAMPLE = "fetch=30,place=10,approach=10,grip=5,release=5"


def with_durations(scene: Scene, *texts: str) -> Scene:
    """Return a scene with robots that take as long as words say, others as before.

    ``texts``: as `EXAMPLE`, for all robots, or for one with its name and a colon before.
    """
    names, out = [r.name for r in scene.robots], [r.durations for r in scene.robots]
    for text in texts:
        name, colon, words = text.partition(":") if ":" in text else ("", "", text)
        if colon and name not in names:
            hint = did_you_mean(name, names)
            raise SceneError(f"durations {text}: no robot {name!r}{hint}; give {', '.join(names)}")
        units = ((name, "m/s" if name == "speed" else f"s, as {EXAMPLE}") for name in NAMES)
        known = {name: (float, f"a number of {unit}") for name, unit in units}
        given = in_words(f"durations {text}", words.split(","), known, f", as {EXAMPLE}")
        for index in (i for i, robot in enumerate(names) if robot == name or not colon):
            before = out[index]
            lacking = [each for each in NAMES if each not in given and each != "speed"]
            if before is None and lacking:
                raise SceneError(
                    f"durations {text}: {', '.join(lacking)} not given, nor in the scene; give "
                    f"all, as {EXAMPLE}"
                )
            out[index] = Durations(**given) if before is None else replace(before, **given)
    pairs = zip(scene.robots, out, strict=True)
    return scene.with_robots(*(replace(robot, durations=each) for robot, each in pairs))
