"""What Bruun et al. published: their robots, criteria, tables and three-robot plan.

The paper is arXiv 2104.04856. No other part of seqopt uses numbers from it.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.network import build_network
>>> from seqopt.responses.table import analyze
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.study import CRITERIA, printed_maxima, published_plan
>>> [name for name in CRITERIA if name.endswith("published")]
['weighted-published', 'worst-ratio-published']
>>> scene = load_scene("arch25")
>>> plan = published_plan(scene)
>>> table = analyze(make_engine("compliance", build_network(scene)), plan)
>>> len(plan), float(table["M_sup_Nm"].max().round(1))  # N m
(90, 21.4)
>>> float(printed_maxima().loc[3, "published"])  # the same as printed
21.5
"""

from __future__ import annotations

import re
from importlib import resources

import pandas as pd

from seqopt._registry import required
from seqopt.contact.mortar import BedStiffness
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.criteria import (
    OVER_METHODS,
    WORST_OVER_METHODS,
    Criterion,
    RankSum,
    WeightedSum,
    WorstRatio,
    equal,
)
from seqopt.problem.requirements import CHOICE_RESPONSES, NAMES, number_word, split_word
from seqopt.responses.quantities import RESPONSES
from seqopt.responses.table import support_columns
from seqopt.scene.parts import Anywhere, Robot, Side
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step

__all__ = [
    "CRITERIA",
    "IRREGULARITIES",
    "ROBOTS",
    "as_printed",
    "printed_maxima",
    "printed_steps",
    "published_plan",
]


ROBOTS = (
    Robot(name="rob1", payload=392.4, reach=Side(toward=(0.0, 1.0, 0.0), point=(0.0, -0.075, 0.0))),
    Robot(name="rob2", payload=392.4, reach=Side(toward=(0.0, -1.0, 0.0), point=(0.0, 0.075, 0.0))),
    Robot(name="rob3", payload=392.4, reach=Anywhere()),
)  # section 3.1: 40 kg; section 5: two beside the arch reach its line, the third is mobile

STUDY_BED = BedStiffness(normal=100e9, tangential=10e9)
"""Stiffnesses jKn and jKs of the discrete-element models of Bruun et al., N/m³ (section 3.2.3)."""

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


_BETWEEN = re.compile(r",(?![^\[]*\])")  # a comma that is not in brackets


def find_criterion(criterion: Criterion | str) -> Criterion:
    """Return a criterion: itself, by name of `seqopt.CRITERIA`, or ranks, as ``T_max,M_sup=2``.

    A weight is 1 by default.
    """
    if not isinstance(criterion, str):
        return criterion
    if criterion in CRITERIA:
        return CRITERIA[criterion]
    terms = []
    for part in _BETWEEN.split(criterion):
        name, weight = split_word(part)
        if name not in (*NAMES, "F_each") and not name.startswith("F_"):
            names = (*CRITERIA, *CHOICE_RESPONSES, "F_each")
            hint, known = did_you_mean(name, names), ", ".join(names)
            raise ProblemError(
                f"criterion {name} does not exist{hint}; give one of {known}, F_ROBOT, or several"
            )
        terms.append((name, number_word(weight or "1", f"criterion {part}")))
    return RankSum(criterion, tuple(terms), tuple(terms))


SOURCE = "Bruun et al., Three Cooperative Robotic Fabrication Methods, arXiv 2104.04856"
STEP_TABLES = {
    "sequential": "table_A1_sequential",
    "cantilever": "table_A2_cantilever",
    "published": "table_B1_three_robot",
}


def printed(name: str) -> pd.DataFrame:
    """Return a table as printed, by the name of its file in ``seqopt/data/paper``."""
    source = resources.files("seqopt").joinpath(f"data/paper/{name}.csv")
    with source.open(encoding="utf-8") as stream:
        return pd.read_csv(stream)


def printed_steps(method: str) -> pd.DataFrame:
    """Return Table A.1, A.2 or B.1, a row per step, with the brick count that A.2 leaves blank.

    The shipped arch was identified from A.1 and A.2; B.1 took no part and serves to validate it.

    Parameters
    ----------
    method : str
        ``sequential`` (A.1), ``cantilever`` (A.2) or ``published`` (B.1, the three-robot plan).

    Returns
    -------
    pandas.DataFrame
        As printed; the names of the columns say the units.
    """
    if method not in STEP_TABLES:
        raise KeyError(f"printed table of {method!r} does not exist; give {', '.join(STEP_TABLES)}")
    table = printed(STEP_TABLES[method])
    if method == "cantilever":
        table.loc[table["step"] == 9, "bricks"] = 5
    return table


