"""Reports: every method and formulation on one scene, side by side, as tables and as text.

Pictures need the extra ``plot`` and stay in `seqopt.report.draw` and `seqopt.report.charts`, which
this page does not import.

>>> from seqopt.engines.registry import make_engine
>>> from seqopt.network.network import build_network
>>> from seqopt.report import compare, format_comparison
>>> from seqopt.scene.scene_file import load_scene
>>> from seqopt.study import CRITERIA
>>> scene, criterion = load_scene("chain:bricks=9"), CRITERIA["worst-ratio-published"]
>>> comparison = compare(make_engine("compliance", build_network(scene)), criterion)
>>> comparison.table.loc[["cascade", "overlap_dp"], "gap"].astype(float).round(3).tolist()
[0.069, 0.0]
>>> print(format_comparison(comparison, scene, criterion).splitlines()[0])
chain 9: 9 bricks, 3 robots
"""

from typing import TYPE_CHECKING

from seqopt._registry import later

if TYPE_CHECKING:
    from seqopt.report._questions import report
    from seqopt.report.comparison import Comparison, compare, format_comparison

__all__ = ["Comparison", "compare", "format_comparison", "report"]
__getattr__, __dir__ = later(
    __name__, dict.fromkeys(__all__, "comparison") | {"report": "_questions"}
)
