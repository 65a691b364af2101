"""Work: one function over many tasks, in order, here, on processes, or on any executor.

Results are those of a loop, and come in its order, whoever works. A worker that dies takes no
result with it: what it had not answered is given out again.

>>> from seqopt.work import hire, map_ordered
>>> with hire(workers=1) as crew:  # more workers are processes
...     list(map_ordered(abs, [-3, 2], crew))
[3, 2]
"""

from seqopt.work.crew import Crew, hire
from seqopt.work.ordered import map_ordered
from seqopt.work.progress import Progress, Stage

__all__ = ["Crew", "Progress", "Stage", "hire", "map_ordered"]
