"""Which steps of builds stand that are shown beside each other: verdicts, and what fails first.

One proof is sought for many steps. Forces that hold a structure by the grips that steps have in
common prove all of these steps, and a motion in which it falls although all of them together hold
it proves that all fall. So such a structure is proven before one of the steps is. It may be of no
use; it is never a verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from functools import partial
from itertools import accumulate, chain, groupby, islice
from operator import attrgetter

import numpy as np

from seqopt.contact._partial_assemblies import PartialAssemblies
from seqopt.contact.mortar import DRY, EPOXY, Mortar, _is_as_strong, _with_mortar
from seqopt.errors import SceneError
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step
from seqopt.stability._screens import OPEN, STANDS, Screen
from seqopt.stability._step_verdicts import by_workers, each_verdict, parts_of
from seqopt.stability._verdict_chain import VerdictChain, Way
from seqopt.stability.assessment import Verdict, _verdict_of
from seqopt.work._threads import cores
from seqopt.work._workers import Crew, hire
from seqopt.work.progress import Tell, with_progress

SHOWN = {"dry": DRY, "epoxy": EPOXY}  # with which it is said what stands
SCREENED = 60  # bricks up to which a program for all grips at once is quickly solved
_SETS = 12  # grips of as many bricks, in the mean, from which on such a program pays
_SHARED = 5e4  # bricks in all steps from which on a process more takes less than it saves
_DEAR = 50  # bricks from which on a proof takes much longer than trying others
_TOGETHER = 1500  # bricks in all steps that are sought for beside each other, where it is not dear
_SPAN = 8  # brick counts whose grips hold a structure that is to fall all the same
_MOST = 16  # brick counts for which nothing is sought at most after it was of no use
_CHUNKS = 6  # of the steps with one mortar: what is found for one does not prove the next one
_SMALL = 0.1  # of a brick's smallest side: ground that turns and shifts no more changes no balance
_EARLIER = (Way.EARLIER_FORCES, Way.EARLIER_MOTION)
_State = tuple[int, Grips]  # bricks that stand, and nodes held
_Found = Iterator[tuple[_State, Verdict]]
_Told = Callable[[], Iterator[Step]]  # steps, told as they are asked
_Way = Callable[[Sequence[Step], Mortar, _Told], _Found]
WORDS = {Verdict.STANDS: "stands", Verdict.FALLS: "falls", Verdict.UNDECIDED: "is undecided"}
_MANY = {Verdict.FALLS: "fall", Verdict.UNDECIDED: "are undecided"}


@dataclass(frozen=True, repr=False)
class BuildVerdicts:
    """Which steps of a build stand with a mortar, and what fails first where one falls.

    ``mortar``: what it is called; ``verdicts``: of every step; ``first``: number of the first step
    that falls, zero if none does; ``begins``: number of the first step of all; ``brick``,
    ``joint``: the fastest one in its motion, and the one that opens fastest; empty where none does.
    """

    mortar: str
    verdicts: tuple[Verdict, ...]
    first: int = 0
    brick: str = ""
    joint: str = ""
    begins: int = 1

    def count(self, verdict: Verdict) -> int:
        """Return how many steps have a verdict."""
        return self.verdicts.count(verdict)

    def falls(self, number: int) -> bool:
        """Return whether a step falls, by its number."""
        return self.verdicts[number - self.begins] is Verdict.FALLS

    @property
    def how(self) -> str:
        """With what it stands or falls, in words."""
        return _with_mortar(self.mortar)

    def facts(self) -> dict[str, object]:
        """Return it as numbers and words, for scripts."""
        counts = {"falls": self.count(Verdict.FALLS), "undecided": self.count(Verdict.UNDECIDED)}
        return counts | {"first_step": self.first, "brick": self.brick, "joint": self.joint}

    @property
    def first_said(self) -> str:
        """What fails first, in words; empty if nothing does."""
        joint = f", joint {self.joint}" if self.joint else ""
        return f"step {self.first} (brick {self.brick}{joint})" if self.first else ""

    def __repr__(self) -> str:
        return f"<BuildVerdicts: {self}>"

    def __str__(self) -> str:
        steps = len(self.verdicts)
        counts = [(self.count(verdict), verdict) for verdict in _MANY]
        said = [f"{n} of {steps} steps {WORDS[v] if n == 1 else _MANY[v]}" for n, v in counts if n]
        first = f", first {self.first_said}" if self.first else ""
        return f"{self.how}: {'; '.join(said) or 'every step stands'}{first}"


class BuildProver:
    """Says which steps of builds stand; what was asked once is known.

    ``network``: of the scene in the order in which the builds place bricks; ``mortars``: by what
    they are called, that of the scene last; without any, nothing is asked; ``progress``: called
    with the progress; ``refusal``: why no verdict is found, where bricks do not touch; else empty.
    """

    def __init__(
        self, network: Network, mortars: Mapping[str, Mortar] = SHOWN, progress: Tell | None = None
    ) -> None:
        self._network, self._mortars, self._progress = network, mortars, progress
        self._known: dict[str, dict[_State, Verdict]] = {name: {} for name in mortars}
        self._parts: PartialAssemblies | None = None  # of as many bricks as any step had so far
        self._crew: Crew | None = None
        self.refusal = ""

    @property
    def scene(self) -> Scene:
        """What is built."""
        return self._network.scene

    @property
    def asks(self) -> bool:
        """Whether it is asked of any mortar what stands."""
        return bool(self._mortars)

    def of_builds(
        self, builds: Mapping[str, Sequence[Step]]
    ) -> dict[str, tuple[BuildVerdicts, ...]]:
        """Return the verdicts of builds by their steps, one for every mortar."""
        return {
            build: tuple(self._of_build(steps, name) for name in self._mortars)
            for build, steps in builds.items()
            if self._ask(chain.from_iterable(builds.values()))
        }

    @contextmanager
    def begun(self, steps: Sequence[Step]) -> Iterator[None]:
        """Share a large build between two processes: for commands, which may start them."""
        work = sum(step.bricks for step in steps) * len(self._mortars)
        with hire(workers=2 if work >= _SHARED and cores() > 1 else 1) as crew:
            self._crew = crew
            try:
                yield
            finally:
                self._crew = None

    def _ask(self, steps: Iterable[Step]) -> bool:
        """Find the verdicts that are not cached; return whether there are verdicts at all."""
        if self.refusal:
            return False
        distinct = [*{_state(step): step for step in steps}.values()]
        try:
            for name in self._mortars:
                known = self._known[name]
                new = [step for step in distinct if _state(step) not in known]
                # one that fewer hold comes before others, which its forces prove
                self._ask_all(name, sorted(new, key=lambda s: (s.bricks, len(s.held))))
        except SceneError as error:
            self.refusal = str(error)
            return False
        return bool(self._mortars)

    def _ask_all(self, name: str, new: Sequence[Step]) -> None:
        """Find the verdicts of steps with a mortar, and those implied with other mortars."""
        if not new:
            return
        what, mortar = f"proving what stands, {name}", self._mortars[name]
        tell = partial(with_progress, what, new, self._progress)
        found = {}
        for state, verdict in self._way(new)(new, mortar, tell):
            self._known[name][state] = found[state] = verdict
        for other, held in self._mortars.items():
            sure = {Verdict.STANDS} if _is_as_strong(held, mortar) else set()
            sure |= {Verdict.FALLS} if _is_as_strong(mortar, held) else set()
            implied = {state: verdict for state, verdict in found.items() if verdict in sure}
            self._known[other] = implied | self._known[other]

    def _way(self, new: Sequence[Step]) -> _Way:
        """Select the fastest route to the verdicts of steps."""
        most = max(step.bricks for step in new) or 1
        if self._parts is None or self._parts.bricks < most:
            self._parts = PartialAssemblies(self._network, most)
        counts = {step.bricks for step in new}
        if len(new) > _SETS * len(counts) and len(self._network.inner) <= SCREENED:
            return partial(_screened, self._parts)  # a program for all grips of a brick count pays
        return partial(_one_by_one, self._parts, crew=self._crew)

    def _of_build(self, steps: Sequence[Step], name: str) -> BuildVerdicts:
        verdicts = tuple(self._known[name][_state(step)] for step in steps)
        for step, verdict in zip(steps, verdicts, strict=True):
            if verdict is Verdict.FALLS:
                parts = self._parts or self._network
                (found,) = each_verdict(parts, [step], self._mortars[name])
                first = found.first_block, found.first_contact
                return BuildVerdicts(name, verdicts, step.number, *first, steps[0].number)
        return BuildVerdicts(name, verdicts, begins=steps[0].number if steps else 1)


def _one_by_one(
    parts: PartialAssemblies,
    steps: Sequence[Step],
    mortar: Mortar,
    tell: _Told | None = None,
    crew: Crew | None = None,
) -> _Found:
    """Yield the verdicts of partial structures, by what was found for those before."""
    if crew is None:
        each = quick_verdicts(parts, steps, mortar)
    else:
        chunks = [list[Step]()]  # they end between brick counts
        for _, same in groupby(steps, attrgetter("bricks")):
            chunks[-1] += same
            if len(chunks[-1]) * _CHUNKS >= len(steps):
                chunks.append([])
        find = partial(quick_verdicts, mortar=mortar)
        each = by_workers(parts, find, [*filter(None, chunks)], crew)
    for step, found in zip(steps if tell is None else tell(), each, strict=True):
        yield _state(step), found


def _screened(parts: PartialAssemblies, _: Sequence[Step], mortar: Mortar, tell: _Told) -> _Found:
    """Yield verdicts of many grip sets at a time; those left open are found one by one."""
    screen, scene = Screen(parts.network, mortar), parts.network.scene
    place = {node: i for i, node in enumerate(scene.placed_nodes, 1)}
    payload = np.array([robot.payload for robot in scene.robots])
    for bricks, same in groupby(tell(), attrgetter("bricks")):
        part = [*same]
        if not bricks:
            yield from _one_by_one(parts, part, mortar)
            continue
        held = np.array([[place[n] if n is not None else 0 for n in s.grips] for s in part])
        found = screen.stands(bricks, held, payload)
        for step, each in zip(part, found.tolist(), strict=True):
            if each == OPEN:
                yield from _one_by_one(parts, [step], mortar)
            else:
                yield _state(step), Verdict.STANDS if each == STANDS else Verdict.FALLS


def _state(step: Step) -> _State:
    return step.bricks, step.grips


class _ProofKind(Enum):
    """What may prove many steps."""

    FORCES = "forces"
    MOTION = "motion"


class _Backoff:
    """How many brick counts are left out after a try was of no use: twice as many each time."""

    def __init__(self) -> None:
        self._rest = self._next = 0

    def ready(self) -> bool:
        """Count down by one brick count; return whether to try again."""
        self._rest = max(self._rest - 1, -1)
        return self._rest < 0

    def learn(self, *, useful: bool) -> None:
        """Start anew after a useful try, else double the pause."""
        self._next = 0 if useful else min(max(2 * self._next, 1), _MOST)
        self._rest = self._next


def quick_verdicts(
    built: Network | PartialAssemblies, steps: Sequence[Step], mortar: Mortar
) -> Iterator[Verdict]:
    """Yield the verdict of every step as soon as it is found; best by ascending brick counts."""
    parts = parts_of(built, steps)
    prove = VerdictChain(parts, mortar, near=True)
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
    """Yield verdicts; a proof of many steps is tried before that of a single one."""
    groups = [(bricks, [*each]) for bricks, each in groupby(steps, attrgetter("bricks"))]
    backoff, sought = {kind: _Backoff() for kind in _ProofKind}, _ProofKind.FORCES
    for i, (bricks, group) in enumerate(groups):
        near = [step for _, each in groups[i : i + _SPAN] for step in each]
        left = {kind for kind in _ProofKind if backoff[kind].ready()}
        for step in group:
            common = sought is _ProofKind.FORCES
            trial = _common_grips(group) if common else _all_grips(network, near, bricks)
            tried: list[object] = []
            before = partial(_try, prove, bricks, trial, tried)
            _, proven, way = prove(bricks, step.grips, before if sought in left else None)
            if tried:
                backoff[sought].learn(useful=way in _EARLIER)
                left.discard(sought)
            if way not in _EARLIER:
                sought = _ProofKind.MOTION if proven.bound > 0 else _ProofKind.FORCES
            yield _verdict_of(proven)


def _try(prove: VerdictChain, bricks: int, grips: Grips, tried: list[object]) -> None:
    tried.append(prove(bricks, grips)[2])


def _common_grips(steps: Sequence[Step]) -> Grips:
    """Return the grips that all steps have: forces by them hold every step."""
    every = zip(*(step.grips for step in steps), strict=True)
    return tuple(held[0] if len({*held}) == 1 else None for held in every)


def _all_grips(network: Network, steps: Sequence[Step], bricks: int) -> Grips:
    """Return the grips of any step at bricks that stand: what falls with them falls in each."""
    stands = {*network.scene.placed_nodes[: 2 * bricks]}
    held = {node for step in steps for node in step.grips if node in stands}
    return (*(None for _ in network.scene.robots), *sorted(held))


def _settlement_said(scene: Scene) -> str:
    """Return that movements of ground ends enter no verdict, in words; empty where none moves.

    Rigid bricks follow the ground, and balance as they did.
    """
    every = (ground.movement for ground in scene.grounds)
    moved = [np.reshape(each, (2, 3)) for each in every if each is not None and any(each)]
    if not moved:
        return ""
    side = min(min(brick.dimensions) for brick in scene.bricks)
    lever = max(max(brick.dimensions) for brick in scene.bricks)
    most = max(float(np.linalg.norm(s) + lever * np.linalg.norm(t)) for s, t in moved)
    many = "s" * (len(moved) > 1)
    ends = f"the movement of {len(moved)} ground end{many}, up to {1e3 * most:.4g} mm,"
    if most > _SMALL * side:
        return (
            f"{ends} enters no verdict, and is not small beside a brick's {1e3 * side:.4g} mm: "
            "verdicts are of the structure where it is planned, not where it moves to"
        )
    return (
        f"{ends} enters no verdict: rigid bricks follow it without strain, and one so small leaves "
        "their balance as it is; where it opens joints, ask: analyze --engine discrete"
    )
