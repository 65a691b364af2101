"""What is given in Python in another form: what is meant is taken, or what is wanted is said."""

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.contact.mortar import Mortar
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.registry import AutoEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SeqoptError
from seqopt.problem.criteria import RankSum, WeightedSum
from seqopt.scene.parts import Anywhere, Robot
from seqopt.stability.failure_map import failure_map
from tests.builders import six_bricks

SCENE = six_bricks()
FLAT = six_bricks("V")
NETWORK = seqopt.build_network(SCENE)
ENGINE = ComplianceEngine(NETWORK)
LOOP = seqopt.three_robot_loop(NETWORK)
EQUATIONS = seqopt.CRITERIA["equations-2-3"]
PROBLEM = seqopt.pose(ENGINE, LOOP, EQUATIONS)


@pytest.mark.parametrize("engine", [ComplianceEngine, FrameEngine, DiscreteEngine, AutoEngine])
def test_engines_take_a_scene(engine):
    made = engine(FLAT)
    held = np.array([[2]])
    expected = engine(seqopt.build_network(FLAT)).solve(2, held)
    assert made.solve(2, held) == expected


@pytest.mark.parametrize(
    "method",
    [seqopt.sequential, seqopt.cantilever, seqopt.three_robot_loop, seqopt.modified_sequential],
)
def test_methods_take_a_scene(method):
    assert method(SCENE) == method(NETWORK)


WIDE = seqopt.Search(options={"width": 3})


@pytest.mark.slow
def test_what_is_meant_is_taken(tmp_path):
    assert Robot(name="r", payload=1.0, reach="anywhere").reach == Anywhere()
    assert seqopt.make_engine("discrete", SCENE, "dry").network.scene == SCENE
    steps = seqopt.sequential(SCENE)[:2]
    dry = seqopt.assess(SCENE, steps, "dry")
    assert dry == seqopt.assess(NETWORK, steps, seqopt.DRY)
    limit = seqopt.Limit("T_max", 1e6)
    assert seqopt.pose(ENGINE, LOOP, EQUATIONS, limits=limit).limits == (limit,)
    own = seqopt.formulations()["overlap_dp"]
    for given in ("overlap_dp", own):
        assert seqopt.solve(PROBLEM, given).certificate.gap == 0.0
    assert (
        seqopt.solve(PROBLEM, "beam", options={"width": 3}).choice
        == seqopt.solve(PROBLEM, "beam", options={"width": np.int64(3)}).choice
    )
    worded = seqopt.optimize(SCENE, formulation="beam", search=seqopt.Search(options=["width=3"]))
    assert worded.choice == seqopt.optimize(SCENE, formulation="beam", search=WIDE).choice
    path = tmp_path / "scene.json"
    seqopt.save_scene(SCENE, str(path))  # type: ignore[arg-type]
    assert seqopt.load_scene(path) == SCENE
    assert seqopt.optimize(path).nodes == seqopt.optimize(SCENE).nodes
    (tmp_path / "plan.csv").write_text(
        "step,type,bricks,rob1_node,rob2_node,rob3_node\n1,place,1,1,,\n", encoding="utf-8"
    )
    assert len(seqopt.read_plan(SCENE, str(tmp_path / "plan.csv"))) == 1  # type: ignore[arg-type]


WEIGHTS = (("T_max", 0.0, 1.0),)
COARSE = RankSum("own", (("T_max", 1.0),), (("T_max", 1.0),), resolution=(("T", 0.0),))

