"""Blocks of states, and what an engine answers for one: the unit that is computed, sent, stored.

A state is a brick count and the nodes held. How many states make a block depends on nothing but
the schedule, so that answers are the same to the last bit wherever and by whomever a block is
answered.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import or_

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.interface import Engine, Want
from seqopt.engines.threads import one_thread
from seqopt.responses.quantities import CHOSEN_BY, lengths, require_finite

Tally = tuple[tuple[object, int], ...]


@dataclass(frozen=True, eq=False, repr=False)
class Block(FrozenValue):
    """States with one brick count, and what is to be known of them.

    Attributes
    ----------
    bricks : int
        How many bricks stand.
    grips : (S, r) int
        Nodes held.
    names : tuple of str
        Responses of `seqopt.responses.quantities.CHOSEN_BY`.
    """

    bricks: int
    grips: Ints
    names: tuple[str, ...]

    @cached_property
    def key(self) -> str:
        """Its content, condensed."""
        mark = hashlib.sha256(repr((self.bricks, self.names, self.grips.shape)).encode())
        mark.update(self.grips.astype("<i8").tobytes())
        return mark.hexdigest()

    @property
    def work(self) -> float:
        """About how long it takes, in no unit: what an engine does grows with the bricks."""
        return work(len(self.grips), self.bricks)


def work(states: int, bricks: int) -> float:
    """Return about how long states take, in no unit.

    Parameters
    ----------
    states : int
    bricks : int
        Of each.
    """
    return float(states * (bricks + APART))


APART = 20  # bricks whose share of the work is what every state costs, however small it is


@dataclass(frozen=True, eq=False, repr=False)
class Answers(FrozenValue):
    """What an engine answers for a block.

    Attributes
    ----------
    values : mapping of str to (S,) float
        The responses asked for, SI units.
    forces : (S, r) float
        Sizes of the forces of the grips, N.
    tally : tuple of (object, int)
        What the engine counted meanwhile, if it counts: `seqopt.engines.auto.AutoEngine`.
    """

    values: Mapping[str, Floats]
    forces: Floats
    tally: Tally = ()


def answer(engine: Engine, block: Block) -> Answers:
    """Return the responses of a block of states.

    Raises
    ------
    MechanismError, SolverError
        As the engine does.
    """
    asked = [CHOSEN_BY[name] for name in block.names]
    want = reduce(or_, (response.needs for response in asked), Want.SCREEN)
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
    """Return what an engine counts, empty if it does not.

    Returns
    -------
    dict of object to int
        Its own: adding to it counts.
    """
    found = getattr(engine, "tally", None)
    return found if isinstance(found, dict) else {}
