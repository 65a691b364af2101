"""What one order is worth, tried here or by other processes."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from seqopt.errors import ProblemError
from seqopt.graph.orders.orders import AllOrders
from seqopt.graph.paths import keep_best
from seqopt.graph.states.states import States
from seqopt.graph.states.visits import explore
from seqopt.responses.blocks import Shipment, engine_of, pack
from seqopt.scene.orders import Order

NARROW = 50  # states of a brick count with which an order is tried first


@dataclass(frozen=True)
class Trial:
    """An order to be tried.

    ``order``: names of all bricks; ``ceiling``: what it must stay below.
    """

    order: Order
    ceiling: float


def worth(problem: AllOrders, trial: Trial) -> float:
    """Return the first goal of the best plan of an order.

    Result: infinite where no plan of it stays below the ceiling.
    """
    judged, ceiling, found = problem.judging(trial.order), trial.ceiling, np.inf
    for width in (NARROW, None):
        visited = explore(judged, ceiling, width)
        if visited.whole:
            visited.refine()
            found = ceiling = keep_best(visited.graph().graph, 0)[1]
    return found


def trying(problem: AllOrders, *, elsewhere: bool) -> Callable[[Trial], float]:
    """Return the function that tries orders.

    ``elsewhere``: whether it is to be sent to other processes: then with the scene, not with an
    engine. Result: takes a trial, returns its `worth`. Raises `ProblemError`, `SceneError` if a
    criterion or an engine of one's own cannot be sent.
    """
    if not elsewhere:
        return partial(worth, problem)
    free = replace(problem.states, resources=problem.states.resources.alone())
    sent = ("engine", "scenarios")
    rest = {f.name: getattr(free, f.name) for f in fields(free) if f.name not in sent}
    others = tuple(map(pack, free.scenarios))
    try:
        content = pickle.dumps((rest, others, problem.among))
    except Exception as error:  # whatever objects of others may raise
        raise ProblemError(
            f"criterion {free.criterion.name}: it cannot be sent to other processes ({error}); "
            "define it in a module, or let this process work alone"
        ) from error
    return partial(_sent, pack(free.engine), content)


def _sent(shipment: Shipment, content: bytes, trial: Trial) -> float:
    rest, others, among = pickle.loads(content)  # our own, from `trying`
    rest["scenarios"] = tuple(map(engine_of, others))
    return worth(AllOrders(States(engine=engine_of(shipment), **rest), among), trial)
