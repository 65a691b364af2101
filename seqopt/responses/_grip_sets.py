"""Responses of grip sets, computed when they are first needed, and kept.

For searches among more sets than need to be solved: all sets that are asked for at once are
solved in batches, each of them once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.engines.interface import Engine
from seqopt.errors import MechanismError
from seqopt.responses._blocks import (
    BLOCK,
    COMPILED,
    Answers,
    Block,
    Store,
    answer,
    open_store,
    packed,
    unpacked,
    work,
)
from seqopt.responses.resources import HERE, Resources
from seqopt.work._workers import hire, map_ordered


class KnownRows:
    """Rows of values by a key and a code, each computed once; ``count``: how many were.

    >>> rows = KnownRows()
    >>> codes = np.array([3, 1, 3])
    >>> rows.of("squares", codes, lambda places: codes[places, None] ** 2.0).ravel()
    array([9., 1., 9.])
    >>> rows.count
    2
    """

    def __init__(self) -> None:
        self._known: dict[object, tuple[Ints, Floats]] = {}
        self.count = 0

    @property
    def nbytes(self) -> int:
        """How much memory the rows take."""
        return sum(codes.nbytes + values.nbytes for codes, values in self._known.values())

    def known(self, key: object, codes: Ints) -> Floats:
        """Return the first values (n,) of rows that are known already; NaN of others."""
        known, values = self._known.get(key, (codes[:0], None))
        if values is None or not len(known):
            return np.full(len(codes), np.nan)
        at = np.searchsorted(known, codes).clip(max=len(known) - 1)
        return np.where(known[at] == codes, values[at, 0], np.nan)

    def of(self, key: object, codes: Ints, compute: Callable[[Ints], Floats]) -> Floats:
        """Return the rows of codes, those that are new computed now, all together.

        ``key``: codes of other keys are others; ``codes`` (n,); ``compute``: returns the rows (m,
        k) of distinct codes, given the places (m,) where they first stand among those asked for.
        Result (n, k).
        """
        distinct, first = np.unique(codes, return_index=True)
        known, values = self._known.get(key, (distinct[:0], None))
        fresh = first[~np.isin(distinct, known, assume_unique=True)]
        if values is None or len(fresh):
            computed = compute(fresh)
            known = np.concatenate([known, codes[fresh]])
            values = computed if values is None else np.concatenate([values, computed])
            order = np.argsort(known, kind="stable")
            known, values = known[order], values[order]
            self._known[key] = known, values
            self.count += len(fresh)
        return np.asarray(values[np.searchsorted(known, codes)])


class GripSets:
    """The responses of grip sets of one scene.

    ``engine``: what solves them; ``names``: responses of `seqopt.responses.quantities.CHOSEN_BY`
    that are wanted; ``resources``: who solves them, and where answers are kept; ``screen``: whether
    six digits are enough, to choose by.

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

    @cached_property
    def _store(self) -> Store | None:
        return open_store(self._resources.cache, self._engine)

    @property
    def solved(self) -> int:
        """How many different grip sets were solved."""
        return self._known.count

    @property
    def nbytes(self) -> int:
        """How much memory their responses take."""
        return self._known.nbytes

    def answers(self, bricks: int, held: Ints) -> tuple[Floats, Floats]:
        """Return the responses of grip sets and the forces of their grips.

        ``held`` (S, r): nodes held, ascending in every row, as places in build order counted from
        1, those of grips of the second kind after all of the first, and so on; zeros for robots
        that hold none. Results: ``responses`` (S, R): in the order of the
        names, SI units; infinite where something would be loose. ``forces`` (S, r): N; zero for a
        robot that holds none.
        """
        held = np.asarray(held)
        responses, forces = np.zeros((len(held), len(self.names))), np.zeros(held.shape)
        grips = (held > 0).sum(axis=1)
        for count in np.unique(grips).tolist():
            rows = np.flatnonzero(grips == count)
            found = self._found(bricks, held[rows, held.shape[1] - count :])
            responses[rows] = found[:, : len(self.names)]
            forces[rows, held.shape[1] - count :] = found[:, len(self.names) :]
        return responses, forces

    def _found(self, bricks: int, nodes: Ints) -> Floats:
        """Return responses and forces of sets (S, r), those that are new solved now: (S, R + r)."""

        def solve(new: Ints) -> Floats:
            grips = self._number[nodes[new]]
            props = self._engine.network.scene.prop_numbers(bricks, held=bool(nodes.shape[1]))
            self._work += work(len(grips), bricks)
            compiled = self._work >= COMPILED
            sets = Block(bricks, grips, self.names, self._screen, props, compiled)
            return solve_sets(self._engine, sets, self._resources, self._store)

        codes = np.zeros(len(nodes), dtype=np.int64)  # a number for every set of its own
        for column in nodes.T:
            codes = codes * len(self._number) + column
        return self._known.of((bricks, nodes.shape[1]), codes, solve)


def solve_sets(
    engine: Engine, sets: Block, resources: Resources = HERE, store: Store | None = None
) -> Floats:
    """Return the responses of grip sets, then the forces of grips; infinite where a part is loose.

    ``sets``: with one brick count; ``resources``: who solves them; ``store``: what is known. Result
    (S, R + r): SI units. Raises `SolverError`, `WorkerError`.
    """
    grips, alone = sets.grips, resources.executor is None and resources.workers == 1
    shared = max(64, len(grips) // 32)  # sets of a task
    most = BLOCK if alone and store is None else min(BLOCK, shared)
    parts = [replace(sets, grips=grips[at : at + most]) for at in range(0, len(grips), most)]
    workers = (resources.executor, resources.workers) if len(parts) > 1 else (None, 1)

    def known(part: Block) -> Floats | None:
        found = None if store is None else store.find(part)
        return None if found is None else _columns(part, found)

    def done(part: Block, rows: Floats) -> None:
        if store is not None and np.isfinite(rows).all():
            values = dict(zip(part.names, rows.T, strict=False))
            store.keep(part, Answers(values, rows[:, len(values) :]))

    with hire(*workers) as crew:
        solved = partial(_solved, engine if crew is None else packed(engine))
        rows = [*map_ordered(solved, parts, crew, known, done)]
    return np.concatenate([np.zeros((0, len(sets.names) + grips.shape[1])), *rows])


def _solved(engine: Engine | bytes, part: Block) -> Floats:
    """Return what is known of a few sets; those that leave something loose are found by halving."""
    try:
        return _columns(part, answer(unpacked(engine), part))
    except MechanismError:
        count = len(part.grips)
        if count == 1:
            return np.full((1, len(part.names) + part.grips.shape[1]), np.inf)
        halves = part.grips[: count // 2], part.grips[count // 2 :]
        return np.concatenate([_solved(engine, replace(part, grips=half)) for half in halves])


def _columns(part: Block, found: Answers) -> Floats:
    return np.column_stack([*(found.values[name] for name in part.names), found.forces])


BAND = 1e-5  # share of a value within which six digits do not decide


def _near(values: Floats, bound: Floats | float) -> Bools:
    """Return which values are so close to a bound, NaN if there is none, that digits decide."""
    finite = np.where(np.isfinite(values), values, np.nan)
    return np.asarray(np.abs(finite - bound) <= BAND * np.abs(bound))
