"""Plans in formats of other programs: tables, JSON, tasks of robots, COMPAS, sequencer_benchmark.

>>> import seqopt
>>> from seqopt.sequence.exports import export_plan
>>> scene = seqopt.load_scene("arch25")
>>> steps = seqopt.sequential(seqopt.build_network(scene))
>>> export_plan(scene, steps, "csv").splitlines()[0][:40]
'step,type,bricks,placed,rob1_node,rob1_b'
"""

from typing import TYPE_CHECKING

from seqopt._later import later
from seqopt.sequence.exports._grip_frames import hold
from seqopt.sequence.exports._tables import BlockState, step_states
from seqopt.sequence.exports._tasks import Action, Task, plan_tasks

if TYPE_CHECKING:
    from seqopt.sequence.exports.formats import EXPORTS, LOST, export_plan, read_folder

__all__ = [
    "EXPORTS",
    "LOST",
    "Action",
    "BlockState",
    "Task",
    "export_plan",
    "hold",
    "plan_tasks",
    "read_folder",
    "step_states",
]
__getattr__, __dir__ = later(
    __name__, dict.fromkeys(("EXPORTS", "LOST", "export_plan", "read_folder"), "formats")
)
