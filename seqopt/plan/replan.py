"""Changes of a plan after changes of the build or of its data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from seqopt._registry import offered
from seqopt.errors import SeqoptError, StepError
from seqopt.graph.states.states import States
from seqopt.judge._rule_moves import check_free
from seqopt.judge._schedules import plan_values
from seqopt.plan.plan import Plan
from seqopt.problem.requirements import _carrying_excesses, overloads
from seqopt.responses.table import analyze
from seqopt.scene._armed import check_postures
from seqopt.scene.scene import Scene, in_order
from seqopt.sequence.rules import Payload
from seqopt.sequence.steps import Site, Step, _begin_step


def without(
    scene: Scene, site: Site, lost: Sequence[str] = (), missing: Sequence[int] = ()
) -> tuple[Scene, Site]:
    """Return scene and site without robots that are lost, and without bricks that are missing.

    A lost robot releases its node and is not used again. A missing brick that stood is placed
    again next; a later one waits for all bricks that are not connected through it. Grips on
    missing bricks are released.
    """
    names = [robot.name for robot in scene.robots]
    for name in lost:
        if name not in names:
            raise StepError(f"robot {name} does not exist; give some of {', '.join(names)}")
    for brick in missing:
        if brick not in scene.build_order:
            raise StepError(f"brick {brick} does not exist; name a brick of scene {scene.name}")
    stood, later = scene.build_order[: site.bricks], scene.build_order[site.bricks :]
    stands = tuple(name for name in stood if name not in missing)
    again = tuple(name for name in stood if name in missing)
    last = tuple(name for name in later if name in missing)
    rest = tuple(name for name in later if name not in missing)
    held = tuple(
        None if name in lost or (node and scene.brick_of_node[node].name in again) else node
        for name, node in zip(names, site.holds(scene), strict=True)
    )
    before, after = _while_missing(scene, {*stands, *again}, rest)
    order = (*stands, *again, *before, *last, *after)
    made = scene if order == scene.build_order else in_order(scene, order)
    ages = tuple(a for n, a in zip(stood, site.ages, strict=False) if n not in missing)
    return made, replace(site, bricks=len(stands), grips=held, ages=ages)


def _while_missing(
    scene: Scene, stand: set[int], rest: Sequence[int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return bricks tied to the standing part or the ground, and those that wait."""
    beside: dict[int, set[int]] = {name: set() for name in scene.build_order}
    for first, second in (joint.bricks for joint in scene.joints):
        beside[first].add(second)
        beside[second].add(first)
    grounded = {ground.brick for ground in scene.grounds if ground.closes_with is None}
    placed, waiting = list[int](), list(rest)
    while True:
        tied = next((b for b in waiting if b in grounded or beside[b] & {*stand, *placed}), None)
        if tied is None:
            return tuple(placed), tuple(waiting)
        placed.append(tied)
        waiting.remove(tied)


def goes_on(states: States, steps: Sequence[Step]) -> dict[str, float]:
    """Return the goals' values of steps that continue from the beginning of a problem.

    Raises a `SeqoptError` that names what they break.
    """
    rules = states.free_rules
    scene, kept = states.network.scene, rules.payload is Payload.KEPT
    begun = (_begin_step(scene, rules.begin), *steps)
    if kept and (over := _carrying_excesses(scene, begun)):
        raise StepError(f"payload exceeded: {over[0]}")
    check_free(states.network, rules, steps)
    check_postures(scene, steps)
    if kept and (excess := overloads(scene, analyze(states.engine, steps))):
        raise StepError(f"payload exceeded: {excess[0]}")
    starts: tuple[float, ...] = ()  # s, at the earliest, where steps wait for mortar
    if (waits := offered("mortar_waits")(states.network, states.standing)) is not None:
        starts = tuple(t.start for t in offered("step_times")(scene, steps, waits, rules.begin))
    values = plan_values(states, steps, starts=starts)
    pairs = zip(states.goals, states.names, values, strict=False)
    return {name: goal.shown(value) for goal, name, value in pairs}


def compared(plan: Plan, old: Sequence[Step]) -> dict[str, object]:
    """Return the changes of a new plan: values of the old rest, and the first step that differs.

    ``old``: the steps that were planned from where the new plan begins. Result: ``as_planned``,
    what goals take of them now, or ``broken``, why they cannot go on; ``differs``, the number of
    the first step that is another, None if all are the same; ``steps``, how many there are now, and
    ``steps_before``.
    """
    robots = len(plan.states.network.scene.robots)
    old = [replace(s, grips=(*s.grips, *[None] * (robots - len(s.grips)))) for s in old]
    pairs = zip(plan.steps, old, strict=False)
    first = next((new.number for new, was in pairs if new != was), None)
    if first is None and len(plan.steps) != len(old):
        first = plan.steps[0].number + min(len(plan.steps), len(old))
    out: dict[str, object] = {"as_planned": None, "broken": ""}
    try:
        out["as_planned"] = goes_on(plan.states, old)
    except SeqoptError as error:
        out["broken"] = str(error)
    return out | {"differs": first, "steps": len(plan.steps), "steps_before": len(old)}
