"""Scenes, engines and measures that several tests share."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from seqopt.engines.interface import _NAMES, Fields, Want
from seqopt.engines.rigid.compliance import ACCURACY, _FastSolution
from seqopt.network.network import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.library import WallShape, wall
from seqopt.scene.parts import Brick, Ground, Joint, Robot, Side
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind, _check_part
from seqopt.stability._screens import HeldStates
from seqopt.stability.assessment import bonded

ROOT = Path(__file__).parents[1]
HERE = np.zeros((1, 0), dtype=int)  # one set of no grips


def solve_batch(operator, columns, want=Want.RESPONSES, *, even=True, accuracy=ACCURACY):
    """The fields of grip sets as an operator alone gives them, and which of them are accurate."""
    tried = _FastSolution(operator, columns, even=even, accuracy=accuracy)
    return Fields(**tried.fields(want)), tried.well_conditioned


# scenes
def six_bricks(pattern="VLR"):
    """An arch of six bricks, closed at both ends."""
    return arch_scene(ArchShape(pitch=[1.2, 0.7, 0.2, -0.3, -0.8, -1.2], pattern=pattern))


SPRING = {
    "along": (0.0, 0.0, 1.0),
    "across": (1.0, 0.0, 0.0),
    "translational_stiffness": (3e8, 2e8, 1e8),
    "rotational_stiffness": (2e6, 1e6, 3e6),
}


def running_bond(columns, courses):
    """Return a wall of courses, every second one shifted by half a brick, open between bricks.

    Joints have one stiffness each, whatever their area: three different ones along their axes.
    """
    robots = tuple(Robot(name=f"rob{i}", payload=400.0) for i in (1, 2, 3))
    scene = wall(WallShape(columns=columns, courses=courses)).with_robots(*robots)
    beds = (joint for joint in scene.joints if abs(joint.along[2]) > 0.5)
    return replace(
        scene,
        joints=tuple(replace(joint, **SPRING) for joint in beds),
        grounds=tuple(replace(ground, **SPRING) for ground in scene.grounds),
        provenance="",
    )


def small_arch(count):
    return arch_scene(ArchShape(pitch=np.linspace(1.3, -1.3, count).tolist()))


def from_both_sides(count, pattern="V"):
    """A symmetric arch; bricks are placed at both ends in turn, and the crown's comes last."""
    shape = ArchShape(pitch=np.linspace(1.3, -1.3, count).tolist(), pattern=pattern)
    inward = zip(range(1, count + 1), range(count, 0, -1), strict=True)
    order = [brick for pair in inward for brick in pair][:count]
    return replace(arch_scene(shape, "from-both-sides"), build_order=tuple(order))


def block(size=(0.4, 0.3, 0.1), lean=0.0, gravity=9.81, **stiffness):
    """A brick on ground that leans by an angle about y; nobody holds it."""
    height = size[2]
    along, normal = (math.cos(lean), 0.0, -math.sin(lean)), (math.sin(lean), 0.0, math.cos(lean))
    spring = {
        "translational_stiffness": (1e9, 1e9, 1e9),
        "rotational_stiffness": (1e7, 1e7, 1e7),
    } | stiffness
    return Scene(
        name="block",
        bricks=(
            Brick(
                name=1,
                position=tuple(0.5 * height * x for x in normal),
                length_axis=along,
                width_axis=(0.0, 1.0, 0.0),
                dimensions=size,
                density=2000.0,
                nodes=(1, 2),
                placing_node=1,
            ),
        ),
        joints=(),
        grounds=(
            Ground(
                brick=1,
                position=(0.0, 0.0, 0.0),
                anchor=tuple(-0.05 * x for x in normal),
                along=normal,
                across=along,
                **spring,
            ),
        ),
        build_order=(1,),
        robots=(Robot(name="rob1", payload=100.0),),
        gravity=(0.0, 0.0, -gravity),
    )


def from_both_ends(count, pattern="VLR", order=None):
    """An arch of which both ends are built; they meet at a closing brick. By default in turn."""
    closing = (count + 1) // 2
    left, right = [*range(1, closing)], [*range(count, closing, -1)]
    pairs = [name for pair in zip(left, right, strict=False) for name in pair]
    rest = (left + right)[len(pairs) :] if len(left) == len(right) else right[len(left) :]
    pitch = np.linspace(1.3, -1.3, count).tolist()
    scene = arch_scene(ArchShape(pitch=pitch, pattern=pattern), "both ends")
    return replace(scene, build_order=tuple(order or (*pairs, *rest, closing)))


