"""Work: one function over many tasks, in this process, in others, or on any executor.

Results are those of a loop and come in the same order, whichever worker computes them. A worker
that dies ends in an error of one line.

>>> from seqopt.work import hire, map_ordered
>>> with hire(workers=1) as crew:  # more workers are processes
...     list(map_ordered(abs, [-3, 2], crew))
[3, 2]
"""

from seqopt.work._workers import Crew, hire, map_ordered
from seqopt.work.progress import Progress, Stage

__all__ = ["Crew", "Progress", "Stage", "hire", "map_ordered"]
