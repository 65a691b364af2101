"""Results outside the range of small displacements and elastic joints are never passed over."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from seqopt._cli.main import main
from seqopt.engines.interface import Want
from seqopt.engines.registry import make_engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import build_network
from seqopt.responses.quantities import RESPONSES, responses_of, support_forces, support_moments
from seqopt.responses.table import _STRAIN, LinearRange, analyze, support_columns
from seqopt.scene.scene_file import _scene_by_words, save_scene
from seqopt.sequence.methods import cantilever, sequential
from seqopt.sequence.steps import Step, StepKind
from seqopt.study import published_plan
from tests.builders import from_both_sides, scaled, small_arch

WORDS = "arch:span=3,rise=1.2,bricks=21,density=2000,dimensions=0.18x0.1x0.06"


def found(scene, method=sequential, engine="compliance"):
    made = make_engine(engine, build_network(scene))
    left = LinearRange(made).departures(analyze(made, method(made.network)))
    return {each.what: each for each in left}


@pytest.mark.parametrize(
    "engine", ["compliance", "auto", pytest.param("frame", marks=pytest.mark.slow)]
)
def test_the_plans_of_the_reference_arch_are_within(arch25, engine):
    made = make_engine(engine, build_network(arch25))
    within = LinearRange(made)
    for steps in (sequential(made.network), cantilever(made.network), published_plan(arch25)):
        assert within.departures(analyze(made, steps)) == ()
    assert within.unchecked == ()


@pytest.mark.slow
def test_every_limit_is_told_from_the_others(arch25):
    moved = found(scaled(arch25, stiffness=1 / 100))["displacement"]  # by half a brick
    assert moved.said == "30.59 mm, more than 5.3 mm, a tenth of the smallest side of a brick"
    assert 47 in moved.steps
    assert 1 not in moved.steps
    assert {*found(scaled(arch25, density=20.0))} == {"displacement", "stress in a joint"}
    thin = replace(arch25, **{
        part: tuple(replace(each, thickness=1e-7, face=None) for each in getattr(arch25, part))
        for part in ("joints", "grounds")
    })  # fmt: skip
    assert found(thin)["deformation of a joint"].said.endswith(f"more than {_STRAIN:g} times")
    assert "rotation" in found(scaled(arch25, stiffness=1 / 1000))


def test_bricks_that_turn_about_their_own_axis_are_seen(arch25):
    """No node moves far where a brick turns about the line of its nodes."""
    made = make_engine("compliance", build_network(arch25))
    (step, *_) = sequential(made.network)
    table, within = analyze(made, [step]), LinearRange(made)
    fields = made.solve(1, np.array([step.held]), Want.ALL)
    fields.brick_twist.flags.writeable = False
    turned = np.array(fields.brick_twist)
    turned[0, 0, 3:] = 0.2
    within.seen(step, replace(fields, brick_twist=turned))
    (left,) = within.departures(table)
    assert (left.what, left.steps) == ("rotation", (1,))


def test_what_is_not_a_number_is_not_within(arch25):
    made = make_engine("compliance", build_network(arch25))
    table = analyze(made, sequential(made.network))
    table.loc[4, "D_max_1e-3mm"] = np.nan
    assert [each.steps for each in LinearRange(made).departures(table)] == [(5,)]


def moved(scene, network, twist):
    """Return a scene in the shape that it has under load."""
    index = {brick.name: i for i, brick in enumerate(scene.placed)}

    def shifted(point, i):
        arm = np.asarray(point) - network.centroid[i]
        return np.asarray(point) + twist[i, :3] + np.cross(twist[i, 3:], arm)

    def turned(vector, i):
        return tuple(Rotation.from_rotvec(twist[i, 3:]).apply(vector))

    bricks = [
        replace(
            brick,
            position=tuple(shifted(brick.position, i)),
            length_axis=turned(brick.length_axis, i),
            width_axis=turned(brick.width_axis, i),
        )
        for brick in scene.bricks
        for i in [index[brick.name]]
    ]
    joints = []
    for joint in scene.joints:
        i, k = (index[name] for name in joint.bricks)
        middle = (shifted(joint.position, i) + shifted(joint.position, k)) / 2
        axes = {name: turned(getattr(joint, name), i) for name in ("along", "across")}
        joints.append(replace(joint, position=tuple(middle), **axes))
    return replace(scene, bricks=tuple(bricks), joints=tuple(joints))


def reached(engine, steps):
    """Return the largest displacement of every step, and the motions of its bricks."""
    for step in steps:
        grips = np.array([step.held], dtype=int).reshape(1, -1)
        fields = engine.solve(step.bricks, grips, Want.ALL)
        twist = np.zeros((len(engine.network.inner), 6))
        twist[: step.bricks] = fields.brick_twist[0]
        yield np.linalg.norm(fields.displacement[0], axis=1).max(), twist


@pytest.mark.parametrize("share", [0.2, 5.0])
def test_at_the_limit_the_displaced_shape_changes_displacements_by_a_tenth(share):
    """What an analysis of second order would add grows with the displacement, as it should."""
    scene, limit = _scene_by_words(WORDS), 0.1 * 0.06
    engine = make_engine("compliance", build_network(scene))
    steps = sequential(engine.network)
    most = max(shift for shift, _ in reached(engine, steps))
    loaded = scaled(scene, density=share * limit / most)
    engine = make_engine("compliance", build_network(loaded))
    changes = []
    for step, (shift, twist) in zip(steps, reached(engine, steps), strict=True):
        if shift > 0.5 * share * limit:
            again = make_engine("compliance", build_network(moved(loaded, engine.network, twist)))
            ((other, _),) = reached(again, [step])
            changes.append(abs(other / shift - 1))
    assert 0.05 * share < max(changes) < 0.1 * share


LOOP = ("optimize", "--formulation", "cascade")
FREE = ("optimize", "--schedule", "free", "--aim", "steps")


@pytest.mark.parametrize(
    "words",
    [
        ("analyze", "--method", "sequential"),
        *(
            pytest.param(words, marks=pytest.mark.slow)
            for words in (("compare",), LOOP, FREE, ("pareto", "--aim", "steps,D_max"))
        ),
    ],
    ids=" ".join,
)
def test_commands_say_it_first_and_tell_scripts(capsys, tmp_path, small_soft, words):
    out = tmp_path / ("out.csv" if words[0] == "analyze" else "out")
    asked = [words[0], small_soft, *words[1:], "--out", str(out)]
    chosen = words[0] in ("optimize", "pareto")  # where the range is a limit, which none keeps
    assert main(asked) == int(chosen)
    said, err = capsys.readouterr()
    assert said.startswith("outside the linear range: ")
    assert ("seqopt: outside the linear range: no plan keeps it; " in err) == chosen
    asked = asked if words[0] in ("optimize", "pareto") else asked[:-2]  # else it writes no files
    assert main([*asked, "--json"]) == int(chosen)
    said, err = capsys.readouterr()
    assert json.loads(said)["outside_linear_range"]
    assert ("seqopt: outside the linear range: " in err) == chosen
    if chosen:
        assert main([*asked, "--limit", "linear_range=any"]) == 0
        said, err = capsys.readouterr()
        assert said.startswith("outside the linear range: ")
        assert "seqopt: " not in err
    if words[0] in ("optimize", "pareto"):
        assert json.loads((out / "summary.json").read_text("utf-8"))["outside_linear_range"]
    if words[0] != "analyze":
        assert '<p id="sentence">Outside the linear range' in (out / "report.html").read_text()


@pytest.fixture
def small_soft(tmp_path):
    save_scene(scaled(small_arch(5), stiffness=1e-6), tmp_path / "soft.json")
    return str(tmp_path / "soft.json")


@pytest.mark.parametrize("engine", ["auto", "discrete"])
def test_engines_whose_joints_break_are_asked_for_displacements_alone(arch25, engine):
    heavy = scaled(arch25, density=20.0)
    made = make_engine(engine, build_network(heavy))
    table = analyze(made, sequential(made.network)[:3])
    table.loc[1, "D_max_1e-3mm"] = 6e3
    (left,) = LinearRange(made).departures(table)
    assert (left.what, left.steps) == ("displacement", (2,))


# the largest over the ground ends is what tables, criteria and limits see
@pytest.fixture(scope="module")
def arch():
    return ComplianceEngine(build_network(from_both_sides(9, "VLR")))


def test_an_arch_built_from_both_sides_reports_its_worse_support(arch25):
    """The fault: a robot relieves one end, and the other, which bears four times as much, hid."""
    inward = zip(range(1, 26), range(25, 0, -1), strict=True)
    order = tuple(itertools.chain.from_iterable(inward))[:25]
    engine = ComplianceEngine(build_network(replace(arch25, build_order=order)))
    answers = engine.solve(16, [[15], [36]])
    each, seen = support_moments(answers), responses_of(engine.network, answers)["M_sup"]
    assert (each.argmax(axis=1) == [1, 0]).all()
    assert (each.max(axis=1) > 4 * each.min(axis=1)).all()
    assert (seen == each.max(axis=1)).all()


def test_the_largest_force_keeps_its_sign():
    """Also where it points down, and the other end's is smaller or none."""
    net = build_network(from_both_sides(7))
    fields = ComplianceEngine(net).solve(5, np.zeros((1, 0), dtype=np.int64))
    for forces, wanted in (
        ([[0, 0, -3.0], [0, 0, 2.0]], -3.0),
        ([[0, 0, -3.0], [4.0, 0, 0]], 4.0),
        ([[0, 0, 0.0], [0, 3.0, -4.0]], -5.0),
        ([[0, 0, -2.0], [0, 0, 2.0]], 2.0),
        ([[0, 0, 2.0], [0, 0, -2.0]], 2.0),
        ([[0, 0, 0.0], [0, 0, 0.0]], 0.0),
    ):
        support = np.zeros((1, 2, 6))
        support[0, :, :3] = forces
        known = replace(fields, support=support)
        assert RESPONSES["F_sup"].of(net, known) == pytest.approx([wanted])
        assert np.abs(support_forces(net, known)).max() == abs(wanted)


