"""Every command as a function of Python: the same words and defaults, and values in place of text.

A scene is given as such, by its name or words, by its file, or as a plan or the folder of one.
Where a parameter says nothing else, words of the command line stand for its value:
``criterion="worst-ratio"``, ``limits=["payload", "F_largest=300"]``; options that make a value,
such as ``grips=1e6`` of a scene, are taken beside it. With ``out`` the files of the command are
written. Progress is shown in a notebook and at a terminal, or passed to ``progress``. A
`SeqoptError` names in one line what to change.
"""

from __future__ import annotations

from seqopt._cli.answer import Answer
from seqopt._cli.commands.analyze import analyze
from seqopt._cli.commands.assess import assess
from seqopt._cli.commands.compare import compare
from seqopt._cli.commands.exporting import export
from seqopt._cli.commands.instance import instance
from seqopt._cli.commands.pareto import pareto
from seqopt._cli.commands.reach import reach
from seqopt._cli.commands.replan import replan
from seqopt._cli.commands.report import report
from seqopt._cli.commands.times import times
from seqopt._registry import Command
from seqopt.instances.answers import judge_instance as judge
from seqopt.sweep import sweep
from seqopt.workflow import optimize

__all__ = [
    "Answer",
    "Command",
    "analyze",
    "assess",
    "compare",
    "export",
    "instance",
    "judge",
    "optimize",
    "pareto",
    "reach",
    "replan",
    "report",
    "sweep",
    "times",
]