def branch(length=0.2):
    """A trunk of two bricks with two arms of two: a Y whose arms grow in turn."""
    up, s = (0.0, 0.0, 1.0), math.sqrt(0.5)
    ways = {1: up, 2: up, 3: (-s, 0.0, s), 4: (s, 0.0, s), 5: (-s, 0.0, s), 6: (s, 0.0, s)}
    below = {2: 1, 3: 2, 4: 2, 5: 3, 6: 4}
    start = {1: np.zeros(3)}
    for name, other in below.items():
        start[name] = start[other] + length * np.array(ways[other])
    stiff = {"translational_stiffness": (1e8,) * 3, "rotational_stiffness": (1e6,) * 3}

    def spring(name):
        place = tuple(start[name].tolist())
        return {"position": place, "along": ways[name], "across": (0.0, 1.0, 0.0)} | stiff

    return Scene(
        name="branch",
        bricks=tuple(
            Brick(
                name=name,
                position=tuple((start[name] + 0.5 * length * np.array(way)).tolist()),
                length_axis=way,
                width_axis=(0.0, 1.0, 0.0),
                dimensions=(length, 0.1, 0.05),
                density=2000.0,
                nodes=(2 * name, 2 * name + 1),
                placing_node=2 * name + 1,
            )
            for name, way in ways.items()
        ),
        joints=tuple(Joint(bricks=(b, a), **spring(a)) for a, b in below.items()),
        grounds=(Ground(brick=1, anchor=(0.0, 0.0, -0.05), **spring(1)),),
        build_order=(1, 2, 3, 4, 5, 6),
        robots=anywhere(3),
    )


def anywhere(count):
    """So many robots that reach everything."""
    return tuple(Robot(name=f"rob{i + 1}", payload=400.0) for i in range(count))


class Clock:
    """A clock that moves on by some seconds whenever it is looked at."""

    def __init__(self, step):
        self.step, self.now = step, 0.0

    def perf_counter(self):
        self.now += self.step
        return self.now


def with_part(scene, kind, index, **change):
    """The scene with one brick, joint or ground end changed."""
    parts = list(getattr(scene, kind))
    parts[index] = replace(parts[index], **change)
    return replace(scene, **{kind: tuple(parts)})


def hinged(scene, joint):
    """The scene with one joint without rotational stiffness."""
    return with_part(scene, "joints", joint, rotational_stiffness=(0.0, 0.0, 0.0))


def torsion_free(scene, joint):
    """The scene with one joint that does not resist turning about its first axis."""
    _, b, c = scene.joints[joint].rotational_stiffness
    return with_part(scene, "joints", joint, rotational_stiffness=(0.0, b, c))


def on_soft_ground(scene, turning):
    """The scene on a first ground end of that rotational stiffness, N m/rad."""
    return with_part(scene, "grounds", 0, rotational_stiffness=(turning,) * 3)


def all_nodes(net, bricks):
    """All nodes of the bricks placed, as one grip set."""
    return [[int(net.node_name[i]) for i in net.inner[:bricks].ravel()]]


def far_reaching(scene):
    """The scene with robots on their sides that reach across whatever the arch does."""
    robots = tuple(
        replace(r, reach=replace(r.reach, point=tuple(-10 * c for c in r.reach.toward)))
        if isinstance(r.reach, Side)
        else r
        for r in scene.robots
    )
    return replace(scene, robots=robots)


