"""Who acts in given steps so that the build takes least: exact, by labels over the steps.

Grips, their order and their nodes stay; who of the robots has them is chosen anew. A label is who
has the grips that are held, when the last step ended, and since when every other robot is free.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

from seqopt.errors import StepError
from seqopt.scene.holders._durations import Durations
from seqopt.scene.scene import Scene
from seqopt.sequence._timing import Waits, require_durations, way_seconds
from seqopt.sequence.schedule import Hold, holds
from seqopt.sequence.steps import Step, check_sequence

FREE = -1  # in the place of the number of a grip
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
) -> tuple[Step, ...]:
    """Return the same grips in the same order by those robots with which the build takes least.

    ``may``: whether a robot, by its index, may have a grip; ``team``: the robots that take part, by
    default all; ``waits``: as of `step_times`. A `StepError` says that there is no such choice.
    """
    team = range(len(scene.robots)) if team is None else team
    own = dict(zip(team, require_durations(scene, team), strict=True))
    every = sorted(holds(scene, steps), key=lambda hold: (hold.first, hold.robot))
    count = len(scene.robots)
    moves = any(durations.speed for durations in own.values())
    labels = [_Label(0.0, (0.0,) * count, (FREE,) * count, (None,) * count, None)]
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
                able = [r for r in team if label.has[r] == FREE and may(r, every[i])]
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
    return _with_robots(scene, steps, every, dict(zip(order, chosen[::-1], strict=True)))


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
        since, has = _put(since, r, end), _put(has, r, FREE)
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
) -> tuple[Step, ...]:
    """Return steps with the grips of chosen robots."""
    out = []
    for step in steps:
        grips: list[int | None] = [None] * len(scene.robots)
        for i, hold in enumerate(every):
            if hold.first <= step.number <= hold.last:
                grips[chosen[i]] = hold.node
        out.append(replace(step, grips=tuple(grips)))
    return check_sequence(scene, out)
