"""Fewer candidates: those near the newest bricks, never none, and the schedule says so."""

from __future__ import annotations

import pytest

from seqopt.errors import StepError
from seqopt.sequence.methods import SCHEDULES
from seqopt.sequence.schedule import thin


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


@pytest.mark.parametrize("rule", ["near:", "near:-1", "far:3", 3])
def test_what_is_no_rule_is_refused(loop25, rule):
    with pytest.raises(StepError, match="give near:JOINTS or within:METERS"):
        thin(loop25, rule)
