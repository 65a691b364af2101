"""Find where each robot should hold a half-built structure, over the whole build.

A scene says what is built, in which order and by which robots. It becomes a network of bars and
springs. An engine computes how every partial structure responds to the robots' grips. A schedule
lists the steps of the build; some of its grips are still open. The problem is to choose them. A
formulation solves the problem, and the plan is the checked answer.

>>> import seqopt
>>> scene = seqopt.load_scene("arch25")
>>> network = seqopt.build_network(scene)
>>> engine = seqopt.make_engine("compliance", network)
>>> schedule = seqopt.three_robot_loop(network)
>>> problem = seqopt.pose(engine, schedule, seqopt.CRITERIA["equations-2-3"])
>>> plan = seqopt.solve(problem, "overlap_dp")
>>> plan.certificate.gap
0.0

`seqopt.optimize` does all of this in one call. Names are loaded when they are first used.
"""

from __future__ import annotations

import re
from pathlib import Path

from seqopt._registry import later

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")  # also of type checkers
_HOME_OF = {name: home for home, name in re.findall(r"from seqopt\.(\S+) import (\w+)", _STUB)}
__all__ = [*_HOME_OF, "__version__"]  # noqa: PLE0604  # they are strings
_find, _ = later("seqopt", _HOME_OF)


def __getattr__(name: str) -> object:
    """Load a public name when it is first used (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415  # 30 ms that few ask for

        return version("seqopt")
    return _find(name)


def __dir__() -> list[str]:
    return [*__all__]
