"""Values that no field can have: one line names the object, the field and what to give."""

from dataclasses import fields, replace

import pytest

from seqopt.contact.mortar import Mortar, bond_mortar, find_mortar
from seqopt.errors import SceneError
from seqopt.exchange import Given, import_scene
from seqopt.scene import Load
from seqopt.scene.arch import ArchShape
from seqopt.scene.library import ArchForm, JointLaw, WallShape
from seqopt.scene.parts import Robot, Side, Sphere
from seqopt.scene.shape import Polyhedron
from tests.builders import six_bricks, with_part
from tests.refusals import one_line

SCENE = six_bricks()
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
VALUES = {
    "arch": ArchShape(pitch=(1.2, 0.0, -1.2), pattern="V"),
    "arch form": ArchForm(span=2.0, rise=0.7),
    "wall": WallShape(columns=3, courses=2),
    "joint law": JointLaw(translational=(1.0, 1.0, 1.0)),
    "mortar": Mortar(friction=0.5),
    "shape": Polyhedron(CORNERS, ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))),
    "brick": SCENE.bricks[0],
    "joint": SCENE.joints[0],
    "ground end": SCENE.grounds[0],
    "robot": Robot(name="left", payload=100.0),
    "reach beside": Side(toward=(0.0, 1.0, 0.0), point=(0.0, 0.0, 0.0)),
    "reach around": Sphere(center=(0.0, 0.0, 0.0), radius=1.0),
    "load": Load(brick=1, force=(0.0, 0.0, -1.0)),
    "scene": SCENE,
}
CASES = [(what, field.name) for what, value in VALUES.items() for field in fields(value)]
OPEN = {("scene", "name"), ("scene", "provenance"), ("robot", "name"), ("arch", "closed")}
EMPTY = {"joints", "robots", "blocked_nodes", "loads", "props"}  # what a scene need not have
ODD = ["x", "", [], {}, object(), {"x"}, float("nan"), -float("inf"), 10**400, [[1.0], 2.0], b"x"]


@pytest.mark.parametrize(("what", "name"), [case for case in CASES if case not in OPEN])
def test_one_line_says_what_is_wrong(what, name):
    for odd in ODD:
        if what == "scene" and name in EMPTY and isinstance(odd, str | list | dict) and not odd:
            continue
        with pytest.raises(SceneError, match=r"(; |: )(give|name|list|close|known)") as caught:
            replace(VALUES[what], **{name: odd})
        assert "\n" not in str(caught.value)
        assert what.split()[0] in str(caught.value)


# where the parts of a scene lie: what leaves nothing to compute is refused in the scene


# what leaves nothing to compute is refused in the scene
def joint(**change):
    return with_part(SCENE, "joints", 1, **change)


def ground(**change):
    return with_part(SCENE, "grounds", 0, **change)


def brick(**change):
    return with_part(SCENE, "bricks", 1, **change)


NEAR = tuple(x + 1e-9 for x in SCENE.node_position(3))
PULLED = r"brick 1: it weighs .* gravity (1e.|9.99989e-)[13]"
JOINT = r"joint \(2, 3\): "
SOFT = (1e-160, 1e6, 1e6)
WRONG = [  # what is said, and what it is said of
    ("mortar: tensile_strength is 'x'; give a number", lambda: bond_mortar("x")),
    ("mortar 3: give epoxy, dry, or bond=", lambda: find_mortar(3)),
    (r"mortar \[\]: give epoxy", lambda: find_mortar([])),
    (f"{JOINT}position is that of node 3", lambda: joint(position=NEAR)),
    (rf"{JOINT}a stiffness is 1e\+300", lambda: joint(translational_stiffness=(1e300,) * 3)),
    (f"{JOINT}a stiffness is 1e-160; give 0", lambda: joint(rotational_stiffness=SOFT)),
    ("ground end of brick 1: .* node 0", lambda: ground(position=SCENE.node_position(0))),
    ("anchor and position are one point", lambda: ground(anchor=(1e-200, 0.0, 0.0))),
    ("brick 2: position .* move the scene", lambda: brick(position=(1e308, 1e308, 0.0))),
    ("brick 2: dimensions .* give meters", lambda: brick(dimensions=(1e-200,) * 3)),
    (r"brick 2: it weighs .*1e\+308 kg/m³", lambda: brick(density=1e308)),
    (PULLED, lambda: replace(SCENE, gravity=(0.0, 0.0, -1e160))),
    (PULLED, lambda: replace(SCENE, gravity=(0.0, 0.0, -1e-160))),
]


@pytest.mark.parametrize(("said", "make"), WRONG)
def test_what_leaves_nothing_to_compute_is_refused(said, make):
    with one_line(SceneError, said):
        make()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"unit": []}, r"two: unit is \[\]; give one of m, cm"),
        ({"supports": 3}, "two: supports is 3; give keys of blocks"),
        ({"law": 3}, "two: law is 3; give a JointLaw"),
        ({"name": 3}, "scene: its name is 3; give text"),
    ],
)
def test_what_is_given_beside_a_file_is_named(tmp_path, given, said):
    path = tmp_path / "two.csv"
    path.write_text("x,y,z,length,width,height\n0,0,1,2,1,2\n0,0,2.5,2,1,1\n", "utf-8")
    with one_line(SceneError, said):
        import_scene(path, given=Given(**{"unit": "m", "density": 2000.0, **given}))
