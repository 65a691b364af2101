"""Which steps of builds stand that are shown beside each other: verdicts, and what fails first.

What stands with one mortar stands with a stronger one, and what falls falls with a weaker one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from seqopt.contact.faces import PartialAssemblies
from seqopt.contact.mortar import (
    DRY,
    EPOXY,
    Mortar,
    _is_as_strong,
    _mortar_name,
    _with_mortar,
    find_mortar,
)
from seqopt.errors import SceneError
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step
from seqopt.stability._steps import each_verdict
from seqopt.stability.assessment import Verdict
from seqopt.work.progress import Tell, with_progress

SHOWN = {"dry": DRY, "epoxy": EPOXY}  # with which it is said what stands
_SMALL = 0.1  # of a brick's smallest side: ground that turns and shifts no more changes no balance
_State = tuple[int, Grips]  # bricks that stand, and nodes held
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
    with the progress; ``refusal``: why no verdict is found, where bricks do not touch; else empty;
    ``proven``: verdicts that took a proof of their own, which others imply.
    """

    def __init__(
        self, network: Network, mortars: Mapping[str, Mortar] = SHOWN, progress: Tell | None = None
    ) -> None:
        self.network, self.mortars, self._progress = network, mortars, progress
        self._known: dict[str, dict[_State, Verdict]] = {name: {} for name in mortars}
        self._parts: PartialAssemblies | None = None  # of as many bricks as any step had so far
        self.refusal, self.proven = "", 0

    @property
    def spent(self) -> dict[str, int]:
        """How many verdicts were asked, by state and mortar, and how many were proven for them."""
        return {"verdicts": sum(map(len, self._known.values())), "proven": self.proven}

    def of_builds(
        self, builds: Mapping[str, Sequence[Step]]
    ) -> dict[str, tuple[BuildVerdicts, ...]]:
        """Return the verdicts of builds by their steps, one for every mortar."""
        return {
            build: tuple(self._of_build(steps, name) for name in self.mortars)
            for build, steps in builds.items()
            if self._ask(chain.from_iterable(builds.values()))
        }

    def _ask(self, steps: Iterable[Step]) -> bool:
        """Find the verdicts that are not cached; return whether there are verdicts at all."""
        # one that fewer hold comes before others, which its forces prove
        distinct = sorted(
            {_state(step): step for step in steps}.values(), key=lambda s: (s.bricks, len(s.held))
        )
        for name in () if self.refusal else self.mortars:
            new = [step for step in distinct if _state(step) not in self._known[name]]
            try:
                self._ask_all(name, new)
            except SceneError as error:
                self.refusal = str(error)
                return False
        return bool(self.mortars) and not self.refusal

    def _ask_all(self, name: str, new: Sequence[Step]) -> None:
        """Find the verdicts of steps with a mortar, and those implied with other mortars."""
        if not new:
            return
        what, mortar = f"proving what stands, {name}", self.mortars[name]
        most = max(step.bricks for step in new) or 1
        if self._parts is None or self._parts.bricks < most:
            self._parts = PartialAssemblies(self.network, most)
        each = each_verdict(self._parts, new, mortar)
        found = dict[_State, Verdict]()
        for step, one in zip(with_progress(what, new, self._progress), each, strict=True):
            self._known[name][_state(step)] = found[_state(step)] = one.verdict
        self.proven += len(found)
        for other, held in self.mortars.items():
            sure = {Verdict.STANDS} if _is_as_strong(held, mortar) else set()
            sure |= {Verdict.FALLS} if _is_as_strong(mortar, held) else set()
            implied = {state: verdict for state, verdict in found.items() if verdict in sure}
            self._known[other] = implied | self._known[other]

    def _of_build(self, steps: Sequence[Step], name: str) -> BuildVerdicts:
        verdicts = tuple(self._known[name][_state(step)] for step in steps)
        for step, verdict in zip(steps, verdicts, strict=True):
            if verdict is Verdict.FALLS:
                parts = self._parts or self.network
                (found,) = each_verdict(parts, [step], self.mortars[name])
                first = found.first_block, found.first_contact
                return BuildVerdicts(name, verdicts, step.number, *first, steps[0].number)
        return BuildVerdicts(name, verdicts, begins=steps[0].number if steps else 1)


def find_prover(
    network: Network,
    mortar: Mortar | str | None,
    progress: Tell | None,
    *,
    asks: bool = True,
    own: Mortar | None = None,
) -> BuildProver:
    """Return the prover of verdicts, dry and with a mortar, by default epoxy; or of none.

    ``own``: what a mortar's name stands for, if not what it usually does.
    """
    own = own or find_mortar(mortar or "epoxy")
    name = mortar if isinstance(mortar, str) else _mortar_name(own)
    shown = {"dry": Mortar(friction=own.friction), name: own}
    return BuildProver(network, shown if asks else {}, progress)


def _state(step: Step) -> _State:
    return step.bricks, step.grips


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
