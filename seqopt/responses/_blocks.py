"""Blocks of states, and their responses: the unit of computing and of messages.

A state is a brick count and the nodes held. The size of blocks depends on the schedule alone, so
that responses are bitwise equal in any process.

Other processes receive the scene, and build the engine themselves.
"""

from __future__ import annotations

import pickle
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import or_

import numpy as np

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.interface import Engine, Want
from seqopt.engines.registry import Recipe, recipe_of
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SceneError
from seqopt.responses._tolerance import misfits
from seqopt.responses.quantities import (
    CHOSEN_BY,
    EXTREMES,
    PROP_EXCESS,
    TOLERANCE,
    _excess_of,
    lengths,
    require_finite,
)
from seqopt.work._workers import one_thread


@dataclass(frozen=True, eq=False, repr=False)
class Block(FrozenValue):
    """States with one brick count, and the requested responses."""

    bricks: int  # how many bricks stand
    grips: Ints  # (S, r); numbers of grips, as `seqopt.Scene.grip_numbers` has them
    names: tuple[str, ...]  # responses of `seqopt.responses.quantities.CHOSEN_BY`
    screen: bool = True  # whether six digits are enough
    props: tuple[int, ...] = ()  # numbers of grips that all of them have beside these
    compiled: bool = False  # whether there is so much to do that loading compiled loops pays

    @property
    def work(self) -> float:
        """Estimated work, without unit: it grows with the bricks."""
        return work(len(self.grips), self.bricks)


COMPILED = 2e7  # work from which on compiled loops save more than loading them takes


def work(states: int, bricks: int) -> float:
    """Return the estimated work of states, without unit."""
    return float(states * (bricks + 20))  # 20: what every state costs, however small it is


@dataclass(frozen=True, eq=False, repr=False)
class Answers(FrozenValue):
    """The requested responses of a block (S,), SI units, and sizes of grip forces (S, r), N."""

    values: Mapping[str, Floats]
    forces: Floats


def answer(engine: Engine, block: Block) -> Answers:
    """Return the responses of a block of states. Raises what the engine does."""
    asked = [CHOSEN_BY[name] for name in block.names if name in CHOSEN_BY]
    want = reduce(or_, (r.needs for r in asked), Want.SCREEN if block.screen else Want(0))
    sets, robots = block.grips.shape
    grips = np.hstack([block.grips, np.tile(np.array(block.props, dtype=np.int64), (sets, 1))])
    if isinstance(engine, ComplianceEngine) and set(block.names) <= EXTREMES.keys():
        with one_thread():
            found = engine._extremes(block.bricks, grips, want, compiled=block.compiled)
        forces = require_finite("grip force", found.force, block.bricks)[:, :robots]
        return Answers({name: EXTREMES[name](found) for name in block.names}, forces)
    with one_thread():  # as many threads everywhere: sums in other orders differ in the last bit
        fields = engine.solve(block.bricks, grips, want)
    forces = require_finite("grip force", lengths(fields.grip_force), block.bricks)[:, :robots]
    network, bricks = engine.network, block.bricks
    values = {r.name: require_finite(r.name, r.of(network, fields), bricks) for r in asked}
    if TOLERANCE in block.names:
        with one_thread():
            values[TOLERANCE] = misfits(engine, bricks, grips)
    if PROP_EXCESS in block.names:
        props = [network.scene.prop_of_number[number] for number in block.props]
        values[PROP_EXCESS] = _excess_of(props, fields.grip_force[:, robots:])
    return Answers(values, forces)


def packed(engine: Engine) -> bytes:
    """Pickle the recipe of an engine, or the engine itself if it has none.

    Raises `SceneError` if a user's engine cannot be pickled.
    """
    recipe = recipe_of(engine)
    known = recipe is not None and recipe.network == engine.network  # else it makes another engine
    try:
        return pickle.dumps(recipe if known else engine)
    except Exception as error:  # foreign code may raise any error
        raise SceneError(
            f"engine {type(engine).__name__}: it cannot be sent to other processes ({error}); take "
            "one of seqopt.make_engine, or let this process work alone"
        ) from error


# Engines of the last two runs of each thread of a worker: executors of users have no storage for
# workers' data between tasks, each of which would build its engine again.
_OF_THREAD = threading.local()


def unpacked(engine: Engine | bytes) -> Engine:
    """Return an engine unchanged, or the one of a `packed` form, built once for a thread."""
    if not isinstance(engine, bytes):
        return engine
    made: dict[bytes, Engine] = vars(_OF_THREAD).setdefault("engines", {})
    if engine not in made:
        found: Recipe | Engine = pickle.loads(engine)  # our own, of `packed`
        made[engine] = found.make() if isinstance(found, Recipe) else found
        if len(made) > 2:
            del made[next(iter(made))]
    return made[engine]


BLOCK = 2048  # grip sets whose fields are held at once: few enough to stay in the cache
