"""Blocks of states, and their responses: the unit of computing and of messages.

A state is a brick count and the nodes held. The size of blocks depends on the schedule alone, so
that responses are bitwise equal in any process.

Other processes receive the scene, and build the engine themselves.
"""

from __future__ import annotations

import math
import pickle
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import reduce
from itertools import groupby
from operator import or_
from typing import TypeAlias

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.engines.interface import Engine, Want
from seqopt.engines.registry import Recipe, recipe_of
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MemoryShortError, SceneError
from seqopt.responses._tolerance import allowed_by, is_tolerance, misfits
from seqopt.responses.quantities import (
    CHOSEN_BY,
    EXTREMES,
    PROP_EXCESS,
    _excess_of,
    lengths,
    require_finite,
    robot_response,
)
from seqopt.scene._armed import go_together
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.work._threads import one_thread
from seqopt.work._workers import free_memory

_Tally = tuple[tuple[str, int], ...]


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
    """The responses of a block.

    ``values`` (S,): the requested responses, SI units; ``forces`` (S, r): sizes of the forces of
    the grips, N; ``tally`` (str, int): what the engine counted meanwhile, if it counts:
    `seqopt.engines.registry.AutoEngine`.
    """

    values: Mapping[str, Floats]
    forces: Floats
    tally: _Tally = ()


def join_answers(parts: Sequence[Answers]) -> Answers:
    """Concatenate the answers to blocks, at least one."""
    values = {name: np.concatenate([a.values[name] for a in parts]) for name in parts[0].values}
    tally = sum((Counter(dict(part.tally)) for part in parts), Counter[str]())
    return Answers(values, np.concatenate([part.forces for part in parts]), tuple(tally.items()))


def answer(engine: Engine, block: Block) -> Answers:
    """Return the responses of a block of states. Raises what the engine does."""
    asked = [CHOSEN_BY[name] for name in block.names if name in CHOSEN_BY]
    want = reduce(or_, (r.needs for r in asked), Want.SCREEN if block.screen else Want(0))
    before = Counter(tally_of(engine))
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
    for name in filter(is_tolerance, block.names):
        with one_thread():
            values[name] = misfits(engine, bricks, grips, allowed_by(name))
    if PROP_EXCESS in block.names:
        props = [network.scene.prop_of_number[number] for number in block.props]
        values[PROP_EXCESS] = _excess_of(props, fields.grip_force[:, robots:])
    return Answers(values, forces, tuple((Counter(tally_of(engine)) - before).items()))


def tally_of(engine: Engine) -> dict[str, int]:
    """Return the counts of an engine, to update in place; an empty mapping if it has none."""
    found = getattr(engine, "tally", None)
    return found if isinstance(found, dict) else {}


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


class _Made(threading.local):
    """The engines of the last two runs of each thread of a worker.

    Executors of users have no storage for workers' data between tasks; without this cache each
    task would build its engine again.
    """

    def __init__(self) -> None:
        self.engines: dict[bytes, Engine] = {}


_OF_THREAD = _Made()


def unpacked(engine: Engine | bytes) -> Engine:
    """Return an engine unchanged, or the one of a `packed` form, built once for a thread."""
    if not isinstance(engine, bytes):
        return engine
    made = _OF_THREAD.engines
    if engine not in made:
        found: Recipe | Engine = pickle.loads(engine)  # our own, of `packed`
        made[engine] = found.make() if isinstance(found, Recipe) else found
        if len(made) > 2:
            del made[next(iter(made))]
    return made[engine]


BLOCK = 2048  # grip sets whose fields are held at once: few enough to stay in the cache


@dataclass(frozen=True, eq=False, repr=False)
class StepChoices(FrozenValue):
    """One open step of a schedule, and the responses of every choice.

    Attributes
    ----------
    step : OpenStep
        Which step of the schedule it is.
    moves : tuple of int
        Index of every open move: one, or two neighboring ones.
    responses : mapping of str to (C,) or (C, D) float
        Over the candidates of the moves; SI units, sizes without sign; NaN where two robots would
        hold one node, all NaN for a robot that does not grip.
    """

    step: OpenStep
    moves: tuple[int, ...]
    responses: Mapping[str, Floats]


Wanted: TypeAlias = Callable[[int], Set[str]]
"""Returns the names of the responses that a move needs, given the bricks placed when it is made."""


