r"""All nondominated plans, one for each vector of responses: exact, by search zones.

A plan has a vector :math:`z` of objectives to minimize, say the worst of each response. It is
dominated by one that is at most as large in all and less in one. A point that none of those found
so far dominates lies in one of finitely many *search zones*,

.. math::

   \{\, z : z < u \,\} \quad\text{for the local upper bounds } u .

A zone is empty if no path of states that are all below :math:`u` leads to an end. Else the least of
the first number in it, of the second among these, and so on, is a new point :math:`z`; every zone
that holds it is split, once for each number, with :math:`z_k` instead of :math:`u_k`, and
zones inside others are dropped. When no zone is left the set is complete. Source: Klamroth, Lacour
and Vanderpooten, On the representation of the search region in multi-objective optimization (2015).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.arrays import Bools, Floats
from seqopt.errors import TimeUpError
from seqopt.graph.formulation import Formulation, FormulationKind, Solution, Watch
from seqopt.plan.front import FrontProblem
from seqopt.work import Tell


def solve(
    problem: FrontProblem, *, seconds: float = np.inf, progress: Tell = lambda _: None
) -> tuple[Solution, ...]:
    """Return a plan for each vector that no plan dominates.

    ``seconds``: after which the plans found are returned, or a `TimeUpError` says there is none.
    """
    watch, stopped = Watch(seconds), ""
    zones = np.full((1, len(problem.names)), np.inf)
    plans = list[Solution]()
    try:
        while len(zones) and not stopped:
            progress(f"{len(plans)} plans found, {len(zones)} regions left")
            found = problem.best_below(zones[-1])
            if found is None:
                zones = zones[:-1]
            else:
                plans.append(found)
                zones = _split(zones, np.array(found.objective))
            stopped = "time" if watch.over and len(zones) else ""
    except KeyboardInterrupt:
        if not plans:
            raise
        stopped = "interrupt"
    if stopped and not plans:
        raise TimeUpError("no plan was found yet; give more time")
    return tuple(replace(plan, stopped=stopped) for plan in plans)


def _split(zones: Floats, point: Floats) -> Floats:
    """Return the upper bounds (m, k) of the zones that are left once a point (k,) is found.

    ``zones`` (n, k). None of the result lies in another one.
    """
    inside = (point < zones).all(axis=1)
    kept = zones[~inside]
    cut = np.eye(zones.shape[1], dtype=bool)[:, None]  # in one number each
    fresh = np.unique(np.concatenate(np.where(cut, point, zones[inside])), axis=0)
    fresh = fresh[~_within(fresh, kept)]
    alone = [i for i in range(len(fresh)) if not _within(fresh[i : i + 1], np.delete(fresh, i, 0))]
    return np.vstack([kept, fresh[alone]])


def _within(zones: Floats, others: Floats) -> Bools:
    """Return which zones lie in one of others, (n,) bool."""
    return np.asarray(np.all(zones[:, None] <= others[None], axis=2).any(axis=1))


FORMULATION = Formulation(
    "pareto_zones",
    "all plans that none beats in every response, zone by zone",
    FormulationKind.EXACT,
    None,
    solve,
    answers=("front",),
)
