"""Blocks that are no boxes, and box scenes written as if their bricks were none."""

from dataclasses import replace

import numpy as np

from seqopt.contact.assembly import bare_assembly
from seqopt.exchange.contacts import flat_face
from seqopt.network.network import build_network
from seqopt.scene._checks import as_vectors
from seqopt.scene.boxes import block_brick, vertices_of
from seqopt.scene.parts import Ground, Joint
from seqopt.scene.shape import Polyhedron


def prism(outline, height=1.0, at=(0.0, 0.0, 0.0)):
    """A polyhedron with an outline (m, 2), counterclockwise, as its floor."""
    count = len(outline)
    floor = np.column_stack([np.array(outline, dtype=float), np.zeros(count)]) + at
    roof = floor + np.array([0.0, 0.0, height])
    around = [(i, (i + 1) % count) for i in range(count)]
    sides = [(a, b, b + count, a + count) for a, b in around]
    ends = [tuple(range(count))[::-1], tuple(range(count, 2 * count))]
    return Polyhedron(as_vectors(np.vstack([floor, roof])), (*ends, *sides))


L_SHAPE = ((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2))
C_SHAPE = ((0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (3, 2), (3, 3), (0, 3))


def box(size, at=(0.0, 0.0, 0.0)):
    """A box with its lowest corner at a point."""
    x, y, z = size
    return prism(((0, 0), (x, 0), (x, y), (0, y)), z, at)


def with_shapes(scene):
    """A scene of boxes as one of polyhedra that touch over given faces."""
    network = build_network(scene)
    faces = bare_assembly(network, len(scene.bricks))
    sorted_springs = [*scene.grounds, *scene.joints]
    place = {tuple(network.springs.position[s]): s for s in range(len(network.springs.since))}

    def faced(spring):
        s = place[spring.position]
        body = network.scene.placed[network.springs.bodies[s][1]].name
        sign = 1.0
        if isinstance(spring, Joint):
            sign = 1.0 if spring.bricks[1] == body else -1.0
        corners = faces.corner[faces.contact == s]
        normal = sign * faces.normal[s]
        along = spring.along if np.dot(spring.along, normal) > 0 else tuple(-np.array(spring.along))
        sides = np.stack([spring.across, np.cross(along, spring.across)])
        flat = (corners - spring.position) @ sides.T
        turn = flat_face(np.column_stack([flat, 0 * flat[:, 0]])).axes[0, 2]
        flat = flat if turn > 0 else flat[::-1]
        steps = np.linalg.norm(flat - np.roll(flat, -1, axis=0), axis=1)
        pairs = flat[steps > 1e-9]
        return replace(spring, along=along, face=tuple(map(tuple, pairs.tolist())))

    def shaped(brick):
        points, sides = vertices_of(brick)
        made = block_brick(
            brick.name, Polyhedron(as_vectors(points), sides), brick.density, nodes=brick.nodes
        )
        spots = [np.subtract(brick.node_position(n), made.position) for n in brick.nodes]
        return replace(
            made, placing_node=brick.placing_node, node_offsets=as_vectors(np.array(spots))
        )

    assert all(isinstance(spring, Joint | Ground) for spring in sorted_springs)
    return replace(
        scene,
        bricks=tuple(map(shaped, scene.bricks)),
        joints=tuple(map(faced, scene.joints)),
        grounds=tuple(map(faced, scene.grounds)),
    )
