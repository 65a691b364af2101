"""Links without shapes for collisions, and models that are no URDF."""

import re
import warnings

import numpy as np
import pytest

from seqopt.arms import Arm, find_postures
from seqopt.arms._model import ArmModel
from seqopt.errors import SceneError, SceneWarning
from tests.arms.scenes import beside_a_wall, boxes
from tests.refusals import one_line

pytest.importorskip("pinocchio")
pytest.importorskip("coal")

INSIDE = (0.3, 0.0, 0.0)  # the wall


EVERY = "no <collision> of l0, l1, l2, l3, l4, l5, l6: <visual> is checked instead"


@pytest.fixture
def shown(tmp_path):
    """An arm of which nothing is given but what is shown."""
    return boxes(tmp_path / "shown.urdf", "visual")


def test_a_base_that_is_only_shown_hits_the_wall_as_its_twin_does(tmp_path, shown):
    with (
        pytest.warns(SceneWarning, match=re.escape(f"robot arm: its arm has {EVERY}")),
        pytest.raises(SceneError, match="robot arm: the base of its arm hits brick 2; move it"),
    ):
        find_postures(beside_a_wall(shown, INSIDE))
    with pytest.raises(SceneError, match="the base of its arm hits brick 2"):
        find_postures(beside_a_wall(boxes(tmp_path / "twin.urdf"), INSIDE))


@pytest.mark.slow
def test_what_is_shown_collides_as_the_same_shapes_do(tmp_path):
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    lines = [f"v {0.03 * x} {0.03 * y} {0.4 * z}" for x, y, z in corners]
    faces = ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    (tmp_path / "l3.obj").write_text("\n".join([*lines, *(f"f {f}" for f in faces)]))
    mesh = {"l3": '<mesh filename="l3.obj"/>'}
    twin = find_postures(beside_a_wall(boxes(tmp_path / "twin.urdf")))
    with pytest.warns(SceneWarning, match="visual"):
        table = find_postures(beside_a_wall(boxes(tmp_path / "shown.urdf", "visual", **mesh)))
    assert table.hits.any()  # so that what is shown is there
    np.testing.assert_allclose(table.joints, twin.joints, atol=1e-9)
    assert (table.hits == twin.hits).all()
    assert (table.found == twin.found).all()


def test_every_arm_is_told_of_once_with_the_links_that_lack_shapes(tmp_path):
    shapes = {"l2": "visual", "l4": "mass", "l5": "visual"}
    urdf = boxes(tmp_path / "some.urdf", shapes)
    text = urdf.read_text().replace('<origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>', "<axis/>")
    urdf.write_text(text)  # the fifth joint is where the fourth is: that link has no length
    scene = beside_a_wall(urdf, (0.3, -9.0, 0.0), (0.3, 9.0, 0.0))
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        find_postures(scene)
        find_postures(scene)
    said = (
        "no <collision> of l2, l5: <visual> is checked instead; no shape at all of l4: nothing "
        "says what it hits"
    )
    assert [str(each.message) for each in found] == [
        f"robot {name}: its arm has {said}" for name in ("arm", "other")
    ]
    assert {each.filename for each in found} == {__file__}


@pytest.mark.parametrize(("link", "name"), [("l0", "l0"), ("l3", "l3"), ("l6", "l6, tool0")])
def test_a_link_with_a_length_and_no_shape_is_refused(tmp_path, link, name):
    urdf = boxes(tmp_path / "bare.urdf", {link: ""})
    said = f"bare.urdf has no shape of {name}, neither <collision> nor <visual>"
    with pytest.raises(SceneError, match=said):
        ArmModel(Arm(urdf=urdf, position=INSIDE, tool_length=0.2, tool_radius=0.03))


NO_URDF = {  # a file: what is in the robot, and what is said
    "tower.xacro": (
        '<xacro:property xmlns:xacro="http://ros.org/wiki/xacro" name="h" value="1"/></robot>',
        "is xacro, from which a URDF is made: run `xacro tower.xacro > tower.urdf` and give",
    ),
    "tower.urdf.xacro": (
        '<xacro:include filename="a.xacro"/></robot>',
        "run `xacro tower.urdf.xacro > tower.urdf`",
    ),
    "plain.urdf": (
        '<joint name="a" type="fixed"><origin xyz="0 0 ${h}"/></joint></robot>',
        "run `xacro plain.urdf >",
    ),
    "torn.urdf": ("<link", "torn.urdf cannot be read (unclosed token"),
}


@pytest.mark.parametrize("name", NO_URDF)
def test_what_is_no_urdf_is_a_line_with_what_to_do(tmp_path, name):
    inside, said = NO_URDF[name]
    (tmp_path / name).write_text(f'<robot name="t">{inside}')
    with one_line(SceneError, re.escape(said)):
        find_postures(beside_a_wall(tmp_path / name))


@pytest.mark.parametrize(
    "how",
    [
        {"kind": "continuous", "limit": ""},
        {"limit": '<limit effort="1" velocity="1"/>'},
        {"limit": '<limit lower="1" upper="-1" effort="1" velocity="1"/>'},
    ],
)
def test_a_joint_without_limits_is_named(tmp_path, how):
    with pytest.raises(SceneError, match=r"arm\.urdf has no limits of joint j3; give <limit>"):
        find_postures(beside_a_wall(boxes(tmp_path / "arm.urdf", **how)))
