"""Which steps of builds stand: with which mortar, friction and tilt, and what would cure falls.

What stands with one mortar stands with a stronger one, and what falls falls with a weaker one:
verdicts of builds shown beside each other need fewer proofs. A map of failures is over what holds
the joints and one more axis. The least bond and the least friction with which all steps stand are
sought where they fall: one step's need is proven, and only those that still fall are asked again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from seqopt._registry import display
from seqopt.contact.assembly import Assembly, PartialAssemblies
from seqopt.contact.mortar import (
    DRY,
    EPOXY,
    ROUGHEST,
    Mortar,
    _is_as_strong,
    _mortar_name,
    _with_mortar,
    bond_mortar,
    find_mortar,
)
from seqopt.errors import SceneError, WorkerError
from seqopt.network.network import GROUND, Network, build_network
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step
from seqopt.stability._steps import each_stability, each_verdict
from seqopt.stability.assessment import Stability, assess
from seqopt.stability.limit_analysis import horizontal
from seqopt.stability.verdict import Verdict
from seqopt.work import Tell, _keep, with_progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = {"dry": DRY, "epoxy": EPOXY}  # with which it is said what stands
_SMALL = 0.1  # of a brick's smallest side: ground that turns and shifts no more changes no balance
_State = tuple[int, Grips]  # bricks that stand, and nodes held
WORDS = {Verdict.STANDS: "stands", Verdict.FALLS: "falls", Verdict.UNDECIDED: "is undecided"}
_MANY = {Verdict.FALLS: "fall", Verdict.UNDECIDED: "are undecided"}
AXES = {"friction": (0.2, 0.3, DRY.friction, 0.6, 0.8), "tilt": (0.0, 1.0, 2.0, 4.0, 8.0)}
_TILTED = 8  # directions, evenly spread
_SURE = 1e-3  # share by which more is taken than a step is proven to need
_TRIED = 24  # nodes where one more grip is tried, the fastest ones first
_SHARED = 50_000  # bricks of all steps from which on workers are worth their start
_HINGE = 0.5  # share of the opening that turning brings about, from which on it is a turn


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
        lines = [f"{n} of {steps} steps {WORDS[v] if n == 1 else _MANY[v]}" for n, v in counts if n]
        first = f", first {self.first_said}" if self.first else ""
        return f"{self.how}: {'; '.join(lines) or 'every step stands'}{first}"


class BuildProver:
    """Says which steps of builds stand; what was asked once is known.

    ``mortars``: by what they are called, that of the scene last; without any, nothing is asked;
    ``refusal``: why no verdict is found, as bricks do not touch or it was interrupted; else empty;
    ``proven``: verdicts that took a proof of their own.
    """

    def __init__(
        self, network: Network, mortars: Mapping[str, Mortar] = SHOWN, progress: Tell | None = None
    ) -> None:
        self.network, self.mortars, self._progress = network, mortars, progress
        self._known: dict[str, dict[_State, Verdict]] = {name: {} for name in mortars}
        self._first = dict[tuple[str, _State], tuple[str, str]]()  # that moves where one falls
        self._parts: PartialAssemblies | None = None  # of as many bricks as any step had so far
        self.refusal, self.proven = "", 0

    @property
    def spent(self) -> dict[str, int]:
        """How many verdicts were asked, by state and mortar, and how many were proven for them."""
        return {"verdicts": sum(map(len, self._known.values())), "proven": self.proven}

    @property
    def notes(self) -> tuple[str, ...]:
        """Why verdicts are missing, and which effects they neglect, in words."""
        lines = [f"not proven; {self.refusal}"] if self.refusal else []
        if self.mortars and (moves := _settlement_said(self.network.scene)):
            lines.append(moves)
        return tuple(f"stability: {each}" for each in lines)

    def of_builds(
        self, builds: Mapping[str, Sequence[Step]], workers: int = 1
    ) -> dict[str, tuple[BuildVerdicts, ...]]:
        """Return the verdicts of builds, one for every mortar; ``workers`` share large builds."""
        distinct = {_state(step): step for steps in builds.values() for step in steps}
        # one that fewer hold comes before others, which its forces prove
        ordered = sorted(distinct.values(), key=lambda step: (step.bricks, len(step.held)))
        workers = workers if sum(step.bricks for step in ordered) >= _SHARED else 1
        try:
            with _keep(workers=workers):
                for name in () if self.refusal else self.mortars:
                    self._ask(name, ordered, workers)
        except WorkerError:  # this process proves what is left
            return self.of_builds(builds)
        except SceneError as error:
            self.refusal = str(error)
        return {
            build: tuple(self._of_build(steps, name) for name in self.mortars)
            for build, steps in builds.items()
            if self.mortars and not self.refusal
        }

    def _ask(self, name: str, steps: Sequence[Step], workers: int) -> None:
        """Find the verdicts of steps with a mortar, and those implied with other mortars."""
        new = [step for step in steps if _state(step) not in self._known[name]]
        if not new:
            return
        what, mortar = f"proving what stands, {name}", self.mortars[name]
        most = max(step.bricks for step in new) or 1
        if self._parts is None or self._parts.bricks < most:
            self._parts = PartialAssemblies(self.network, most)
        each = each_stability(self._parts, new, mortar, shared=(None, workers))
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
                key = name, _state(step)
                if key not in self._first:
                    parts = self._parts or self.network
                    (found,) = each_verdict(parts, [step], self.mortars[name])
                    self._first[key] = found.first_block, found.first_contact
                first = self._first[key]
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
    """Return the prover of verdicts, dry and with a mortar, by default epoxy; or of none."""
    own = own or find_mortar(mortar or "epoxy")
    name = mortar if isinstance(mortar, str) else _mortar_name(own)
    shown = {"dry": Mortar(friction=own.friction), name: own}
    return BuildProver(network, shown if asks else {}, progress)


def _state(step: Step) -> _State:
    return step.bricks, step.grips


def _settlement_said(scene: Scene) -> str:
    """Return in words that movements of ground ends enter no verdict: rigid bricks follow them."""
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


@dataclass(frozen=True, eq=False, repr=False)
class FailureMap:
    """What falls, where, and what would cure it.

    Attributes
    ----------
    cases : pandas.DataFrame
        A row for every ``build``, what ``holds`` and ``value`` of the ``axis`` (friction, tilt in
        degrees): how many ``steps`` there are, ``fall`` and are ``undecided``; of the
        ``first_step`` that falls the ``bricks`` placed, ``brick`` and ``joint`` that fail first and
        the ``motion`` there; the ``bond_needed_Pa`` and the ``friction_needed`` with which all
        steps stand, inf if none is enough; and ``grip_node``, where one more robot would hold it.
    steps : pandas.DataFrame
        The ``verdict`` of every ``step`` of these, and of how many ``bricks`` it is.
    usual : float
        The value nearest to the default: the friction of `DRY`, or no tilt.
    """

    cases: pd.DataFrame
    steps: pd.DataFrame
    usual: float

    def __repr__(self) -> str:
        fall, steps = self.cases["fall"].sum(), self.cases["steps"].sum()
        return f"<FailureMap: {len(self.cases)} cases, {fall} of {steps} steps fall>"

    def plot(self) -> Figure:
        """Draw which share of steps falls in every case, and where along the builds.

        Result: a notebook shows it; ``savefig`` writes it to a file. Raises `ExtraError` if
        matplotlib is not installed (extra ``plot``).
        """
        figure: Figure = display(FailureMap, "plot")(self)
        return figure


@dataclass(frozen=True)
class _Case:
    """A build with a mortar, and scenes turned so that gravity pulls as it does in the case."""

    build: str
    steps: Sequence[Step]
    holds: str
    mortar: Mortar
    turned: tuple[PartialAssemblies, ...]

    @cached_property
    def found(self) -> tuple[Stability, ...]:
        """What is proven of every step: that of the first scene in which it is worst."""
        each = [[*each_verdict(parts, self.steps, self.mortar)] for parts in self.turned]
        worst = (Verdict.FALLS, Verdict.UNDECIDED, Verdict.STANDS)
        pairs = zip(*each, strict=True)
        return tuple(min(same, key=lambda one: worst.index(one.verdict)) for same in pairs)

    @property
    def falling(self) -> list[Step]:
        """The steps that fall."""
        pairs = zip(self.steps, self.found, strict=True)
        return [step for step, found in pairs if found.verdict is Verdict.FALLS]


def failure_map(
    scene: Scene,
    builds: Mapping[str, Sequence[Step]],
    holds: Sequence[str] = ("dry", "epoxy"),
    axis: str = "friction",
    values: Sequence[float] = (),
    progress: Tell | None = None,
) -> FailureMap:
    """Return which steps of builds fall, over what holds the joints and one more axis.

    Parameters
    ----------
    scene : Scene
    builds : mapping of str to sequence of Step
        By name.
    holds : sequence of str, optional
        What is in the joints: ``dry``, ``bond=PASCAL`` or ``epoxy``.
    axis : str, optional
        ``friction``, or ``tilt`` (degrees, to eight sides).
    values : sequence of float, optional
        On the axis.
    progress : callable, optional
        Called with a `seqopt.work.Stage`.

    Returns
    -------
    FailureMap

    Raises
    ------
    SceneError
        If there is no such axis or mortar, or bricks that share a joint do not touch.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch:span=1,rise=0.4,pattern=VLR")
    >>> builds = {"sequential": seqopt.sequential(seqopt.build_network(scene))}
    >>> found = failure_map(scene, builds, holds=["dry"], values=[0.1, 0.5])
    >>> found.cases[["value", "steps", "fall"]].to_numpy().tolist()
    [[0.1, 17.0, 13.0], [0.5, 17.0, 4.0]]
    """
    if axis not in AXES:
        raise SceneError(f"axis {axis!r}: give one of {', '.join(AXES)}")
    if not builds:
        raise SceneError("builds: there are none; give one by its name")
    values, least = values or AXES[axis], DRY.friction if axis == "friction" else 0.0
    usual = min(values, key=lambda value: abs(value - least))
    asked = [*_cases(scene, builds, holds, axis, values)]
    cases = with_progress("mapping failures", asked, progress)
    rows = [_row(case, axis, value) for value, case in cases]
    steps = list[pd.DataFrame]()
    for value, case in asked:
        own = {"build": case.build, "holds": case.holds, "axis": axis, "value": value}
        found = {
            "step": [step.number for step in case.steps],
            "bricks": [step.bricks for step in case.steps],
            "verdict": [each.verdict.value for each in case.found],
        }
        steps.append(pd.DataFrame(own | found))
    return FailureMap(pd.DataFrame(rows), pd.concat(steps, ignore_index=True), usual)


def _cases(
    scene: Scene,
    builds: Mapping[str, Sequence[Step]],
    holds: Sequence[str],
    axis: str,
    values: Sequence[float],
) -> Iterator[tuple[float, _Case]]:
    """Yield every case with its value on the axis, those beside each other by what holds."""
    upright = (_parts(scene),)
    turned = {value: _tilted(scene, value) if axis == "tilt" else upright for value in values}
    for name, steps in builds.items():
        for held in holds:
            mortar = find_mortar(held)
            for value in values:
                own = replace(mortar, friction=value) if axis == "friction" else mortar
                yield value, _Case(name, steps, held, own, turned[value])


def _parts(scene: Scene) -> PartialAssemblies:
    return PartialAssemblies(build_network(scene), len(scene.bricks))


def _tilted(scene: Scene, degrees: float) -> tuple[PartialAssemblies, ...]:
    """Return a scene tilted towards all sides."""
    if not degrees:
        return (_parts(scene),)
    up, size, tilt = np.array(scene.up), np.linalg.norm(scene.gravity), np.radians(degrees)
    out = []
    for angle in 2 * np.pi * np.arange(_TILTED) / _TILTED:
        pull = size * (np.sin(tilt) * horizontal(scene.up, angle) - np.cos(tilt) * up)
        x, y, z = pull.tolist()
        out.append(_parts(replace(scene, gravity=(x, y, z))))
    return tuple(out)


def _row(case: _Case, axis: str, value: float) -> dict[str, object]:
    """Return the row of a case."""
    verdicts = [found.verdict for found in case.found]
    row = dict[str, object](build=case.build, holds=case.holds, axis=axis, value=value)
    row |= {"steps": len(verdicts), "fall": verdicts.count(Verdict.FALLS)}
    row |= {"undecided": verdicts.count(Verdict.UNDECIDED), "first_step": 0, "bricks": 0}
    row |= {"brick": "", "joint": "", "motion": "", "bond_needed_Pa": 0.0}
    row |= {"friction_needed": 0.0, "grip_node": None}
    if not case.falling:
        return row
    first = case.falling[0]
    found = case.found[case.steps.index(first)]
    assembly = case.turned[0](first.bricks, first.grips)
    row |= {"first_step": first.number, "bricks": first.bricks, "brick": found.first_block}
    row |= {"joint": found.first_contact, "motion": _motion_word(assembly, found)}
    row |= {"bond_needed_Pa": _cure(case, "bond"), "friction_needed": _cure(case, "friction")}
    return row | {"grip_node": _grip(case, first, found)}


def _motion_word(assembly: Assembly, found: Stability) -> str:
    """Return how the joint that fails first parts: it turns, slides or lifts off."""
    if not found.first_contact:
        return "drops"
    contact = assembly.contact_name.index(found.first_contact)
    corners = assembly.corner[assembly.contact == contact]
    middle, bodies = corners.mean(axis=0), assembly.bodies[contact].tolist()
    velocity, turning = np.zeros(3), np.zeros(3)
    for body, sign in zip(bodies, (-1.0, 1.0), strict=True):
        if body != GROUND:
            move, turn = found.motion[body, :3], found.motion[body, 3:]
            velocity += sign * (move + np.cross(turn, middle - assembly.centroid[body]))
            turning += sign * turn
    opening = float(velocity @ assembly.normal[contact])
    slide = float(np.linalg.norm(velocity - opening * assembly.normal[contact]))
    reach = float(np.linalg.norm(corners - middle, axis=1).max())
    turned = reach * float(np.linalg.norm(turning))
    if slide > max(abs(opening), turned):
        return "slides"
    return "turns" if turned >= _HINGE * abs(opening) else "lifts off"


def _cure(case: _Case, what: str) -> float:
    """Return the least ``bond``, Pa, or ``friction`` with which every step stands.

    Inf if none is enough, NaN if nothing is proven of a step; more than needed by `_SURE`.
    """
    needed = 0.0
    for parts in case.turned:
        left = case.falling
        while left:
            step = left.pop()
            assembly = parts(step.bricks, step.grips)
            own = getattr(assess(assembly, case.mortar, margins=(what,)), what)
            if not np.isfinite(own):
                return float(own)
            needed = max(needed, float(own) * (1 + _SURE))
            mortar = replace(case.mortar, friction=min(needed, ROUGHEST))
            if what == "bond":  # at least what there is
                bond = bond_mortar(needed, case.mortar.friction)
                tension = max(bond.tensile_strength, case.mortar.tensile_strength)
                cohesion = max(bond.cohesion, case.mortar.cohesion)
                mortar = replace(bond, tensile_strength=tension, cohesion=cohesion)
            pairs = zip(left, [*each_verdict(parts, left, mortar)], strict=True)
            left = [each for each, now in pairs if now.verdict is not Verdict.STANDS]
    return needed


def _grip(case: _Case, step: Step, found: Stability) -> int | None:
    """Return a node where one more robot, as strong as the strongest, would hold a step."""
    scene = case.turned[0].network.scene
    strongest = max(scene.robots, key=lambda robot: robot.payload)
    more = replace(strongest, name=f"{strongest.name} more")
    helped = [
        _parts(replace(parts.network.scene, robots=(*scene.robots, more))) for parts in case.turned
    ]
    speed = dict[int, float]()
    for brick, motion in zip(scene.placed[: step.bricks], found.motion, strict=False):
        for node in brick.nodes:
            if node in scene.blocked_nodes or node in step.grips:
                continue
            arm = np.subtract(scene.node_position(node), brick.position)
            speed[node] = float(np.linalg.norm(motion[:3] + np.cross(motion[3:], arm)))
    for node in sorted(speed, key=lambda node: -speed[node])[:_TRIED]:  # the fastest ones first
        held = replace(step, grips=(*step.grips, node))
        verdicts = (next(each_verdict(parts, [held], case.mortar)).verdict for parts in helped)
        if all(verdict is Verdict.STANDS for verdict in verdicts):
            return node
    return None
