"""Mortars by name: what a joint carries besides compression."""

from __future__ import annotations

import math
from dataclasses import dataclass

from seqopt.errors import SceneError, did_you_mean
from seqopt.scene._checks import check, not_negative, short


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
    """Return whether a mortar carries whatever another one does: what stands with that, stands.

    Friction takes from what is carried in shear where a contact is pulled: there it must be equal.

    >>> _is_as_strong(EPOXY, DRY), _is_as_strong(DRY, EPOXY)
    (True, False)
    """
    slides = mortar.friction - other.friction
    return (
        (slides == 0 or (slides > 0 and not other.tensile_strength))
        and mortar.tensile_strength >= other.tensile_strength
        and mortar.cohesion >= other.cohesion
    )


def bond_mortar(strength: float, friction: float = _FRICTION) -> Mortar:
    """Return the mortar of a bond with the same strength in tension and in shear, Pa.

    >>> bond_mortar(3e3, friction=0.5)
    Mortar(friction=0.5, tensile_strength=3000.0, cohesion=4500.0)
    """
    strength = not_negative("mortar: tensile_strength", strength)
    friction = not_negative("mortar: friction", friction)
    return Mortar(friction=friction, tensile_strength=strength, cohesion=strength * (1 + friction))


def find_mortar(mortar: Mortar | str) -> Mortar:
    """Return a mortar: itself, by a name of `MORTARS`, or as ``bond=STRENGTH``, in Pa."""
    if isinstance(mortar, Mortar):
        return mortar
    if str(mortar) in MORTARS:
        return MORTARS[str(mortar)]
    name, _, strength = str(mortar).partition("=")
    try:
        pascal = float(strength if name == "bond" else "")
    except ValueError:
        hint = did_you_mean(name, (*MORTARS, "bond"))
        raise SceneError(
            f"mortar {short(mortar)}{hint}: give a Mortar, or one of {', '.join(MORTARS)}, "
            "or bond=STRENGTH (Pa)"
        ) from None
    return bond_mortar(pascal)


def _mortar_name(mortar: Mortar) -> str:
    """Return what a mortar is called: as `find_mortar` takes it, or its strengths.

    >>> _mortar_name(DRY), _mortar_name(bond_mortar(3e3)), _mortar_name(Mortar(friction=0.6))
    ('dry', 'bond=3000', 'dry, friction 0.6')
    """
    tension, cohesion = mortar.tensile_strength, mortar.cohesion
    named = (
        n for n, m in MORTARS.items() if (m.tensile_strength, m.cohesion) == (tension, cohesion)
    )
    bonded = math.isclose(cohesion, tension * (1 + mortar.friction), rel_tol=1e-9)
    own = (
        f"bond={tension:.10g}" if bonded else f"{tension:g} Pa in tension, {cohesion:g} Pa in shear"
    )
    rough = "" if mortar.friction == _FRICTION else f", friction {mortar.friction:.3g}"
    return f"{next(named, own)}{rough}"


def _with_mortar(name: str) -> str:
    """Return a mortar's name as what a structure stands with.

    >>> _with_mortar("dry"), _with_mortar("epoxy")
    ('dry', 'with epoxy')
    """
    return name if name.partition(",")[0] == "dry" else f"with {name}"
