"""Blocks of states, and what an engine answers for one: the unit that is computed, sent, stored.

A state is a brick count and the nodes held. How many states make a block depends on nothing but
the schedule, so that answers are the same to the last bit wherever and by whomever a block is
answered.

For other processes the scene is sent, and the engine made where it is needed.

In a folder of answers every block is a file of its own, written whole: a checksum of all that
follows, the numbers, then what the engine counted. No more is read than an answer to the block can
be, and a file is believed only if it is whole and its block's own: whatever is damaged is computed
again. Against somebody who writes false numbers with their checksum there is
`seqopt.plan.judge.certificate`.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from operator import or_
from pathlib import Path

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.auto import Level, LevelChoice
from seqopt.engines.interface import Engine, Want, one_thread
from seqopt.engines.registry import Recipe, make_engine, recipe_of
from seqopt.errors import FileError, SceneError
from seqopt.files import HIDDEN, make_folder, require_folder, write_bytes
from seqopt.responses.quantities import CHOSEN_BY, lengths, require_finite

_Tally = tuple[tuple[object, int], ...]


@dataclass(frozen=True, eq=False, repr=False)
class Block(FrozenValue):
    """States with one brick count, and what is to be known of them."""

    bricks: int  # how many bricks stand
    grips: Ints  # (S, r); nodes held
    names: tuple[str, ...]  # responses of `seqopt.responses.quantities.CHOSEN_BY`
    screen: bool = True  # whether six digits are enough

    @cached_property
    def key(self) -> str:
        """Its content, condensed."""
        exact = () if self.screen else ("exact",)
        mark = hashlib.sha256(repr((self.bricks, self.names, self.grips.shape, *exact)).encode())
        mark.update(self.grips.astype("<i8").tobytes())
        return mark.hexdigest()

    @property
    def work(self) -> float:
        """About how long it takes, in no unit: what an engine does grows with the bricks."""
        return work(len(self.grips), self.bricks)


def work(states: int, bricks: int) -> float:
    """Return about how long states take, in no unit."""
    return float(states * (bricks + _APART))


_APART = 20  # bricks whose share of the work is what every state costs, however small it is


@dataclass(frozen=True, eq=False, repr=False)
class Answers(FrozenValue):
    """What an engine answers for a block.

    ``values`` (S,): the responses asked for, SI units; ``forces`` (S, r): sizes of the forces of
    the grips, N; ``tally`` (object, int): what the engine counted meanwhile, if it counts:
    `seqopt.engines.auto.AutoEngine`.
    """

    values: Mapping[str, Floats]
    forces: Floats
    tally: _Tally = ()


def answer(engine: Engine, block: Block) -> Answers:
    """Return the responses of a block of states.

    Raises `MechanismError`, `SolverError` as the engine does.
    """
    asked = [CHOSEN_BY[name] for name in block.names]
    digits = Want.SCREEN if block.screen else Want(0)
    want = reduce(or_, (response.needs for response in asked), digits)
    before = Counter(tally_of(engine))
    with one_thread():  # as many threads everywhere: sums in other orders differ in the last bit
        fields = engine.solve(block.bricks, block.grips, want)
    forces = require_finite("grip force", lengths(fields.grip_force), block.bricks)
    values = {
        response.name: require_finite(
            response.name, response.of(engine.network, fields), block.bricks
        )
        for response in asked
    }
    return Answers(values, forces, tuple((Counter(tally_of(engine)) - before).items()))


def tally_of(engine: Engine) -> dict[object, int]:
    """Return what an engine counts, empty if it does not. Result: its own: adding to it counts."""
    found = getattr(engine, "tally", None)
    return found if isinstance(found, dict) else {}


_HELD = 2  # engines that a process keeps between tasks: of the run before, and of this one
Blocks = Sequence[Block]


@dataclass(frozen=True)
class Shipment:
    """An engine as it is sent: how to make it, or itself where nobody knows."""

    key: str  # its content, condensed
    content: bytes

    def unpack(self) -> Engine:
        """Return the engine, newly made."""
        found: Recipe | Engine = pickle.loads(self.content)  # our own, from `pack`
        if isinstance(found, Recipe):
            return make_engine(found.engine, found.scene, **found.options)  # type: ignore[arg-type]
        return found


def pack(engine: Engine) -> Shipment:
    """Return an engine as it is sent.

    Raises `SceneError` if it is an engine of one's own that cannot be sent.
    """
    recipe = _known_recipe(engine)
    try:
        content = pickle.dumps(engine if recipe is None else recipe)
    except Exception as error:  # whatever objects of others may raise
        raise SceneError(
            f"engine {type(engine).__name__}: it cannot be sent to other processes ({error}); take "
            "one of seqopt.make_engine, or let this process work alone"
        ) from error
    return Shipment(hashlib.sha256(content).hexdigest(), content)


def _known_recipe(engine: Engine) -> Recipe | None:
    """Return how an engine can be made again with the same answers.

    Result: None for an engine that is not made by name, or of a network that its scene does not
    have.
    """
    recipe = recipe_of(engine)
    return recipe if recipe is not None and recipe.network == engine.network else None


def worker_for(engine: Engine, *, elsewhere: bool) -> Callable[[Blocks], list[Answers]]:
    """Return the function that answers blocks of states.

    ``elsewhere``: whether it is to be sent to other processes. Result: takes blocks, returns their
    answers.
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
            while len(self.engines) >= _HELD:
                self.engines.popitem(last=False)
            self.engines[shipment.key] = shipment.unpack()
        self.engines.move_to_end(shipment.key)
        return self.engines[shipment.key]


