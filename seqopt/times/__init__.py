"""How long builds take: robots that prepare, mortar that cures, and the proof of makespans.

Others find what the room offers in `seqopt._registry`. Robots prepare at the same time, and act one
after the other:

>>> import seqopt
>>> from seqopt.times import times
>>> words = "fetch=30,place=20,approach=10,grip=5,release=5"
>>> build = times(seqopt.load_scene("arch25").with_durations(words), "sequential")
>>> build.times().loc[1, ["ready_s", "start_s", "end_s"]].tolist()  # the second brick waits
[30.0, 50.0, 70.0]
>>> build.makespan
1340.0
"""

from typing import TYPE_CHECKING

from seqopt._registry import later

if TYPE_CHECKING:
    from seqopt.times._build import times
    from seqopt.times._curing_law import Curing
    from seqopt.times._durations import Durations

__all__ = ["Curing", "Durations", "times"]
__getattr__, __dir__ = later(
    __name__, {"Curing": "_curing_law", "Durations": "_durations", "times": "_build"}
)
