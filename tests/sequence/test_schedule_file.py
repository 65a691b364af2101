"""Schedules of one's own, from files."""

from __future__ import annotations

import re
from dataclasses import replace

import pandas as pd
import pytest

from seqopt.errors import FileError, StepError
from seqopt.network.build import build_network
from seqopt.sequence.methods import SCHEDULES, sequential
from seqopt.sequence.schedule_file import (
    find_schedule,
    parse_plan,
    parse_schedule,
    read_plan,
    read_schedule,
    schedule_text,
)
from seqopt.sequence.steps import Step, StepKind
from tests.builders import small_arch
from tests.quality.fuzz_cases import plan_text

HEADER = "step,type,bricks,rob1_node,rob2_node,rob3_node\n"
START = HEADER + "1,place,1,1,,\n2,place,2,1,2,\n"


@pytest.mark.parametrize("name", SCHEDULES)
def test_what_is_written_can_be_read(engine25, name):
    schedule = SCHEDULES[name](engine25.network)
    text = schedule_text(schedule)
    assert parse_schedule(engine25.network, text, "x.csv") == replace(schedule, method="x")
    bare = re.sub(r"\?\d+", "?", text)  # numbers may be left out
    assert parse_schedule(engine25.network, bare, "x.csv") == replace(schedule, method="x")
    assert schedule_text(parse_schedule(engine25.network, bare, "x.csv")) == text


def test_a_move_lasts_until_its_robot_lets_go(arch25):
    text = START + "3,reposition,2,1,2,?\n4,release,2,,2,?\n5,place,3,?,2,?\n6,release,3,?,2,\n"
    schedule = parse_schedule(arch25, text + "7,reposition,3,?,2,?\n", "mine.csv")
    assert schedule.method == "mine"
    assert [step.moves for step in schedule.steps] == [
        (), (), (0,), (0,), (0, 1), (1,), (1, 2)
    ]  # fmt: skip
    assert [(m.robot, m.step, m.candidates) for m in schedule.moves] == [
        ("rob3", 3, (3,)),
        ("rob1", 5, (4,)),
        ("rob3", 7, (1, 3, 4, 5)),
    ]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "schedule s.csv: column step is missing; give step, type"),
        (HEADER, "schedule s.csv: it has no steps; give at least one"),
        (
            HEADER.replace("rob3_node", "rob3_node,rob4_node") + "1,place,1,1,,,\n",
            "column rob4_node: no robot of scene arch25 is called so; give rob1_node",
        ),
        (
            HEADER.replace("rob3_node", "rob3_node,rob1_node") + "1,place,1,1,,,\n",
            "column rob1_node occurs twice",
        ),
        (HEADER + "1,put,1,1,,\n", "line 2: type is 'put'; give one of place"),
        (HEADER + "1,place,1,1,,,5\n", "line 2: it has more cells than there are columns"),
        (START + "3,place,3,1,2,!\n", "line 4: rob3_node is '!'; give a node, \\? for an open"),
        (START + "3,place,3,1,2,99\n", "line 4: step 3: rob3 at node 99: there is no such node"),
        (START + "3,place,3,1,2,1\n", "rob3 at node 1: rob1 holds it; hold another"),
        (START + "3,place,3,1,2,?2\n", "rob3_node is '\\?2', but this is open grip \\?1"),
        (
            START + "3,place,3,1,2,?1\n4,release,3,,2,?1\n5,reposition,3,?1,2,?1\n",
            "line 6: rob1_node is '\\?1', but this is open grip \\?2",
        ),
        (
            START + "3,place,3,1,2,?1\n4,release,3,,2,?2\n",
            "line 5: rob3_node is '\\?2', but this is open grip \\?1: .* let rob3 release first",
        ),
        (
            START + "3,place,3,1,2,?\n4,release,3,,2,4\n",
            "line 5: step 4 .*: rob3 moves from node \\?1 to 4; let it release first",
        ),
        (
            START + "3,release,2,,2,\n4,reposition,2,?,2,?\n",
            "line 5: step 4 .*: it takes grips \\[\\?1, \\?2\\] and drops \\[\\]",
        ),
        (
            START + "3,release,2,,2,\n4,place,3,1,2,\n",
            "line 5: step 4 .*: its new grip is on node 1; hold brick 3 at one of",
        ),
    ],
)
def test_schedule_files_are_checked(arch25, text, named):
    with pytest.raises(StepError, match=named) as caught:
        parse_schedule(arch25, text, "s.csv")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("schedule s.csv")


