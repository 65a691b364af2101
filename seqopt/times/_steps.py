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

Given steps may also be shared out anew among robots, exactly, by labels over the steps: grips,
their order and their nodes stay. A label is who has the grips that are held, when the last step
ended, and since when every other robot is free.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeVar

from seqopt.errors import StepError
from seqopt.scene._durations import Durations
from seqopt.scene.scene import Scene
from seqopt.sequence._durations import require_durations
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.site import Site, _begin_step
from seqopt.sequence.steps import AnyStep, Grips, Step, StepKind, check_sequence
from seqopt.times._curing import Waits


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
    robots = range(len(scene.robots))
    before: Sequence[object] = _begin_step(scene, begin).grips
    busy = [r for r in robots if any(g[r] is not None for g in (before, *(s.grips for s in steps)))]
    durations = dict(zip(busy, require_durations(scene, busy), strict=True))
    free, last = dict.fromkeys(busy, 0.0), dict[int, object](enumerate(_lasts(scene, begin)))
    now, out, placed = 0.0, list[StepTime](), [] if begin is None else begin.placed
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
        out.append(StepTime(step.number, acting, prepares, ready, start, now, cures, joint))
        placed += [now] * placing
        if taker is None:
            free |= dict.fromkeys(acting, now)
        before = step.grips
    return tuple(out)


def _lasts(scene: Scene, begin: Site | None) -> Grips:
    """Return the node that every robot holds, or held last, where a build begins."""
    holds = _begin_step(scene, begin).grips
    stays = begin.stays if begin is not None and begin.stays else (None,) * len(holds)
    return tuple(s if h is None else h for h, s in zip(holds, stays, strict=True))


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


_NOTHING = -1  # in the place of the number of a grip
_Part = TypeVar("_Part")
May = Callable[[int, Hold], bool]


class _Label(NamedTuple):
    """What one choice of robots comes to.

    ``end``: of the last step, s; ``since``: since when robots are free, s; of those who hold zero;
    ``has``: number of the grip of every robot; ``last``: node that each held last; ``chosen``: the
    robots of all grips by then, the last one first; ``placed``: where mortar cures, when bricks
    were in their places, s.
    """

    end: float
    since: tuple[float, ...]
    has: tuple[int, ...]
    last: tuple[int | None, ...]
    chosen: tuple[int, Any] | None  # a robot, and what was chosen before it
    placed: tuple[float, ...] = ()


def reassigned_steps(
    scene: Scene,
    steps: Sequence[Step],
    may: May,
    team: Sequence[int] | None = None,
    waits: Waits | None = None,
    begin: Site | None = None,
) -> tuple[Step, ...]:
    """Return the same grips in the same order by those robots with which the build takes least.

    ``may``: whether a robot, by its index, may have a grip; ``team``: the robots that take part, by
    default all; ``waits``, ``begin``: as of `step_times`; who holds there goes on. A `StepError`
    says that there is no such choice.
    """
    team = range(len(scene.robots)) if team is None else team
    own = dict(zip(team, require_durations(scene, team), strict=True))
    at_first = _begin_step(scene, begin)
    whole = (at_first, *steps) if at_first.held else steps
    every = sorted(holds(scene, whole), key=lambda hold: (hold.first, hold.robot))
    moves = any(durations.speed for durations in own.values())
    labels = [_first_label(scene, every, begin)]
    for step in steps:
        ended = [i for i, hold in enumerate(every) if hold.last == step.number - 1]
        begun = [i for i, hold in enumerate(every) if hold.first == step.number]
        found = list[_Label]()
        for label in labels:
            if ended:
                ready = _cured(label, step, label.end, waits)
                if ready.end < math.inf:
                    found.append(_let_go(ready, [label.has.index(i) for i in ended], own))
                continue
            for i in begun:
                able = [r for r in team if label.has[r] == _NOTHING and may(r, every[i])]
                after = [_take(scene, label, (r, i, every[i]), own[r], (step, waits)) for r in able]
                found += [each for each in after if each.end < math.inf]
        labels = _undominated(found, moves=moves)
    if not labels:
        raise StepError("no robot may have a grip of the steps; nobody can be reassigned")
    chosen, link = list[int](), min(labels, key=lambda label: label.end).chosen
    while link is not None:
        chosen.append(link[0])
        link = link[1]
    order = [i for step in steps for i, hold in enumerate(every) if hold.first == step.number]
    by = {i: hold.robot for i, hold in enumerate(every) if hold.first == at_first.number}
    by |= dict(zip(order, chosen[::-1], strict=True))
    return check_sequence(scene, _with_robots(scene, steps, every, by), at_first)


