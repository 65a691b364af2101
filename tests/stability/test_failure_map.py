"""A map of failure: its counts are verdicts, and what it says would cure a build does."""

import numpy as np
import pytest

import seqopt
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.errors import SceneError
from seqopt.exchange._content import Given
from seqopt.exchange.imports import import_scene
from seqopt.report import _failures
from seqopt.report._failures import cure_words, failure_blocks, usual_builds
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability._screens import Screen
from seqopt.stability._steps import step_verdicts
from seqopt.stability.assessment import _verdict_of, bonded
from seqopt.stability.failure_map import failure_map
from seqopt.stability.limit_analysis import Prover
from seqopt.stability.verdict import Verdict
from tests.blocks import box
from tests.documents import obj

FRICTIONS = (0.15, 0.45)


pytestmark = pytest.mark.xdist_group("failure_map")  # what all look at is made once


@pytest.fixture(scope="module")
def network():
    return seqopt.build_network(seqopt.load_scene("arch:span=1,rise=0.4,pattern=VLR"))


@pytest.fixture(scope="module")
def builds(network):
    return {"sequential": seqopt.sequential(network)}


@pytest.fixture(scope="module")
def found(network, builds):
    return failure_map(network.scene, builds, ["dry", "bond=2e3"], values=FRICTIONS)


def falls(network, steps, mortar):
    return [verdict is Verdict.FALLS for verdict in step_verdicts(network, steps, mortar)]


def test_counts_are_those_of_the_verdicts(network, builds, found):
    assert len(found.cases) == 4
    for case in found.cases.to_dict(orient="records"):
        tension = {"dry": 0.0, "bond=2e3": 2e3}[case["holds"]]
        bond = bond_mortar(2e3).cohesion if tension else 0.0
        mortar = Mortar(friction=case["value"], tensile_strength=tension, cohesion=bond)
        own = falls(network, builds[case["build"]], mortar)
        assert (case["steps"], case["fall"]) == (len(own), sum(own))
        assert case["first_step"] == (own.index(True) + 1 if any(own) else 0)
    counted = found.steps.groupby(["build", "holds", "value"])["verdict"]
    fall = counted.agg(lambda each: (each == Verdict.FALLS.value).sum())
    assert fall.sum() == found.cases["fall"].sum() > 0


def test_the_least_bond_is_enough_and_less_is_not(network, builds, found):
    dry = found.cases[(found.cases["holds"] == "dry") & (found.cases["fall"] > 0)]
    assert len(dry)
    for case in dry.to_dict(orient="records"):
        steps, friction = builds[case["build"]], case["value"]
        assert not any(falls(network, steps, bond_mortar(case["bond_needed_Pa"], friction)))
        assert any(falls(network, steps, bond_mortar(0.98 * case["bond_needed_Pa"], friction)))


def test_the_least_friction_is_enough_and_less_is_not():
    """Bricks along the arch slide alone; those across it tip, and no friction helps."""
    network = seqopt.build_network(seqopt.load_scene("arch:span=1,rise=0.4"))
    steps = seqopt.cantilever(network)
    (case,) = failure_map(network.scene, {"": steps}, ["dry"], values=[0.05]).cases.itertuples()
    assert case.fall > 0
    least = case.friction_needed
    assert not any(falls(network, steps, Mortar(friction=least)))
    assert any(falls(network, steps, Mortar(friction=0.98 * least)))


@pytest.mark.slow
def test_no_tilt_is_the_friction_of_the_mortar_and_more_tilt_fells_no_less(network, builds):
    upright = failure_map(network.scene, builds, ["dry"], values=[DRY.friction]).cases
    tilted = failure_map(network.scene, builds, ["dry"], "tilt", [0.0, 20.0]).cases
    assert tilted["fall"].iloc[0] == upright["fall"].iloc[0]
    assert tilted["fall"].iloc[1] > tilted["fall"].iloc[0]


@pytest.mark.parametrize(("friction", "word"), [(0.05, "slides"), (5.0, "turns")])
def test_how_a_leaning_brick_falls(friction, word):
    """A steep joint: with little friction the second brick slides; with much it turns over."""
    scene = seqopt.load_scene("arch:span=1,rise=0.4,pattern=VLR")
    bare = [Step(1, StepKind.PLACE, 8, (None,) * len(scene.robots))]
    case = failure_map(scene, {"bare": bare}, ["dry"], values=[friction]).cases.iloc[0]
    assert (case["fall"], case["motion"]) == (1, word)


