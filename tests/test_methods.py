"""Methods and plans: the published sequences, other arches, impossible steps."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest
from hypothesis import given

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Robot
from seqopt.scene.reach import Side, Sphere
from seqopt.sequence.plan_file import parse_plan, read_plan
from seqopt.sequence.steps import Step, StepKind, check_sequence
from seqopt.sequence.two_robots import METHODS, cantilever, lies_along, sequential
from seqopt.study.published import published_plan
from seqopt.study.tables import printed_steps
from tests.scenes import arches

GRIPS = [f"rob{i}_node" for i in (1, 2, 3)]


@pytest.mark.parametrize("method", METHODS)
def test_the_published_sequences(engine25, method):
    """Tables A.1 and A.2: type, brick count and grips of all 49 steps."""
    steps = METHODS[method](engine25.network)
    table = printed_steps(method)
    assert [s.kind.value for s in steps] == table["type"].tolist()
    assert [s.bricks for s in steps] == table["bricks"].tolist()
    wanted = [tuple(None if pd.isna(n) else int(n) for n in row) for row in table[GRIPS].to_numpy()]
    assert [s.grips for s in steps] == wanted


def test_the_published_plan(arch25):
    steps = published_plan(arch25)
    assert len(steps) == 90
    assert steps[-1].bricks == 25
    assert all(len(s.held) >= 2 for s in steps[1:])  # criterion 1 of section 5: no twisting
    newest = [arch25.placed[s.bricks - 1].nodes for s in steps]
    assert all(set(s.held) & set(nodes) for s, nodes in zip(steps, newest, strict=True))


def far_reaching(scene):
    """The scene with robots on their sides that reach across whatever the arch does."""
    robots = tuple(
        replace(r, reach=replace(r.reach, point=tuple(-10 * c for c in r.reach.toward)))
        if isinstance(r.reach, Side)
        else r
        for r in scene.robots
    )
    return replace(scene, robots=robots)


@pytest.mark.parametrize("method", METHODS)
@given(scene=arches().map(far_reaching))
def test_any_arch_can_be_built(method, scene):
    steps = METHODS[method](build_network(scene))
    assert [s.bricks for s in steps if s.kind is StepKind.PLACE] == [
        *range(1, len(scene.bricks) + 1)
    ]
    assert steps[-1].held == ()
    assert all(s.held for s in steps[:-1])


@given(scene=arches().map(far_reaching))
def test_the_sequential_method_holds_the_newest_brick(scene):
    for step in sequential(build_network(scene))[:-1]:
        assert set(step.held) & set(scene.placed[step.bricks - 1].nodes)


def test_where_all_bricks_lie_along_the_methods_are_one():
    net = build_network(arch_scene(ArchShape(pitch=[1.0, 0.6, 0.2, -0.2], pattern="V")))
    assert lies_along(net) == {1, 2, 3, 4}
    assert sequential(net) == cantilever(net)


def test_methods_say_what_they_lack(arch25):
    with pytest.raises(StepError, match="1 robots; this method needs two"):
        sequential(build_network(replace(arch25, robots=arch25.robots[:1])))
    near = Sphere(center=(0.0, 0.0, 0.0), radius=0.5)
    short = tuple(Robot(name=f"rob{i}", payload=300.0, reach=near) for i in (1, 2))
    with pytest.raises(StepError, match="brick 4: rob2 reaches none of its free nodes"):
        sequential(build_network(replace(arch25, robots=short)))


def edited(plan, number, **changes):
    return [replace(s, **changes) if s.number == number else s for s in plan]


@pytest.mark.parametrize(
    ("number", "changes", "named"),
    [
        (4, {"grips": (None, 2)}, "step 4: 2 grips for 3 robots"),
        (4, {"bricks": 0}, "step 4: 0 bricks"),
        (4, {"bricks": 26}, "step 4: 26 bricks"),
        (4, {"grips": (None, 2, 99)}, "step 4: rob3 at node 99: there is no such node"),
        (4, {"grips": (None, 2, 0)}, "step 4: rob3 at node 0: the node is blocked"),
        (4, {"grips": (None, 2, 9)}, "step 4: rob3 at node 9: brick 5 is not placed yet"),
        (4, {"grips": (None, 2, 2)}, "step 4: rob3 at node 2: rob2 holds it"),
        (9, {"grips": (7, 8, None)}, "step 9: rob2 at node 8: the node is out of its reach"),
        (4, {"grips": (1, 2, 4)}, r"step 4 \(release\): it takes grips \[\] and drops \[\]"),
        (4, {"grips": (None, 1, 4)}, "step 4 .*: rob2 goes from node 2 to 1"),
        (4, {"kind": StepKind.PLACE}, r"step 4 \(place\): 3 bricks after 3; give 4"),
        (5, {"kind": StepKind.RELEASE}, r"step 5 \(release\): 4 bricks after 3; give 3"),
        (5, {"grips": (1, 2, 4)}, r"step 5 \(place\): its new grip is on node 1; hold brick 4"),
        (7, {"kind": StepKind.RELEASE}, r"step 7 \(release\): it takes grips"),
    ],
)
def test_impossible_steps(arch25, number, changes, named):
    with pytest.raises(StepError, match=named) as caught:
        check_sequence(arch25, edited(published_plan(arch25), number, **changes))
    assert "\n" not in str(caught.value)


def test_an_empty_sequence_is_refused(arch25):
    with pytest.raises(StepError, match="no steps"):
        check_sequence(arch25, [])


HEADER = "step,type,bricks,rob1_brick,rob1_node,rob2_brick,rob2_node,rob3_brick,rob3_node\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "column step is missing"),
        ("step,type,bricks,rob1_node\n1,place,1,1\n", "column rob2_node is missing"),
        (HEADER, "no steps"),
        (HEADER + "1,put,1,1,1,,,,\n", "line 2: type is 'put'"),
        (HEADER + "1,place,one,1,1,,,,\n", "line 2: bricks is 'one'"),
        (HEADER + "1,place,1,1,a,,,,\n", "line 2: rob1_node is 'a'"),
        (HEADER + "1,place,1,2,1,,,,\n", "rob1 holds node 1 of brick 2; it is on brick 1"),
        (HEADER + "2,place,1,1,1,,,,\n", "step 2 stands where 1 should"),
        (HEADER + "1,place\n", "line 2: bricks is ''"),
    ],
)
def test_plan_files_are_checked(arch25, text, named):
    with pytest.raises(StepError, match=named):
        parse_plan(arch25, text, "p.csv")


def test_a_plan_from_a_file(tmp_path, arch25):
    path = tmp_path / "plan.csv"
    path.write_text(HEADER + "1,place,1,1,1,,,,\n2,place,2,1,1,2,2,,\n", encoding="utf-8")
    assert read_plan(arch25, path) == (
        Step(1, StepKind.PLACE, 1, (1, None, None)),
        Step(2, StepKind.PLACE, 2, (1, 2, None)),
    )
