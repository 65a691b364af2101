"""Linear programs of one structure whose grips change: what is asked of a solver."""

from __future__ import annotations

from collections.abc import Callable

from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.plugins import plugins
from seqopt.stability.limit_analysis import Answer, Case

Enough = Callable[[Answer], bool]
"""Says whether an answer proves what is asked, or the program must be refined."""

HeldProgram = Callable[[Floats, Enough], Answer]
"""A case of one assembly, solved for the payloads (N) of all its grips; none for one not held.

Where no forces exist, the answer claims that, has no value and a motion that says why.
"""

CompileHeld = Callable[[Assembly, Case], HeldProgram]
"""Makes the program of an assembly, whose grips are all that may ever be held, and a case."""


def compile_held(assembly: Assembly, case: Case) -> HeldProgram:
    """Return the registered linear program (entry points ``seqopt.limit_analysis``).

    Parameters
    ----------
    assembly : Assembly
        Its grips are all that may ever be held.
    case : Case
    """
    entry = plugins("seqopt.limit_analysis")["lp"]
    compiled: CompileHeld = entry.load()
    return compiled(assembly, case)