@dataclass(frozen=True, eq=False, repr=False)
class Batch(FrozenValue):
    """Open steps of equal numbers of bricks and grips."""

    schedule: Schedule
    steps: tuple[OpenStep, ...]
    names: tuple[frozenset[str], ...]  # responses that each step needs
    rows: Ints  # (P, r); grips, for all possible choices of one step after the other
    possible: tuple[Bools, ...]  # (C,); which choices of each step are possible: no node held twice
    states: Ints  # (S, r); the different grip sets in them, numbers ascending
    state: Ints  # (P,); which of these each choice leads to

    def blocks(self, *, compiled: bool = False) -> list[Block]:
        """Return the states in blocks, one at least. ``compiled``: as of `Block`."""
        asked = sorted(frozenset().union(*self.names))
        known = (*CHOSEN_BY, PROP_EXCESS)
        names = tuple(name for name in asked if name in known or is_tolerance(name))
        bricks = self.steps[0].bricks
        props = self.schedule.scene.prop_numbers(bricks, held=True)
        starts = range(0, max(len(self.states), 1), BLOCK)
        parts = (self.states[start : start + BLOCK].copy() for start in starts)
        return [Block(bricks, part, names, props=props, compiled=compiled) for part in parts]

    def choices(self, answers: Sequence[Answers]) -> list[StepChoices]:
        """Return the responses of every step's choices. ``answers``: to the blocks."""
        whole = join_answers(answers)
        values, forces = whole.values, whole.forces
        ends = np.cumsum([ok.sum() for ok in self.possible])
        out = []
        for step, mine, ok, end in zip(self.steps, self.names, self.possible, ends, strict=True):
            part = slice(end - ok.sum(), end)
            index = self.state[part]
            by_robot = np.argsort(np.argsort(self.rows[part], axis=1), axis=1)
            found = {name: answer[index] for name, answer in values.items() if name in mine}
            held = np.take_along_axis(forces[index], by_robot, axis=1)
            scene, moves = self.schedule.scene, self.schedule.moves
            robots = [robot_response(scene.robots[i].name) for i in _robots_holding(step)]
            found |= {name: held[:, i] for i, name in enumerate(robots)}
            found["F_move"] = found[robot_response(moves[step.moves[-1]].robot)]
            found["F_largest"] = held.max(axis=1)
            shaped = {}
            for name in sorted(mine):  # NaN for what is impossible and for a robot that holds none
                spread = np.full(ok.shape, np.nan)
                if name in found:
                    spread[ok] = found[name]
                shaped[name] = spread.reshape(_shape(self.schedule, step))
            out.append(StepChoices(step, step.moves, shaped))
        return out


def steps_of_batches(schedule: Schedule) -> list[list[list[OpenStep]]]:
    """Return the open steps by brick count and, within it, by how many grips, ascending."""

    def key(step: OpenStep) -> tuple[int, int, int]:
        return step.bricks, len(_robots_holding(step)), step.number

    steps = sorted((step for step in schedule.steps if step.moves), key=key)
    return [
        [[*same] for _, same in groupby(level, key=lambda step: key(step)[:2])]
        for _, level in groupby(steps, key=lambda step: step.bricks)
    ]


def _shape(schedule: Schedule, step: OpenStep) -> tuple[int, ...]:
    """Return the number of candidates of each open move of a step."""
    return tuple(len(schedule.moves[m].candidates) for m in step.moves)


def choices_of(schedule: Schedule, step: OpenStep) -> int:
    """Return the number of choices of a step, including infeasible ones."""
    return math.prod(_shape(schedule, step))


def batch_of(schedule: Schedule, steps: Sequence[OpenStep], wanted: Wanted) -> Batch:
    """Group open steps of equal numbers of bricks and grips, with their distinct states."""
    names = tuple(frozenset(wanted(schedule.moves[step.moves[-1]].bricks)) for step in steps)
    choices = [combinations(schedule, step) for step in steps]
    possible = tuple(
        no_node_twice(rows) & for_arms(schedule.scene, step, rows)
        for step, rows in zip(steps, choices, strict=True)
    )
    parts = zip(steps, choices, possible, strict=True)
    rows = np.concatenate([_grip_rows(schedule, step, nodes[ok]) for step, nodes, ok in parts])
    states, state = distinct(np.sort(rows, axis=1))
    return Batch(schedule, tuple(steps), names, rows, possible, states, state)


