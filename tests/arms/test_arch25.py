"""Three ABB IRB 4600 around the arch of Bruun et al.: where the third one stands decides."""

from __future__ import annotations

import pytest

import seqopt
from seqopt.scene.arm import Arm
from seqopt.sequence._postures import plan_postures
from seqopt.study.published import published_plan
from tests.arms.scenes import NORTH, SOUTH, TOOL

for extra in ("pinocchio", "coal", "compas_fab", "mujoco"):
    pytest.importorskip(extra)
from tests.arms.witness import Site as Witness  # noqa: E402

pytestmark = [pytest.mark.slow, pytest.mark.long]


def around(third):
    """The arch with an arm on each side, and a third one."""
    scene = seqopt.load_scene("arch25")
    at = [scene.node_position(node)[0] for node in scene.brick_of_node]
    x = 0.5 * (min(at) + max(at))
    places = [((x, 1.5, 0.0), SOUTH), ((x, -1.5, 0.0), NORTH)]
    places += [((x - 1.2, 1.5, 0.0), SOUTH) if third == "beside" else ((x - 2.0, 0.0, 0.0), {})]
    pairs = zip(scene.robots, places, strict=True)
    return scene.with_robots(
        *(
            seqopt.Robot(name=r.name, payload=r.payload, arm=Arm(position=p, **TOOL, **axes))
            for r, (p, axes) in pairs
        )
    )


@pytest.fixture(scope="module", params=["beside", "end"])
def third(request):
    return request.param


def contacts(scene, steps, found):
    """The steps in which MuJoCo sees something touch."""
    witness = Witness(scene, found.table)
    names = [robot.name for robot in scene.robots]
    rows = [dict(zip(names, rows, strict=True)) for rows in found.steps]
    held = [{name: row for name, row in each.items() if row is not None} for each in rows]
    pairs = zip(steps, held, strict=True)
    return [step.number for step, each in pairs if each and witness.touching(each, step.bricks)]


def test_the_published_plan_needs_the_third_base_beside_the_first(third):
    scene, steps = around(third), published_plan(seqopt.load_scene("arch25"))
    found = plan_postures(scene, steps)
    lacking = {fault.step for fault in found.unreached}
    if third == "beside":
        assert lacking == set()
        assert contacts(scene, steps, found) == []
    else:
        alone = [f.step for f in found.unreached if "has no posture" in f.why]
        assert 32 <= len(alone) <= 40  # 32 if arms may hit the brick that they grip, else 37
        free = [step for step in range(1, 91) if step not in lacking]
        assert not {*free} & {*contacts(scene, steps, found)}


def test_the_free_plan_is_as_good_as_without_arms(third):
    scene = around(third)
    bare = scene.with_robots(
        *(seqopt.Robot(name=robot.name, payload=robot.payload) for robot in scene.robots)
    )
    plan = seqopt.optimize(scene, "free", aim="minmax,steps")
    other = seqopt.optimize(bare, "free", aim="minmax,steps")
    assert plan.objective == pytest.approx(other.objective)
    assert len(plan.steps) == 48
    assert plan.arms.best
    assert contacts(scene, plan.steps, plan.arms.postures) == []
