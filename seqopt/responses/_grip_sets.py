"""Responses of grip sets, computed on demand and cached.

For searches that need few of many sets: the sets of a request are solved in blocks, each once. The
size of blocks depends on the schedule alone, so that responses are bitwise equal in any process.
Other processes receive the scene, and build the engine themselves.
"""

from __future__ import annotations

import pickle
import threading
from collections import defaultdict
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import or_
from typing import Any, NamedTuple

import numpy as np

from seqopt._registry import Later
from seqopt.arrays import Bools, Floats, FrozenValue, Ints, KnownRows
from seqopt.engines.interface import FLAGS, Engine, Fields, NamedEngine, Want, linear_limit
from seqopt.engines.registry import Recipe, recipe_of
from seqopt.engines.rigid.compliance import ComplianceEngine, Extremes
from seqopt.errors import MechanismError, ProblemError, SceneError
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
from seqopt.sequence.steps import Step
from seqopt.work import Progress, Tell, _one_thread, map_ordered, worker_pool

_STACKED = Later("seqopt.engines.rigid._stacked")  # with scenarios alone

SHARED = 1e7  # work at once, a third of a second and more, from which on it may be shared
COMPILED = 1e6  # work from which on compiled loops save more than loading them takes
# Engines of the last two runs of each thread of a worker: executors of users have no storage for
# workers' data between tasks, each of which would build its engine again.
_OF_THREAD = threading.local()
BLOCK = 2048  # grip sets whose fields are held at once: few enough to stay in the cache
BAND = 1e-5  # share of a value within which six digits do not decide


@dataclass(frozen=True)
class Resources:
    """What a computation may use; no result depends on it.

    Parameters
    ----------
    workers : int, optional
        Processes to share the work among; with an executor, how many tasks it works on at once.
    executor : concurrent.futures.Executor, optional
        Any executor, instead of processes of our own. The caller ends it.
    progress : callable, optional
        Called with the progress, in a few words, of computations longer than a second.

    Raises
    ------
    ProblemError
        If a number is none that can be meant.

    Examples
    --------
    >>> Resources(workers=2).workers
    2
    """

    workers: int = 1
    executor: Executor | None = None
    progress: Tell | None = None

    def __post_init__(self) -> None:
        if isinstance(self.workers, bool) or not isinstance(self.workers, int) or self.workers < 1:
            raise ProblemError(f"workers is {self.workers!r}; give a whole number from 1")
        if not (self.executor is None or hasattr(self.executor, "submit")):
            raise ProblemError(
                f"executor: a {type(self.executor).__name__} is not an executor; "
                "give one of concurrent.futures, or workers"
            )

    def alone(self) -> Resources:
        """Return resources for little work: one process, without progress."""
        return replace(self, workers=1, executor=None, progress=None)


HERE = Resources()
"""This process alone."""


@dataclass(frozen=True, eq=False, repr=False)
class Block(FrozenValue):
    """States with one brick count, and the requested responses."""

    bricks: int  # how many bricks stand
    grips: Ints  # (S, r); numbers of grips, as `seqopt.Scene.grip_numbers` has them
    names: tuple[str, ...]  # responses of `seqopt.responses.quantities.CHOSEN_BY`
    screen: bool = True  # whether six digits are enough
    props: tuple[int, ...] = ()  # numbers of grips that all of them have beside these
    compiled: bool = False  # whether there is so much to do that loading compiled loops pays
    errors: bool = False  # whether rows go on with bounds on the errors of all that is in them

    @property
    def width(self) -> int:
        """How many columns the answers have."""
        own = len(self.names) + int(self.grips.shape[1])
        return 2 * own if self.errors else own

    def asked(self) -> tuple[Ints, Want]:
        """Return all grips, those of props last, and the fields from which responses follow."""
        props = np.tile(np.array(self.props, dtype=np.int64), (len(self.grips), 1))
        needs = (CHOSEN_BY[name].needs for name in self.names if name in CHOSEN_BY)
        want = reduce(or_, needs, Want.SCREEN if self.screen else Want(0))
        return np.hstack([self.grips, props]), want

    def rows(self, found: Extremes) -> Floats:
        """Return responses and sizes of grip forces (S, R + r) that are extremes."""
        forces = require_finite("grip force", found.force, self.bricks)[:, : self.grips.shape[1]]
        return np.column_stack([*(EXTREMES[name](found) for name in self.names), forces])

    def with_errors(self, rows: Floats, fields: Fields) -> Floats:
        """Return rows (S, R + r), and beside them what six digits may be off, as many columns.

        Fields err by a share of the largest entry of each.
        """
        largest = dict[Want, Floats]()
        for name, flag in FLAGS.items():
            flat = getattr(fields, name).reshape(len(rows), -1)
            most, least = flat.max(axis=1, initial=0.0), flat.min(axis=1, initial=0.0)
            largest[flag] = np.maximum(most, -least)
        of_grips = [lengths(fields.grip_force).max(axis=1, initial=0.0)] * self.grips.shape[1]
        own = [
            reduce(np.maximum, (most for flag, most in largest.items() if flag & needs))
            for needs in (CHOSEN_BY[name].needs for name in self.names)
        ]
        return np.column_stack([rows, BAND * np.column_stack([*own, *of_grips])])


