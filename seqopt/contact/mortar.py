"""Mortars: what a joint carries besides compression, and the share of its bond at an age."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from seqopt.arrays import Terse
from seqopt.errors import SceneError, did_you_mean
from seqopt.scene._checks import check, finite, not_negative, positive, rows, settle, short


@dataclass(frozen=True, kw_only=True)
class Mortar:
    """What a contact can carry besides compression: Mohr-Coulomb with a tension cut-off.

    Parameters
    ----------
    friction : float
        Coefficient of friction, the tangent of the friction angle.
    tensile_strength, cohesion : float
        Pa; zero for blocks laid dry.

    Raises
    ------
    SceneError
        If a number is negative or not finite.

    Examples
    --------
    >>> DRY.tensile_strength, EPOXY.tensile_strength
    (0.0, 3000000.0)
    >>> Mortar(friction=0.6, cohesion=2e5)
    Mortar(friction=0.6, tensile_strength=0.0, cohesion=200000.0)
    """

    friction: float
    tensile_strength: float = 0.0
    cohesion: float = 0.0

    def __post_init__(self) -> None:
        check(self, "mortar", friction=not_negative)
        check(self, "mortar", tensile_strength=not_negative, cohesion=not_negative)


_FRICTION = math.tan(math.radians(25.0))
DRY = Mortar(friction=_FRICTION)
"""Blocks laid dry: compression and friction alone.

Examples
--------
>>> DRY.cohesion
0.0
"""
EPOXY = Mortar(friction=_FRICTION, tensile_strength=3e6, cohesion=2e6)
"""The epoxy putty of Bruun et al. (section 3.2.3: 25°, 3 MPa, and 2 MPa printed as "2 MPa/m").

Examples
--------
>>> EPOXY.tensile_strength, EPOXY.cohesion
(3000000.0, 2000000.0)
"""
MORTARS = {"epoxy": EPOXY, "dry": DRY}


def _is_as_strong(mortar: Mortar, other: Mortar) -> bool:
    """Return whether a mortar is at least as strong as another one in everything.

    Friction takes from what is carried in shear where a contact is pulled: there it must be equal.
    """
    slides, pulled = mortar.friction - other.friction, other.tensile_strength
    rough = slides == 0 or (slides > 0 and not pulled)
    return rough and mortar.tensile_strength >= pulled and mortar.cohesion >= other.cohesion


def bond_mortar(strength: float, friction: float = _FRICTION) -> Mortar:
    """Return the mortar of a bond with the same strength in tension and in shear, Pa."""
    strength = not_negative("mortar: tensile_strength", strength)
    friction = not_negative("mortar: friction", friction)
    return Mortar(friction=friction, tensile_strength=strength, cohesion=strength * (1 + friction))


def find_mortar(mortar: Mortar | str, where: str = "mortar") -> Mortar:
    """Return a mortar: itself, by a name of `MORTARS`, or as ``bond=STRENGTH``, in Pa.

    ``where``: what is given, for messages.
    """
    if isinstance(mortar, Mortar):
        return mortar
    if str(mortar) in MORTARS:
        return MORTARS[str(mortar)]
    name, _, strength = str(mortar).partition("=")
    try:
        return bond_mortar(float(strength if name == "bond" else ""))
    except ValueError:
        hint, known = did_you_mean(name, (*MORTARS, "bond")), ", ".join(MORTARS)
        text = short(mortar)[1:-1] if isinstance(mortar, str) else short(mortar)
        raise SceneError(
            f"{where} {text}{hint}: give {known}, or bond=STRENGTH (Pa), zero or more"
        ) from None


def _mortar_name(mortar: Mortar) -> str:
    """Return what a mortar is called: as `find_mortar` takes it, or its strengths."""
    tension, cohesion = mortar.tensile_strength, mortar.cohesion
    strengths = {(m.tensile_strength, m.cohesion): name for name, m in MORTARS.items()}
    own = f"{tension:g} Pa in tension, {cohesion:g} Pa in shear"
    if math.isclose(cohesion, tension * (1 + mortar.friction), rel_tol=1e-9):
        own = f"bond={tension:.10g}"
    rough = "" if mortar.friction == _FRICTION else f", friction {mortar.friction:.3g}"
    return f"{strengths.get((tension, cohesion), own)}{rough}"


def _with_mortar(name: str) -> str:
    """Return a mortar's name as what a structure stands with: dry, or with epoxy."""
    return name if name.partition(",")[0] == "dry" else f"with {name}"


SHARES = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""The shares of full bond at which a bond that grows in proportion to its age is counted."""
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0}
EXAMPLE = "15min, or 5min=0.4,15min=1"
Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True, repr=False)
class Curing(Terse):
    """The share of its full bond that a joint has at an age: what was reached last, never more.

    Its age counts from when the brick that closes it is in its place. Tensile strength and
    cohesion grow with the share; friction is there from the first.

    ``points``: ages, s, and the share that is reached then, both rising; the last share is 1.
    Before the first point there is no bond. No points at all: it never cures. Raises `SceneError`
    if ages or shares do not rise, or the last share is not 1.
    """

    points: Points = ()

    def __post_init__(self) -> None:
        settle(self, points=_checked("curing", self.points))

    def __str__(self) -> str:
        if self.points and self.points == _linear(self.points[-1][0]):
            return f"{self.points[-1][0]:g}s"
        return ",".join(f"{age:g}s={share:g}" for age, share in self.points) or "never"


def _checked(where: str, given: Iterable[Sequence[float]]) -> Points:
    """Return points whose ages and shares rise, up to a share of 1."""
    what = "pairs of an age (s) and a share"
    pairs = [rows(where, pair, what) for pair in rows(where, given, what)]
    if any(len(pair) != 2 for pair in pairs):
        raise SceneError(f"{where}: points are {short(pairs)}; give {what}")
    out = tuple(
        (finite(f"{where}: age", age, 0.0), finite(f"{where}: share", share, 0.0))
        for age, share in pairs
    )
    for before, after in pairwise(out):
        if not (before[0] < after[0] and before[1] < after[1]):
            raise SceneError(f"{where}: {before} comes before {after}; ages and shares must rise")
    if out and out[-1][1] != 1.0:
        raise SceneError(
            f"{where}: the last share is {out[-1][1]:g}; give 1 last, and a weaker mortar for less"
        )
    return tuple(pair for pair in out if pair[1] > 0)


def _linear(seconds: float) -> Points:
    """Return points of a bond that grows in proportion to its age, from below."""
    if seconds == 0.0:
        return ((0.0, 1.0),)
    return tuple((share * seconds, share) for share in SHARES)


def _find_curing(given: Curing | str | Iterable[str]) -> Curing:
    """Return how mortar cures: itself, or by words.

    ``15min`` (or ``s``, ``h``) has full bond after that and before a share in proportion, counted
    from below at `SHARES`; ``5min=0.4,15min=1`` what is reached when; ``never``. An age without a
    unit is in s.
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
            seconds = float(number) * _UNITS[age[len(number) :] or "s"]
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


@dataclass(frozen=True)
class BedStiffness:
    """Stiffness of a joint or pad per area.

    ``normal``, ``tangential``: N/m³. Raises `SceneError` if one is not a positive number.
    """

    normal: float
    tangential: float

    def __post_init__(self) -> None:
        each = partial(positive, unit="N/m³")
        check(self, "bed", normal=each, tangential=each)
