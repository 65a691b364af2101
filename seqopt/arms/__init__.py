"""Arms that must reach: postures of robots at nodes, free of bricks, the ground and each other.

A robot of a scene may have an arm (`seqopt.scene.arm.Arm`): a model, a base and a tool. What it
reaches is then looked up in a table of postures, which is computed once by pinocchio and coal
(extra ``arms``). Schedules, methods and plans ask this table::

    table = find_postures(scene, cache="postures")
    reach_table(scene)      # which robot reaches which node, with how many postures
    plan = seqopt.optimize(scene, "free")
    print(plan.arms)        # whether postures are kept while robots hold
"""

from seqopt.arms.listing import posture_table, reach_table
from seqopt.arms.model import compliance
from seqopt.arms.reach import find_postures
from seqopt.arms.table import PostureTable

__all__ = ["PostureTable", "compliance", "find_postures", "posture_table", "reach_table"]
