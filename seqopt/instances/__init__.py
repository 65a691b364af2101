"""Compiled graphs that stand alone: read without a scene, written for any solver, judged anywhere.

>>> import seqopt
>>> from seqopt.instances import instance
>>> graph = instance("chain:bricks=7", "free", aim="minmax,steps", below=40.0)
>>> plan = seqopt.solve(graph)
>>> seqopt.judge_instance(graph, plan.nodes).gap
0.0

Files hold the graph, goals and caps of its paths (`save_instance`, `read_instance`); MPS
files hold it as an integer program.
"""

from typing import TYPE_CHECKING

from seqopt._registry import later

if TYPE_CHECKING:
    from seqopt.instances._files import read_instance, save_instance
    from seqopt.instances._judge import judge_instance
    from seqopt.instances.compiled import compile_instance, instance
    from seqopt.instances.model import Instance

__all__ = [
    "Instance",
    "compile_instance",
    "instance",
    "judge_instance",
    "read_instance",
    "save_instance",
]
__getattr__, __dir__ = later(
    __name__,
    {
        "Instance": "model",
        "compile_instance": "compiled",
        "instance": "compiled",
        "judge_instance": "_judge",
        "read_instance": "_files",
        "save_instance": "_files",
    },
)
