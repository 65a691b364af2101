"""Engines against sixty digits, one cell for every value of an axis: stiffness, size, grips, units.

Every cell is a chain of bricks, once with bricks that stick out of its line and once in a plane,
with several grip sets. The worst of them counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from experiments.harness.scenes import grip_sets
from seqopt import build_network, make_engine
from seqopt.arrays import Floats, Ints
from seqopt.engines import frame
from seqopt.engines.interface import Engine, Want, grip_columns
from seqopt.engines.rigid import _mixed, _refinement, compliance
from seqopt.errors import MechanismError, SolverError
from seqopt.network.network import Network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Joint
from seqopt.scene.scene import Scene
from tests.limit_scenes import HELD, LOOSE_AT, chain, loosened, without_joint
from tests.reference_chain import Reference, solve_exactly

Grips = tuple[int, ...]
BRICKS = 25
SETS = 4  # random ones, where one joint is loose
LARGEST_FRAME = 100  # bricks; beyond, the frame is not asked
POWERS = (1, 3, 5, 7, 9, 11, 13, 15)
SHAPES = ("VLR", "V")  # patterns of bricks; the second one lies in a plane
COMPARED = "compliance, to compare"  # six digits, to choose by
ENGINES = ("compliance", COMPARED, "frame")
UNDECIDED = 1e-3  # share of an answer from which on last digits decide whether it is a mechanism
FIELDS = Want.DISPLACEMENTS | Want.JOINTS | Want.BRICKS


def far_grips(count: int) -> tuple[Grips, ...]:
    """Return no grip, one at the tip, two apart, three close together at the tip."""
    last = 2 * count - 1
    sets: list[Grips] = [(), (last,)]
    if count >= 5:
        sets += [(count | 1, last), (last - 3, last - 2, last), (count // 2 * 2, count + 2, last)]
    return tuple(dict.fromkeys(sets))


class Exact(NamedTuple):
    """The exact answer of a grip set, None for a mechanism, and what the scene's last digits do."""

    answer: Reference | None
    digits: float


class Cell(NamedTuple):
    """A value of an axis, and grip sets whose grips have a stiffness, N/m, or are rigid."""

    axis: str
    value: float
    network: Network
    grips: Sequence[Grips]
    stiffness: float | None = None


def softened(joint: Joint, factor: float) -> Joint:
    """Return a joint or a ground end with its stiffness multiplied."""
    shift, turn = (
        tuple(factor * k for k in each)
        for each in (joint.translational_stiffness, joint.rotational_stiffness)
    )
    return replace(joint, translational_stiffness=shift, rotational_stiffness=turn)


def in_units(scene: Scene, size: float) -> Scene:
    """Return the same scene in units of length that are so many times smaller."""

    def rescaled(part, lengths, squares=()):  # type: ignore[no-untyped-def]
        own = {n: (size, getattr(part, n)) for n in lengths}
        own |= {n: (size**2, getattr(part, n)) for n in squares}
        return replace(part, **{n: tuple(f * x for x in v) for n, (f, v) in own.items()})

    turn = ("rotational_stiffness",)
    bricks = [rescaled(b, ("position", "dimensions")) for b in scene.bricks]
    return replace(
        rescaled(scene, ("gravity",)),
        bricks=tuple(replace(b, density=b.density / size**3) for b in bricks),
        joints=tuple(rescaled(j, ("position",), turn) for j in scene.joints),
        grounds=tuple(rescaled(g, ("position", "anchor"), turn) for g in scene.grounds),
    )


def contrasts(pattern: str) -> Iterator[Cell]:
    scene = chain(BRICKS, pattern=pattern)
    for power in POWERS:
        joints = [softened(j, 10.0 ** -(power * (i % 2))) for i, j in enumerate(scene.joints)]
        net = build_network(replace(scene, joints=tuple(joints)))
        yield Cell("stiff over soft joints", 10.0**power, net, far_grips(BRICKS))


