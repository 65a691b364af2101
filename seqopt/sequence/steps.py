"""Steps of a build, the check that a sequence of them is possible in its scene, and sites.

A site is the state in which a build begins or ends: placed bricks and grips.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from numbers import Integral

from seqopt.errors import StepError
from seqopt.scene._checks import finite, settle, short
from seqopt.scene.parts import Robot
from seqopt.scene.scene import Scene, _reachable

Grips = tuple[int | None, ...]


class StepKind(Enum):
    """Kind of a step."""

    PLACE = "place"  # one more brick, held by the robot that places it
    RELEASE = "release"  # one grip fewer, or several; same bricks
    REPOSITION = "reposition"  # one grip more; same bricks
    REMOVE = "remove"  # one brick fewer, taken away by the only robot that holds it


_CHANGES = (StepKind.PLACE, StepKind.REMOVE)  # of bricks


@dataclass(frozen=True)
class AnyStep:
    """A step, or one with grips that are still open: anything but a node or None."""

    number: int  # from 1
    kind: StepKind
    bricks: int  # how many are placed, in build order
    grips: tuple[object, ...]  # of each of the scene's robots


@dataclass(frozen=True)
class Step(AnyStep):
    """One step of the build: the bricks placed, and the node that every robot holds.

    Parameters
    ----------
    number : int
        From 1.
    kind : StepKind
        What the step does.
    bricks : int
        How many bricks are placed, in build order.
    grips : tuple of (int or None)
        Node that each of the scene's robots holds; None for a robot that holds nothing.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> step = seqopt.sequential(network)[1]
    >>> step.kind.value, step.bricks, step.grips
    ('place', 2, (1, 2, None))
    >>> step.held
    (1, 2)
    """

    grips: Grips

    @property
    def held(self) -> tuple[int, ...]:
        """The nodes held, in the order of the robots."""
        return tuple(node for node in self.grips if node is not None)


def idle_robots(scene: Scene, steps: Iterable[AnyStep]) -> tuple[str, ...]:
    """Return the names of the robots of a scene that never grip, in its order."""
    busy = {i for step in steps for i, grip in enumerate(step.grips) if grip is not None}
    return tuple(robot.name for i, robot in enumerate(scene.robots) if i not in busy)


def _idle_note(scene: Scene, name: str, steps: Iterable[AnyStep]) -> list[str]:
    """Return a note that names the robots which never grip, or none."""
    idle = idle_robots(scene, steps)
    return [f"{name}: {', '.join(idle)} never grip{'s' * (len(idle) == 1)}"] if idle else []


def require_steps(steps: Sequence[Step]) -> Sequence[Step]:
    """Return steps unchanged; raise an error for other objects, as a schedule with open grips."""
    if not isinstance(steps, Sequence) or not all(isinstance(step, Step) for step in steps):
        raise StepError(
            f"a {type(steps).__name__} is not a sequence of steps; "
            "give the steps of a method, a plan, or a filled schedule"
        )
    return steps


def check_sequence(
    scene: Scene, steps: Sequence[Step], begin: AnyStep | None = None
) -> tuple[Step, ...]:
    """Return the steps, checked to be feasible one after the other, the first after ``begin``.

    By default they begin at the empty site.
    """
    if not steps:
        raise StepError("the sequence has no steps; give at least one")
    for before, step in zip((begin, *steps), steps, strict=False):
        _check_step(scene, before, step)
    return tuple(steps)


def _check_part(scene: Scene, steps: Sequence[Step]) -> tuple[Step, ...]:
    """Return the checked steps of a build or of a part of one, which may begin in any state."""
    if require_steps(steps):
        _check_state(scene, steps[0], f"step {steps[0].number}")
    if len(steps) != 1:
        check_sequence(scene, steps[1:], steps[0] if steps else None)
    return tuple(steps)


def _check_state(scene: Scene, step: AnyStep, where: str) -> None:
    """Require feasible grips, regardless of previous steps; ``where``: named in messages."""
    if len(step.grips) != len(scene.robots):
        raise StepError(
            f"{where}: {len(step.grips)} grips for {len(scene.robots)} robots; give one each"
        )
    least = step.kind is not StepKind.REMOVE
    if not least <= step.bricks <= len(scene.bricks):
        raise StepError(f"{where}: {step.bricks} bricks; the scene has 1 to {len(scene.bricks)}")
    holder: dict[int, str] = {}
    for robot, grip in zip(scene.robots, step.grips, strict=True):
        if not isinstance(grip, Integral):  # none, or open
            continue
        node = int(grip)
        if node in holder:
            raise StepError(
                f"{where}: {robot.name} at node {node}: {holder[node]} holds it; hold another"
            )
        _check_grip(scene, step, robot, node, where)
        holder[node] = robot.name


def _check_grip(scene: Scene, step: AnyStep, robot: Robot, node: int, where: str) -> None:
    """Require a node that exists, is free and stands within reach."""
    if node not in scene.brick_of_node:
        reason = "there is no such node"
    elif node in scene.blocked_nodes:
        reason = "the node is blocked"
    elif scene.since[scene.brick_of_node[node].name] > step.bricks:
        reason = f"brick {scene.brick_of_node[node].name} is not placed yet"
    elif not robot.reach.covers(scene.brick_of_node[node].node_position(node)):
        reason = "the node is out of its reach"
    else:
        return
    nodes = _reachable(scene, robot, step.bricks)
    possible = ", ".join(map(str, nodes)) or "no node"
    if len(nodes) > 12:
        possible = f"{len(nodes)} nodes from {nodes[0]} to {nodes[-1]}"
    raise StepError(f"{where}: {robot.name} at node {node}: {reason}; it can hold {possible}")


def _check_step(scene: Scene, before: AnyStep | None, step: AnyStep) -> None:
    """Require that a step makes exactly the change of its kind, for any choice of open grips."""
    _check_state(scene, step, f"step {step.number}")
    before = before or Step(0, StepKind.RELEASE, 0, (None,) * len(scene.robots))
    where = f"step {step.number} ({step.kind.value})"
    removes = step.kind is StepKind.REMOVE
    expected = before.bricks + (step.kind is StepKind.PLACE) - removes
    if step.bricks != expected:
        raise StepError(
            f"{where}: {step.bricks} bricks after {before.bricks}; give {expected} or another kind"
        )
    taken: list[object] = []
    dropped: list[object] = []
    for robot, old, new in zip(scene.robots, before.grips, step.grips, strict=True):
        if None not in (old, new) and old != new:
            raise StepError(
                f"{where}: {robot.name} moves from node {old} to {new}; let it release first"
            )
        if old != new:
            (dropped if new is None else taken).append(old if new is None else new)
    brick = scene.placed[step.bricks - (not removes)]
    right, wanted = len(taken) == 1 and not dropped, "such a step takes one, drops none"
    if step.kind is StepKind.RELEASE:
        right, wanted = bool(dropped) and not taken, "such a step takes none and drops some"
    elif removes:
        right = not taken and len(dropped) == 1
        right &= all(node in brick.nodes for node in dropped if isinstance(node, Integral))
        wanted = f"one robot alone holds brick {brick.name}, at one of {list(brick.nodes)}, and "
        wanted += "takes it away"
    if not right:
        given, left = (", ".join(map(str, grips)) for grips in (taken, dropped))
        raise StepError(f"{where}: it takes grips [{given}] and drops [{left}]; {wanted}")
    given_node = step.kind is StepKind.PLACE and isinstance(taken[0], Integral)
    if given_node and taken[0] not in brick.nodes:
        raise StepError(
            f"{where}: its new grip is on node {taken[0]}; "
            f"hold brick {brick.name} at one of {list(brick.nodes)}"
        )


@dataclass(frozen=True)
class Site:
    """State of a site.

    Parameters
    ----------
    bricks : int
        How many bricks stand, in build order.
    grips : tuple of (int or None), optional
        Node that each of the scene's robots holds. By default nobody holds anything where a build
        begins; where it ends, the rule ``ending`` says who holds.
    stays : tuple of (int or None), optional
        Node that each robot that is free held last, from which its travel counts.
    regrips : int
        How many grips were taken since the last brick, besides that which placed it.
    step : int, optional
        Number of the step that led there: steps are numbered on from it. By default 1, and 0 for
        the empty site.
    ages : tuple of float, optional
        For how long bricks, in build order, have been in their places, s, where mortar cures; by
        default they were placed just now.

    Examples
    --------
    >>> import seqopt
    >>> steps = seqopt.sequential(seqopt.build_network(seqopt.load_scene("arch25")))
    >>> Site.after(steps, 4)
    Site(bricks=3, grips=(4, 2, None), stays=(None, None, None), regrips=0, step=4, ages=())
    """

    bricks: int
    grips: Grips | None = None
    stays: Grips = ()
    regrips: int = 0
    step: int = -1
    ages: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        ages = tuple(finite("site: age", age, 0.0) for age in self.ages)
        if len(ages) > max(self.bricks, 0):
            raise StepError(f"site: {len(ages)} ages of {self.bricks} bricks; give one for each")
        settle(self, ages=ages, step=self.step if self.step >= 0 else int(self.bricks != 0))

    @classmethod
    def after(cls, steps: Sequence[Step], count: int) -> Site:
        """Return the site after a number of steps of a build, 0 for the empty site."""
        first, last = (steps[0].number - 1, steps[-1].number) if steps else (0, 0)
        if not isinstance(count, Integral) or not first <= count <= last:
            raise StepError(f"step {short(count)}: the plan has {first} to {last}")
        done = steps[: count - first]
        if first and not done:
            raise StepError(f"step {count}: the plan begins after it; give {first + 1} to {last}")
        if not done:  # before a build, or before a take-down
            if all(step.kind is not StepKind.REMOVE for step in steps):
                return cls(0)
            bricks = steps[0].bricks + (steps[0].kind is StepKind.REMOVE)
            return cls(bricks, (None,) * len(steps[0].grips), step=0)
        lasts = {r: n for s in done for r, n in enumerate(s.grips) if n is not None}
        free = (lasts.get(r) if node is None else None for r, node in enumerate(done[-1].grips))
        kinds = [step.kind for step in done]
        moved = [k for k, kind in enumerate(kinds, start=1) if kind in _CHANGES]
        regrips = kinds[max(moved, default=0) :].count(StepKind.REPOSITION)
        return cls(done[-1].bricks, done[-1].grips, tuple(free), regrips, done[-1].number)

    @property
    def placed(self) -> list[float]:
        """When the placed bricks were in position, s, from their ages."""
        return [-age for age in self.ages] + [0.0] * (self.bricks - len(self.ages))

    @property
    def held(self) -> int:
        """Number of grips."""
        return sum(node is not None for node in self.grips or ())

    def holds(self, scene: Scene) -> Grips:
        """Return the node that each robot holds; raise an error if the scene does not allow it."""
        grips, most = self.grips, len(scene.placed)
        if not isinstance(self.bricks, Integral) or not 0 <= self.bricks <= most:
            raise StepError(
                f"site: {short(self.bricks)} bricks; scene {scene.name} has 0 to {most}"
            )
        if grips is None:
            return (None,) * len(scene.robots)
        if self.bricks:
            _check_state(scene, Step(0, StepKind.RELEASE, self.bricks, tuple(grips)), "site")
        elif self.held:
            raise StepError("site: a robot holds a brick, and none stands; give bricks")
        if taken := [prop.node for prop in scene.props if prop.node in grips]:
            raise StepError(f"site: a robot holds node {taken[0]} of a prop; leave one out")
        return grips

    def described(self, scene: Scene) -> dict[str, object]:
        """Return bricks and grips by names, ready for JSON."""
        pairs = zip(scene.robots, self.holds(scene), strict=True)
        held = {robot.name: node for robot, node in pairs if node is not None}
        return {
            "bricks": [brick.name for brick in scene.placed[: self.bricks]],
            "grips": held if self.grips is not None else "as the rule ending says",
        }


def _begin_step(scene: Scene, site: Site | None) -> Step:
    """Return the state before the first step of a build, as the step that led to it."""
    site = site or Site(0)
    return Step(site.step, StepKind.RELEASE, site.bricks, site.holds(scene))
