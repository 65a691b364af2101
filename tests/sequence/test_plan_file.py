"""Plans from files."""

from __future__ import annotations

import pandas as pd
import pytest

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.sequence.methods import sequential
from seqopt.sequence.schedule_file import parse_plan, read_plan
from seqopt.sequence.steps import Step, StepKind
from tests.quality.fuzz_cases import plan_text

HEADER = "step,type,bricks,rob1_brick,rob1_node,rob2_brick,rob2_node,rob3_brick,rob3_node\n"


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "column step is missing"),
        ("step,type,bricks,rob1_node\n1,place,1,1\n", "column rob2_node is missing"),
        (HEADER, "no steps"),
        (HEADER + "1,put,1,1,1,,,,\n", "line 2: type is 'put'"),
        (HEADER + "1,place,1,1,a,,,,\n", "line 2: rob1_node is 'a'"),
        (HEADER + "1,place,1,2,1,,,,\n", "rob1 holds node 1 of brick 2; it is on brick 1"),
        (HEADER + "2,place,1,1,1,,,,\n", "step 2 should be 1"),
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