def loose_joints(pattern: str) -> Iterator[Cell]:
    """Yield cells with one loose joint that grips beyond it hold up, in many sets, or nobody."""
    scene = chain(BRICKS, pattern=pattern)
    for power in POWERS:
        net = build_network(loosened(scene, 10.0**-power, only_turning=False))
        random = [tuple(nodes) for nodes in grip_sets(net, BRICKS, SETS).tolist()]
        yield Cell("stiff over one loose joint", 10.0**power, net, [(), HELD, *random])


def soft_grounds(pattern: str) -> Iterator[Cell]:
    scene = chain(BRICKS, pattern=pattern)
    for power in POWERS:
        grounds = tuple(softened(end, 10.0**-power) for end in scene.grounds)
        net = build_network(replace(scene, grounds=grounds))
        yield Cell("joints over soft ground", 10.0**power, net, far_grips(BRICKS))


def near_mechanisms(pattern: str) -> Iterator[Cell]:
    """Yield chains without a joint, held beyond it by grips ever more nearly in a line."""
    for power in POWERS:
        pitch = np.full(BRICKS, 0.3)
        pitch[LOOSE_AT + 6 :] += 10.0**-power
        shape = ArchShape(pitch=pitch, pattern=pattern, closed=False)
        net = without_joint(arch_scene(shape))
        yield Cell("1 over bend of grips in line", 10.0**power, net, [(30, 40, 49), (33, 40, 45)])


def soft_grips(pattern: str) -> Iterator[Cell]:
    for power in (3, 5, 7, 9, 11, 13, 14, 15):
        net = build_network(chain(BRICKS, pattern=pattern).with_grips(10.0**power))
        yield Cell("stiffness of grips [N/m]", 10.0**power, net, far_grips(BRICKS), 10.0**power)


def units(pattern: str) -> Iterator[Cell]:
    for power in (-6, -3, -2, -1, 1, 2, 3, 6):
        net = build_network(in_units(chain(BRICKS, pattern=pattern), 10.0**power))
        yield Cell("units in a meter", 10.0**power, net, far_grips(BRICKS))


def sizes(pattern: str, counts: Sequence[int]) -> Iterator[Cell]:
    for count in counts:
        net = build_network(chain(count, pattern=pattern))
        yield Cell("bricks", count, net, far_grips(count))


def cells(*, quick: bool) -> Iterator[Cell]:
    """Yield all cells, or two of every axis of one shape."""
    for pattern in SHAPES[-1:] if quick else SHAPES:
        for each in (contrasts, loose_joints, soft_grounds, near_mechanisms, soft_grips, units):
            own = [*each(pattern)]
            yield from own[2::5] if quick else own
        yield from sizes(pattern, (5, 10) if quick else (5, 10, 25, 50, 100, 200, 338, 1000))


def exact(cell: Cell) -> list[Exact]:
    """Return the exact answers of a cell's grip sets."""
    small = len(cell.network.inner) <= BRICKS
    found = [_solved(cell.network, cell, columns) for columns in places(cell)]
    other = nudged(cell.network)
    again = [_solved(other, cell, columns) if small else None for columns in places(cell)]
    return [Exact(one, _apart(one, two)) for one, two in zip(found, again, strict=True)]


def _solved(net: Network, cell: Cell, columns: Ints) -> Reference | None:
    try:
        return solve_exactly(net, len(net.inner), columns, cell.stiffness)
    except MechanismError:
        return None


def _apart(one: Reference | None, other: Reference | None) -> float:
    """Return the largest difference of two answers; that of a mechanism is no number."""
    if one is None or other is None:
        return 0.0
    return worst(one.displacement, one.joint_wrench, other)


