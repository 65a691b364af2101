r"""When every step of a build begins and ends, from how long robots take.

Two things take time. A robot that holds nothing *prepares* what it does next, from when it let go:
it fetches the brick that it will place, or comes to the brick that it will hold. Robots prepare at
the same time, independent of others. What changes the structure, *acting*, happens one after the
other, in the order of the steps, since every state between two steps is one that was looked at:
with :math:`e_{i-1}` the end of the step before, :math:`r` when the robot of step :math:`i` let go
last (0 at first), and :math:`p`, :math:`a` what it takes to prepare and to act,

.. math::

   e_i = \max \{ e_{i-1}, \, r + p \} + a .

Letting go needs no preparation. Where several let go at once, the slowest counts.

Given steps may also be shared out anew among robots, exactly, by labels over the steps: grips,
their order and their nodes stay. A label is who has the grips that are held, when the last step
ended, and since when every other robot is free.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from seqopt.errors import StepError
from seqopt.network.network import build_network
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import AnyStep, Site, Step, StepKind, _begin_step, check_sequence
from seqopt.stability.standing import Standing
from seqopt.times._curing import Waits, mortar_waits
from seqopt.times._durations import EXAMPLE, Durations


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


def step_times(
    scene: Scene, steps: Sequence[AnyStep], waits: Waits | None = None, begin: Site | None = None
) -> tuple[StepTime, ...]:
    """Return when every step of a build happens at the earliest, in the order that is given.

    Steps are all of one build, from its first on, or from where it ``begin``s: there robots that
    are free begin to prepare. ``waits``: what a step has to wait for besides, where mortar cures:
    since nothing is gained by acting later, every step is done as soon as it may. A `StepError`
    names robots that act of which it is not known how long they take.

    >>> import seqopt
    >>> words = "fetch=30,place=10,approach=10,grip=5,release=5"
    >>> scene = seqopt.load_scene("arch25").with_durations(words)
    >>> steps = seqopt.sequential(seqopt.build_network(scene))
    >>> [(each.start, each.end) for each in step_times(scene, steps)[:4]]
    [(30.0, 40.0), (40.0, 50.0), (50.0, 55.0), (85.0, 95.0)]
    """
    if steps and steps[0].number > 1 and begin is None:
        raise StepError(f"steps from {steps[0].number} on: times are of whole builds; give all")
    before: Sequence[object] = _begin_step(scene, begin).grips
    every = zip(before, *(step.grips for step in steps), strict=True)
    busy = [r for r, grips in enumerate(every) if any(grip is not None for grip in grips)]
    team = _Team(scene, dict(zip(busy, require_durations(scene, busy), strict=True)), waits)
    clock, out = _begin_clock(scene, begin), list[StepTime]()
    for step in steps:
        changes = {r: step.grips[r] for r in busy if step.grips[r] != before[r]}
        clock, time = team.act(clock, step, changes)
        if time.start == math.inf:
            which = "before the joints that it closes have any bond"
            which = which if step.kind is StepKind.PLACE else "with all mortar cured"
            raise StepError(
                f"step {step.number} ({step.kind.value}): it is not proven to stand {which}; no "
                "wait helps, but more grips may"
            )
        out.append(time)
        before = step.grips
    return tuple(out)


class _Clock(NamedTuple):
    """What the times of a build depend on after a step.

    ``end``: of the last step, s; ``since``: since when robots are free, s; zero of those who hold;
    ``last``: node that each holds or held last; ``placed``: when bricks were in their places, s.
    """

    end: float
    since: tuple[float, ...]
    last: tuple[Any, ...]
    placed: tuple[float, ...]


def _begin_clock(scene: Scene, begin: Site | None) -> _Clock:
    """Return the clock where a build begins, with robots that are free from then on."""
    grips = _begin_step(scene, begin).grips
    stays = begin.stays if begin is not None and begin.stays else (None,) * len(grips)
    last = tuple(s if h is None else h for h, s in zip(grips, stays, strict=True))
    return _Clock(0.0, (0.0,) * len(grips), last, () if begin is None else tuple(begin.placed))


class _Team(NamedTuple):
    """Robots by index, how long they take, and how long steps wait for mortar, where it cures."""

    scene: Scene
    durations: Mapping[int, Durations]
    waits: Waits | None

    def act(
        self, clock: _Clock, step: AnyStep, changes: Mapping[int, Any]
    ) -> tuple[_Clock, StepTime]:
        """Return the clock after a step, and when it happens; never where no wait is enough.

        ``changes``: by robot that acts the node that it takes, None where it lets go.
        """
        taker = next((r for r, node in changes.items() if node is not None), None)
        placing, prepares, ready = step.kind is StepKind.PLACE, None, None
        start, acts = clock.end, max((self.durations[r].release for r in changes), default=0.0)
        since, last = list(clock.since), list(clock.last)
        if taker is not None:
            own, node, prepares = self.durations[taker], changes[taker], clock.since[taker]
            ready = prepares + (own.fetch if placing else own.approach)
            if own.speed is not None and isinstance(last[taker], int) and isinstance(node, int):
                at = self.scene.node_position
                ready += math.dist(at(last[taker]), at(node)) / own.speed
            start, acts = max(start, ready), own.place if placing else own.grip
            since[taker], last[taker] = 0.0, node
        cures, joint = None, ""
        if self.waits is not None:
            start, joint = self.waits(step, clock.placed, start)
            cures = start
        end = start + acts
        for r in changes if taker is None else ():
            since[r] = end
        ages = placing and self.waits is not None  # else nothing depends on them
        placed = (*clock.placed, end) if ages else clock.placed
        time = StepTime(step.number, tuple(changes), prepares, ready, start, end, cures, joint)
        return _Clock(end, tuple(since), tuple(last), placed), time


_NOTHING = -1  # in the place of the number of a grip
May = Callable[[int, Hold], bool]


class _Label(NamedTuple):
    """What one choice of robots comes to.

    ``has``: number of the grip of every robot; ``chosen``: grips by then, with their robots.
    """

    clock: _Clock
    has: tuple[int, ...]
    chosen: tuple[tuple[int, int], ...] = ()


def reassigned_steps(
    scene: Scene,
    steps: Sequence[Step],
    may: May,
    team: Sequence[int] | None = None,
    waits: Waits | None = None,
    begin: Site | None = None,
) -> tuple[Step, ...]:
    """Return the steps with the robot assignment of least makespan.

    ``may``: whether a robot, by its index, may have a grip; ``team``: the robots that take part, by
    default all; ``waits``, ``begin``: as of `step_times`; who holds there goes on. A `StepError`
    says that there is no such choice.
    """
    team = range(len(scene.robots)) if team is None else team
    own = _Team(scene, dict(zip(team, require_durations(scene, team), strict=True)), waits)
    first = _begin_step(scene, begin)
    whole = (first, *steps) if first.held else steps
    every = sorted(holds(scene, whole), key=lambda hold: (hold.first, hold.robot))
    begun = {hold.robot: i for i, hold in enumerate(every) if hold.first == first.number}
    has = tuple(begun.get(r, _NOTHING) for r in range(len(scene.robots)))
    labels = [_Label(_begin_clock(scene, begin), has, tuple((i, r) for r, i in begun.items()))]
    for step in steps:
        found = (after for each in labels for after in _successors(own, each, step, every, may))
        labels = _undominated(found, parks=any(each.speed for each in own.durations.values()))
    if not labels:
        raise StepError("no robot may have a grip of the steps; nobody can be reassigned")
    by = dict(min(labels, key=lambda label: label.clock.end).chosen)
    out = []
    for step in steps:
        lasting = [i for i, hold in enumerate(every) if hold.first <= step.number <= hold.last]
        nodes = {by[i]: every[i].node for i in lasting}
        out.append(replace(step, grips=tuple(map(nodes.get, range(len(scene.robots))))))
    return check_sequence(scene, out, first)


def _successors(
    team: _Team, label: _Label, step: Step, every: Sequence[Hold], may: May
) -> Iterator[_Label]:
    """Yield the labels after a step, one for every robot that may act in it."""
    ended = [i for i, hold in enumerate(every) if hold.last == step.number - 1]
    begun = [i for i, hold in enumerate(every) if hold.first == step.number]
    choices = (
        [({label.has.index(i): None for i in ended}, _NOTHING)]
        if ended
        else [
            ({r: every[i].node}, i)
            for i in begun
            for r in team.durations
            if label.has[r] == _NOTHING and may(r, every[i])
        ]
    )
    for changes, number in choices:
        clock, time = team.act(label.clock, step, changes)
        if time.end < math.inf:
            has = tuple(number if r in changes else i for r, i in enumerate(label.has))
            chosen = () if number == _NOTHING else tuple((number, r) for r in changes)
            yield _Label(clock, has, (*label.chosen, *chosen))


def _undominated(labels: Iterable[_Label], *, parks: bool) -> list[_Label]:
    """Return labels that no other one of the same grips dominates; ``parks``: and last nodes."""
    kept: dict[object, list[tuple[float, ...]]] = {}
    out = list[_Label]()
    clocks = ("end", "since", "placed")
    for label in sorted(labels, key=lambda each: [getattr(each.clock, name) for name in clocks]):
        times = (*label.clock.since, *label.clock.placed)
        own = kept.setdefault((label.has, label.clock.last if parks else None), [])
        if not any(all(a <= b for a, b in zip(each, times, strict=True)) for each in own):
            own.append(times)
            out.append(label)
    return out


def mortar_ages(scene: Scene, done: Sequence[Step], standing: Standing) -> tuple[float, ...]:
    """Return how long mortar has cured when steps have ended, by the bricks that they placed, s."""
    times = step_times(scene, done, mortar_waits(build_network(scene), standing))
    ends = [t.end for t, s in zip(times, done, strict=True) if s.kind is StepKind.PLACE]
    return tuple(times[-1].end - end for end in ends)


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


def have_speeds(scene: Scene) -> bool:
    """Return whether ways of some robot take time of their own."""
    return any(robot.durations and robot.durations.speed for robot in scene.robots)
