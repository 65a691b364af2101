"""What property tests draw: scenes, grip sets, placement problems."""

from dataclasses import replace

import numpy as np
from hypothesis import strategies as st

from experiments.harness.layers import LayeredCosts
from seqopt.scene._checks import as_vectors
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.boxes import vertices_of
from seqopt.scene.parts import Anywhere, Load, Prop, Robot, Side, Sphere
from seqopt.scene.shape import Polyhedron
from seqopt.sequence.rules import FreeRules
from seqopt.study import ROBOTS
from tests.builders import about_vertical, from_both_sides, moved, running_bond
from tests.layered import Budget, Costs

angles = st.floats(-0.3, 0.3)


@st.composite
def arches(draw, max_bricks=7, min_bricks=1):
    """An arch of a few bricks, bent, rolled and yawed at random, with unequal joint stiffnesses."""
    count = draw(st.integers(min_bricks, max_bricks))
    bend = draw(st.floats(-0.5, 0.2))
    start = draw(st.floats(0.2, 1.5))
    stiffness = st.tuples(*[st.floats(1e7, 1e9)] * 3)
    turning = st.tuples(*[st.floats(1e5, 1e7)] * 3)
    shape = ArchShape(
        pitch=[start + bend * i for i in range(count)],
        roll=draw(st.lists(angles, min_size=count, max_size=count)),
        yaw=draw(st.lists(angles, min_size=count, max_size=count)),
        pattern=draw(st.sampled_from(["VLR", "V", "LR", "VL"])),
        gap=draw(st.floats(0.0, 0.03)),
        translational_stiffness=draw(stiffness),
        rotational_stiffness=draw(turning),
        closed=draw(st.booleans()),
    )
    return arch_scene(shape, robots=ROBOTS)


@st.composite
def both_sided(draw, pattern=None):
    """A small arch that is built from both of its ends at once and closes at the crown."""
    shape = st.sampled_from(["VLR", "V", "LR", "VL"]) if pattern is None else st.just(pattern)
    return from_both_sides(draw(st.integers(2, 7)), draw(shape))


@st.composite
def walls(draw):
    """A small wall in running bond: bricks with several joints, loops from the start."""
    return running_bond(draw(st.integers(2, 4)), draw(st.integers(2, 3)))


@st.composite
def teams(draw, scene, least=2):
    """The scene with two to five robots, each of which reaches all, a side, or a sphere."""
    points = np.array([brick.position for brick in scene.bricks])
    middle, size = points.mean(axis=0), 0.3 + np.ptp(points, axis=0).max()
    share = st.floats(-0.5, 0.5)
    spheres = st.builds(
        lambda x, y, z, r: Sphere(
            center=tuple((middle + size * np.array([x, y, z])).tolist()), radius=r * size
        ),
        *(share, share, share, st.floats(0.4, 1.2)),
    )
    sides = st.builds(
        lambda sign, far: Side(toward=(0.0, sign, 0.0), point=(0.0, -sign * far, 0.0)),
        *(st.sampled_from([-1.0, 1.0]), st.floats(0.0, 0.2)),
    )
    reaches = draw(
        st.lists(st.one_of(st.just(Anywhere()), sides, spheres), min_size=least, max_size=5)
    )
    robots = (Robot(name=f"rob{i}", payload=500.0, reach=r) for i, r in enumerate(reaches, 1))
    return replace(scene, robots=tuple(robots))


@st.composite
def builds(draw):
    """An arch, a wall, an arch built from both ends, or one in any order, and any robots."""
    kind = draw(st.sampled_from(["arch", "wall", "both ends", "any order"]))
    if kind == "wall":
        return draw(teams(draw(walls())))
    scene = draw(arches(max_bricks=9))
    names = [*scene.build_order]
    if kind == "any order":
        names = draw(st.permutations(names))
    elif kind == "both ends":
        ends = draw(st.lists(st.sampled_from([0, -1]), min_size=len(names), max_size=len(names)))
        names = [names.pop(end) for end in ends]
    return draw(teams(replace(scene, build_order=tuple(names))))


