"""Of the automatic engine one level answers all choices; the plan says whether it was enough."""

from __future__ import annotations

import pytest

import seqopt
from seqopt.contact.mortar import bond_mortar
from seqopt.engines.interface import Want
from seqopt.engines.registry import AutoEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.responses.table import OUTSIDE
from seqopt.scene.scene_file import load_scene
from tests.builders import small_arch

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
