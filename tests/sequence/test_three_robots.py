"""The three-robot loop and the modified sequential method as schedules."""

from __future__ import annotations

from dataclasses import replace

import pytest

from seqopt.errors import StepError
from seqopt.sequence.methods import modified_sequential, sequential
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import StepKind
from seqopt.study.published import printed


def test_who_moves_when(loop25):
    """Table B.1: 22 moves, at step 3 and every fourth after it, by robots 3, 2, 1 in turn."""
    assert [m.step for m in loop25.moves] == list(range(3, 88, 4))
    assert [m.robot for m in loop25.moves] == [f"rob{3 - k % 3}" for k in range(22)]
    printed_robots = printed("three_robot_plan").set_index("step")["optimized_robot"]
    for step in loop25.steps[2:]:
        named = {f"rob{number}" for number in str(printed_robots[step.number]).split(";")}
        assert {loop25.moves[m].robot for m in step.moves} == named


def test_the_modified_sequential_method(engine25):
    """A third support for three steps; without it the sequential method is left."""
    schedule = modified_sequential(engine25.network)
    assert len(schedule.moves) == 23
    for k in range(len(schedule.moves)):
        kinds = [s.kind for s in schedule.steps if k in s.moves]
        assert kinds == [StepKind.REPOSITION, StepKind.RELEASE, StepKind.PLACE]
    plain = [(s.bricks, s.grips[:2]) for s in sequential(engine25.network)]
    bare = [(s.bricks, s.grips[:2]) for s in schedule.steps if s.kind is not StepKind.REPOSITION]
    assert [b for i, b in enumerate(bare) if i == 0 or b != bare[i - 1]] == plain
    nodes = [m.candidates[0] for m in schedule.moves]
    assert len(schedule.fill(nodes)) == len(schedule.steps)


def test_schedules_are_checked(loop25):
    with pytest.raises(StepError, match="3 nodes for 22 moves"):
        loop25.fill((1, 2, 3))
    far = replace(loop25.steps[0], grips=(OpenGrip(0), OpenGrip(5), None))
    with pytest.raises(StepError, match="at most two neighboring"):
        Schedule("x", loop25.scene, (far,), loop25.moves).require_pairs()