def for_arms(scene: Scene, step: OpenStep, rows: Ints) -> Bools:
    """Return which choices (P,) of a step are feasible for arms.

    ``rows`` (P, r): nodes held, by the robots that hold any, in their order.
    """
    if not scene.has_arms:
        return np.ones(len(rows), dtype=bool)
    nodes = scene.placed_nodes
    order = np.argsort(nodes)
    held = np.zeros((len(rows), len(scene.robots)), dtype=np.int64)
    robots = [robot for robot, grip in enumerate(step.grips) if grip is not None]
    held[:, robots] = 1 + order[np.searchsorted(nodes, rows, sorter=order)]
    return go_together(scene, step.bricks, held)


def distinct(rows: Ints) -> tuple[Ints, Ints]:
    """Return the distinct rows (S, r), ascending, and the index (P,) of each row among them."""
    found, which = np.unique(rows, axis=0, return_inverse=True)
    return found, which.ravel()  # NumPy 2.0 has it as a column


def _robots_holding(step: OpenStep) -> list[int]:
    """Return the indices of the scene's robots that grip in a step."""
    return [i for i, grip in enumerate(step.grips) if grip is not None]


def combinations(schedule: Schedule, step: OpenStep) -> Ints:
    """Return the nodes held for all combinations of the open moves of a step (choices, grips)."""
    candidates = [np.array(schedule.moves[m].candidates, dtype=np.int64) for m in step.moves]
    grid = dict(zip(step.moves, np.meshgrid(*candidates, indexing="ij"), strict=True))
    columns = [
        grid[grip.move] if isinstance(grip, OpenGrip) else np.full(_shape(schedule, step), grip)
        for grip in step.grips
        if grip is not None
    ]
    return np.stack([column.ravel() for column in columns], axis=1).astype(np.int64)


def _grip_rows(schedule: Schedule, step: OpenStep, nodes: Ints) -> Ints:
    """Return the numbers of grips on nodes (P, r) that the robots of a step hold."""
    return schedule.scene.grip_kinds.numbers(nodes, _robots_holding(step))


def no_node_twice(rows: Ints) -> Bools:
    """Return which rows name no node twice. ``rows`` (P, r). Result (P,)."""
    return np.asarray((np.diff(np.sort(rows, axis=1), axis=1) > 0).all(axis=1))


_NUMBER = 8  # bytes
_BESIDE = 6  # numbers per choice beside its responses: nodes, order, costs
_COSTS = 4  # numbers per choice where costs alone are kept: as found, posed, handed over, solved
_AT_ONCE = 24  # numbers per choice of the brick count that is being evaluated
_SHARE = 0.8  # of the free memory that responses and costs may take


def _bytes_of_choices(schedule: Schedule, wanted: Wanted) -> int:
    """Estimate the memory of the responses of all choices of a schedule, bytes."""
    return sum(
        _NUMBER
        * (len(wanted(schedule.moves[step.moves[-1]].bricks)) + _BESIDE)
        * choices_of(schedule, step)
        for step in schedule.steps
        if step.moves
    )


def _bytes_of_costs(schedule: Schedule) -> int:
    """Estimate the memory of all costs if responses are computed step by step, bytes."""
    of_moves: dict[tuple[int, ...], int] = {}
    of_bricks = Counter[int]()
    for step in (step for step in schedule.steps if step.moves):
        of_moves[step.moves] = choices_of(schedule, step)
        of_bricks[step.bricks] += of_moves[step.moves]
    at_once = _AT_ONCE * max(of_bricks.values(), default=0)
    return _NUMBER * (_COSTS * sum(of_moves.values()) + at_once)


def require_memory(schedule: Schedule, wanted: Wanted, most: float | None = None) -> bool:
    """Return whether memory suffices for the responses of all choices, not only for costs.

    ``most``: bytes that may be used; by default `_SHARE` of the free memory. Raises
    `MemoryShortError` if it does not suffice for the costs.
    """
    most = _SHARE * free_memory() if most is None else most
    if _bytes_of_choices(schedule, wanted) <= most:
        return True
    needed = _bytes_of_costs(schedule)
    if needed <= most:
        return False
    largest = max(len(move.candidates) for move in schedule.moves)
    raise MemoryShortError(
        f"the costs of all choices take about {needed / 1e9:.3g} GB, and {most / 1e9:.3g} GB may "
        f"be used; let robots reach less (a move has up to {largest} candidates), block nodes, "
        "take near candidates only, or search without proof"
    )
