"""The table of grips says what the table of responses says, grip by grip."""

from __future__ import annotations

import io

import numpy as np
import pandas as pd
import pytest

from seqopt._files import csv_text
from seqopt.plan.solve import solve
from seqopt.workflow import optimize


@pytest.fixture(scope="module")
def plans(problem25):
    return [solve(problem25, "overlap_dp"), optimize("wall:columns=3,courses=3", "free")]


def require_same(grips, table):
    """Require that grips are those of a table of responses, cell by cell."""
    count = 0
    for row in grips.to_dict("records"):
        own = table[(table["step"] >= row["from_step"]) & (table["step"] <= row["to_step"])]
        robot = row["robot"]
        assert (own[f"{robot}_node"] == row["node"]).all()
        assert (own[f"{robot}_brick"] == row["brick"]).all()
        forces = own.set_index("step")[f"F_{robot}_N"]
        largest = pytest.approx(row["largest_force_N"], rel=1e-5)  # the file has six digits
        assert forces.max() == forces[row["at_step"]] == largest
        assert row["places"] == (own["type"].iloc[0] == "place")
        count += len(own)
    nodes = [name for name in table if name.endswith("_node")]
    assert count == int(table[nodes].notna().to_numpy().sum())


def test_grips_are_those_of_the_plans_csv(plans):
    for plan in plans:
        table = pd.read_csv(io.StringIO(csv_text(plan.responses())))
        require_same(plan.grips(), table)


def test_another_force_is_seen(plans):
    grips = plans[0].grips()
    grips.loc[3, "largest_force_N"] += 0.1
    with pytest.raises(AssertionError):
        require_same(grips, plans[0].responses())


def test_the_table_of_a_plan_names_robot_steps_brick_and_node(plans):
    plan, free = plans
    moves = plan.table()
    held = plan.grips().merge(
        moves, left_on=["robot", "from_step"], right_on=["robot", "step"], suffixes=("", "_move")
    )
    assert len(held) == len(moves)
    for column in ("to_step", "brick", "node", "largest_force_N"):
        np.testing.assert_allclose(held[column], held[f"{column}_move"], 1e-9, err_msg=column)
    pd.testing.assert_frame_equal(free.table(), free.grips(), rtol=1e-9)
