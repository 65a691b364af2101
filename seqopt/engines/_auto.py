"""The engine that chooses the simplest sufficient model for each grip set, and says why.

Exactly rigid bricks, as long as joints stay within their elastic limits, else discrete elements:
within the limits both give the same answer, to rounding. Who chooses among many grip sets takes
rigid bricks for all of them, and asks of what was chosen alone whether joints stay within limits.
"""

from __future__ import annotations

from collections import Counter
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from seqopt.contact._elastic_limits import ElasticLimits, find_elastic_limits
from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines.interface import (
    Fields,
    Level,
    LevelChoice,
    NamedEngine,
    OpeningEngine,
    Want,
    keep_wanted,
    merge_sets,
    select_sets,
)
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.network.network import Network
from seqopt.scene.scene import Scene

_SIMPLEST = LevelChoice(Level.RIGID, "the simplest, until a joint leaves its elastic limits")
_BEYOND = LevelChoice(Level.DISCRETE, "a joint would leave its elastic limits")


class AutoEngine(NamedEngine):
    """Computes every grip set at the cheapest level whose condition it meets.

    ``mortar``: of joints; ``tally``: how many grip sets of all calls were answered at which level,
    and why.
    """

    def __init__(self, network: Network | Scene, mortar: Mortar = EPOXY) -> None:
        super().__init__(network)
        self.mortar, self.tally = mortar, Counter[LevelChoice]()

    choice = _SIMPLEST  # of the level that alone answers all grip sets of a problem

    @cached_property
    def rigid(self) -> ComplianceEngine:
        """Bricks on springs that never break."""
        return ComplianceEngine(self.network)

    @cached_property
    def _discrete(self) -> OpeningEngine:
        from seqopt.engines.discrete.engine import DiscreteEngine  # noqa: PLC0415  # few sets ask

        return DiscreteEngine(self.network, self.mortar)

    @cached_property
    def _limits(self) -> tuple[ElasticLimits | None, str]:
        try:
            return find_elastic_limits(self.network, self.mortar), ""
        except SceneError as error:
            return None, f"elastic limits are not checked: {error}"

    @property
    def limits(self) -> ElasticLimits | None:
        """Elastic limits of joints, where they are known."""
        return self._limits[0]

    @property
    def unchecked(self) -> str:
        """Why they are not known; empty if they are."""
        return self._limits[1]

    def solve(
        self,
        bricks: int,
        grips: ArrayLike,
        want: Want = Want.RESPONSES,
        moved: ArrayLike | None = None,
    ) -> Fields:
        """Return the fields of a partial structure for grip sets (S, r)."""
        asked = want if self.limits is None else want | Want.JOINTS
        fields = self.rigid.solve(bricks, grips, asked, moved)
        beyond = np.zeros(len(fields.grip_force), dtype=bool)
        if self.limits is not None:
            beyond = self.limits.exceeded(fields.joint_wrench)
        if beyond.any():
            sets = np.asarray(grips)[beyond]
            far = None if moved is None else np.asarray(moved, dtype=float)[beyond]
            found = self._discrete.solve(bricks, sets, asked, far)
            fields = merge_sets(beyond, keep_wanted(found, asked), select_sets(fields, ~beyond))
        levels = (_SIMPLEST, ~beyond), (_BEYOND, beyond)
        self.tally.update({level: int(mine.sum()) for level, mine in levels if mine.any()})
        return keep_wanted(fields, want)