@st.composite
def states(draw, scenes=None, max_grips=3):
    """A scene, a brick count and a set of different free nodes."""
    scene = draw(arches() if scenes is None else scenes)
    bricks = draw(st.integers(1, len(scene.bricks)))
    free = [n for b in scene.placed[:bricks] for n in b.nodes if n not in scene.blocked_nodes]
    size = st.integers(0, min(max_grips, len(free)))
    grips = draw(
        size.flatmap(lambda k: st.lists(st.sampled_from(free), min_size=k, max_size=k, unique=True))
    )
    return scene, bricks, np.array([grips], dtype=np.int64).reshape(1, -1)


@st.composite
def loosened(draw, scenes):
    """A scene some of whose joints are missing, or have no stiffness in some directions."""
    scene = draw(scenes)
    joints = []
    for joint in scene.joints:
        kind = draw(st.sampled_from(["kept", "kept", "kept", "torsion", "hinge", "any", "missing"]))
        slack = {"torsion": (0,), "hinge": (0, 1, 2)}.get(kind, ())
        if kind == "any":
            slack = draw(st.sets(st.integers(0, 5)))
        own = [*joint.rotational_stiffness, *joint.translational_stiffness]
        own = [0.0 if i in slack else k for i, k in enumerate(own)]
        if kind != "missing":
            joints.append(
                replace(
                    joint,
                    rotational_stiffness=tuple(own[:3]),
                    translational_stiffness=tuple(own[3:]),
                )
            )
    return replace(scene, joints=tuple(joints))


@st.composite
def flat_arches(draw):
    """An arch whose bricks all lie along it, in one plane that is turned about the vertical."""
    count = draw(st.integers(2, 7))
    bend = draw(st.floats(-0.5, 0.2))
    shape = ArchShape(
        pitch=[1.2 + bend * i for i in range(count)],
        pattern="V",
        offset=draw(st.lists(st.floats(-0.01, 0.01), min_size=count, max_size=count)),
        translational_stiffness=draw(st.tuples(*[st.floats(1e7, 1e9)] * 3)),
        rotational_stiffness=draw(st.tuples(*[st.floats(1e5, 1e7)] * 3)),
        closed=draw(st.booleans()),
    )
    turn = about_vertical(draw(st.floats(0, 3)))
    return moved(arch_scene(shape), lambda x: turn @ x)


@st.composite
def problems(draw, most_moves=5, most_candidates=4):
    """Costs with many ties and some choices not allowed."""
    sizes = draw(st.lists(st.integers(1, most_candidates), min_size=1, max_size=most_moves))
    cost = st.sampled_from([0.0, 1.0, 2.0, 3.0] * 3 + [np.inf])  # with more, hardly any is solvable

    def array(*shape):
        count = int(np.prod(shape))
        return np.array(draw(st.lists(cost, min_size=count, max_size=count))).reshape(shape)

    single = tuple(array(size) for size in sizes)
    shared = tuple(array(a, b) for a, b in zip([1, *sizes[:-1]], sizes, strict=True))
    return Costs(LayeredCosts(single, shared))


@st.composite
def budgeted(draw, most_budgets=3):
    """A problem with budgets on whole amounts, of choices and of pairs."""
    problem = draw(problems())

    def arrays(parts):
        sizes = [part.size for part in parts]
        flat = draw(st.lists(st.integers(0, 3), min_size=sum(sizes), max_size=sum(sizes)))
        cuts = np.split(np.array(flat, float), np.cumsum(sizes)[:-1])
        return tuple(cut.reshape(part.shape) for cut, part in zip(cuts, parts, strict=True))

    budgets = tuple(
        Budget(
            f"use {i}",
            arrays(problem.sums.single),
            arrays(problem.sums.shared),
            float(draw(st.integers(-2, 10))),
        )
        for i in range(draw(st.integers(1, most_budgets)))
    )
    return replace(problem, budgets=budgets)


