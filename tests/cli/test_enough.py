"""What messages call enough is enough, and what is slightly less is not."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import InfeasibleError, StepError

ARCH = "arch:span=1.2,rise=0.5"


def refusal(make, *given, **options):
    """Return what an error says."""
    with pytest.raises((InfeasibleError, StepError)) as error:
        make(*given, **options)
    return str(error.value)


def said(text, pattern):
    """Return the values that a message names."""
    found = re.findall(pattern, text)
    assert found, text
    return found


@pytest.mark.parametrize("asked", [{}, pytest.param({"stands": "dry"}, marks=pytest.mark.slow)])
def test_a_payload_that_is_enough_for_a_free_schedule(asked):
    def make(payload):
        scene = seqopt.load_scene(ARCH)
        robots = (replace(robot, payload=payload) for robot in scene.robots)
        return seqopt.optimize(scene.with_robots(*robots), "free", aim="steps", **asked)

    (newton,) = said(refusal(make, 20.0), r"a payload of (\d+) N \(--payload \1\)")
    assert make(float(newton)).steps
    refusal(make, float(newton) - 1)