def nudged(net: Network) -> Network:
    """Return a network with other last digits of positions and stiffnesses."""
    rng, digit = np.random.default_rng(0), np.finfo(float).eps

    def changed(values: Floats, size: Floats | float) -> Floats:
        return np.asarray(values + digit * size * rng.choice([-1.0, 1.0], values.shape))

    springs = net.springs
    kinds = ("translational_stiffness", "rotational_stiffness")
    stiff = {name: getattr(springs, name) for name in kinds}
    own = {name: changed(values, values) for name, values in stiff.items()}
    size = float(np.abs(net.node_position).max())
    own["position"] = changed(springs.position, size)
    place = changed(net.node_position, size)
    return replace(net, node_position=place, springs=replace(springs, **own))


def places(cell: Cell) -> list[Ints]:
    bricks = len(cell.network.inner)
    sets = [np.array(grips, dtype=int).reshape(1, -1) for grips in cell.grips]
    return [grip_columns(cell.network, bricks, each)[0] for each in sets]


def relative(found: Floats, wanted: Floats) -> float:
    """Return the largest difference over the largest wanted value."""
    size = max(np.abs(wanted).max(), np.finfo(float).tiny)
    return float(np.abs(found - wanted).max() / size)


def worst(moved: Floats, wrench: Floats, wanted: Reference) -> float:
    """Return the largest error of displacements, joint forces and joint moments."""
    return max(
        relative(moved, wanted.displacement),
        relative(wrench[:, :3], wanted.joint_wrench[:, :3]),
        relative(wrench[:, 3:], wanted.joint_wrench[:, 3:]),
    )


def stated(name: str, net: Network, digits: float) -> float:
    """Return the largest error that an engine says its answers have.

    It is more where the scene's last digits decide more, or a joint has next to no stiffness.
    """
    if name == "frame":
        return frame._LAST_FRAME_CORRECTION
    kinds = net.springs.translational_stiffness, net.springs.rotational_stiffness
    loose = any(each.min() < _refinement._SOFT * each.max() for each in kinds)
    loose = loose or digits > compliance.ACCURACY
    if name == COMPARED:
        return compliance._SCREEN * (10 if loose else 1)
    return 0.1 * _mixed._SENSITIVE if loose else compliance.ACCURACY


def engines(net: Network) -> dict[str, Engine]:
    """Return the engines that are asked of a network, by name."""
    out: dict[str, Engine] = {}
    for name in ENGINES:
        if name == "frame" and len(net.inner) > LARGEST_FRAME:
            continue
        own = name.partition(",")[0]
        out[name] = out[own] if own in out else make_engine(own, net)
    return out


def ending(name: str, engine: Engine, grips: Grips, wanted: Exact) -> dict[str, object]:
    """Return how an engine ends on a grip set, the true error of an answer, and what it says."""
    want = FIELDS | Want.SCREEN if name == COMPARED else FIELDS
    net, true = engine.network, wanted.answer
    bricks = len(net.inner)
    try:
        fields = engine.solve(bricks, np.array(grips, dtype=int).reshape(1, -1), want)
    except MechanismError as refusal:
        right = true is None or wanted.digits > UNDECIDED
        return {"status": "mechanism" if right else "wrong", "message": str(refusal)}
    except SolverError as refusal:
        return {"status": "refused", "message": str(refusal)}
    if true is None:
        return {"status": "wrong", "message": "no mechanism seen"}
    moved = fields.displacement[0, net.inner[:bricks].ravel()]
    off, most = worst(moved, fields.joint_wrench[0], true), stated(name, net, wanted.digits)
    return {"status": "answered" if off <= most else "wrong", "error": off, "stated": most}


def rows(cell: Cell, wanted: Sequence[Exact]) -> Iterator[dict[str, object]]:
    """Yield how every engine ends on every grip set of a cell."""
    made = engines(cell.network)
    for case, (grips, one) in enumerate(zip(cell.grips, wanted, strict=True)):
        for name, engine in made.items():
            row = {"axis": cell.axis, "value": f"{cell.value:g}", "method": name}
            case_name = f"{cell.network.scene.name}, {case}"
            yield row | {"case": case_name} | ending(name, engine, grips, one)
