"""What Bruun et al. give numbers for: their robots, beds, criteria and scales."""

from __future__ import annotations

from seqopt.engines.discrete.system import BedStiffness
from seqopt.placement.criteria import RankSum, WeightedSum, WorstRatio, equal
from seqopt.placement.requirements import Criterion
from seqopt.scene.parts import Robot
from seqopt.scene.reach import Anywhere, Side

ROBOTS = (
    Robot(name="rob1", payload=392.4, reach=Side(toward=(0.0, 1.0, 0.0), point=(0.0, -0.075, 0.0))),
    Robot(name="rob2", payload=392.4, reach=Side(toward=(0.0, -1.0, 0.0), point=(0.0, 0.075, 0.0))),
    Robot(name="rob3", payload=392.4, reach=Anywhere()),
)  # section 3.1: 40 kg; section 5: two beside the arch reach its line, the third is mobile

STUDY_BED = BedStiffness(normal=100e9, tangential=10e9)
"""Stiffnesses jKn and jKs of the discrete-element models of Bruun et al., N/m³ (section 3.2.3)."""

STUDY_PADS = BedStiffness(normal=1e12, tangential=1e11)
"""Of a robot's grip: stiffer "by an order of magnitude"; how large its pads are is not printed."""

CROWN = 13  # bricks of the reference arch up to its crown

EQUATIONS = RankSum(
    "equations-2-3",
    before=equal("T_max", "M_sup", "F_each"),
    after=equal("T_max", "M_sup", "F_move", "D_max"),
    crown=CROWN,
)
CLOSEST = RankSum(  # of the variants tried, the one that names the published plan most often
    "closest-to-plan",
    before=equal("T_max", "M_sup", "F_move", "F_largest"),
    after=equal("T_max", "F_move"),
    crown=CROWN + 1,
)
PUBLISHED_BEST = (("F_largest", 270.0), ("M_sup", 21.5), ("T_max", 87.7), ("D_max", 15.9e-6))
WEIGHTED = WeightedSum("weighted", tuple((name, 1.0, limit) for name, limit in PUBLISHED_BEST))
WORST_RATIO = WorstRatio("worst-ratio", PUBLISHED_BEST)

CRITERIA: dict[str, Criterion] = {c.name: c for c in (EQUATIONS, CLOSEST, WEIGHTED, WORST_RATIO)}
"""What a step may cost, by name.

``equations-2-3`` ranks responses as equations (2) and (3) of Bruun et al. say; ``closest-to-plan``
is the variant of it that chooses the nodes of the published plan most often. ``weighted`` adds
the responses, each over its best published value of 270 N (grip force), 21.5 N m (``M_sup``),
87.7 N (``T_max``) and 15.9e-6 m (``D_max``); ``worst-ratio`` takes the largest of these ratios.

Examples
--------
>>> import seqopt
>>> seqopt.CRITERIA["worst-ratio"].wanted(bricks=10)
('F_largest', 'M_sup', 'T_max', 'D_max')
"""
