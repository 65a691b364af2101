"""How far steps change the shape of a structure, over what a linear model bears."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from seqopt.engines.interface import Engine, linear_limit
from seqopt.responses._blocks import Block
from seqopt.responses._grip_sets import solve_sets
from seqopt.sequence.steps import Step


class Moved(NamedTuple):
    """The largest displacement of any node over the limit of the linear range, and its step."""

    share: float
    step: int


def most_moved(engines: Iterable[Engine], steps: Sequence[Step]) -> Moved:
    """Return how far any node moves in any step, in the worst of some engines of alike scenes.

    Displacements alone are computed, to six digits: all states with as many bricks and grips at
    once.
    """
    return max((_most_moved(engine, steps) for engine in engines), key=lambda moved: moved.share)


def _most_moved(engine: Engine, steps: Sequence[Step]) -> Moved:
    scene, found = engine.network.scene, [Moved(0.0, 0)]
    alike = defaultdict[tuple[int, int], dict[tuple[int, ...], int]](dict)
    for step in steps:
        grips = scene.grip_numbers(step.grips, step.bricks)
        if step.bricks:
            alike[step.bricks, len(grips)].setdefault(grips, step.number)
    far = linear_limit(scene)
    for (bricks, count), numbers in alike.items():
        sets = np.array([*numbers], dtype=np.int64).reshape(len(numbers), count)
        shift = solve_sets(engine, Block(bricks, sets, ("D_max",)))[:, 0]
        at = int(shift.argmax())
        found.append(Moved(float(shift[at]) / far, [*numbers.values()][at]))
    return max(found, key=lambda moved: moved.share)
