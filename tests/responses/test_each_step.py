"""Steps that are solved together have the fields and errors of each on its own."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from seqopt._files import csv_text
from seqopt.engines.interface import FLAGS, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, ProblemError
from seqopt.graph.decisions import pose_decisions
from seqopt.plan.solve import solve
from seqopt.problem.criteria import RankSum, equal
from seqopt.responses import _blocks as batches
from seqopt.responses._choices import CHOICE_RESPONSES, Evaluation
from seqopt.responses.quantities import responses_of
from seqopt.responses.table import _each_fields, step_fields
from seqopt.sequence.methods import SCHEDULES, three_robot_loop
from seqopt.sequence.steps import Step, StepKind
from seqopt.study.published import EQUATIONS
from seqopt.workflow import optimize


@pytest.fixture(scope="module")
def engine():
    return seqopt.make_engine("compliance", seqopt.load_scene("chain:bricks=7"))


@pytest.fixture(scope="module")
def builds(engine):
    return [seqopt.sequential(engine.network), seqopt.cantilever(engine.network)]


def test_they_are_those_of_every_step_alone(engine, builds):
    last = Step(99, StepKind.REMOVE, 0, (None,) * len(engine.network.scene.robots))
    steps = [*builds[0], *builds[1], *builds[0][::-1], last]
    found = _each_fields(engine, steps, Want.ALL)
    for step, fields in zip(steps, found, strict=True):
        own = step_fields(engine, step, Want.ALL)
        for name in ("grip_force", *FLAGS):
            one, other = getattr(fields, name), getattr(own, name)
            scale = np.abs(other).max(initial=0.0)
            assert one == pytest.approx(other, rel=1e-9, abs=1e-9 * scale)


def test_equal_states_are_solved_once_and_others_with_as_many_grips_together(
    engine, builds, monkeypatch
):
    calls, real = [], ComplianceEngine.solve

    def noted(self, bricks, grips, *how):
        calls.append((bricks, len(grips)))
        return real(self, bricks, grips, *how)

    monkeypatch.setattr(ComplianceEngine, "solve", noted)
    steps = sorted(builds[0] + builds[1] + builds[0], key=lambda step: step.bricks)
    assert len([*_each_fields(engine, steps)]) == len(steps)
    states = {(step.bricks, step.grips) for step in steps}
    assert sum(count for _, count in calls) == len(states)
    assert len(calls) < len(states)


def test_an_error_names_the_step_whose_it_is(engine, builds):
    scene = engine.network.scene
    free = [replace(ground, rotational_stiffness=(0.0, 0.0, 0.0)) for ground in scene.grounds]
    hinged = seqopt.make_engine("compliance", replace(scene, grounds=tuple(free)))
    held = next(step for step in builds[0] if step.bricks == 3 and len(step.held) > 1)
    loose = Step(7, StepKind.RELEASE, 3, (None,) * len(scene.robots))
    with pytest.raises(MechanismError, match=r"^step 7: "):
        [*_each_fields(hinged, [held, loose])]


# the responses of all choices: those of the steps, and no more than is asked


COMPARED = ("T_max", "M_sup", "D_max")


@pytest.mark.parametrize("method", ["three-robot", "modified-sequential"])
def test_states_hold_the_responses_of_their_steps(engine25, method):
    """Every response of a random filled schedule is found again in the problem's steps."""
    schedule = SCHEDULES[method](engine25.network)
    also = ("F_largest", "F_move", "F_rob1", "F_rob2", "F_rob3", *COMPARED, "C_max")
    problem = pose_decisions(engine25, schedule, EQUATIONS, also=also)
    rng = np.random.default_rng(1)
    choice: list[int] = []
    for k, move in enumerate(schedule.moves):
        allowed = np.flatnonzero(np.isfinite(problem.sums.shared[k][choice[-1] if choice else 0]))
        choice.append(int(rng.choice(allowed)))
        assert len(move.candidates) > choice[-1]
    steps = {s.number: s for s in schedule.fill(problem.nodes(choice))}
    for choices in problem.evaluation.steps:
        chosen = tuple(choice[m] for m in choices.moves)
        step = steps[choices.step.number]
        want = responses_of(engine25.network, step_fields(engine25, step))
        for name in COMPARED:
            assert choices.responses[name][chosen] == pytest.approx(want[name][0])
        compressed = choices.responses["C_max"][chosen]
        assert compressed == pytest.approx(max(0.0, -want["F_min"][0]))
        forces = iter(np.abs(want["F_rob"][0]))
        for i, node in enumerate(step.grips):
            found = choices.responses[f"F_rob{i + 1}"][chosen]
            assert np.isnan(found) if node is None else found == pytest.approx(next(forces))


def test_unknown_responses_are_refused(engine25, loop25):
    with pytest.raises(ProblemError, match="response F_rob9 does not exist; give C_max, D_max"):
        pose_decisions(engine25, loop25, RankSum("x", equal("F_rob9"), equal("F_rob9")))


def test_fields_are_asked_for_in_blocks(engine25, monkeypatch):
    schedule = three_robot_loop(engine25.network)
    monkeypatch.setattr(batches, "BLOCK", 10**9)
    whole = Evaluation(engine25, schedule, lambda _: {*CHOICE_RESPONSES})
    assert whole.steps
    monkeypatch.setattr(batches, "BLOCK", 100)
    parts = Evaluation(engine25, schedule, lambda _: {*CHOICE_RESPONSES})
    assert parts.models == whole.models
    for a, b in zip(parts.steps, whole.steps, strict=True):
        for name in CHOICE_RESPONSES:
            most = 1e-11 * np.nanmax(np.abs(b.responses[name]), initial=0.0)
            assert a.responses[name] == pytest.approx(b.responses[name], abs=most, nan_ok=True)


# the table of grips says what the table of responses says, grip by grip


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