def work(states: int, bricks: int) -> float:
    """Return the estimated work of states, without unit."""
    return float(states * (bricks + 20))  # 20: what every state costs, however small it is


def answer(engine: Engine, block: Block) -> Floats:
    """Return the responses of a block of states, SI units, and sizes of grip forces (S, R + r), N.

    Raises what the engine does.
    """
    (grips, want), robots = block.asked(), block.grips.shape[1]
    extremes = set(block.names) <= EXTREMES.keys() and not block.errors
    if isinstance(engine, ComplianceEngine) and extremes:
        with _one_thread():
            return block.rows(engine._extremes(block.bricks, grips, want, compiled=block.compiled))
    with _one_thread():  # as many threads everywhere: sums in other orders differ in the last bit
        fields = engine.solve(block.bricks, grips, want)
    forces = require_finite("grip force", lengths(fields.grip_force), block.bricks)[:, :robots]
    network, bricks = engine.network, block.bricks
    asked = [CHOSEN_BY[name] for name in block.names if name in CHOSEN_BY]
    values = {r.name: require_finite(r.name, r.of(network, fields), bricks) for r in asked}
    if TOLERANCE in block.names:
        with _one_thread():
            values[TOLERANCE] = misfits(engine, bricks, grips)
    if PROP_EXCESS in block.names:
        props = [network.scene.prop_of_number[number] for number in block.props]
        values[PROP_EXCESS] = _excess_of(props, fields.grip_force[:, robots:])
    rows = np.column_stack([*(values[name] for name in block.names), forces])
    return block.with_errors(rows, fields) if block.errors else rows


def packed(engine: Engine) -> bytes:
    """Pickle an engine's recipe, or itself if it has none; a `SceneError` if it cannot be."""
    recipe = recipe_of(engine)
    own = None if recipe is None else recipe.network
    known = own is engine.network or own == engine.network  # else it makes another engine
    try:
        return pickle.dumps(recipe if known else engine)
    except Exception as error:  # foreign code may raise any error
        raise SceneError(
            f"engine {type(engine).__name__}: it cannot be sent to other processes ({error}); take "
            "one of seqopt.make_engine, or let this process work alone"
        ) from error


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


