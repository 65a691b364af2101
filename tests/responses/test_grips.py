"""The table of grips says what the table of responses says, grip by grip."""

from __future__ import annotations

import io

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
        require_same(plan.table(), table)


def test_another_force_is_seen(plans):
    grips = plans[0].table()
    grips.loc[3, "largest_force_N"] += 0.1
    with pytest.raises(AssertionError):
        require_same(grips, plans[0].responses())


def test_the_table_of_a_plan_has_the_node_that_was_chosen_for_every_move(plans):
    plan, _ = plans
    rows = plan.table().set_index(["robot", "from_step"])
    for move, node in zip(plan.decisions.schedule.moves, plan.nodes, strict=True):
        assert rows.loc[(move.robot, move.step), "node"] == node
