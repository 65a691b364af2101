"""Which steps of builds fall, by seqopt and by two linear programs of this file's own.

Forces f at the corners of the contact faces and at the grips balance the bricks. Friction is a cone
and a payload a ball: one program takes polyhedra inside them, the other one polyhedra around them::

    find  f    such that  sum of f on every brick = -weight,   sum of moments = 0
               f_n >= -a s,   f_t . d <= m f_n + a c   for DIRECTIONS d in the face
               g . d <= p                              for ALL_ROUND d

with the share a of a corner in its face, tensile strength s and cohesion c. What the inner one
solves stands, what the outer one cannot solve falls. Only where faces are and what bricks weigh is
taken from seqopt, nothing of `seqopt.stability`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from seqopt import Scene, Step, build_network
from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly, step_assembly
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.stability.failure_map import failure_map
from seqopt.stability.verdict import Verdict

DIRECTIONS = 16  # in which friction is bounded
ALL_ROUND = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
ALL_ROUND /= np.linalg.norm(ALL_ROUND, axis=1)[:, None]
WITHIN = 0.88  # radius of a ball: 26 planes that touch it have no corner beyond 1
LEAN = np.arange(8) * np.pi / 4  # sides to which a structure is tilted
SLACK = 1e-9  # of forces over the heaviest brick's weight
SOLVED, INFEASIBLE = 0, 2  # of scipy's statuses


def tangents(normal: Floats) -> Floats:
    """Return two unit vectors in every face, (K, 2, 3)."""
    helper = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(normal, first)], axis=1)


def balance(blocks: Assembly) -> sparse.csr_array:
    """Return the matrix from forces at corners, on the second body, and grips to wrenches."""
    bodies, rows = blocks.bodies[blocks.contact], []
    ends = [(bodies[:, side], blocks.corner, sign) for side, sign in ((0, -1.0), (1, 1.0))]
    ends = [(b, p, sign, np.arange(len(p))) for b, p, sign in ends]
    count = len(blocks.corner)
    at = count + np.arange(len(blocks.grip_block))
    ends.append((blocks.grip_block, blocks.grip_position, 1.0, at))
    for body, place, sign, column in ends:
        for b, p, c in zip(body.tolist(), place, column.tolist(), strict=True):
            if b >= 0:
                x, y, z = p - blocks.centroid[b]
                turn = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
                rows.append((b, c, sign * np.vstack([np.eye(3), turn])))
    shape = (6 * len(blocks.centroid), 3 * (count + len(blocks.grip_block)))
    i = np.concatenate([6 * b + np.repeat(np.arange(6), 3) for b, _, _ in rows])
    j = np.concatenate([3 * c + np.tile(np.arange(3), 6) for _, c, _ in rows])
    values = np.concatenate([part.ravel() for _, _, part in rows])
    return sparse.csr_array(sparse.coo_array((values, (i, j)), shape=shape))


def bounds(blocks: Assembly, mortar: Mortar, *, inside: bool) -> tuple[sparse.csr_array, Floats]:
    """Return what forces keep, matrix f <= right: tension, friction and payloads."""
    normal = blocks.normal[blocks.contact]
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ways = np.einsum("dk,nki->ndi", ways, tangents(normal))
    narrow = np.cos(np.pi / DIRECTIONS) if inside else 1.0
    share = blocks.corner_area
    slides = ways - narrow * mortar.friction * normal[:, None]
    at_corners = np.concatenate([-normal[:, None], slides], axis=1)
    right = np.column_stack(
        [share * mortar.tensile_strength] + [narrow * share * mortar.cohesion] * DIRECTIONS
    )
    pulls = blocks.payload[:, None] * np.full(len(ALL_ROUND), WITHIN if inside else 1.0)
    parts = [*at_corners, *[ALL_ROUND] * len(blocks.payload)]
    matrix = sparse.csr_array(sparse.block_diag(parts))
    return matrix, np.concatenate([right.ravel(), pulls.ravel()])


def solvable(blocks: Assembly, mortar: Mortar, weight: Floats, *, inside: bool) -> bool | None:
    """Return whether forces balance weights (B, 3), N; None if the solver ended otherwise."""
    unit = np.linalg.norm(weight, axis=1).max()
    matrix, right = bounds(blocks, mortar, inside=inside)
    load = np.hstack([weight, np.zeros_like(weight)]).ravel() / unit
    found = linprog(
        np.zeros(matrix.shape[1]),
        A_ub=matrix,
        b_ub=right / unit + (0.0 if inside else SLACK),
        A_eq=balance(blocks),
        b_eq=-load,
        bounds=(None, None),
        method="highs",
    )
    return {SOLVED: True, INFEASIBLE: False}.get(found.status)


def own_verdict(blocks: Assembly, mortar: Mortar, weights: Sequence[Floats]) -> str:
    """Return whether blocks stand under all weights, fall under one, or neither is shown."""
    out = "stands"
    for weight in weights:
        if solvable(blocks, mortar, weight, inside=False) is False:
            return "falls"
        if solvable(blocks, mortar, weight, inside=True) is not True:
            out = "open"
    return out


def tilted(weight: Floats, up: Floats, degrees: float) -> list[Floats]:
    """Return weights (B, 3) of a structure that leans to eight sides, or of one that does not."""
    if not degrees:
        return [weight]
    lean, size = np.radians(degrees), np.linalg.norm(weight, axis=1)[:, None]
    x = np.cross(up, np.eye(3)[np.abs(up).argmin()])
    x /= np.linalg.norm(x)
    sides = [np.cos(a) * x + np.sin(a) * np.cross(up, x) for a in LEAN]
    return [size * (np.sin(lean) * side - np.cos(lean) * up) for side in sides]


def contradicts(said: str, own: str) -> bool:
    """Return whether one says that a step stands and the other one that it falls."""
    return (said, own) in ((Verdict.STANDS.value, "falls"), (Verdict.FALLS.value, "stands"))


def rows(
    scene: Scene,
    builds: Mapping[str, Sequence[Step]],
    holds: Sequence[str],
    axes: Mapping[str, Sequence[float]],
) -> Iterator[dict[str, object]]:
    """Yield how many steps of builds fall with every mortar, friction and tilt, by both."""
    net, up = build_network(scene), np.array(scene.up)
    blocks = {
        name: [step_assembly(net, step.bricks, step.grips) for step in steps]
        for name, steps in builds.items()
    }
    for axis, values in axes.items():
        table = failure_map(scene, builds, holds, axis, values).steps
        for (build, held, value), steps in table.groupby(["build", "holds", "value"], sort=False):
            mortar, size = find_mortar(str(held)), float(str(value))
            lean = size if axis == "tilt" else 0.0
            mortar = replace(mortar, friction=size) if axis == "friction" else mortar
            own = [own_verdict(b, mortar, tilted(b.weight, up, lean)) for b in blocks[str(build)]]
            said = steps["verdict"].tolist()
            yield {
                "bricks": len(scene.bricks),
                "method": build,
                "mortar": held,
                "axis": axis,
                "value": size,
                "steps": len(said),
                "fall": said.count(Verdict.FALLS.value),
                "undecided": said.count(Verdict.UNDECIDED.value),
                "own_fall": own.count("falls"),
                "own_open": own.count("open"),
                "contradicted": sum(map(contradicts, said, own)),
            }