class GripSets:
    """The responses of grip sets of one scene.

    ``engine``: what solves them; ``names``: responses of `seqopt.responses.quantities.CHOSEN_BY`
    that are wanted; ``resources``: who solves them; ``screen``: whether six digits are enough, to
    choose by. Responses of mechanisms are infinite.

    >>> import numpy as np
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> sets = GripSets(seqopt.make_engine("compliance", network), ["T_max"])
    >>> responses, forces = sets.answers(2, np.array([[0, 3], [2, 3]]))  # zero: no grip
    >>> responses.shape, forces.shape, sets.solved
    ((2, 1), (2, 2), 2)
    """

    def __init__(
        self,
        engine: Engine,
        names: Sequence[str],
        resources: Resources = HERE,
        *,
        screen: bool = False,
    ) -> None:
        self._engine, self._resources, self._screen = engine, resources, screen
        self.names, self._known, self._work = tuple(names), KnownRows(), 0.0
        scene = engine.network.scene
        nodes = np.array([node for brick in scene.placed for node in brick.nodes])
        kinds = [k * scene.grip_kinds.span for k in range(len(scene.grip_kinds.turns))]
        self._number = np.concatenate([[0], *(nodes + more for more in kinds)])

    def __repr__(self) -> str:
        return f"<GripSets of {self._engine}: {self.solved} solved>"

    @property
    def solved(self) -> int:
        """Number of distinct grip sets solved."""
        return self._known.count

    def solved_by(self, other: GripSets) -> int:
        """Return how many of these grip sets another one has solved too."""
        return self._known.shared(other._known)

    @property
    def nbytes(self) -> int:
        """Memory of the responses, bytes."""
        return self._known.nbytes

    def answers(self, bricks: int, held: Ints) -> tuple[Floats, Floats]:
        """Return responses (S, R), in the order of the names, and forces (S, r) of grips, SI units.

        ``held`` (S, r): nodes held, ascending in every row, as places in build order counted from
        1, those of grips of the second kind after all of the first, and so on; zero for a robot
        that holds none, whose force is zero. Infinite where something would be loose.
        """
        held = np.asarray(held)
        responses, forces = np.zeros((len(held), len(self.names))), np.zeros(held.shape)
        grips = (held > 0).sum(axis=1)
        for count in np.unique(grips).tolist():
            rows = np.flatnonzero(grips == count)
            found = self._found(bricks, self._number[held[rows, held.shape[1] - count :]])
            responses[rows] = found[:, : len(self.names)]
            forces[rows, held.shape[1] - count :] = found[:, len(self.names) :]
        return responses, forces

    def of_grips(self, bricks: int, grips: Ints) -> tuple[Floats, Floats]:
        """Return responses (S, R) and forces (S, r) of grips (S, r), by number, in any order."""
        order, forces = np.argsort(grips, axis=1), np.zeros(grips.shape)
        found = self._found(bricks, np.take_along_axis(grips, order, axis=1))
        np.put_along_axis(forces, order, found[:, len(self.names) :], axis=1)
        return found[:, : len(self.names)], forces

    def known(self, name: str, bricks: int, grips: Ints) -> Floats:
        """Return a response (S,) of grips (S, r), by number; NaN where none is known."""
        if name not in self.names:
            return np.full(len(grips), np.nan)
        order = np.argsort(self._number)
        held = np.sort(order[np.searchsorted(self._number, grips, sorter=order)], axis=1)
        codes, column = self._codes(self._number[held]), self.names.index(name)
        return self._known.known((bricks, grips.shape[1]), codes, column)

    def _found(self, bricks: int, every: Ints) -> Floats:
        """Return responses and forces (S, R + r) of grips (S, r); those not cached are solved."""

        def solve(new: Ints) -> Floats:
            sets = self._block(bricks, every[new])
            return solve_sets(self._engine, sets, self._resources)

        return self._known.of((bricks, every.shape[1]), self._codes(every), solve)

    def _codes(self, every: Ints) -> Ints:
        """Return a number (S,) for every grip set (S, r) of its own."""
        codes = np.zeros(len(every), dtype=np.int64)
        for column in every.T:
            codes = codes * (self._number.max() + 1) + column
        return codes

    def _block(self, bricks: int, grips: Ints) -> Block:
        props = self._engine.network.scene.prop_numbers(bricks, held=bool(grips.shape[1]))
        self._work += work(len(grips), bricks)
        return Block(bricks, grips, self.names, self._screen, props, self._work >= COMPILED)


