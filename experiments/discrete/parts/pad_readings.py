"""Ways to read the paper's discrete-element models: how the robot holds, and what a joint is."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from experiments.discrete.parts.arch_pads import AtCorners, pads_at_corners
from seqopt.engines.discrete.engine import Across, DiscreteEngine, Pinch
from seqopt.engines.discrete.system import BedStiffness
from seqopt.network.network import Network
from seqopt.study.presets import STUDY_BED, STUDY_PADS

PADS = (0.012, 0.02, 0.03)  # m
CORNERS = "springs at corners"
JOINTS = {
    "as printed": STUDY_BED,
    "tangential as normal": BedStiffness(STUDY_BED.normal, STUDY_BED.normal),
    "halves in series": BedStiffness(STUDY_BED.normal / 2, STUDY_BED.tangential / 2),
    CORNERS: STUDY_BED,
}
STEPS = {17: 33, 18: 35, 23: 45, 24: 47}  # steps of the sequential method, by bricks


@dataclass(frozen=True)
class Reading:
    """One way to read the paper's model: how the robot holds, and what a joint is."""

    joint: str = "as printed"
    pinch: Pinch | None = None

    @classmethod
    def of(cls, grip: str, side: float, joint: str) -> Reading:
        """Return the reading that the tables call so, from its pads' side in mm."""
        across = [a for a in Across if grip.endswith(a.name.lower())]
        return cls(joint, Pinch(across[0], STUDY_PADS, side=1e-3 * side) if across else None)

    @property
    def grip(self) -> str:
        """What the tables call it."""
        return "node" if self.pinch is None else f"pads, {self.pinch.across.name.lower()}"

    def engine(self, net: Network) -> DiscreteEngine:
        """Return the discrete elements so read."""
        if self.joint != CORNERS:
            return DiscreteEngine(net, bed=JOINTS[self.joint], pinch=self.pinch)
        pinch = None if self.pinch is None else pads_at_corners(self.pinch)
        return AtCorners(net, bed=STUDY_BED, pinch=pinch)


def readings() -> list[Reading]:
    """Return all readings of the table."""
    pinches = [Pinch(across, STUDY_PADS, side=side) for across, side in product(Across, PADS)]
    return [Reading(joint, pinch) for pinch, joint in product((None, *pinches), JOINTS)]
