"""How stiff the bed of a joint is, as a number that others than engines name too."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from seqopt.errors import SceneError


@dataclass(frozen=True)
class BedStiffness:
    """Stiffness of a joint or pad per area.

    ``normal``, ``tangential``: N/m³. Raises `SceneError` if one is not a positive number.
    """

    normal: float
    tangential: float

    def __post_init__(self) -> None:
        for name in ("normal", "tangential"):
            if not 0 < getattr(self, name) < inf:
                raise SceneError(f"bed: {name} is {getattr(self, name)}; give a positive number")