@st.composite
def free_builds(draw, most_bricks=5, most_robots=4):
    """A small arch or wall with a few robots, and rules of the free schedule."""
    scene = draw(st.one_of(arches(max_bricks=most_bricks, min_bricks=2), both_sided()))
    if len(scene.bricks) > most_bricks:
        scene = draw(arches(max_bricks=most_bricks, min_bricks=2))
    scene = draw(teams(scene))
    scene = replace(scene, robots=scene.robots[:most_robots])
    names = [robot.name for robot in scene.robots]
    rules = FreeRules(
        least_grips=draw(st.integers(0, 2)),
        newest=draw(st.sampled_from(["either", "placing", "free"])),
        regrips=draw(st.sampled_from([None, 0, 1])),
        ending=draw(st.sampled_from(["held", "released", "one-by-one"])),
        placers=tuple(names[: draw(st.sampled_from([0, len(names) - 1]))]),
        payload=draw(st.sampled_from(["kept", "ignored"])),
        candidates=draw(st.sampled_from(["", "near:0", "near:1", "near:2"])),
    )
    return scene, rules


@st.composite
def scenes_with_all(draw):
    """A small scene with everything that one may have: shapes, loads, movement, blocked nodes."""
    scene = draw(builds())
    share = st.floats(-1.0, 1.0)
    vectors, near = st.tuples(share, share, share), st.tuples(*[st.floats(-0.1, 0.1)] * 3)
    bricks = []
    for brick in scene.bricks:
        if draw(st.booleans()):
            points, faces = vertices_of(brick)
            own = Polyhedron(as_vectors(points - brick.position), faces)
            spots = brick.node_position(brick.nodes[0]), brick.node_position(brick.nodes[1])
            spots = as_vectors(np.subtract(spots, brick.position))
            bricks.append(replace(brick, shape=own, node_offsets=spots))
        else:
            bricks.append(brick)
    square = ((-0.01, -0.01), (0.01, -0.01), (0.01, 0.01), (-0.01, 0.01))
    joints = [
        replace(joint, face=square, thickness=0.02) if draw(st.booleans()) else joint
        for joint in scene.joints
    ]
    grounds, last = list(scene.grounds), scene.build_order[-1]
    if draw(st.booleans()):
        more = {"face": square, "thickness": 0.02, "movement": draw(vectors), "closes_with": last}
        grounds[0] = replace(grounds[0], **more)
    free = [n for brick in bricks for n in brick.nodes if n != brick.placing_node]
    loads = [
        Load(brick=scene.build_order[0], force=force, position=at, since=last)
        for force, at in draw(st.lists(st.tuples(vectors, near), max_size=2))
    ]
    blocked = draw(st.lists(st.sampled_from(free), max_size=2, unique=True))
    props = [
        Prop(node=node, stiffness=soft, direction=way, capacity=most)
        for node in free
        if node not in blocked and draw(st.booleans())
        for soft in (draw(st.sampled_from([None, 1e6])),)
        for way in (draw(st.sampled_from([None, (0.0, 0.6, 0.8)])),)
        for most in (draw(st.sampled_from([None, 250.0])),)
    ]
    return replace(
        scene,
        bricks=tuple(draw(st.permutations(bricks))),
        joints=tuple(draw(st.permutations(joints))),
        grounds=tuple(grounds),
        blocked_nodes=tuple(blocked),
        props=tuple(props),
        loads=tuple(loads),
        wind=draw(vectors),
        gravity=draw(st.sampled_from([(0.0, 0.0, -9.81), (0.0, -1.62, 0.0)])),
        weight_factor=draw(st.floats(0.5, 2.0)),
        provenance=draw(st.sampled_from(["", "printed\nfrom a page", "größer <b>"])),
    )
