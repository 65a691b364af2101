"""One way from a problem, its graph or an instance to a plan; which level of engines answers."""

from __future__ import annotations

import pytest

import seqopt
from seqopt.contact.mortar import bond_mortar
from seqopt.engines.interface import Want
from seqopt.engines.registry import AutoEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError
from seqopt.plan.pose import graph_of
from seqopt.responses.table import OUTSIDE
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import three_robot_loop
from tests.builders import small_arch

WORST = seqopt.CRITERIA["worst-ratio"]


def posed(goals):
    engine = seqopt.make_engine("compliance", small_arch(4))
    return seqopt.pose(engine, three_robot_loop(engine.network), WORST, goals)


def test_a_problem_its_graphs_and_its_instance_have_one_optimum():
    problem = posed("sum")
    moves, states = (graph_of(problem, moves=each) for each in (True, False))
    arcs = seqopt.compile_instance(problem)
    plans = [seqopt.solve(each) for each in (problem, moves, states, arcs)]
    best = plans[0].certificate.values
    for plan in plans:
        assert plan.certificate.values == pytest.approx(best, rel=1e-9)
        assert plan.gap == pytest.approx(0, abs=1e-9)
    assert [bool(plan.steps) for plan in plans] == [True, True, True, False]
    assert [plan.graph for plan in plans[1:]] == [moves, states, arcs]


def test_a_formulation_takes_the_aim_that_is_asked():
    """Its own aim holds where none is asked; what it cannot make small it refuses itself."""
    for goals in ("sum", "minmax", "steps", "minmax,steps"):
        best = seqopt.solve(posed(goals)).certificate.values
        for name in ("overlap_dp", "overlap_lp"):
            plan = seqopt.solve(posed(goals), name)
            assert plan.certificate.values == pytest.approx(best), (goals, name)
    with pytest.raises(ProblemError, match="minimax: a sum comes first"):
        seqopt.solve(posed("sum"), "minimax")
    with pytest.raises(ProblemError, match="minimax_arc: it writes one largest cost down alone"):
        seqopt.solve(posed("sum"), "minimax_arc")


WALL, ARCH = load_scene("wall:columns=3,courses=2"), small_arch(5)
WEAK = bond_mortar(3e4)  # some joints of the small arch would leave its limits


@pytest.mark.parametrize(("scene", "schedule"), [(WALL, None), (ARCH, "free")])
def test_it_chooses_as_rigid_bricks_do_and_asks_no_joint(scene, schedule, monkeypatch):
    wanted, real = set(), ComplianceEngine._found

    def noted(self, bricks, columns, hands, want):
        wanted.add(want)
        return real(self, bricks, columns, hands, want)

    monkeypatch.setattr(ComplianceEngine, "_found", noted)
    monkeypatch.setattr(AutoEngine, "solve", lambda *_: pytest.fail("set by set"))
    plan = seqopt.optimize(scene, schedule)
    assert not any(want & (Want.JOINTS | Want.BRICKS) for want in wanted)
    other = seqopt.optimize(scene, schedule, engine="compliance")
    assert plan.objective == pytest.approx(other.objective, rel=1e-9)
    assert [step.grips for step in plan.steps] == [step.grips for step in other.steps]
    said = plan.summary()["engine"]
    assert (said["name"], said["reason"]) == ("auto", "the default")
    assert said["level"]["engine"] == "compliance"
    assert plan.enough.engine == "compliance"


def test_a_plan_that_leaves_elastic_limits_says_so_first_and_what_to_do():
    plan = seqopt.optimize(ARCH, engine="auto", mortar=WEAK)
    assert plan.result.startswith(f"{OUTSIDE}: ")
    (left,) = plan.departures
    assert "MPa beyond what bond=30000 holds, 0.03 MPa in tension" in left.said
    assert "the engine discrete says it" in plan.enough.others
    assert not seqopt.optimize(ARCH).departures
