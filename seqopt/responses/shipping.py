"""Work on states for other processes: the scene is sent, and the engine made where it is needed."""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from seqopt.engines.interface import Engine
from seqopt.engines.recipe import Recipe, recipe_of
from seqopt.engines.registry import make_engine
from seqopt.errors import SceneError
from seqopt.responses.states import Answers, Block, answer

HELD = 2  # engines that a process keeps between tasks: of the run before, and of this one
Blocks = Sequence[Block]


@dataclass(frozen=True)
class Shipment:
    """An engine as it is sent: how to make it, or itself where nobody knows.

    Attributes
    ----------
    key : str
        Its content, condensed.
    content : bytes
    """

    key: str
    content: bytes

    def unpack(self) -> Engine:
        """Return the engine, newly made."""
        found: Recipe | Engine = pickle.loads(self.content)  # our own, from `pack`
        if isinstance(found, Recipe):
            return make_engine(found.engine, found.scene, **found.options)  # type: ignore[arg-type]
        return found


def pack(engine: Engine) -> Shipment:
    """Return an engine as it is sent.

    Raises
    ------
    SceneError
        If it is an engine of one's own that cannot be sent.
    """
    recipe = known_recipe(engine)
    try:
        content = pickle.dumps(engine if recipe is None else recipe)
    except Exception as error:  # whatever objects of others may raise
        raise SceneError(
            f"engine {type(engine).__name__}: it cannot be sent to other processes ({error}); take "
            "one of seqopt.make_engine, or let this process work alone"
        ) from error
    return Shipment(hashlib.sha256(content).hexdigest(), content)


def known_recipe(engine: Engine) -> Recipe | None:
    """Return how an engine can be made again with the same answers.

    Returns
    -------
    Recipe or None
        None for an engine that is not made by name, or of a network that its scene does not have.
    """
    recipe = recipe_of(engine)
    return recipe if recipe is not None and recipe.network == engine.network else None


def worker_for(engine: Engine, *, elsewhere: bool) -> Callable[[Blocks], list[Answers]]:
    """Return the function that answers blocks of states.

    Parameters
    ----------
    engine : Engine
    elsewhere : bool
        Whether it is to be sent to other processes.

    Returns
    -------
    callable
        Takes blocks, returns their answers.

    Raises
    ------
    SceneError
        As of `pack`.
    """
    return partial(_answer_sent, pack(engine)) if elsewhere else partial(_answer_here, engine)


def _answer_here(engine: Engine, blocks: Blocks) -> list[Answers]:
    return [answer(engine, block) for block in blocks]


def _answer_sent(shipment: Shipment, blocks: Blocks) -> list[Answers]:
    return _answer_here(engine_of(shipment), blocks)


def engine_of(shipment: Shipment) -> Engine:
    """Return an engine that was sent; a worker keeps the last few that it made."""
    return _shelf.engine(shipment)


class _Shelf(threading.local):
    """The engines that a worker made, the last few by content.

    An executor of others offers no place for what its workers keep between tasks; without one
    each task would make its engine, and grow it, anew. Every thread has its own.
    """

    def __init__(self) -> None:
        self.engines: OrderedDict[str, Engine] = OrderedDict()

    def engine(self, shipment: Shipment) -> Engine:
        if shipment.key not in self.engines:
            while len(self.engines) >= HELD:
                self.engines.popitem(last=False)
            self.engines[shipment.key] = shipment.unpack()
        self.engines.move_to_end(shipment.key)
        return self.engines[shipment.key]


_shelf = _Shelf()
