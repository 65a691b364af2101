"""Methods on other arches, impossible steps."""

from __future__ import annotations

from dataclasses import replace

import pytest

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Robot, Sphere
from seqopt.sequence.methods import cantilever, lies_along, sequential
from seqopt.sequence.steps import StepKind, check_sequence
from seqopt.study.published import published_plan


def test_where_all_bricks_lie_along_the_methods_are_one():
    net = build_network(arch_scene(ArchShape(pitch=[1.0, 0.6, 0.2, -0.2], pattern="V")))
    assert lies_along(net) == {1, 2, 3, 4}
    assert sequential(net) == cantilever(net)


def test_methods_say_what_they_lack(arch25):
    with pytest.raises(StepError, match="1 robots; this method needs two"):
        sequential(build_network(replace(arch25, robots=arch25.robots[:1])))
    near = Sphere(center=(0.0, 0.0, 0.0), radius=0.5)
    short = tuple(Robot(name=f"rob{i}", payload=300.0, reach=near) for i in (1, 2))
    with pytest.raises(StepError, match="brick 4: rob1 and rob2 reach none of its free nodes"):
        sequential(build_network(replace(arch25, robots=short)))


def edited(plan, number, **changes):
    return [replace(s, **changes) if s.number == number else s for s in plan]


@pytest.mark.parametrize(
    ("number", "changes", "named"),
    [
        (4, {"grips": (None, 2)}, "step 4: 2 grips for 3 robots"),
        (4, {"bricks": 0}, "step 4: 0 bricks"),
        (4, {"grips": (None, 2, 99)}, "step 4: rob3 at node 99: there is no such node"),
        (4, {"grips": (None, 2, 9)}, "step 4: rob3 at node 9: brick 5 is not placed yet"),
        (4, {"grips": (None, 2, 2)}, "step 4: rob3 at node 2: rob2 holds it"),
        (9, {"grips": (7, 8, None)}, "step 9: rob2 at node 8: the node is out of its reach"),
        (4, {"grips": (1, 2, 4)}, r"step 4 \(release\): it takes grips \[\] and drops \[\]"),
        (4, {"grips": (None, 1, 4)}, "step 4 .*: rob2 moves from node 2 to 1"),
        (4, {"kind": StepKind.PLACE}, r"step 4 \(place\): 3 bricks after 3; give 4"),
        (5, {"grips": (1, 2, 4)}, r"step 5 \(place\): its new grip is on node 1; hold brick 4"),
    ],
)
def test_impossible_steps(arch25, number, changes, named):
    with pytest.raises(StepError, match=named) as caught:
        check_sequence(arch25, edited(published_plan(arch25), number, **changes))
    assert "\n" not in str(caught.value)
