"""The engine that chooses the simplest sufficient model for each grip set, and says why.

There are three levels, and the cheapest whose condition a grip set meets is used: planar, if
everything lies in one plane; exactly rigid bricks, if joints stay within their elastic limits; and
discrete elements otherwise. Where their condition holds, the first two give the same answer as the
next level, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Bools, Ints
from seqopt.contact._elastic_limits import ElasticLimits, find_elastic_limits
from seqopt.contact.mortar import EPOXY, Mortar
from seqopt.engines._planar import NoPlane, PlanarEngine, find_plane, off_plane
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.interface import (
    Fields,
    NamedEngine,
    Want,
    grip_columns,
    keep_wanted,
    merge_sets,
    select_sets,
)
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene


class Level(Enum):
    """Levels of detail of a model, cheapest first; values are the engines' names."""

    PLANAR = "planar"
    RIGID = "compliance"
    DISCRETE = "discrete"


@dataclass(frozen=True)
class LevelChoice:
    """A level and why it was taken."""

    level: Level
    reason: str  # a clause that goes into a sentence


_IN_PLANE = LevelChoice(Level.PLANAR, "bricks, springs, gravity and grips lie in one plane")
_OFF_PLANE = LevelChoice(Level.RIGID, "a grip lies outside the plane of the bricks")
_BEYOND = LevelChoice(Level.DISCRETE, "a joint would leave its elastic limits")


class AutoEngine(NamedEngine):
    """Computes every grip set at the cheapest level whose condition it meets.

    ``mortar``: what the joints hold; the epoxy of Bruun et al. by default. ``tally``: how many grip
    sets of all calls were answered at which level, and why. ``unchecked``: why elastic limits are
    not checked; empty if they are.
    """

    def __init__(self, network: Network | Scene, mortar: Mortar = EPOXY) -> None:
        network = network_of(network)
        self._rigid = ComplianceEngine(network)
        self._discrete = DiscreteEngine(network, mortar)
        self._planar: PlanarEngine | None = None
        self._in_space = _OFF_PLANE
        self._limits: ElasticLimits | None = None
        self.tally: dict[LevelChoice, int] = {}
        self.unchecked = ""
        plane = find_plane(network)
        if isinstance(plane, NoPlane):
            self._in_space = LevelChoice(Level.RIGID, plane.reason)
        else:
            self._planar = PlanarEngine(network, plane)
        try:
            self._limits = find_elastic_limits(network, mortar)
        except SceneError as error:
            self.unchecked = f"elastic limits are not checked: {error}"

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""
        return self._rigid.network

    @property
    def rigid(self) -> ComplianceEngine:
        """Rigid bricks on springs that never break: for what need not be the last word."""
        return self._rigid

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Return the fields of a partial structure for many grip sets.

        ``grips`` (S, r): node numbers.
        """
        columns = grip_columns(self.network, bricks, grips)
        sets = np.asarray(grips).reshape(columns.shape)
        asked = want if self._limits is None else want | Want.JOINTS
        flat = self._flat(columns)
        fields = keep_wanted(self._rigid.solve(bricks, sets[~flat], asked), asked)
        if self._planar is not None and flat.any():
            found = keep_wanted(self._planar.solve(bricks, sets[flat], asked), asked)
            fields = merge_sets(flat, found, fields)
        beyond = np.zeros(len(sets), dtype=bool)
        if self._limits is not None:
            beyond = self._limits.exceeded(fields.joint_wrench)
        if beyond.any():
            found = self._discrete.solve(bricks, sets[beyond], asked)
            fields = merge_sets(beyond, keep_wanted(found, asked), select_sets(fields, ~beyond))
        self._count(_IN_PLANE, flat & ~beyond)
        self._count(self._in_space, ~flat & ~beyond)
        self._count(_BEYOND, beyond)
        return keep_wanted(fields, want)

    def _flat(self, columns: Ints) -> Bools:
        """Return which grip sets (S, r) lie in the plane, (S,)."""
        if self._planar is None:
            return np.zeros(len(columns), dtype=bool)
        return np.asarray(~off_plane(self.network, self._planar.plane, columns).any(axis=1))

    def _count(self, choice: LevelChoice, sets: Bools) -> None:
        if sets.any():
            self.tally[choice] = self.tally.get(choice, 0) + int(sets.sum())