IRREGULARITIES = (
    "Table A.2 leaves the brick count of step 9 blank (it is 5) and F_sup of step 49 "
    "(472.3 N, as in step 49 of A.1, which is the same).",
    "The payload is 40 kg (392.4 N); step 47 exceeds it in both two-robot methods.",
    "The text counts 23 optimizations; the printed three-robot plan contains 22.",
    "The largest D_max of the three-robot plan is 27.9 µm, at step 86 of Table B.1; the "
    "improvement table gives the second largest, 21.9 µm at step 88. The reduction against the "
    "sequential method is then 90.9 %, not 93 %.",
    "The three-robot plan moves more than the cantilever method (27.9 against 15.9 µm), "
    "though it is called an improvement in all responses.",
    "Averages 'over the full sequence' (D_max 7.3 µm, M_sup 6.8 N m) leave out the eight "
    "twisting steps; over all 49 steps of A.1 the mean D_max is 21.9 µm.",
    "The average T_max of the sequential method is printed as 38.0 N; all 49 rows give 36.7 N. "
    "Those of the cantilever method leave out steps 1 to 4.",
)
"""Inconsistencies in the paper's own numbers, one sentence each."""

PUBLISHED = "published"  # the name of the printed three-robot plan, where methods are listed
PRINTED_COLUMN = {"sequential": "sequential", "cantilever": "cantilever", PUBLISHED: "three_robot"}


def is_reference_arch(scene: Scene) -> bool:
    """Return whether a scene is the arch of Bruun et al. as it ships with the package."""
    return scene == load_scene("arch25")


def published_plan(scene: Scene) -> tuple[Step, ...]:
    """Return the published three-robot plan (Table B.1), checked in a scene.

    Parameters
    ----------
    scene : Scene
        The arch of Bruun et al., or one like it.

    Returns
    -------
    tuple of Step
        90 steps.
    """
    source = resources.files("seqopt").joinpath("data/paper/three_robot_plan.csv")
    text = source.read_text(encoding="utf-8")
    steps: tuple[Step, ...] = required("parse_plan")(scene, text, "published three-robot plan")
    return steps


def paper_models(schedule: Schedule) -> tuple[int, int]:
    """Return how many models Bruun et al. count: cascading, and with shared steps over all pairs.

    They count 2n candidates for every brick count n from 3 to the last, four steps each, and 2n
    times 2(n-1) pairs for the shared one.
    """
    counts = range(3, len(schedule.scene.bricks) + 1)
    return sum(8 * n for n in counts), sum(6 * n + 2 * n * 2 * (n - 1) for n in counts)


def as_printed(scene: Scene, table: pd.DataFrame) -> pd.DataFrame:
    """Return responses of steps with ``F_sup`` and ``M_sup`` where Bruun et al. take them.

    They print force and moment of the end where the build starts, the scene's first; elsewhere
    both are the largest over all ends.

    Parameters
    ----------
    scene : Scene
        The arch of Bruun et al., or one like it.
    table : pandas.DataFrame
        From `seqopt.analyze`.

    Returns
    -------
    pandas.DataFrame
        With the same columns.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> table = seqopt.analyze(
    ...     seqopt.make_engine("compliance", network), seqopt.sequential(network)
    ... )
    >>> [float(t["M_sup_Nm"][48].round(1)) for t in (table, as_printed(network.scene, table))]
    [6.5, 0.8]
    """
    ends = support_columns(scene)
    if not ends:
        return table
    force, moment = (RESPONSES[name].column for name in ("F_sup", "M_sup"))
    first_force, first_moment = ends[0]
    return table.assign(**{force: table[first_force], moment: table[first_moment]})


def printed_maxima() -> pd.DataFrame:
    """Return the largest responses that the paper prints (its improvement table).

    Returns
    -------
    pandas.DataFrame
        A column per method; rows in the paper's order: the force of each robot [N], M_sup [N m],
        T_max [N], D_max [1e-3 mm].
    """
    table = printed("improvement_3robot").drop(columns=["quantity", "unit"])
    return table[[*PRINTED_COLUMN.values()]].set_axis([*PRINTED_COLUMN], axis=1)
