"""Presets with the numbers of Bruun et al.: robots, joint stiffness, criteria and scales."""

from __future__ import annotations

from seqopt.engines.discrete.system import BedStiffness
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.criteria import (
    OVER_METHODS,
    WORST_OVER_METHODS,
    RankSum,
    WeightedSum,
    WorstRatio,
    equal,
)
from seqopt.problem.requirements import Criterion
from seqopt.scene.parts import Anywhere, Robot, Side

ROBOTS = (
    Robot(name="rob1", payload=392.4, reach=Side(toward=(0.0, 1.0, 0.0), point=(0.0, -0.075, 0.0))),
    Robot(name="rob2", payload=392.4, reach=Side(toward=(0.0, -1.0, 0.0), point=(0.0, 0.075, 0.0))),
    Robot(name="rob3", payload=392.4, reach=Anywhere()),
)  # section 3.1: 40 kg; section 5: two beside the arch reach its line, the third is mobile

STUDY_BED = BedStiffness(normal=100e9, tangential=10e9)
"""Stiffnesses jKn and jKs of the discrete-element models of Bruun et al., N/m³ (section 3.2.3)."""

STUDY_PADS = BedStiffness(normal=1e12, tangential=1e11)
"""Of a robot's grip: stiffer "by an order of magnitude"; how large its pads are is not printed."""

RESOLUTION = (("F", 1.0), ("T", 1.0), ("C", 1.0), ("M", 1.0), ("D", 1e-6))
"""Rounding (N, N, N m, m) with which ranks explain most of the choices in the published plan."""

EQUATIONS = RankSum(
    "equations-2-3",
    before=equal("T_max", "M_sup", "F_each"),
    after=equal("T_max", "M_sup", "F_move", "D_max"),
)
CLOSEST = RankSum(  # of the variants tried, the one that names the published plan most often
    "closest-to-plan",
    before=equal("T_max", "M_sup", "F_move", "F_largest"),
    after=equal("T_max", "F_move"),
    delay=1,
)
PUBLISHED_BEST = (("F_largest", 270.0), ("M_sup", 21.5), ("T_max", 87.7), ("D_max", 15.9e-6))
WEIGHTED = WeightedSum(
    "weighted-published", tuple((name, 1.0, limit) for name, limit in PUBLISHED_BEST)
)
WORST_RATIO = WorstRatio("worst-ratio-published", PUBLISHED_BEST)

CRITERIA: dict[str, Criterion] = {
    criterion.name: criterion
    for criterion in (EQUATIONS, CLOSEST, OVER_METHODS, WORST_OVER_METHODS, WEIGHTED, WORST_RATIO)
}
"""What a step may cost, by name.

``equations-2-3`` ranks responses as equations (2) and (3) of Bruun et al. say, (2) before the
scene's crown and (3) from it on; ``closest-to-plan`` is the variant of it that chooses the nodes of
the published plan most often. ``weighted`` adds the responses, each over the least that a fixed
method of the scene reaches of it; ``worst-ratio`` takes the largest of these ratios. The same over
the best published values of the arch of Bruun et al., 270 N (grip force), 21.5 N m (``M_sup``),
87.7 N (``T_max``) and 15.9e-6 m (``D_max``), are ``weighted-published`` and
``worst-ratio-published``.

Examples
--------
>>> import seqopt
>>> seqopt.CRITERIA["worst-ratio"].wanted(bricks=10)
('F_largest', 'M_sup', 'T_max', 'D_max')
"""


def find_criterion(criterion: Criterion | str) -> Criterion:
    """Return a criterion, by name or itself.

    ``criterion``: a criterion, or a name of `seqopt.CRITERIA`. Raises `ProblemError` if there is
    none of that name.
    """
    if not isinstance(criterion, str):
        return criterion
    if criterion not in CRITERIA:
        raise ProblemError(
            f"criterion {criterion!r} does not exist{did_you_mean(criterion, CRITERIA)}; give "
            f"one of {', '.join(CRITERIA)}"
        )
    return CRITERIA[criterion]