def test_a_move_to_which_nothing_is_open_is_named(arch25):
    text = HEADER + "1,place,1,1,,\n2,reposition,1,1,?,\n"
    with pytest.raises(
        StepError, match=r"step 2 \(reposition\): no node is open to rob2"
    ) as caught:
        parse_schedule(arch25, text, "s.csv")
    assert str(caught.value).startswith("schedule s.csv: step 2")


def test_schedules_are_found_by_name_file_and_value(engine25, loop25, tmp_path):
    network, path = engine25.network, tmp_path / "own.csv"
    path.write_text(schedule_text(loop25), encoding="utf-8")
    own = replace(loop25, method="own")
    assert read_schedule(network.scene, path) == read_schedule(network, path) == own
    assert find_schedule(network, path) == find_schedule(network, str(path)) == own
    assert find_schedule(network, "three-robot") == find_schedule(network, loop25) == loop25
    named = find_schedule(network, "two-robot", ("rob3", "rob1"))
    assert [move.robot for move in named.moves[:2]] == ["rob3", "rob1"]


def test_what_cannot_be_found_gets_one_line(engine25, loop25, tmp_path):
    network = engine25.network
    with pytest.raises(
        StepError, match=r"schedule 'ring' does not exist; .* three-robot, .*loop, or a CSV file"
    ):
        find_schedule(network, "ring")
    with pytest.raises(FileError, match=r"cannot read .*none.csv"):
        find_schedule(network, tmp_path / "none.csv")
    with pytest.raises(StepError, match="schedule three-robot: it is of scene arch25, not of this"):
        find_schedule(build_network(small_arch(5)), loop25)
    with pytest.raises(StepError, match="robots rob1, rob2: only a schedule by name takes them"):
        find_schedule(network, loop25, ("rob1", "rob2"))


# plans from files


COLUMNS = "step,type,bricks,rob1_brick,rob1_node,rob2_brick,rob2_node,rob3_brick,rob3_node\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "column step is missing"),
        ("step,type,bricks,rob1_node\n1,place,1,1\n", "column rob2_node is missing"),
        (COLUMNS, "no steps"),
        (COLUMNS + "1,put,1,1,1,,,,\n", "line 2: type is 'put'"),
        (COLUMNS + "1,place,1,1,a,,,,\n", "line 2: rob1_node is 'a'"),
        (COLUMNS + "2,place,1,1,1,,,,\n", "step 2 should be 1"),
    ],
)
def test_plan_files_are_checked(arch25, text, named):
    with pytest.raises(StepError, match=named):
        parse_plan(arch25, text, "p.csv")


def test_a_plan_from_a_file(tmp_path, arch25):
    path = tmp_path / "plan.csv"
    path.write_text(COLUMNS + "1,place,1,1,1,,,,\n2,place,2,1,1,2,2,,\n", encoding="utf-8")
    assert read_plan(arch25, path) == (
        Step(1, StepKind.PLACE, 1, (1, None, None)),
        Step(2, StepKind.PLACE, 2, (1, 2, None)),
    )


HEAD = "step,type,bricks,rob1_node,rob2_node,rob3_node\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (HEAD + "1,place,1," + "1" * 131_073 + ",,\n", "not a readable CSV file: field larger"),
        (HEAD.replace("\n", "\r") + "1,place,1,1,,\r", "not a readable CSV file: new-line"),
        (HEAD + "1,place,1," + "1" * 5000 + ",,\n", "rob1_node is '1111"),
        (HEAD.strip() + ",rob1_node\n1,place,1,1,,,4\n", "column rob1_node occurs twice"),
    ],
)
def test_what_is_no_table_of_steps_gets_one_line(arch25, text, named):
    with pytest.raises(StepError, match=named) as caught:
        parse_plan(arch25, text, "plan.csv")
    assert len(str(caught.value)) < 300


def test_a_plan_that_pandas_wrote_again_is_the_same(tmp_path, arch25):
    """Columns with empty cells are floats in pandas: 48 is written as 48.0."""
    steps = sequential(build_network(arch25))
    path = tmp_path / "plan.csv"
    path.write_text(plan_text(arch25, steps), encoding="utf-8")
    pd.read_csv(path).to_csv(path, index=False)
    assert ",1.0," in path.read_text(encoding="utf-8")
    assert read_plan(arch25, path) == tuple(steps)
