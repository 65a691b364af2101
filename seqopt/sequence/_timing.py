r"""When every step of a build begins and ends, from how long robots take.

Two things take time. A robot that holds nothing *prepares* what it does next, from when it let go:
it fetches the brick that it will place, or comes to the brick that it will hold. Robots prepare at
the same time, whatever others do. What changes the structure, *acting*, happens one after the
other, in the order of the steps, since every state between two steps is one that was looked at:
with :math:`e_{i-1}` the end of the step before, :math:`r` when the robot of step :math:`i` let go
last (0 at first), and :math:`p`, :math:`a` what it takes to prepare and to act,

.. math::

   e_i = \max \{ e_{i-1}, \, r + p \} + a .

Letting go needs no preparation. Where several let go at once, the slowest counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from seqopt.errors import ProblemError, StepError
from seqopt.scene.holders._durations import EXAMPLE, Durations
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import AnyStep, StepKind


@dataclass(frozen=True)
class StepTime:
    """When a step happens; all in s from the beginning of the build.

    ``step``: its number; ``robots``: indices of those who act in it; ``prepares``: from when the
    one who takes a grip gets ready; ``ready``: when it is; both None where robots let go;
    ``start``, ``end``: of what changes the structure; ``cures``: since when mortar holds what
    the step leads to, None where that was not asked; ``joint``: the one whose mortar it waits for,
    empty if for none.
    """

    step: int
    robots: tuple[int, ...]
    prepares: float | None
    ready: float | None
    start: float
    end: float
    cures: float | None = None
    joint: str = ""


Waits = Callable[[AnyStep, Sequence[float], float], tuple[float, str]]
"""Says from when on, no sooner than a time, a step may be done after bricks were in their places at
some times, and for which joint it waits; empty if for none."""


def require_durations(scene: Scene, robots: Sequence[int] | None = None) -> tuple[Durations, ...]:
    """Return the durations of some robots of a scene, by index, or of all; none is assumed."""
    which = range(len(scene.robots)) if robots is None else robots
    lacking = [scene.robots[r].name for r in which if scene.robots[r].durations is None]
    if lacking:
        raise StepError(
            f"scene {scene.name}: it is not known how long {', '.join(lacking)} "
            f"take{'s' * (len(lacking) == 1)}; give durations, as {EXAMPLE}"
        )
    return tuple(d for r in which if (d := scene.robots[r].durations) is not None)


def step_times(
    scene: Scene, steps: Sequence[AnyStep], waits: Waits | None = None
) -> tuple[StepTime, ...]:
    """Return when every step of a build happens at the earliest, in the order that is given.

    Steps are all of one build, from its first on. ``waits``: what a step has to wait for besides,
    where mortar cures: since nothing is gained by acting later, every step is done as soon as it
    may. A `StepError` names robots that act of which it
    is not known how long they take.

    Examples
    --------
    >>> import seqopt
    >>> words = "fetch=30,place=10,approach=10,grip=5,release=5"
    >>> scene = seqopt.load_scene("arch25").with_durations(words)
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> [(each.start, each.end) for each in step_times(scene, steps)[:4]]
    [(30.0, 40.0), (40.0, 50.0), (50.0, 55.0), (85.0, 95.0)]
    """
    if steps and steps[0].number > 1:
        raise StepError(f"steps from {steps[0].number} on: times are of whole builds; give all")
    robots = range(len(scene.robots))
    busy = [r for r in robots if any(step.grips[r] is not None for step in steps)]
    durations = dict(zip(busy, require_durations(scene, busy), strict=True))
    free, last = dict.fromkeys(busy, 0.0), dict[int, object]()
    before: Sequence[object] = (None,) * len(robots)
    now, out, placed = 0.0, list[StepTime](), list[float]()
    for step in steps:
        acting = tuple(r for r in busy if step.grips[r] != before[r])
        taker = next((r for r in acting if step.grips[r] is not None), None)
        placing = step.kind is StepKind.PLACE
        prepares = ready = None
        acts, start = max((durations[r].release for r in acting), default=0.0), now
        if taker is not None:
            own, node, prepares = durations[taker], step.grips[taker], free[taker]
            ready = prepares + (own.fetch if placing else own.approach)
            ready += way_seconds(scene, own, last.get(taker), node)
            start, last[taker] = max(now, ready), node
            acts = own.place if placing else own.grip
        cures, joint = (None, "") if waits is None else waits(step, placed, start)
        start = start if cures is None else cures
        if start == math.inf:
            raise StepError(_never(step))
        now = start + acts
        times = step.number, acting, prepares, ready, start, now
        out.append(StepTime(*times, cures, joint))
        placed += [now] * placing
        if taker is None:
            free |= dict.fromkeys(acting, now)
        before = step.grips
    return tuple(out)


def _never(step: AnyStep) -> str:
    """Return why a step is never done."""
    if step.kind is StepKind.PLACE:
        why = "before the joints that it closes have any bond; no wait helps, but more grips may"
    else:
        why = "with all mortar cured; no wait helps, but more grips may"
    return f"step {step.number} ({step.kind.value}): it is not proven to stand {why}"


def way_seconds(scene: Scene, own: Durations, last: object, node: object) -> float:
    """Return how long a robot goes from one node to another, s; nothing if that is not known."""
    if own.speed is None or not isinstance(last, int) or not isinstance(node, int):
        return 0.0
    return math.dist(scene.node_position(last), scene.node_position(node)) / own.speed


def has_durations(scene: Scene) -> bool:
    """Return whether it is known how long every robot takes."""
    return bool(scene.robots) and all(robot.durations is not None for robot in scene.robots)


def has_speeds(scene: Scene) -> bool:
    """Return whether ways of some robot take time of their own."""
    return any(robot.durations and robot.durations.speed for robot in scene.robots)


def require_for_makespan(scene: Scene, moves: FreeRules | Schedule) -> None:
    """Raise a `ProblemError` unless it is known how long those take who take part."""
    team = moves.team(scene) if isinstance(moves, FreeRules) else None
    try:
        require_durations(scene, team)
    except StepError as error:
        raise ProblemError(f"makespan: {error}") from None
