"""How long a robot takes for what it does: the seconds of each kind of step, and its speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

from seqopt.arrays import Terse
from seqopt.errors import SceneError, did_you_mean
from seqopt.scene._checks import check, finite, in_words, unless_none

_seconds = partial(finite, least=0.0, wanted="seconds, zero or more")
_METERS = "a positive number of m/s, or none if ways take no time"
_speed = partial(finite, least=1e-12, wanted=_METERS)
SLOWER = "slower"  # the word for a factor on all durations


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
    >>> durations = Durations(fetch=30.0, place=10.0, approach=10.0, grip=5.0, release=5.0)
    >>> durations.slower(2.0).fetch
    60.0
    """

    fetch: float
    place: float
    approach: float
    grip: float
    release: float
    speed: float | None = None

    def __post_init__(self) -> None:
        names = [name for name in _NAMES if name != "speed"]
        check(self, "durations", **dict.fromkeys(names, _seconds), speed=unless_none(_speed))

    def slower(self, factor: float) -> Durations:
        """Return durations that are longer by a factor, the speed lower by as much."""
        times = finite("durations: slower", factor, 1e-9, "a positive factor")
        values = {name: times * getattr(self, name) for name in _NAMES if name != "speed"}
        speed = None if self.speed is None else self.speed / times
        return replace(self, **values, speed=speed)

    def __str__(self) -> str:
        said = [(name, getattr(self, name)) for name in _NAMES]
        return ",".join(f"{name}={value:g}" for name, value in said if value is not None)


_NAMES = tuple(field.name for field in fields(Durations))
EXAMPLE = "fetch=30,place=10,approach=10,grip=5,release=5"


def _durations_in_words(
    names: Sequence[str], given: Sequence[Durations | None], texts: Sequence[str]
) -> tuple[Durations | None, ...]:
    """Return the durations of robots as words say, those before being for all, or as given.

    ``names``: of the robots; ``given``: their own; ``texts``: as `EXAMPLE`, for one robot with its
    name and a colon before; ``slower=2`` among the words multiplies what it has by then.

    >>> found = _durations_in_words(["a", "b"], [None, None], [EXAMPLE, "b:slower=2.5"])
    >>> [each.release for each in found]
    [5.0, 12.5]
    """
    out = list(given)
    for text in texts:
        name, colon, words = text.partition(":") if ":" in text else ("", "", text)
        if colon and name not in names:
            hint = did_you_mean(name, names)
            raise SceneError(f"durations {text}: no robot {name!r}{hint}; give {', '.join(names)}")
        known = dict.fromkeys((*_NAMES, SLOWER), (float, f"a number, as {EXAMPLE}"))
        said = in_words(f"durations {text}", words.split(","), known, f", as {EXAMPLE}")
        factor = said.pop(SLOWER, None)
        for index in (i for i, robot in enumerate(names) if robot == name or not colon):
            before = out[index]
            lacking = [each for each in _NAMES if each not in said and each != "speed"]
            if before is None and lacking:
                raise SceneError(
                    f"durations {text}: {', '.join(lacking)} not given, nor in the scene; give "
                    f"all, as {EXAMPLE}"
                )
            found = Durations(**said) if before is None else replace(before, **said)
            out[index] = found if factor is None else found.slower(factor)
    return tuple(out)