def test_wrong_words(network, builds):
    with pytest.raises(SceneError, match="axis 'wind': give one of friction, tilt"):
        failure_map(network.scene, builds, axis="wind")
    with pytest.raises(SceneError, match="mortar glue: give epoxy"):
        failure_map(network.scene, builds, ["glue"])


@pytest.mark.parametrize(
    ("bond", "said"),
    [
        (2e3, "every step stands with a bond of 2 kPa"),
        (np.inf, "no bond or friction helps"),
        (np.nan, "what is enough is not proven"),
    ],
)
def test_what_is_not_proven_is_not_called_impossible(bond, said):
    case = {"bond_needed_Pa": bond, "friction_needed": np.inf, "grip_node": None}
    assert cure_words(case) == said


def test_steps_of_a_wall_that_two_methods_share_are_mapped_once_and_all_stand():
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    builds, notes = usual_builds(scene)
    assert [*builds] == ["sequential", "three-robot", "free"]
    assert "cantilever: the same steps as sequential" in notes
    found = failure_map(scene, builds, ["dry"], values=[DRY.friction])
    assert not found.cases[["fall", "undecided"]].to_numpy().any()
    assert failure_blocks(scene, found, str)[1:] == ["every step is proven to stand, in every case"]


def test_an_imported_mesh_that_leans_out_is_mapped_with_a_cure(tmp_path):
    """Of three cubes the third lies beyond the second's edge: it tips unless it is held."""
    cubes = [box((0.2, 0.2, 0.2), at=at) for at in ((0, 0, 0), (0, 0, 0.2), (0.11, 0, 0.4))]
    (tmp_path / "stack.obj").write_text(obj(*cubes))
    scene = import_scene(tmp_path / "stack.obj", given=Given(unit="m", density=2000.0))
    bare = [Step(1, StepKind.PLACE, 3, (None,) * len(scene.robots))]
    found = failure_map(scene, {"bare": bare}, ["dry"], values=[0.5])
    (case,) = found.cases.to_dict("records")
    assert (case["fall"], case["brick"], case["motion"]) == (1, "2", "turns")
    assert "one more robot at node" in failure_blocks(scene, found, str)[1]
    held = [Step(1, StepKind.PLACE, 3, (case["grip_node"], None, None))]
    (other,) = failure_map(scene, {"held": held}, ["dry"], values=[0.5]).cases.to_dict("records")
    assert other["fall"] == 0


def test_a_plan_that_is_not_proven_in_time_is_mapped_too(monkeypatch):
    """On a scene of many bricks no search may run without an end before anything is mapped."""
    monkeypatch.setattr(_failures, "PATIENCE", 1e-9)
    builds, notes = usual_builds(seqopt.load_scene("wall:columns=3,courses=3"))
    assert "sequential" in builds
    late = [note for note in notes if "within 1e-09 s" in note or note.startswith(("loop", "free"))]
    assert len(late) == 2


@pytest.mark.slow
def test_how_many_steps_fall_is_what_two_other_programs_say():
    """The counts on the page on stability: by forces and motions, linear and cone programs."""
    scene = seqopt.load_scene("arch:span=2,rise=0.8,pattern=VLR")
    network, counts = seqopt.build_network(scene), {}
    builds, _ = usual_builds(scene)
    nodes = {node: i for i, node in enumerate((n for b in scene.placed for n in b.nodes), 1)}
    screen, falls_by_cones = Screen(network, DRY), {}
    for name, steps in builds.items():
        own = falls(network, steps, DRY)
        for step, mine in zip(steps, own, strict=True):
            key = step.bricks, step.grips
            if key not in falls_by_cones:
                assembly = step_assembly(network, *key)
                proven = Prover(assembly, compile_equilibrium)(bonded(assembly, DRY))
                falls_by_cones[key] = _verdict_of(proven) is Verdict.FALLS
            held = [[nodes[node] if node is not None else 0 for node in step.grips]]
            by_lines = screen.stands(step.bricks, held)[0]
            assert mine == falls_by_cones[key] == (by_lines == -1)
            assert by_lines != 0
        counts[name] = sum(own), len(own)
    assert counts["sequential"] == (18, 37)
    assert counts["cantilever"] == (20, 37)
    assert counts["three-robot"] == (32, 66)
    assert counts["free"] == (3, 36)
