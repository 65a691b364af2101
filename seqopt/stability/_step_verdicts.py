"""Verdicts of the steps of a build as they are found, and how each was proven."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Floats, FrozenValue
from seqopt.contact.mortar import Mortar
from seqopt.network.network import Network
from seqopt.sequence.steps import Grips, Step
from seqopt.stability._verdict_chain import VerdictChain
from seqopt.stability.assessment import Verdict, _verdict_of, bonded
from seqopt.stability.limit_analysis import Compile, compile_equilibrium


@dataclass(frozen=True, eq=False, repr=False)
class StepVerdict(FrozenValue):
    """Verdict of a step, and how it was proven.

    ``way``: "forces" or a "motion" that prove it by themselves, "earlier" ones of another step, or
    the "cone program". ``motion`` (B, 6): how it falls, as of `Stability`; none if it does not.
    """

    verdict: Verdict
    way: str
    motion: Floats | None


def each_verdict(
    network: Network, steps: Sequence[Step], mortar: Mortar, compiled: Compile = compile_equilibrium
) -> Iterator[StepVerdict]:
    """Yield the verdict of every step as soon as it is found: that of `verdict`, mostly unsolved.

    Of equal partial structures it is asked once. What is found for one is tried on those that
    follow, so steps of a build are asked best in their order. ``compiled``: makes the programs of
    the steps for which that proves nothing.
    """
    most = max((step.bricks for step in steps), default=1)
    prove = VerdictChain(network, most, lambda assembly: bonded(assembly, mortar), compiled)
    found: dict[tuple[int, Grips], StepVerdict] = {}
    for step in steps:
        key = step.bricks, step.grips
        if key not in found:
            assembly, proven, way = prove(*key)
            verdict, motion = _verdict_of(proven), None
            if verdict is Verdict.FALLS:
                fastest = np.abs(proven.answer.motion).max()
                motion = proven.answer.motion / fastest / np.repeat([1.0, assembly.scales[1]], 3)
            found[key] = StepVerdict(verdict, way.value, motion)
        yield found[key]


def step_verdicts(network: Network, steps: Sequence[Step], mortar: Mortar) -> tuple[Verdict, ...]:
    """Return the verdict of every step; of equal partial structures it is asked once."""
    return tuple(found.verdict for found in each_verdict(network, steps, mortar))
