"""Builds in time by enumeration: every order of acts by named robots, state after state."""

import heapq
from dataclasses import replace
from functools import cache
from itertools import count

import numpy as np

import seqopt
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import EPOXY
from seqopt.judge._schedules import judge_schedule
from seqopt.scene.scene import with_robots
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.steps import StepKind
from seqopt.stability.assessment import verdict
from seqopt.stability.verdict import Verdict
from seqopt.times._curing_law import find_curing
from tests.brute_force import ONES, allowed, distance
from tests.builders import small_arch
from tests.plain_rules import PlainBook

WORDS = "fetch=30,place=10,approach=10,grip=5,release=5"
SLOW = "rob3:fetch=75,place=25,approach=25,grip=12.5,release=12.5"  # than others
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


# builds whose mortar cures by enumeration: every order of acts, and every wait on a grid
def stands_with(network, mortar=EPOXY):
    """A function that says by the cone program alone whether a state stands with some bonds."""

    @cache
    def stands(bricks, grips, bond):
        assembly = step_assembly(network, bricks, grips).with_bond(np.array(bond))
        return verdict(assembly, mortar) is Verdict.STANDS

    return stands


def bonds(network, curing, bricks, placed, now):
    """The share of bond of every joint of a state, from when its bricks were placed."""
    names = step_assembly(network, bricks, (None,) * len(network.scene.robots)).contact_name
    which = {str(brick.name): i for i, brick in enumerate(network.scene.placed)}
    out = []
    for name in names:
        ends = [which[part] for part in name.split("-") if part != "ground"]
        age = now - max(placed[i] if i < len(placed) else now for i in ends)
        points = curing.points
        out.append(max((share for at, share in points if at <= age + 1e-9), default=0.0))
    return tuple(out)


def least_cured_makespan(engine, rules, words, most=np.inf):
    """The least makespan of any plan, each step at any time at which some joint gets stronger.

    Nothing is taken for granted of waits: a step is tried at its earliest time and at all later
    ones of the grid, as far as builds that end by a time could do it. Infinite where none does.
    """
    book, tick = PlainBook(engine.network, rules), count()
    worst, stands = worsts(engine, rules), stands_with(engine.network)
    curing, none = find_curing(words), (None,) * len(engine.network.scene.robots)
    (first, grips, _), _ = begun(engine.network.scene, rules)
    ages = () if rules.begin is None else rules.begin.ages
    placed = (*(-age for age in ages), *[0.0] * (first - len(ages)))
    heap, seen = [(0.0, next(tick), (first, grips), (0.0,) * len(none), placed)], set()
    while heap:
        end, _, (bricks, grips), since, placed = heapq.heappop(heap)
        if book.ends(bricks, grips) and bricks and end:
            return end
        key = (bricks, grips, round(end, 6), tuple(np.round(since, 6)), tuple(np.round(placed, 6)))
        if key in seen:
            continue
        seen.add(key)
        for kind, after_bricks, after, _ in book.follow(bricks, grips, 0):
            if np.isinf(worst(after_bricks, after)):
                continue
            follows = at_all_times(
                engine.network, curing, (kind, grips, after), (end, since, placed)
            )
            for now, then, free, put in follows:
                bond = bonds(engine.network, curing, after_bricks, placed, now)
                if then <= most and stands(after_bricks, after, bond):
                    heapq.heappush(heap, (then, next(tick), (after_bricks, after), free, put))
    return np.inf


def at_all_times(network, curing, step, label):
    """What follows from a label by a step, started at its earliest time or when joints change."""
    (kind, grips, after), (end, since, placed) = step, label
    begin, acts, gone = started(network.scene, kind, (grips, after), (end, since))
    ages = {age for age, _ in curing.points}
    for now in sorted({begin, *(t + age for t in placed for age in ages if t + age > begin)}):
        then = now + acts
        free = tuple(
            0.0 if after[r] is not None else then if r in gone else since[r]
            for r in range(len(after))
        )
        yield now, then, free, (*placed, then) if kind is StepKind.PLACE else placed


def started(scene, kind, states, label):
    """When a step may start, how long it takes, and who lets go."""
    (before, after), (end, since) = states, label
    placing = kind is StepKind.PLACE
    for r, robot in enumerate(scene.robots):
        if before[r] is None and after[r] is not None:
            own = robot.durations
            ready = since[r] + (own.fetch if placing else own.approach)
            return max(end, ready), own.place if placing else own.grip, ()
    gone = [r for r in range(len(before)) if before[r] is not None and after[r] is None]
    return end, max((scene.robots[r].durations.release for r in gone), default=0.0), gone


def judged(plan, **changes):
    return judge_schedule(replace(plan.graph), replace(plan.selection, **changes), plan.steps)