WRONG = {
    "limit F_largest=-3: give a number from zero": lambda: seqopt.Limit("F_largest", -3),
    "brick count None: the scene has 1 to": lambda: ENGINE.solve(None, [[1]]),
    "brick count '3': the scene has 1 to": lambda: ENGINE.solve("3", [[1]]),
    "brick count 3.5: the scene has 1 to": lambda: ENGINE.solve(3.5, [[1]]),
    "builds: there are none; give one by its name": lambda: failure_map(SCENE, {}),
    "robot: its name is empty; give one": lambda: Robot(name="", payload=1.0),
    "a coefficient up to 2; 25° is 0.466": lambda: seqopt.assess(SCENE, None, friction=25),
    "friction 25: give a coefficient up to 10; 25° is": lambda: Mortar(friction=25),
    "friction 90: give a coefficient up to 10": lambda: replace(seqopt.EPOXY, friction=90.0),
    "it has no robots; give at least one": lambda: seqopt.optimize(SCENE.with_robots(), "free"),
    "limit heavy does not exist; give": lambda: seqopt.optimize(SCENE, limits="heavy"),
    "limits [5]: give values": lambda: seqopt.pose(ENGINE, LOOP, EQUATIONS, limits=[5]),
    "schedule 5: give a Schedule": lambda: seqopt.optimize(SCENE, 5),
    "cache is 5; give the path of a folder": lambda: seqopt.optimize(
        SCENE, search=seqopt.Search(cache=5)
    ),
    "lost or missing rob1: give a list, as ['rob1']": lambda: seqopt.optimize(
        SCENE, seqopt.Part(schedule="free", begin=2, lost="rob1")
    ),
    "lost or missing 2: give a list, as [2]": lambda: seqopt.optimize(
        SCENE, seqopt.Part(schedule="free", begin=2, missing=2)
    ),
    "robots 'rob1': give names": lambda: seqopt.optimize(SCENE, robots="rob1"),
    "aims 5: give goals": lambda: seqopt.optimize(SCENE, "free", aim=5),
    "T_max has the weight, scale or rounding 0.0; give a positive number": lambda: seqopt.optimize(
        SCENE, criterion=WeightedSum("own", WEIGHTS)
    ),
    "T has the weight, scale or rounding 0.0": lambda: seqopt.optimize(SCENE, criterion=COARSE),
    "a float is not a network": lambda: ComplianceEngine(3.0),
    "a str is not a network": lambda: seqopt.sequential("arch25"),
    "a Network is not a scene": lambda: seqopt.build_network(NETWORK),
    "a int is not a name of a scene": lambda: seqopt.load_scene(25),
    "mortar glue: give epoxy, dry, or bond=": lambda: seqopt.make_engine("auto", SCENE, "glue"),
    "robot r: reach is 'far'; give Anywhere": lambda: Robot(name="r", payload=1.0, reach="far"),
    "is no engine; take one of": lambda: seqopt.pose(NETWORK, LOOP, EQUATIONS),
    "'weighted' is no criterion": lambda: seqopt.pose(ENGINE, LOOP, "weighted"),
    "a Schedule is not a problem": lambda: seqopt.solve(LOOP, "overlap_dp"),
    "a int is not a formulation": lambda: seqopt.solve(PROBLEM, 3),
    "option width=2.5: width is 2.5; give a whole number": lambda: beam({"width": 2.5}),
    "option width=True: width is True; give a whole number": lambda: beam({"width": True}),
    "option width=x: width is 'x'; give a whole number": lambda: beam(["width=x"]),
    "widht=3: beam has width, seconds, max_memory (did you mean width?)": lambda: beam(
        {"widht": 3}
    ),
    "options 'width=3': give {'width': 10} or ['width=10']": lambda: beam("width=3"),
    "options 3: give {'width': 10}": lambda: beam(3),
    "'free' is no schedule; take one of": lambda: PROBLEM.but(moves="free"),
    "'weighted' is no criterion; take": lambda: PROBLEM.but(criterion="weighted"),
    "'frame' is no engine; take one of": lambda: PROBLEM.but(engine="frame"),
    "3 is no Resources; take one of": lambda: PROBLEM.but(resources=3),
    "limit D_max=20: 20 m is more": lambda: PROBLEM.but(limits=[seqopt.Limit("D_max", 20.0)]),
    "scenarios 3: give seqopt.scenarios": lambda: PROBLEM.but(scenarios=3),
    "scenario 1: 3 is not a scene": lambda: PROBLEM.but(scenarios=[3]),
    "time_limit is '5s'; give seconds from 0": lambda: seqopt.solve(PROBLEM, time_limit="5s"),
    "progress is 3; give a function": lambda: seqopt.solve(PROBLEM, progress=3),
    "workers is 0; give a whole number": lambda: seqopt.sweep([SCENE], workers=0),
    "a Network is not an engine": lambda: seqopt.analyze(NETWORK, seqopt.sequential(NETWORK)),
    "a Schedule is not a sequence of steps": lambda: seqopt.analyze(ENGINE, LOOP),
    "limit 3 of 'much'": lambda: seqopt.Limit(3, "much"),
    "arch: pitch is 3": lambda: seqopt.ArchShape(pitch=3),
    "a list is not a shape of an arch": lambda: seqopt.arch_scene([1.0, 0.5]),
    "scene: bricks: give each as Brick(...), not 3": lambda: seqopt.Scene(
        **{k: v for k, v in vars(SCENE).items() if k in SCENE.__dataclass_fields__} | {"bricks": 3}
    ),
}


def beam(options):
    seqopt.solve(PROBLEM, "beam", options=options)


@pytest.mark.parametrize("said", WRONG)
def test_what_is_wanted_is_said(said):
    with pytest.raises(SeqoptError) as caught:
        WRONG[said]()
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
