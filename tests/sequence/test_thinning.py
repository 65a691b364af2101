"""Fewer candidates: those near the newest bricks, never none, and the schedule says so."""

from __future__ import annotations

import math

import pytest

from seqopt.errors import StepError
from seqopt.sequence.methods import SCHEDULES, three_robot_loop
from seqopt.sequence.schedule import thin
from tests.builders import from_both_sides


@pytest.mark.parametrize("method", SCHEDULES)
def test_on_a_chain_joints_are_counted(arch25, method):
    schedule = SCHEDULES[method](arch25)
    thinned = thin(schedule, "near:4")
    place = {brick.name: i for i, brick in enumerate(arch25.placed)}
    for few, whole in zip(thinned.moves, schedule.moves, strict=True):
        newest = range(max(0, whole.bricks - 2), whole.bricks)
        away = {
            node: min(abs(place[arch25.brick_of_node[node].name] - end) for end in newest)
            for node in whole.candidates
        }
        limit = max(4, min(away.values()))
        assert few.candidates == tuple(n for n in whole.candidates if away[n] <= limit)
    assert thinned.steps == schedule.steps


def test_meters_are_measured_from_both_ends_of_a_build():
    scene = from_both_sides(9)
    schedule = three_robot_loop(scene)
    thinned = thin(schedule, "within:0.2")
    for few, whole in zip(thinned.moves, schedule.moves, strict=True):
        ends = [brick.position for brick in scene.placed[: whole.bricks][-2:]]
        away = {
            n: min(math.dist(scene.node_position(n), e) for e in ends) for n in whole.candidates
        }
        limit = max(0.2, min(away.values()))
        assert few.candidates == tuple(n for n in whole.candidates if away[n] <= limit)


@pytest.mark.parametrize("rule", ["near:", "near:-1", "far:3", 3])
def test_what_is_no_rule_is_refused(loop25, rule):
    with pytest.raises(StepError, match="give near:JOINTS or within:METERS"):
        thin(loop25, rule)
