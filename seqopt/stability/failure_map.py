"""Where builds fail: which steps fall with which mortar, friction and tilt, and what would cure it.

A build is mapped over what holds its joints and one more axis. The least bond and the least
friction with which all of its steps stand are sought where they fall: one step's need is proven,
and only those that still fall with it are asked again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from seqopt._registry import display
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import PartialAssemblies
from seqopt.contact.mortar import DRY, Mortar, bond_mortar, find_mortar
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.network.network import GROUND
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.stability._prover import horizontal
from seqopt.stability._steps import each_verdict
from seqopt.stability.assessment import Stability, Verdict, assess
from seqopt.work.progress import Tell, with_progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES = {"friction": (0.2, 0.3, DRY.friction, 0.6, 0.8), "tilt": (0.0, 1.0, 2.0, 4.0, 8.0)}
_TILTED = 8  # directions, evenly spread
_SURE = 1e-3  # share by which more is taken than a step is proven to need
_TRIED = 24  # nodes where one more grip is tried, the fastest ones first
_HINGE = 0.5  # share of the opening that turning brings about, from which on it is a turn


@dataclass(frozen=True, eq=False, repr=False)
class FailureMap:
    """What falls, where, and what would cure it.

    Attributes
    ----------
    cases : pandas.DataFrame
        A row for every ``build``, what ``holds`` and ``value`` of the ``axis`` (friction, tilt in
        degrees): how many ``steps`` there
        are, ``fall`` and are ``undecided``; of the ``first_step`` that falls the ``bricks`` placed,
        ``brick`` and ``joint`` that fail first and the ``motion`` there; the ``bond_needed_Pa`` and
        the ``friction_needed`` with which all steps stand, inf if none is enough; and
        ``grip_node``, where one more robot would hold the first step.
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
    values, least = values or AXES[axis], DRY.friction if axis == "friction" else 0.0
    usual = min(values, key=lambda value: abs(value - least))
    asked = [*_cases(scene, builds, holds, axis, values)]
    told = with_progress("mapping failures", asked, progress)
    rows = [_row(case, axis, value) for value, case in told]
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

    It is inf if none is enough and NaN if nothing is proven of a step; and more than what a step is
    proven to need by `_SURE`, with which the others are asked.
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
            mortar = replace(case.mortar, friction=needed)
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