def test_tables_have_columns_per_end(arch):
    steps = [Step(1, StepKind.PLACE, 1, (1, None, None)), Step(2, StepKind.PLACE, 8, (2, 3, None))]
    table = analyze(arch, steps)
    assert support_columns(arch.network.scene) == [
        ("F_sup_1_N", "M_sup_1_Nm"),
        ("F_sup_9_N", "M_sup_9_Nm"),
    ]
    assert list(table)[-5:] == [
        [*RESPONSES.values()][-1].column,
        *itertools.chain.from_iterable(support_columns(arch.network.scene)),
    ]
    assert table.loc[0, ["F_sup_9_N", "M_sup_9_Nm"]].isna().all()  # brick 9 does not stand yet
    assert table.loc[0, "M_sup_Nm"] == table.loc[0, "M_sup_1_Nm"] > 0
    assert table.loc[1, "M_sup_Nm"] == max(table.loc[1, ["M_sup_1_Nm", "M_sup_9_Nm"]])
    assert abs(table.loc[1, "F_sup_N"]) == table.loc[1, ["F_sup_1_N", "F_sup_9_N"]].abs().max()


def test_one_end_needs_no_columns_of_its_own():
    arch = small_arch(3)
    free = replace(arch, grounds=arch.grounds[:1])
    table = analyze(
        ComplianceEngine(build_network(free)), [Step(1, StepKind.PLACE, 1, (1, None, None))]
    )
    assert list(table)[-1] == [*RESPONSES.values()][-1].column
