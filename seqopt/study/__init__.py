"""What Bruun et al. published: their robots, criteria, tables and three-robot plan.

The paper is arXiv 2104.04856. No other part of seqopt uses numbers from it.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.build import build_network
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

from seqopt.study.published import (
    CRITERIA,
    IRREGULARITIES,
    ROBOTS,
    as_printed,
    printed_maxima,
    printed_steps,
    published_plan,
)

__all__ = [
    "CRITERIA",
    "IRREGULARITIES",
    "ROBOTS",
    "as_printed",
    "printed_maxima",
    "printed_steps",
    "published_plan",
]