_shelf = _Shelf()


_LEFT = 3600.0  # s after which a file that is not complete is one that was given up
_DIGEST = 32  # bytes of a checksum
_WORDS = 2**16  # bytes that what an engine counted takes at most


class Store:
    """The answers of one engine in a folder.

    ``folder``: made if it is not there; ``engine``: made by name. Raises `FileError` if the folder
    cannot be written; `SceneError` if nobody can say what the engine's answers depend on.
    """

    def __init__(self, folder: Path, engine: Engine) -> None:
        require_folder(folder)
        recipe = _known_recipe(engine)
        if recipe is None:
            raise SceneError(
                f"cache {folder}: a {type(engine).__name__} does not say what its answers depend "
                "on; take one of seqopt.make_engine, or no cache"
            )
        self._recipe: Recipe = recipe
        self._folder = folder / recipe.key[:32]
        make_folder(self._folder)
        _tidy(self._folder)

    def path(self, block: Block) -> Path:
        """Return the file of a block."""
        return self._folder / f"{block.bricks}-{block.key[:48]}.answers"

    def find(self, block: Block) -> Answers | None:
        """Return the answers to a block, if they are there and whole."""
        sets, columns = len(block.grips), len(block.names) + block.grips.shape[1]
        words = _DIGEST + 8 * sets * columns
        try:
            with self.path(block).open("rb") as file:
                content = file.read(words + _WORDS + 1)
        except OSError:
            return None
        whole = words <= len(content) <= words + _WORDS
        if not whole or content[:_DIGEST] != self._checksum(block, content[_DIGEST:]):
            return None
        numbers = np.frombuffer(content[_DIGEST:words], "<f8").reshape(columns, sets).astype(float)
        if not np.isfinite(numbers).all():
            return None
        try:
            rows = json.loads(content[words:])
            tally = tuple((LevelChoice(Level(level), why), int(n)) for level, why, n in rows)
        except (ArithmeticError, RecursionError, TypeError, ValueError):  # checked, and yet false
            return None
        values = dict(zip(block.names, numbers, strict=False))
        return Answers(values, numbers[len(values) :].T.copy(), tally)

    def keep(self, block: Block, answers: Answers) -> None:
        """Write the answers to a block. Raises `FileError` if the file cannot be written."""
        numbers = np.array([*(answers.values[name] for name in block.names), *answers.forces.T])
        words = json.dumps([_words(what, count) for what, count in answers.tally])
        content = numbers.astype("<f8").tobytes() + words.encode()
        write_bytes(self.path(block), self._checksum(block, content) + content)

    def _checksum(self, block: Block, content: bytes) -> bytes:
        """Return the checksum of what is to be known of a block."""
        return hashlib.sha256(f"{self._recipe.key} {block.key} ".encode() + content).digest()


def open_store(folder: Path | str | None, engine: Engine) -> Store | None:
    """Return the store of an engine's answers in a folder. ``folder``: None for none."""
    return None if folder is None else Store(Path(folder), engine)


def _words(what: object, count: int) -> list[str | int]:
    if not isinstance(what, LevelChoice):
        raise SceneError(f"cache: an engine that counts {what!r} cannot be kept; take no cache")
    return [what.level.value, what.reason, count]


def _tidy(folder: Path) -> None:
    """Take away what runs that were killed left half-written."""
    for path in folder.glob(f"{HIDDEN}*"):
        try:
            if time.time() - path.stat().st_mtime > _LEFT:
                path.unlink()
        except FileNotFoundError:  # another run was faster
            continue
        except OSError as error:
            raise FileError(
                f"cannot tidy {folder}: {error.strerror}; name another cache"
            ) from error
