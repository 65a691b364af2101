"""Verdicts of the steps of a whole build, where one proof is sought for many of them.

Forces that hold a structure by the grips that steps have in common prove all of these steps, and a
motion in which it falls although all of them together hold it proves that all fall. So such a
structure is proven before one of the steps is. It may be of no use; it is never a verdict.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from enum import Enum
from functools import partial
from itertools import accumulate, groupby, islice
from operator import attrgetter

from seqopt.contact._partial_assemblies import PartialAssemblies
from seqopt.contact.mortar import Mortar
from seqopt.network.network import Network
from seqopt.sequence.steps import Grips, Step
from seqopt.stability._step_verdicts import parts_sent
from seqopt.stability._verdict_chain import VerdictChain, Way
from seqopt.stability.assessment import Verdict, _verdict_of, bonded
from seqopt.stability.limit_analysis import compile_equilibrium
from seqopt.work._workers import Crew, map_ordered

_DEAR = 50  # bricks from which on a proof takes much longer than trying others
_TOGETHER = 1500  # bricks in all steps that are sought for beside each other, where it is not dear
_SPAN = 8  # brick counts whose grips hold a structure that is to fall all the same
_MOST = 16  # brick counts for which nothing is sought at most after it was of no use
_PORTIONS = 6  # of the steps with one mortar: what is found for one does not prove the next one
_EARLIER = (Way.EARLIER_FORCES, Way.EARLIER_MOTION)


class _Sought(Enum):
    """What may prove many steps."""

    FORCES = "forces"
    MOTION = "motion"


class _Patience:
    """How many brick counts are left out after a try was of no use: twice as many each time."""

    def __init__(self) -> None:
        self._rest = self._next = 0

    def ready(self) -> bool:
        """Return whether it is time for another try; if not, it is nearer now."""
        self._rest = max(self._rest - 1, -1)
        return self._rest < 0

    def learn(self, *, useful: bool) -> None:
        """Take note of how a try has ended."""
        self._next = 0 if useful else min(max(2 * self._next, 1), _MOST)
        self._rest = self._next


def quick_verdicts(
    built: Network | PartialAssemblies, steps: Sequence[Step], mortar: Mortar
) -> Iterator[Verdict]:
    """Yield the verdict of every step as soon as it is found; best by ascending brick counts."""
    most = max((step.bricks for step in steps), default=1) or 1
    parts = PartialAssemblies(built, most) if isinstance(built, Network) else built
    prove = VerdictChain(parts, lambda each: bonded(each, mortar), compile_equilibrium, near=True)
    for dear, same in groupby(steps, lambda step: step.bricks > _DEAR):
        if dear:
            yield from _each_dear(prove, [*same], parts.network)
        else:
            yield from _each_small(prove, [*same])


def _each_small(prove: VerdictChain, steps: Sequence[Step]) -> Iterator[Verdict]:
    """Yield verdicts; cases that earlier proofs leave open are solved as one batch."""

    def seek(number: int) -> None:
        near = [*islice(steps, number, number + _TOGETHER)]
        total = accumulate(step.bricks for step in near)
        few = [step for step, bricks in zip(near, total, strict=True) if bricks <= _TOGETHER]
        prove.search([*dict.fromkeys((step.bricks, step.grips) for step in few if step.bricks)])

    for number, step in enumerate(steps):
        if not step.bricks:
            yield Verdict.STANDS
        else:
            yield _verdict_of(prove(step.bricks, step.grips, partial(seek, number))[1])


def _each_dear(prove: VerdictChain, steps: Sequence[Step], network: Network) -> Iterator[Verdict]:
    """Yield verdicts, where what may prove many is sought before what proves one."""
    groups = [(bricks, [*each]) for bricks, each in groupby(steps, attrgetter("bricks"))]
    patience, sought = {each: _Patience() for each in _Sought}, _Sought.FORCES
    for i, (bricks, group) in enumerate(groups):
        near = [step for _, each in groups[i : i + _SPAN] for step in each]
        left = {each for each in _Sought if patience[each].ready()}
        for step in group:
            trial = _held(network, group if sought is _Sought.FORCES else near, bricks, sought)
            tried: list[object] = []
            before = partial(_try, prove, bricks, trial, tried)
            _, proven, way = prove(bricks, step.grips, before if sought in left else None)
            if tried:
                patience[sought].learn(useful=way in _EARLIER)
                left.discard(sought)
            if way not in _EARLIER:
                sought = _Sought.MOTION if proven.bound > 0 else _Sought.FORCES
            yield _verdict_of(proven)


_Portion = tuple[Sequence[Step], Mortar]


def shared_verdicts(
    parts: PartialAssemblies, steps: Sequence[Step], mortar: Mortar, crew: Crew
) -> Iterator[Verdict]:
    """Yield the same as `quick_verdicts`, by workers; portions end between brick counts."""
    portions, part = list[_Portion](), list[Step]()
    for _, same in groupby(steps, attrgetter("bricks")):
        part += same
        if len(part) * _PORTIONS >= len(steps):
            portions.append((part, mortar))
            part = []
    portions += [(part, mortar)] if part else []
    for found in map_ordered(partial(_sent, pickle.dumps(parts)), portions, crew):
        yield from found


def _sent(parts: bytes, portion: _Portion) -> tuple[Verdict, ...]:
    return tuple(quick_verdicts(parts_sent(parts), *portion))


def _try(prove: VerdictChain, bricks: int, grips: Grips, tried: list[object]) -> None:
    tried.append(prove(bricks, grips)[2])


def _held(network: Network, steps: Sequence[Step], bricks: int, sought: _Sought) -> Grips:
    """Return the grips that all steps have, or all that some have at bricks that stand."""
    if sought is _Sought.FORCES:
        every = zip(*(step.grips for step in steps), strict=True)
        return tuple(held[0] if len({*held}) == 1 else None for held in every)
    stands = {node for brick in network.scene.placed[:bricks] for node in brick.nodes}
    held = {node for step in steps for node in step.grips if node in stands}
    return (*(None for _ in network.scene.robots), *sorted(held))
