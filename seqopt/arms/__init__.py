"""Arms that must reach: postures of robots at nodes, free of bricks, the ground and each other.

A robot of a scene may have an arm, an `Arm`: a model, a base and a tool. What it
reaches is then looked up in a table of postures, which pinocchio and coal compute once (extra
``arms``). Schedules, methods, plans and judges ask this table::

    scene = seqopt.load_scene("mine.json")             # whose robots have arms
    table = find_postures(scene, cache="postures")     # kept there for the next time
    table.rows("rob1", 12)                             # its postures at a node, as in table.joints
    plan = seqopt.optimize(scene, "free")              # with postures in every step
    print(plan.arms)                                   # whether they are kept while robots hold

Where no robot has an arm there is no table:

>>> import seqopt
>>> find_postures(seqopt.load_scene("arch25")) is None
True
"""

from typing import TYPE_CHECKING

from seqopt._registry import later
from seqopt.arms.reach import find_postures

if TYPE_CHECKING:
    from seqopt.arms._arm import Arm
    from seqopt.arms._tables import PostureTable

__all__ = ["Arm", "PostureTable", "find_postures"]
__getattr__, __dir__ = later(__name__, {"Arm": "_arm", "PostureTable": "_tables"})
