"""Verdicts of steps apart from their margins: what is asked for is found, nothing else changes."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, EPOXY
from seqopt.errors import ProblemError, SceneError, SceneWarning
from seqopt.stability import assess
from seqopt.stability._steps import assess_steps, each_stability, stability_row
from seqopt.stability.assessment import MARGINS
from tests.builders import six_bricks

NUMBERS = {"bond": "bond", "friction": "friction", "tilt": "tilt", "payload": "grip"}


@pytest.fixture(scope="module")
def network():
    return seqopt.build_network(seqopt.load_scene("arch25"))


@pytest.fixture(scope="module")
def steps(network):
    return seqopt.cantilever(network)[24:28]


@pytest.fixture(scope="module")
def wholes(network, steps):
    """What is known of every step, with all margins."""
    return [assess(step_assembly(network, step.bricks, step.grips), DRY) for step in steps]


@pytest.mark.xdist_group("steps with all margins")  # which are found once
@pytest.mark.parametrize("margin", MARGINS)
def test_a_margin_is_found_alone_as_with_all_others(network, steps, wholes, margin):
    for whole, found in zip(wholes, assess_steps(network, steps, DRY, [margin]), strict=True):
        assert found.verdict is whole.verdict
        for name, number in NUMBERS.items():
            own, other = getattr(found, number), getattr(whole, number)
            if name == margin:
                assert own == pytest.approx(other, rel=2e-3, abs=1e-6, nan_ok=True)
            else:
                assert np.isnan(own)


def test_bricks_that_interpenetrate_are_warned_of_once(recwarn):
    """Bricks 1 and 3 of a wall, without a joint of theirs: every step stood without a word."""
    wall = seqopt.load_scene("wall:columns=3,courses=1")
    (x, y, z), *_ = (brick.position for brick in wall.bricks[2:])
    moved = replace(wall.bricks[2], position=(x - 0.25, y, z))
    joints = tuple(joint for joint in wall.joints if 3 not in joint.bricks)
    ends = tuple(
        replace(
            end,
            position=tuple(np.subtract(end.position, (0.25, 0, 0))),
            anchor=tuple(np.subtract(end.anchor, (0.25, 0, 0))),
        )
        if end.brick == 3
        else end
        for end in wall.grounds
    )
    sunk = replace(wall, bricks=(*wall.bricks[:2], moved), joints=joints, grounds=ends)
    network = seqopt.build_network(sunk)
    with pytest.warns(SceneWarning, match="bricks 1 and 3 interpenetrate by 50 mm"):
        found = assess_steps(network, seqopt.sequential(network)[:1], DRY)
    assert len(found) == 1
    recwarn.clear()
    assess_steps(network, seqopt.sequential(network)[1:2], DRY)
    assess_steps(wall, seqopt.sequential(wall)[:1], DRY)
    assert not recwarn.list


@pytest.mark.slow
def test_shared_steps_have_the_same_rows(network):
    steps = seqopt.sequential(network)[:20]
    alone = [*each_stability(network, steps, EPOXY)]
    shared = assess_steps(network, steps, EPOXY, workers=2)
    with ThreadPoolExecutor(2) as threads:
        given = assess_steps(network, steps, EPOXY, workers=threads)
    verdicts = [[found.verdict for found in each] for each in (alone, shared, given)]
    assert verdicts[0] == verdicts[1] == verdicts[2]
    rows = [stability_row(*pair) for pair in zip(steps, shared, strict=True)]
    assert [row["step"] for row in rows] == [step.number for step in steps]


def test_no_steps_and_no_such_margin():
    network = seqopt.build_network(six_bricks())
    assert assess_steps(network, (), DRY) == ()
    assert [*each_stability(network, (), DRY, shared=(None, 2))] == []
    with pytest.raises(SceneError, match=r"margin 'tillt' \(did you mean tilt\?\): give all"):
        assess_steps(network, (), DRY, ["tillt"])


@pytest.mark.parametrize("workers", [0, "two", None])
def test_workers_that_cannot_be(network, workers):
    with pytest.raises(ProblemError, match=f"workers is {workers!r}; give a whole number from 1"):
        assess_steps(network, (), DRY, workers=workers)


def test_a_step_that_touches_nothing_is_not_called_standing(network, steps):
    """The control: verdicts follow the step, and not the ones before it."""
    bare = [replace(step, grips=(None,) * 3) for step in steps]
    found = assess_steps(network, [*steps[:2], *bare], DRY)
    assert {each.verdict for each in found[2:]} == {seqopt.stability.Verdict.FALLS}
