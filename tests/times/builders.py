"""Builds in time by enumeration: every order of acts by named robots, state after state."""

from __future__ import annotations

import heapq
from functools import cache
from itertools import count

import numpy as np

import seqopt
from seqopt.sequence.rules import FreeRules, with_robots
from seqopt.sequence.steps import StepKind
from tests.brute_force import ONES, allowed, distance
from tests.builders import small_arch
from tests.plain_rules import PlainBook

WORDS = "fetch=30,place=10,approach=10,grip=5,release=5"
SCALES = np.array([scale for _, scale in ONES.limits])
RULES = FreeRules(ending="held")


@cache
def engine_of(bricks, robots, *words):
    """An engine of a small arch with robots that take as long as words say."""
    scene = with_robots(small_arch(bricks), robots).with_durations(WORDS, *words)
    return seqopt.make_engine("compliance", scene)


def worsts(engine, rules):
    """A function that says the worst ratio of a state; infinite where it is not allowed."""

    @cache
    def worst(bricks, grips):
        found = allowed(engine, rules, bricks, grips)
        return np.inf if found is None else float((found / SCALES).max())

    return worst


def least_makespan(engine, rules=RULES, most=np.inf, regrips=None):
    """The least makespan of any plan below a worst ratio, by all orders of named robots.

    Of two ways to the same grips by the same robots one goes on if the other is nowhere later.
    They begin where rules say, with robots that are free from then on.
    """
    scene, book, worst = (
        engine.network.scene,
        PlainBook(engine.network, rules),
        worsts(engine, rules),
    )
    robots, tick = scene.robots, count()
    state, last = begun(scene, rules)
    heap = [(0.0, next(tick), state, (0.0,) * len(robots), last, 0)]
    kept = {}
    while heap:
        end, _, state, since, last, taken = heapq.heappop(heap)
        bricks, grips, regripped = state
        if book.ends(bricks, grips) and bricks and end:
            return end
        key = (end, *since, taken)
        own = kept.setdefault((state, last), [])
        if any(all(a <= b for a, b in zip(other, key, strict=True)) for other in own):
            continue
        own.append(key)
        for kind, after_bricks, after, counted in book.follow(bricks, grips, regripped):
            if worst(after_bricks, after) > most * (1 + 1e-9):
                continue
            more = taken + (kind is StepKind.REPOSITION)
            if regrips is not None and more > regrips:
                continue
            then, free, where = acted(scene, kind, (grips, after), (end, since, last))
            follows = (after_bricks, after, counted if rules.regrips is not None else 0)
            heapq.heappush(heap, (then, next(tick), follows, free, where, more))
    return np.inf


def begun(scene, rules):
    """Bricks, grips and regrips where a build begins, and where robots hold or held last."""
    none = (None,) * len(scene.robots)
    site = rules.begin
    if site is None:
        return (0, none, 0), none
    holds = site.holds(scene)
    speeds = [robot.durations.speed for robot in scene.robots]
    pairs = zip(holds, site.stays or none, speeds, strict=True)
    last = tuple((stay if node is None else node) if speed else None for node, stay, speed in pairs)
    return (site.bricks, holds, site.regrips if rules.regrips is not None else 0), last


def acted(scene, kind, states, label):
    """When a step ends, since when robots are free then, and where they were last."""
    (before, after), (end, since, last) = states, label
    then, since, last = end, list(since), list(last)
    for r, robot in enumerate(scene.robots):
        own = robot.durations
        if before[r] is None and after[r] is not None:
            placing = kind is StepKind.PLACE
            ready = since[r] + (own.fetch if placing else own.approach)
            if own.speed and last[r] is not None:
                ready += distance(scene, last[r], after[r]) / own.speed
            then = max(end, ready) + (own.place if placing else own.grip)
            since[r] = 0.0
            last[r] = after[r] if own.speed else None
    if then == end:
        gone = [r for r in range(len(before)) if before[r] is not None and after[r] is None]
        then = end + max((scene.robots[r].durations.release for r in gone), default=0.0)
        for r in gone:
            since[r] = then
    return then, tuple(since), tuple(last)
