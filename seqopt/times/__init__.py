"""How long builds take: robots that prepare, mortar that cures, and the proof of makespans.

The room hands out nothing: others find what it offers in `seqopt._registry`. Robots prepare at the
same time, and act one after the other:

>>> import seqopt
>>> from seqopt.times._steps import step_times
>>> words = "fetch=30,place=20,approach=10,grip=5,release=5"
>>> scene = seqopt.load_scene("arch25").with_durations(words)
>>> times = step_times(scene, seqopt.sequential(scene))
>>> times[1].ready, times[1].start, times[1].end  # s; the second brick waits for the first
(30.0, 50.0, 70.0)
>>> times[-1].end
1340.0
"""

__all__: list[str] = []