def solve_sets(engine: Engine, sets: Block, resources: Resources = HERE) -> Floats:
    """Return responses and grip forces (S, R + r) of grip sets of one brick count, SI units.

    Infinite of mechanisms. Raises `SolverError`, `WorkerError`.
    """
    grips, load = sets.grips, work(len(sets.grips), sets.bricks)
    alone = resources.executor is None and resources.workers == 1
    alone |= load < SHARED and isinstance(engine, ComplianceEngine)  # others take far longer
    most = BLOCK if alone else min(BLOCK, max(64, len(grips) // 32))  # sets of a task
    parts = [replace(sets, grips=grips[at : at + most]) for at in range(0, len(grips), most)]
    own = HERE if alone or len(parts) < 2 else resources  # to share little does not pay
    progress = Progress("responses", load, resources.progress)

    def done(part: Block, found: tuple[Floats, int]) -> None:
        progress.add(work(len(part.grips), part.bricks))
        if pool is not None and isinstance(engine, NamedEngine):  # else it has counted itself
            engine.answered += len(part.grips)
            engine.corrected += found[1]

    rows = [np.zeros((0, sets.width))]
    with worker_pool(own.executor, own.workers) as pool:
        task = partial(_answer, engine if pool is None else packed(engine))
        with closing(map_ordered(task, parts, pool, done)) as answers:
            rows += [found for found, _ in answers]
    return np.concatenate(rows)


def _answer(engine: Engine | bytes, block: Block) -> tuple[Floats, int]:
    """Return what `answer` does, and how many sets the engine had to correct.

    Mechanisms are isolated by bisection: their rows are infinite.
    """
    engine, count = unpacked(engine), len(block.grips)
    before = getattr(engine, "corrected", 0)
    with suppress(MechanismError):
        return answer(engine, block), getattr(engine, "corrected", 0) - before
    if count == 1:
        return np.full((1, block.width), np.inf), 0
    halves = block.grips[: count // 2], block.grips[count // 2 :]
    parts = [_answer(engine, replace(block, grips=half)) for half in halves]
    return np.concatenate([rows for rows, _ in parts]), sum(corrected for _, corrected in parts)


class ScenarioSets:
    """Grip sets of one structure in several scenarios, solved in batches over all of them.

    ``engines``: one for every scenario. Nothing is solved together where engines are others than
    compliance, or processes share the work.
    """

    def __init__(self, engines: Sequence[Engine], resources: Resources = HERE) -> None:
        alone = resources.executor is None and resources.workers == 1
        own = [each for each in engines if type(each) is ComplianceEngine]
        self._stacked: Any = None
        if alone and len(own) == len(engines) > 1:
            self._stacked = _STACKED.StackedEngines(own)

    def solve(self, parts: Sequence[int], block: Block) -> dict[int, Floats]:
        """Return responses and forces (S, R + r) by scenario; nothing that is not solved together.

        ``parts``: numbers of scenarios.
        """
        stacked, (grips, want) = self._stacked, block.asked()
        able = stacked is not None and grips.size and EXTREMES.keys() >= {*block.names}
        if not able or not stacked.fits(block.bricks):
            return {}
        out = dict[int, Floats]()
        with suppress(MechanismError), _one_thread():  # which sets are loose is found one by one
            each = stacked.extremes(parts, block.bricks, grips, want)
            out |= {k: block.rows(found) for k, found in zip(parts, each, strict=True)}
        return out

    def fill(self, parts: Sequence[int], sets: Sequence[GripSets], bricks: int, held: Ints) -> None:
        """Solve places held (S, r) for the caches of several scenarios; ``sets``: of all."""
        if self._stacked is None or len(parts) < 2:
            return
        first, grips = sets[parts[0]], (held > 0).sum(axis=1)
        for count in np.unique(grips[grips > 0]).tolist():
            every = first._number[held[grips == count, held.shape[1] - count :]]
            codes = first._codes(every)
            _, new = np.unique(codes, return_index=True)
            new = new[np.isnan(first._known.known((bricks, count), codes[new]))]
            found = self.solve(parts, first._block(bricks, every[new]))
            for k, rows in found.items():
                sets[k]._known.of((bricks, count), codes[new], rows.__getitem__)


class Moved(NamedTuple):
    """The largest displacement of any node over the limit of the linear range, and its step."""

    share: float
    step: int


def most_moved(engine: Engine, steps: Sequence[Step], known: GripSets | None = None) -> Moved:
    """Return the largest displacement of any node in any step, in single precision.

    ``known``: grip sets of the engine, of which those that are solved are not solved again.
    """
    scene = engine.network.scene
    alike = defaultdict[tuple[int, int], dict[tuple[int, ...], int]](dict)
    far, found = linear_limit(scene), [Moved(0.0, 0)]
    for step in steps:
        if step.bricks:
            grips = scene.grip_numbers(step.grips, step.bricks)
            alike[step.bricks, len(grips)].setdefault(grips, step.number)
    for (bricks, count), numbers in alike.items():
        sets = np.array([*numbers], dtype=np.int64).reshape(len(numbers), count)
        shift = np.full(len(sets), np.nan) if known is None else known.known("D_max", bricks, sets)
        new = np.isnan(shift)
        shift[new] = solve_sets(engine, Block(bricks, sets[new], ("D_max",)))[:, 0]
        at = int(shift.argmax())
        found.append(Moved(float(shift[at]) / far, [*numbers.values()][at]))
    return max(found, key=lambda moved: moved.share)


def _near(values: Floats, bound: Floats | float) -> Bools:
    """Return which values agree with a bound (NaN for none) to within single precision."""
    finite = np.where(np.isfinite(values), values, np.nan)
    return np.asarray(np.abs(finite - bound) <= BAND * np.abs(bound))
