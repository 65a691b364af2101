"""Which steps of builds stand that are shown beside each other: verdicts, and what fails first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, groupby
from operator import attrgetter

import numpy as np

from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import Mortar
from seqopt.network.network import Network
from seqopt.sequence.steps import Grips, Step
from seqopt.stability._screens import OPEN, STANDS, Screen
from seqopt.stability._step_verdicts import each_verdict
from seqopt.stability.assessment import Verdict, _first_to_fail
from seqopt.work.progress import Tell, with_progress

SCREENED = 60  # bricks up to which a program for all grips at once is quickly solved
_WORDS = {Verdict.FALLS: "fall", Verdict.UNDECIDED: "are undecided"}


@dataclass(frozen=True)
class BuildVerdicts:
    """Which steps of a build stand with a mortar, and what fails first where one falls.

    ``mortar``: what it is called; ``verdicts``: of every step; ``first``: number of the first step
    that falls, zero if none does; ``brick``, ``joint``: the fastest one in its motion, and the one
    that opens fastest; empty where none does.
    """

    mortar: str
    verdicts: tuple[Verdict, ...]
    first: int = 0
    brick: str = ""
    joint: str = ""

    def count(self, verdict: Verdict) -> int:
        """Return how many steps have a verdict."""
        return self.verdicts.count(verdict)

    def facts(self) -> dict[str, object]:
        """Return it as numbers and words, for scripts."""
        counts = {"falls": self.count(Verdict.FALLS), "undecided": self.count(Verdict.UNDECIDED)}
        return counts | {"first_step": self.first, "brick": self.brick, "joint": self.joint}

    @property
    def first_said(self) -> str:
        """What fails first, in words; empty if nothing does."""
        joint = f", joint {self.joint}" if self.joint else ""
        return f"step {self.first} (brick {self.brick}{joint})" if self.first else ""

    def __str__(self) -> str:
        steps = len(self.verdicts)
        said = [f"{self.count(v)} of {steps} steps {w}" for v, w in _WORDS.items() if self.count(v)]
        first = f", first {self.first_said}" if self.first else ""
        return f"{self.mortar}: {'; '.join(said) or 'every step stands'}{first}"


def build_verdicts(
    network: Network,
    builds: Mapping[str, Sequence[Step]],
    mortars: Mapping[str, Mortar],
    progress: Tell | None = None,
) -> dict[str, tuple[BuildVerdicts, ...]]:
    """Return by build which steps stand with every mortar; equal partial structures are asked once.

    ``network``: of the scene in the order in which all of the builds place bricks; ``mortars``: by
    what they are called; without any, nothing is asked.
    """
    distinct = {_state(step): step for step in chain.from_iterable(builds.values())}
    steps = sorted(distinct.values(), key=attrgetter("bricks"))
    prove = _screened if len(network.inner) <= SCREENED else _one_by_one
    out: dict[str, tuple[BuildVerdicts, ...]] = dict.fromkeys(builds, ())
    for name, mortar in mortars.items():
        answers = with_progress(f"proving what stands ({name})", steps, progress)
        found = dict(prove(network, answers, mortar))
        for build, own in builds.items():
            verdicts = tuple(found[_state(step)] for step in own)
            falls = [s for s, v in zip(own, verdicts, strict=True) if v is Verdict.FALLS][:1]
            first = [(s.number, *_failing(network, s, mortar)) for s in falls]
            out[build] += (BuildVerdicts(name, verdicts, *chain.from_iterable(first)),)
    return out


_Found = Iterator[tuple[tuple[int, Grips], Verdict]]


def _one_by_one(network: Network, steps: Iterable[Step], mortar: Mortar) -> _Found:
    """Yield the verdicts of partial structures, by what was found for those before."""
    asked = [*steps]
    for step, found in zip(asked, each_verdict(network, asked, mortar), strict=True):
        yield _state(step), found.verdict


def _screened(network: Network, steps: Iterable[Step], mortar: Mortar) -> _Found:
    """Yield the same, many grip sets at a time; what is left open is asked one by one."""
    screen, scene = Screen(network, mortar), network.scene
    place = {node: i for i, node in enumerate((n for b in scene.placed for n in b.nodes), 1)}
    payload = np.array([robot.payload for robot in scene.robots])
    for bricks, same in groupby(steps, attrgetter("bricks")):
        part = [*same]
        held = np.array([[place[n] if n is not None else 0 for n in s.grips] for s in part])
        found = screen.stands(bricks, held, payload)
        for step, each in zip(part, found.tolist(), strict=True):
            if each == OPEN:
                yield from _one_by_one(network, [step], mortar)
            else:
                yield _state(step), Verdict.STANDS if each == STANDS else Verdict.FALLS


def _failing(network: Network, step: Step, mortar: Mortar) -> tuple[str, str]:
    """Return the brick and the joint that fail first in a step that falls."""
    (found,) = each_verdict(network, [step], mortar)
    if found.motion is None:
        return "", ""
    return _first_to_fail(step_assembly(network, step.bricks, step.grips), found.motion)


def _state(step: Step) -> tuple[int, Grips]:
    return step.bricks, step.grips
