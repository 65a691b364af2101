"""How mortar cures: the share of its full bond that a joint has at an age."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from seqopt.arrays import Terse
from seqopt.errors import SceneError
from seqopt.scene._checks import finite, rows, settle, short

SHARES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""The shares of full bond at which a bond that grows in proportion to its age is counted."""
UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}
EXAMPLE = "15min, or 5min=0.4,15min=1"
Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True, repr=False)
class Curing(Terse):
    """The share of its full bond that a joint has at an age: what was reached last, never more.

    Its age counts from when the brick that closes it is in its place; friction is there from the
    first.

    Parameters
    ----------
    points : sequence of (float, float), optional
        Ages, s, and shares, both rising to 1; none: it never cures.

    Raises
    ------
    SceneError
        If they do not rise, or the last share is not 1.

    Examples
    --------
    >>> print(Curing(((300, 0.4), (900, 1.0))))
    300s=0.4,900s=1
    """

    points: Points = ()

    def __post_init__(self) -> None:
        what = "pairs of an age (s) and a share"
        pairs = [rows("curing", pair, what) for pair in rows("curing", self.points, what)]
        if any(len(pair) != 2 for pair in pairs):
            raise SceneError(f"curing: points are {short(pairs)}; give {what}")
        out = tuple(
            (finite("curing: age", age, 0.0), finite("curing: share", share, 0.0))
            for age, share in pairs
        )
        for before, after in pairwise(out):
            if not (before[0] < after[0] and before[1] < after[1]):
                raise SceneError(
                    f"curing: {before} comes before {after}; ages and shares must rise"
                )
        if out and out[-1][1] != 1.0:
            wrong = f"curing: the last share is {out[-1][1]:g}"
            raise SceneError(f"{wrong}; give 1 last, and a weaker mortar for less")
        settle(self, points=tuple(pair for pair in out if pair[1] > 0))

    def __str__(self) -> str:
        if self.points and self.points == _linear(self.points[-1][0]):
            return f"{self.points[-1][0]:g}s"
        return ",".join(f"{age:g}s={share:g}" for age, share in self.points) or "never"


def _linear(seconds: float) -> Points:
    """Return points of a bond that grows in proportion to its age, from below."""
    if seconds == 0.0:
        return ((0.0, 1.0),)
    return tuple((share * seconds, share) for share in SHARES)


def find_curing(given: Curing | str | Iterable[str]) -> Curing:
    """Return how mortar cures: itself, or by words.

    ``15min`` (or ``s``, ``h``) has full bond after that and before a share in proportion, at
    `SHARES`; ``5min=0.4,15min=1`` what is reached when; ``never``. No unit: s.
    """
    if isinstance(given, Curing):
        return given
    words, out = given.split() if isinstance(given, str) else [*given], []
    if len(words) != 1:
        raise SceneError(f"curing {' '.join(words)}: give one law for all joints, as {EXAMPLE}")
    if words[0] == "never":
        return Curing()
    for part in words[0].split(","):
        age, equals, share = part.partition("=")
        number = age.rstrip("minhs")
        try:
            seconds = float(number) * UNITS[age[len(number) :] or "s"]
        except (KeyError, ValueError):
            wrong = f"{short(age)} is no age"
            raise SceneError(f"curing {words[0]}: {wrong}; give {EXAMPLE}, or never") from None
        if not 0 <= seconds < math.inf:
            raise SceneError(f"curing {words[0]}: {short(age)} is no age; give zero or more")
        if not equals and len(words[0]) == len(age):
            return Curing(_linear(seconds))
        try:
            out.append((seconds, float(share)))
        except ValueError:
            raise SceneError(f"curing {words[0]}: share {short(share)}; give {EXAMPLE}") from None
    return Curing(tuple(out))