# the same scene elsewhere and in other units
def about_vertical(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def moved(scene, change, size=1.0):
    """Return the scene with positions passed through a function, axes through its linear part.

    Bricks are ``size`` times as large.
    """

    def axis(v):
        a, o = np.array(change(np.array(v))), np.array(change(np.zeros(3)))
        d = a - o
        return tuple((d / np.linalg.norm(d)).tolist())

    def point(v):
        return tuple(np.array(change(np.array(v))).tolist())

    def spring(s):
        out = replace(s, position=point(s.position), along=axis(s.along), across=axis(s.across))
        return replace(out, anchor=point(s.anchor)) if hasattr(s, "anchor") else out

    return replace(
        scene,
        bricks=tuple(
            replace(
                b,
                position=point(b.position),
                length_axis=axis(b.length_axis),
                width_axis=axis(b.width_axis),
                dimensions=tuple(size * d for d in b.dimensions),
            )
            for b in scene.bricks
        ),
        joints=tuple(map(spring, scene.joints)),
        grounds=tuple(map(spring, scene.grounds)),
    )


def scaled(scene, length=1.0, density=1.0, stiffness=1.0):
    """Scale lengths (rotational stiffness with their square), densities, stiffnesses, payloads."""
    out = moved(scene, lambda p: length * p, length)  # at once: halves of it may make no scene

    def spring(s):
        return replace(
            s,
            translational_stiffness=tuple(stiffness * k for k in s.translational_stiffness),
            rotational_stiffness=tuple(stiffness * length**2 * k for k in s.rotational_stiffness),
        )

    def robot(r):
        if isinstance(r.reach, Side):
            point = tuple(length * x for x in r.reach.point)
            r = replace(r, reach=replace(r.reach, point=point))
        return replace(r, payload=density * length**3 * r.payload)

    return replace(
        out,
        bricks=tuple(replace(b, density=density * b.density) for b in out.bricks),
        joints=tuple(map(spring, out.joints)),
        grounds=tuple(map(spring, out.grounds)),
        robots=tuple(map(robot, out.robots)),
    )


def rescaled(scene, length, force, softness):
    """The scene with lengths, weights and payloads, and joint flexibilities multiplied.

    Forces grow with ``force``, moments with ``force * length``, and displacements with ``force *
    softness`` where the softness of turning is that of shifting over the square of the length.
    """
    return scaled(scene, length, density=force / length**3, stiffness=1 / softness)


# answers and programs
def solve(engine_type, scene, bricks, grips, want):
    return engine_type(build_network(scene)).solve(bricks, grips, want)


def apart(fields, others, names=_NAMES):
    """The largest difference of each field, relative to its largest entry."""
    pairs = [(getattr(fields, name), getattr(others, name)) for name in names]
    return max(
        np.abs(a - b).max(initial=0.0) / max(np.abs(b).max(initial=0.0), 1e-300) for a, b in pairs
    )


def largest_difference(first, second, net):
    """Over all fields, relative to the largest entry or to what a hundredth of a brick makes."""
    weight = 0.01 * np.linalg.norm(net.weight, axis=1).mean()
    soft = weight / net.springs.translational_stiffness.max()
    floors = {"displacement": soft, "brick_twist": soft}
    worst = 0.0
    for name in first.__dataclass_fields__:
        a, b = getattr(first, name), getattr(second, name)
        scale = max(np.abs(b).max(initial=0.0), floors.get(name, weight))
        worst = max(worst, np.abs(a - b).max(initial=0.0) / scale)
    return worst


def held(assembly, payload, *points):
    """The assembly with its last block held at points."""
    last = len(assembly.centroid) - 1
    return replace(
        assembly,
        grip_block=np.full(len(points), last),
        grip_position=np.array(points, float).reshape(-1, 3),
        payload=np.full(len(points), payload),
    )


def first(scene, count):
    """The scene of the first bricks that are placed, with the joints and ground ends between."""
    bricks = scene.placed[:count]
    names = {brick.name for brick in bricks}
    return replace(
        scene,
        bricks=bricks,
        joints=tuple(joint for joint in scene.joints if {*joint.bricks} <= names),
        grounds=tuple(ground for ground in scene.grounds if ground.brick in names),
        build_order=scene.build_order[:count],
    )


def turned_round(scene, steps):
    """Return the take-down that passes the states of a build in reverse, from 1.

    It begins at the end of the build; simultaneous releases become successive grips.
    """
    out = []
    before = [Step(0, StepKind.RELEASE, 0, (None,) * len(scene.robots)), *steps]
    for now, then in zip(before[::-1], before[-2::-1], strict=False):
        if now.kind is StepKind.PLACE:
            out.append(Step(len(out) + 1, StepKind.REMOVE, then.bricks, then.grips))
            continue
        kind = StepKind.REPOSITION if now.kind is StepKind.RELEASE else StepKind.RELEASE
        grips = list(now.grips)
        for robot in (r for r, node in enumerate(then.grips) if node != grips[r]):
            grips[robot] = then.grips[robot]
            out.append(Step(len(out) + 1, kind, then.bricks, tuple(grips)))
    return _check_part(scene, out)


def lacking(assembly, mortar, compiled):
    """The brackets of the least bond that a structure lacks; it stands at zero."""
    case = bonded(assembly, mortar)
    return HeldStates(assembly, case, compiled, case.fixed())


class Counting:
    """An engine that counts the grip sets it is asked for."""

    def __init__(self, engine):
        self.engine, self.sets = engine, 0

    @property
    def network(self):
        return self.engine.network

    def solve(self, bricks, grips, want=Want.RESPONSES):
        self.sets += len(grips)
        return self.engine.solve(bricks, grips, want)


def install(folder, group, **entries):
    """Write a package with these entry points as if it were installed in a folder of the path."""
    about = folder / "own-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: own\nVersion: 1\n")
    lines = [f"{name} = {place}\n" for name, place in entries.items()]
    (about / "entry_points.txt").write_text("".join([f"[{group}]\n", *lines]))