def _first_label(scene: Scene, every: Sequence[Hold], begin: Site | None) -> _Label:
    """Return what it comes to before the first step: who holds there, and when bricks came."""
    none, number = (0.0,) * len(scene.robots), _begin_step(scene, begin).number
    has = [_NOTHING] * len(none)
    for i, hold in enumerate(every):
        if hold.first == number:
            has[hold.robot] = i
    placed = () if begin is None else tuple(begin.placed)
    return _Label(0.0, none, tuple(has), _lasts(scene, begin), None, placed)


def _cured(label: _Label, step: Step, start: float, waits: Waits | None) -> _Label:
    """Return a label that ends no sooner than a time, and than mortar lets a step be done."""
    return label._replace(end=start if waits is None else waits(step, label.placed, start)[0])


def _take(
    scene: Scene,
    label: _Label,
    which: tuple[int, int, Hold],
    own: Durations,
    asked: tuple[Step, Waits | None],
) -> _Label:
    """Return what follows where a robot takes a grip in a step."""
    robot, number, hold = which
    placing = hold.places is not None
    ready = label.since[robot] + (own.fetch if placing else own.approach)
    ready += way_seconds(scene, own, label.last[robot], hold.node)
    step, waits = asked
    start = _cured(label, step, max(label.end, ready), waits).end
    end = start + (own.place if placing else own.grip)
    return _Label(
        end,
        _put(label.since, robot, 0.0),
        _put(label.has, robot, number),
        _put(label.last, robot, hold.node),
        (robot, label.chosen),
        label.placed if waits is None or not placing else (*label.placed, end),
    )


def _let_go(label: _Label, robots: Sequence[int], own: Mapping[int, Durations]) -> _Label:
    """Return what follows where robots let go, all at once."""
    end = label.end + max(own[r].release for r in robots)
    since, has = label.since, label.has
    for r in robots:
        since, has = _put(since, r, end), _put(has, r, _NOTHING)
    return label._replace(end=end, since=since, has=has)


def _put(values: tuple[_Part, ...], place: int, value: _Part) -> tuple[_Part, ...]:
    return (*values[:place], value, *values[place + 1 :])


def _undominated(labels: Sequence[_Label], *, moves: bool) -> list[_Label]:
    """Return the labels that no other one of the same grips is nowhere above."""
    kept: dict[object, list[_Label]] = {}
    for label in sorted(labels, key=lambda each: (each.end, each.since, each.placed)):
        own = kept.setdefault((label.has, label.last if moves else None), [])
        if not any(_nowhere_above(other, label) for other in own):
            own.append(label)
    return [label for own in kept.values() for label in own]


def _nowhere_above(first: _Label, second: _Label) -> bool:
    pairs = zip((*first.since, *first.placed), (*second.since, *second.placed), strict=True)
    return all(a <= b for a, b in pairs)


def _with_robots(
    scene: Scene, steps: Sequence[Step], every: Sequence[Hold], chosen: dict[int, int]
) -> list[Step]:
    out = []
    for step in steps:
        grips: list[int | None] = [None] * len(scene.robots)
        for i, hold in enumerate(every):
            if hold.first <= step.number <= hold.last:
                grips[chosen[i]] = hold.node
        out.append(replace(step, grips=tuple(grips)))
    return out
