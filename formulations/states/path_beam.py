r"""The states of a build by a beam of given width: a heuristic that computes few responses.

Brick count by brick count it keeps the ``width`` states :math:`s` of least value :math:`v` that
those kept before lead to by placing a brick and letting go,

.. math::

   B_k = \text{the } w \text{ states } s \text{ next to } B_{k-1} \cup B_k
   \text{ with the least } \; v(s),

and returns the best path among them, goal by goal. Regrips are left out, but if no plan is found
without them: then all states are looked at. The value is that of the first goal; if that is about
moves and not about states, the states that come first are kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from formulations.states._search import (
    after_margins,
    best_standing,
    best_total,
    narrow,
    plan_by_then,
    shortest,
    watched,
)
from formulations.states._totals import StopError
from seqopt.errors import ProblemError
from seqopt.graph._explore import Explorer
from seqopt.graph.formulation import Formulation, FormulationKind, Solution, Watch
from seqopt.graph.states.explored import build_space
from seqopt.graph.states.states import States
from seqopt.work.progress import Tell


def solve(
    problem: States,
    *,
    width: int = 50,
    seconds: float = np.inf,
    max_memory: float = np.inf,
    progress: Tell = lambda _: None,
) -> Solution:
    """Return a plan through the states of a beam.

    ``width``: how many new states of a brick count are kept, from 1; ``seconds``, ``max_memory``:
    limits, s and bytes, at which it ends without a plan; ``progress``: called with a
    `seqopt.work.Stage`. Only margins of stability have a bound. Raises `InfeasibleError` if no plan
    is feasible; `ProblemError`, `TimeUpError` if the width is not positive, or memory or time is
    up.
    """
    if width < 1:
        raise ProblemError(f"option width={width}: give a whole number from 1 on")
    watch = Watch(seconds)
    tell = watched(problem, watch, max_memory, progress)
    if problem.totals:
        plan = best_total(problem, shortest, watch, tell, width)
        return replace(plan, bound=(-np.inf,))

    def search(rest: States) -> Solution:
        try:
            found = narrow(rest, width, tell, every=True)
            if found is None:
                every = Explorer(build_space(rest), tell=tell)
                if not every.rise():
                    raise every.without_plan("no plan is allowed")
                found = best_standing(every, rest.budgets)
        except StopError as stop:
            return plan_by_then(None, stop)
        return replace(found, bound=(-np.inf,) * len(found.bound))

    return after_margins(problem, search, tell)


FORMULATION = Formulation(
    "path_beam",
    "a beam over the states of every brick count",
    FormulationKind.HEURISTIC,
    None,
    solve,
    answers=("goals", "tail", "order"),
)
