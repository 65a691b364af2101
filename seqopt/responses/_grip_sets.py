"""Responses of grip sets, computed on demand and cached.

For searches that need few of many sets: the sets of a request are solved in batches, each once.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, KnownRows
from seqopt.engines.interface import Engine, linear_limit
from seqopt.errors import MechanismError
from seqopt.responses._blocks import BLOCK, COMPILED, Answers, Block, answer, packed, unpacked, work
from seqopt.responses.resources import HERE, Resources
from seqopt.sequence.steps import Step
from seqopt.work._workers import hire, map_ordered
from seqopt.work.progress import Progress


class GripSets:
    """The responses of grip sets of one scene.

    ``engine``: what solves them; ``names``: responses of `seqopt.responses.quantities.CHOSEN_BY`
    that are wanted; ``resources``: who solves them; ``screen``: whether six digits are enough, to
    choose by; ``loose``: whether responses of mechanisms are infinite instead of raising a
    `MechanismError`; ``work``: that is known to come, as `seqopt.responses._blocks.work` has it.

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
        loose: bool = True,
        work: float = 0.0,
    ) -> None:
        self._engine, self._resources, self._screen = engine, resources, screen
        self.names, self._known, self._work, self._loose = tuple(names), KnownRows(), work, loose
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

    @property
    def nbytes(self) -> int:
        """Memory of the responses, bytes."""
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
            found = self._found(bricks, self._number[held[rows, held.shape[1] - count :]])
            responses[rows] = found[:, : len(self.names)]
            forces[rows, held.shape[1] - count :] = found[:, len(self.names) :]
        return responses, forces

    def of_grips(self, bricks: int, grips: Ints) -> tuple[Floats, Floats]:
        """Return responses (S, R) and forces (S, r) of grips, by number, in any order.

        ``grips`` (S, r): as `seqopt.Scene.grip_numbers` has them.
        """
        order, forces = np.argsort(grips, axis=1), np.zeros(grips.shape)
        found = self._found(bricks, np.take_along_axis(grips, order, axis=1))
        np.put_along_axis(forces, order, found[:, len(self.names) :], axis=1)
        return found[:, : len(self.names)], forces

    def _found(self, bricks: int, every: Ints) -> Floats:
        """Return responses and forces (S, R + r) of grips (S, r); those not cached are solved."""

        def solve(new: Ints) -> Floats:
            grips = every[new]
            props = self._engine.network.scene.prop_numbers(bricks, held=bool(every.shape[1]))
            self._work += work(len(grips), bricks)
            compiled = self._work >= COMPILED
            sets = Block(bricks, grips, self.names, self._screen, props, compiled)
            return solve_sets(self._engine, sets, self._resources, loose=self._loose)

        codes = np.zeros(len(every), dtype=np.int64)  # a number for every set of its own
        for column in every.T:
            codes = codes * (self._number.max() + 1) + column
        return self._known.of((bricks, every.shape[1]), codes, solve)


def solve_sets(
    engine: Engine, sets: Block, resources: Resources = HERE, *, loose: bool = True
) -> Floats:
    """Return responses and grip forces of grip sets; infinite for mechanisms.

    ``sets``: of one brick count; ``resources``: workers; ``loose``: as of `GripSets`. Result (S, R
    + r): SI units. Raises `SolverError`, `WorkerError`.
    """
    grips, alone = sets.grips, resources.executor is None and resources.workers == 1
    most = BLOCK if alone else min(BLOCK, max(64, len(grips) // 32))  # sets of a task
    parts = [replace(sets, grips=grips[at : at + most]) for at in range(0, len(grips), most)]
    own = resources if len(parts) > 1 else HERE  # to share one part does not pay
    progress = Progress("responses", sets.work, own.progress)

    def done(part: Block, _: Answers) -> None:
        progress.add(part.work)

    rows = [np.zeros((0, len(sets.names) + grips.shape[1]))]
    with hire(own.executor, own.workers) as crew:
        task = partial(_answer, engine if crew is None else packed(engine), loose=loose)
        with closing(map_ordered(task, parts, crew, done)) as answers:
            for found in answers:
                columns = [found.values[name] for name in sets.names]
                rows.append(np.column_stack([*columns, found.forces]))
    return np.concatenate(rows)


def _answer(engine: Engine | bytes, block: Block, *, loose: bool) -> Answers:
    """Return answers; ``loose``: infinite for mechanisms, which are isolated by bisection."""
    engine, count = unpacked(engine), len(block.grips)
    try:
        return answer(engine, block)
    except MechanismError:
        if not loose:
            raise
    if count == 1:
        infinite = dict.fromkeys(block.names, np.full(1, np.inf))
        return Answers(infinite, np.full(block.grips.shape, np.inf))
    halves = block.grips[: count // 2], block.grips[count // 2 :]
    parts = [_answer(engine, replace(block, grips=half), loose=True) for half in halves]
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in block.names}
    return Answers(values, np.concatenate([part.forces for part in parts]))


class Moved(NamedTuple):
    """The largest displacement of any node over the limit of the linear range, and its step."""

    share: float
    step: int


def most_moved(engine: Engine, steps: Sequence[Step]) -> Moved:
    """Return the largest displacement of any node in any step, in single precision."""
    scene = engine.network.scene
    alike = defaultdict[tuple[int, int], dict[tuple[int, ...], int]](dict)
    far = linear_limit(scene)
    found = [Moved(0.0, 0)]
    for step in steps:
        if step.bricks:
            grips = scene.grip_numbers(step.grips, step.bricks)
            alike[step.bricks, len(grips)].setdefault(grips, step.number)
    for (bricks, count), numbers in alike.items():
        sets = np.array([*numbers], dtype=np.int64).reshape(len(numbers), count)
        shift = solve_sets(engine, Block(bricks, sets, ("D_max",)))[:, 0]
        at = int(shift.argmax())
        found.append(Moved(float(shift[at]) / far, [*numbers.values()][at]))
    return max(found, key=lambda moved: moved.share)


BAND = 1e-5  # share of a value within which six digits do not decide


def _near(values: Floats, bound: Floats | float) -> Bools:
    """Return which values agree with a bound (NaN for none) to within single precision."""
    finite = np.where(np.isfinite(values), values, np.nan)
    return np.asarray(np.abs(finite - bound) <= BAND * np.abs(bound))
