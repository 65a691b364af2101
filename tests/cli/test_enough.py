"""What messages call enough is enough, and what is slightly less is not."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import InfeasibleError, StepError
from seqopt.scene.parts import Side
from seqopt.sequence.methods import _enough_reach

ARCH = "arch:span=1.2,rise=0.5"
CENTERS = ((0.2, -0.5, 0.4), (1.0, -0.5, 0.4), (0.6, 0.5, 0.4))


def reaching(*radii):
    """Return an arch whose robots reach so far."""
    scene = seqopt.load_scene(ARCH)
    each = zip(scene.robots, CENTERS, radii, strict=True)
    robots = [replace(r, reach=seqopt.Sphere(center=c, radius=far)) for r, c, far in each]
    return scene.with_robots(*robots)


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


@pytest.mark.parametrize(
    ("make", "radii"),
    [
        (lambda scene: seqopt.optimize(scene, "free", aim="steps"), [0.75, 0.75, 0.75]),
        (seqopt.three_robot_loop, [0.8, 2.0, 2.0]),
        (seqopt.sequential, [0.55, 0.55, 0.55]),
    ],
    ids=["free", "loop", "sequential"],
)
def test_a_reach_that_is_enough(make, radii):
    text = refusal(make, reaching(*radii))
    names = ("rob1", "rob2", "rob3")
    ways = re.findall(r"a reach of ([\d.]+) m of (rob\d) \([\d.]+ m now\)", text)
    tried = [[float(m) if r == name else far for r, far in zip(names, radii, strict=True)]
             for m, name in ways]  # fmt: skip
    for more in re.findall(r"a reach that is ([\d.]+) m longer of every robot", text):
        tried.append([far + float(more) for far in radii])
    assert tried, text
    for each in tried:
        make(reaching(*each))
        less = [now - 0.001 * (now != was) for now, was in zip(each, radii, strict=True)]
        refusal(make, reaching(*less))


def test_a_reach_to_one_side_moves_by_as_much_as_is_enough():
    scene = seqopt.load_scene(ARCH)
    far = Side(toward=(0.0, 1.0, 0.0), point=(0.0, 0.5, 0.0))
    one = scene.with_robots(replace(scene.robots[0], reach=far), *scene.robots[1:])

    def exists(other):
        return all(other.within_reach(other.robots[0]))

    (text,) = _enough_reach(one, exists)
    (more,) = map(float, said(text, r"rob1 that is ([\d.]+) m longer"))
    for off, holds in ((0.0, True), (-0.001, False)):
        near = replace(far, point=(0.0, 0.5 - more - off, 0.0))
        moved = scene.with_robots(replace(scene.robots[0], reach=near), *scene.robots[1:])
        assert exists(moved) is holds
