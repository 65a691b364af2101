"""Every plan says what it took, and what had to be."""

import json
from dataclasses import replace

import seqopt
from seqopt.graph.decisions import pose_decisions
from seqopt.stability._builds import BuildProver
from tests.commands import command

SMALL = "chain:bricks=7"


def test_no_response_is_computed_that_nobody_asks_for():
    for schedule, aim in ((None, None), ("free", "minmax,steps"), ("free", "T_max")):
        plan = seqopt.optimize(SMALL, schedule, aim=aim)
        spent = plan.spent
        assert {*spent["responses"]["computed"]} <= {*spent["responses"]["asked"]}
        assert 0 <= spent["models"]["six_digits"] <= spent["models"]["searched"] == plan.models
        assert spent["verdicts"] == {"asked": 0, "programs": 0}
    assert spent["responses"]["computed"] == ["T_max"]


def test_a_response_that_nobody_asks_for_is_named():
    engine = seqopt.optimize(SMALL).engine
    schedule = seqopt.three_robot_loop(engine.network)
    problem = pose_decisions(engine, schedule, seqopt.CRITERIA["worst-ratio"], also=("C_max",))
    plan = seqopt.solve(problem)
    assert "C_max" not in plan.spent["responses"]["asked"]
    assert "C_max" in plan.spent["responses"]["computed"]


def test_verdicts_are_counted_once():
    plan = seqopt.optimize(SMALL, "free", aim="minmax,steps", stands="dry")
    sets = plan.spent["verdicts"]
    assert min(sets["asked"], sets["programs"]) > 0
    prover = BuildProver(plan.engine.network)
    for asked in ((plan.steps,), (plan.steps, plan.steps)):  # what is known is not proven again
        prover.of_builds(dict(enumerate(asked)))
        states = {(step.bricks, step.grips) for step in plan.steps}
        assert prover.spent["verdicts"] == 2 * len(states) >= prover.proven
    before = prover.proven
    prover.of_builds({"bare": [replace(step, grips=(None,) * 3) for step in plan.steps[1:3]]})
    assert prover.proven > before


def test_the_summary_has_it(tmp_path, capsys):
    command(capsys, "optimize", SMALL, "--out", tmp_path / "plan")
    found = json.loads((tmp_path / "plan/summary.json").read_text())
    assert {*found["spent"]} == {"models", "responses", "verdicts"}
    assert min(found["spent"]["models"]["proof"], found["spent_on_showing"]["proven"]) > 0
    assert found["spent_on_showing"]["pictures"] == 0
