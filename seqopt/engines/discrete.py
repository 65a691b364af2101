"""The discrete-element engine: rigid bricks on beds of springs that open, slip and break.

A joint is its own elastic spring in series with a bed of points over the face between its bricks,
so that within the elastic limits the answer is that of exactly rigid bricks; the bed takes over
where tension or shear exceeds what the mortar holds. With a `BedStiffness` the bed alone is the
joint, as in the discrete-element models of Bruun et al. (section 3.2.3). Every grip holds its node
and lets its brick turn.

Points of a bed are springs until a bond breaks, then contact and friction. A bond breaks where
tension exceeds the strength or shear exceeds cohesion and friction, and is then lost for good. What
is broken carries compression and shear up to friction; it slips along the shear and keeps its slip,
as long as it is closed.

One grip set at a time: Newton's method with the exact tangent, the load in steps once a bond
breaks. What it finds is an equilibrium within all limits, reached from rest with grips that only
react. `seqopt.stability` asks less: only that balanced forces exist.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.contact.assembly import bare_assembly
from seqopt.contact.mortar import EPOXY, BedStiffness, Mortar, face_quadrature, opening_maps
from seqopt.contact.mortar import quadrature_stiffness as bed_stiffness
from seqopt.engines.interface import FAR, Fields, GripCompliance, OpeningEngine, grip_springs
from seqopt.engines.rigid._mixed import Solution, mechanism_error, require_resistance, respond
from seqopt.errors import SolverError
from seqopt.network._mechanics import deformation, node_motion, point_motion, spring_stiffness
from seqopt.network.network import Network
from seqopt.scene.scene import Scene

_EXCESS = 1e-9  # stress above a limit that counts as none, over the stress scale
_BED_OVER_JOINT = 10.0  # how much stiffer a bed is than its joint, whichever way it moves
_ITERATIONS = 60
_BALANCED = 1e-10  # largest force left on a body, over the heaviest body's weight
_ROUNDING = 1e-13  # relative
_HIDDEN = 1e-4  # of the heaviest body's weight, that rounding may leave: else nothing rests
LARGEST_STEP, SMALLEST_STEP = 0.1, 1e-3  # of the load, once a bond breaks
_FIRST_RESISTANCE = 1.0  # resistance to motion at first, over the stiffness
_MOVES = 120  # against a resistance
_HALVINGS = 4
_LENT_STIFFNESS = 1e-12  # lent to every motion, over its own: a loose body can come to rest


@dataclass(frozen=True, eq=False, repr=False)
class _Points(FrozenValue):
    """The springs of P points of a bed.

    ``area`` (P,): m²; ``normal``, ``tangential`` (P,): stiffness, N/m; ``stress_scale``: Pa.
    """

    area: Floats
    normal: Floats
    tangential: Floats
    mortar: Mortar
    stress_scale: float

    def exceeds(self, force: Floats) -> Bools:
        """Return at which points (P,) bonds do not hold forces (P, 3)."""
        mortar, margin = self.mortar, _EXCESS * self.stress_scale
        normal, shear = force[:, 0] / self.area, np.linalg.norm(force[:, 1:], axis=1) / self.area
        slides = shear > mortar.cohesion + mortar.friction * normal + margin
        return np.asarray((-normal > mortar.tensile_strength + margin) | slides)

    def forces(self, opening: Floats, slip: Floats, broken: Bools) -> tuple[Floats, Floats]:
        """Return forces on the second bodies, and how fast they fall.

        ``opening`` (P, 3); ``slip`` (P, 2); ``broken`` (P,): where the bond is lost. Results:
        ``force`` (P, 3): N; ``slope`` (P, 3, 3): minus its derivative by the opening, N/m.
        """
        slope = np.zeros((len(opening), 3, 3))
        slope[:, 0, 0] = self.normal
        slope[:, 1, 1] = slope[:, 2, 2] = self.tangential
        force = -np.diagonal(slope, axis1=1, axis2=2) * opening  # of unbroken springs, slipped
        force[:, 1:] += self.tangential[:, None] * slip
        size = np.linalg.norm(force[:, 1:], axis=1)
        limit = self.mortar.friction * np.maximum(force[:, 0], 0.0)
        slips = np.flatnonzero(broken & (size > limit))
        along = force[slips, 1:] / size[slips, None]
        share = (limit[slips] / size[slips] * self.tangential[slips])[:, None, None]
        slope[slips, 1:, 1:] = share * (np.eye(2) - along[:, :, None] * along[:, None, :])
        slope[slips, 1:, 0] = self.mortar.friction * self.normal[slips, None] * along
        force[slips, 1:] = limit[slips, None] * along
        apart = broken & (force[:, 0] <= 0)
        force[apart], slope[apart] = 0.0, 0.0
        return force, slope


@dataclass(frozen=True, eq=False, repr=False)
class _System(FrozenValue):
    """Bodies, their connections and loads; the bricks are the first bodies.

    Twists are in m and rad over ``unit``, wrenches in N and N m times it.
    """

    bricks: int
    acting: Ints  # (J,); the springs whose joints these are
    points: _Points
    face: Ints  # (P,); the joint of every point, in ascending order
    first: Ints  # (J,); the first point of every joint
    maps: Floats  # (P, 3, 6); openings for unit twists across a joint, taken at its spring
    gap: sparse.csr_array  # (6J, 6n); twists across the beds for unit twists of the n bodies
    layers: sparse.csr_array  # (6n, 6n); stiffness of the elastic layers
    load: Floats  # (6n,)
    moved: Floats  # (6J,); how the ground moves where beds lie on it
    unit: Floats  # (6n,)
    length: float  # of a brick, m
    scale: float  # the heaviest body's weight, N

    def bed_wrenches(self, force: Floats) -> Floats:
        """Return the wrenches (J, 6) of point forces (P, 3) on second bodies, about the springs."""
        each = np.einsum("pij,pi->pj", self.maps, force)
        return np.asarray(np.add.reduceat(each, self.first, axis=0))

    def beds(self, slope: Floats) -> sparse.csr_array:
        """Return the stiffness (6J, 6J) of the beds for twists across; slopes as of `_Points`."""
        falls = (slope @ self.maps).reshape(-1, 6)
        maps, ends = self.maps.reshape(-1, 6), [*3 * self.first, None]
        parts = [slice(*part) for part in pairwise(ends)]
        return _diagonal(np.array([maps[part].T @ falls[part] for part in parts]))


def _build_system(
    network: Network, bricks: int, mortar: Mortar, bed: BedStiffness | None
) -> _System:
    """Return the system of a partial structure; raises `SceneError` if faces do not overlap.

    ``bed``: the joints themselves; by default beds in series with layers, as stiff as the scene
    says.
    """
    assembly, acting = bare_assembly(network, bricks), network.springs.acting(bricks)
    bed_points = face_quadrature(assembly)
    face, area = bed_points.face, bed_points.area
    maps = opening_maps(assembly, bed_points.point, face, network.springs.position[acting])
    own = None
    if bed is None:
        stiffness, even = spring_stiffness(network, acting), np.ones((len(acting), 2))
        beds = bed_stiffness(bed_points, maps, even)
        pairs = zip(stiffness, beds, strict=True)
        most = np.array([linalg.eigh(k, b, eigvals_only=True)[-1] for k, b in pairs])
        moduli = even * (_BED_OVER_JOINT * most[:, None])  # stiffer than its joint every way
        share = np.eye(6) - np.linalg.solve(bed_stiffness(bed_points, maps, moduli), stiffness)
        layer = np.linalg.solve(share.transpose(0, 2, 1), stiffness.transpose(0, 2, 1))
        own = np.asarray(0.5 * (layer + layer.transpose(0, 2, 1)))  # in series with their beds
    else:
        moduli = np.tile([bed.normal, bed.tangential], (len(acting), 1))
    length = max(network.scene.placed[0].dimensions)
    gap, layers, unit = _joined(network, bricks, length, own)
    # plates weigh nothing
    load = np.pad(network.weight[:bricks], ((0, len(unit) // 6 - bricks), (0, 3)))
    load[:bricks] += network.applied(bricks)
    moved = network.springs.movement[acting].ravel()
    normal, tangential = (area * moduli[face, i] for i in (0, 1))
    points = _Points(area, normal, tangential, mortar, assembly.stress_scale)
    pull = load.ravel() * unit
    return _System(
        bricks=bricks,
        acting=acting,
        points=points,
        face=face,
        first=np.searchsorted(face, np.arange(len(acting))),
        maps=maps,
        gap=gap,
        layers=layers,
        load=pull,
        moved=moved,
        unit=unit,
        length=length,
        scale=float(np.abs(pull).max()) or 1.0,
    )


def _joined(
    network: Network, bricks: int, length: float, own: Floats | None
) -> tuple[sparse.csr_array, sparse.csr_array, Floats]:
    """Return twists across beds (6J, 6n), stiffness of layers (6n, 6n) and unit (6n,) of bodies.

    Between a joint's layer of stiffness ``own`` (J, 6, 6) and its bed is one more body, a plate. It
    moves as the twist across its bed says: as a difference of two motions, the twist across a bed
    that is far stiffer than the rest would be lost to rounding.
    """
    acting = network.springs.acting(bricks)
    bodies, where = network.springs.bodies[acting], network.springs.position[acting]
    plates = 0 if own is None else len(acting)
    unit = np.tile(np.repeat([1.0, 1.0 / length], 3), bricks + plates)
    units = sparse.csr_array(sparse.diags_array(unit))
    brick, gap = units[: 6 * bricks, : 6 * bricks], units[6 * bricks :]
    joint = sparse.csr_array(deformation(bodies, where, network.centroid[:bricks]) @ brick)
    if own is None:
        return joint, sparse.csr_array(units.shape), unit
    layer = sparse.hstack([joint, -gap[:, 6 * bricks :]])
    return gap, sparse.csr_array(layer.T @ _diagonal(own) @ layer), unit


def _diagonal(blocks: Floats) -> sparse.csr_array:
    """Return blocks (J, 6, 6) as one matrix; SciPy deprecates `block_diag` of dense blocks."""
    index = np.arange(len(blocks) + 1)
    return sparse.csr_array(sparse.bsr_array((blocks, index[:-1], index)))


class _Held:
    """A system and the forces of its grips.

    ``free`` (6n, m): motions that the grips leave; ``pads`` (6n, 6n): stiffness of compliant grips;
    ``far``, ``pull`` (6n,): how grips move the bodies that they hold, and pull at those that stay,
    all the way; ``diagonal`` (m,): of the unbroken stiffness in the free motions.
    """

    def __init__(
        self,
        system: _System,
        free: sparse.csr_array,
        pads: sparse.csr_array,
        far: Floats,
        pull: Floats,
    ) -> None:
        self.system, self.free, self.pads, self.far, self.pull = system, free, pads, far, pull
        self.across = sparse.csr_array(system.gap @ free)  # twists across the beds, (6J, m)
        self.taken, stiff = system.gap @ far, system.layers + pads
        self._unbroken = sparse.csr_array(free.T @ stiff @ free)  # but for beds, (m, m)
        self.sizes = sparse.csr_array(abs(system.layers) + abs(pads))
        none = np.zeros((len(system.points.area), 3))
        _, slope = system.points.forces(none, none[:, 1:], np.zeros(len(none), bool))
        self.diagonal = self.stiffness(slope).diagonal()

    def moved(self, motion: Floats, share: float = 1.0) -> Floats:
        """Return how bodies move (6n,). ``motion`` (m,): in the free motions; ``share``: of it."""
        return np.asarray(self.free @ motion + share * self.far)

    def reaction(self, motion: Floats, force: Floats, share: float = 1.0) -> Floats:
        """Return the unbalanced wrenches on bodies (6n,), which the grips must take.

        ``motion`` (m,): in the free motions; ``force`` (P, 3): of the points, N; ``share``: of the
        load, and of the ways of grips.
        """
        system, moved = self.system, self.moved(motion, share)
        carried = system.gap.T @ system.bed_wrenches(force).ravel()
        given = share * (system.load + self.pull)
        return np.asarray(given + carried - (system.layers + self.pads) @ moved)

    def gone(self, state: _Settled) -> bool:
        """Return whether a state has moved too far for the bricks to be where they were."""
        return bool(np.abs(state.motion).max(initial=0.0) > FAR * self.system.length)

    def stiffness(self, slope: Floats) -> sparse.csr_array:
        """Return the stiffness (m, m) in the free motions; slopes as of `_Points.forces`."""
        beds = self.across.T @ self.system.beds(slope) @ self.across
        return sparse.csr_array(beds + self._unbroken)


@dataclass(frozen=True, eq=False, repr=False)
class _Settled(FrozenValue):
    """A state of the bodies.

    ``motion`` (m,): in the free motions; ``force`` (P, 3): of the points on second bodies, N;
    ``slip`` (P, 2); ``broken`` (P,); ``left``: largest force not balanced, over the heaviest body's
    weight or what rounding makes of it.
    """

    motion: Floats
    force: Floats
    slip: Floats
    broken: Bools
    left: float

    @property
    def rests(self) -> bool:
        """Whether this is an equilibrium."""
        return self.left <= _BALANCED


def _settle(held: _Held) -> _Settled:
    """Return where a structure comes to rest within all limits, or as far as it was followed.

    Where no bond breaks under the whole load at once, none would on the way to it: the limits are
    convex. Otherwise the load grows in steps, which shrink where none is found, and a bond once
    broken stays so.
    """
    points = held.system.points
    dry = points.mortar.tensile_strength == 0 and points.mortar.cohesion == 0
    none, motion = np.zeros((len(points.area), 3)), np.zeros(held.free.shape[1])
    unloaded = _Settled(motion, none, none[:, 1:], np.full(len(none), dry), np.inf)
    state = _balance(held, unloaded, 1.0)
    if dry or (state.rests and not points.exceeds(state.force).any()):
        return state
    state, at, step = unloaded, 0.0, LARGEST_STEP
    while at < 1.0:
        target = min(at + step, 1.0)
        found = _balance(held, state, target)
        while found.rests and (breaks := points.exceeds(found.force) & ~found.broken).any():
            found = _balance(held, replace(found, broken=found.broken | breaks), target)
        if found.rests:
            state, at, step = found, target, min(2 * step, LARGEST_STEP)
        elif step > SMALLEST_STEP:
            step /= 2
        else:
            return found
    return state


def _balance(held: _Held, state: _Settled, share: float) -> _Settled:
    """Return where a state moves to under a share of the load with the bonds it has.

    By Newton at once; else by letting the structure move against a resistance that fades
    (pseudo-transient continuation, Kelley and Keyes 1998), friction keeping track of every slip.
    """
    found = _newton(held, state, share, 0.0)
    state = replace(state, left=np.inf)
    resistance = _FIRST_RESISTANCE
    for _ in range(_MOVES):
        if found is not None and (found.rests or held.gone(found)):
            # a brick that moved by its length left its faces: no small residual counts
            far = np.abs(found.motion).max(initial=0) > held.system.length
            return replace(found, left=np.inf) if far and found.broken.any() else found
        found = _newton(held, state, share, resistance)
        if found is None:
            resistance *= 8
        else:
            state, resistance = found, resistance / 2
    return state


def _newton(held: _Held, state: _Settled, share: float, resistance: float) -> _Settled | None:
    """Return where a state moves to against a resistance, over the stiffness of every motion."""
    system, motion, shorter = held.system, state.motion, 0
    drag = np.maximum(resistance, _LENT_STIFFNESS) * held.diagonal
    step, best = np.zeros_like(motion), np.inf
    for _ in range(_ITERATIONS):
        across = held.across @ motion + share * held.taken - share * system.moved
        opening = np.einsum("pij,pj->pi", system.maps, across.reshape(-1, 6)[system.face])
        force, slope = system.points.forces(opening, state.slip, state.broken)
        left = held.free.T @ held.reaction(motion, force, share)
        missing = left - resistance * held.diagonal * (motion - state.motion)
        size = np.linalg.norm(missing)
        large = (held.sizes @ np.abs(held.moved(motion))).max() + np.abs(force).sum()
        rounding = min(_ROUNDING * float(large), _HIDDEN * system.scale)
        unit = max(system.scale, rounding / _BALANCED)
        if np.abs(missing).max() <= _BALANCED * unit:
            slip = opening[:, 1:] + force[:, 1:] / system.points.tangential[:, None]
            return _Settled(motion, force, slip, state.broken, float(np.abs(left).max() / unit))
        if size >= best and shorter < _HALVINGS:
            step *= 0.5
            motion, shorter = motion - step, shorter + 1
            continue
        best, shorter = float(size), 0
        step = splu((held.stiffness(slope) + sparse.diags_array(drag)).tocsc()).solve(missing)
        motion = motion + step
    return None


class DiscreteEngine(OpeningEngine):
    """Solves each grip set by discrete elements.

    Raises `MechanismError` also if the structure moves a tenth of a brick's length and is not
    stopped by then; `SolverError` also if it neither rests nor goes; `SceneError` if faces do not
    overlap.

    ``bed``: the joints themselves; by default they are as stiff as the scene says.
    """

    def __init__(
        self, network: Network | Scene, mortar: Mortar = EPOXY, bed: BedStiffness | None = None
    ) -> None:
        super().__init__(network)
        self._mortar, self._bed = mortar, bed
        self._systems: dict[int, _System] = {}

    def _answer(self, bricks: int, columns: Ints, compliance: GripCompliance) -> Fields:
        network = self.network
        require_resistance(network, bricks, columns, compliance)
        if bricks not in self._systems:
            self._systems[bricks] = _build_system(network, bricks, self._mortar, self._bed)
        system = self._systems[bricks]
        nodes, springs = network.inner.ravel()[columns], list[_Spring]()
        for grip, ways, flexibility, offset in grip_springs(compliance, len(columns)):
            body = int(columns[grip] // 2)
            arm = network.node_position[nodes[grip]] - network.centroid[body]
            every = np.vstack([point_motion(arm), np.eye(6)[3:]]) * system.unit[:6]
            stiffness = np.asarray(np.linalg.inv(flexibility), float)
            springs.append(_Spring(grip, body, ways, every[ways], stiffness, offset))
        held = _held_nodes(network, system, columns, compliance, springs)
        found = _settle(held)
        if found.rests:
            return _fields(network, held, found, columns, springs)
        if held.gone(found):
            moved = (system.unit * held.moved(found.motion))[: 6 * bricks]
            text = "joints open or slip and brick {brick} becomes unstable; add a grip, a bond or "
            raise mechanism_error(network, moved, text + "friction")
        names = ", ".join(str(network.node_name[node]) for node in nodes) or "nothing"
        raise SolverError(
            f"{bricks} bricks held at {names}: the discrete elements neither came to rest nor "
            "became unstable; assess the step's stability to learn whether there is an equilibrium"
        )


class _Spring(NamedTuple):
    """A compliant grip."""

    grip: int
    body: int
    ways: list[int]  # in which of shifts and turns it is compliant, w
    motion: Floats  # (w, 6); how its node shifts and turns with the body, scaled as the system is
    stiffness: Floats  # (w, w)
    far: Floats  # (w,); how far its end is moved


def _held_nodes(
    network: Network,
    system: _System,
    columns: Ints,
    compliance: GripCompliance,
    springs: list[_Spring],
) -> _Held:
    """Return a system whose nodes are held: rigidly, or by springs of compliant grips."""
    count = len(system.load) // 6
    blocks, taken = [np.eye(6)] * count, np.zeros_like(system.load)
    pads, pull = [sparse.csr_array((6, 6))] * count, np.zeros_like(system.load)
    rigid, far = ~compliance.compliant(1, len(columns))[0], compliance.offsets(len(columns))
    nodes = network.node_position[network.inner.ravel()[columns]]
    for body in np.unique(columns[rigid] // 2):
        mine = rigid & (columns // 2 == body)
        moved = point_motion(nodes[mine] - network.centroid[body]).reshape(-1, 6)
        moved *= system.unit[:6]
        own = slice(6 * body, 6 * body + 6)
        blocks[body] = linalg.null_space(moved)
        taken[own] = np.linalg.lstsq(moved, far[mine].ravel(), rcond=None)[0]
    for spring in springs:
        own = slice(6 * spring.body, 6 * spring.body + 6)
        pad = spring.motion.T @ spring.stiffness @ spring.motion
        pads[spring.body] = pads[spring.body] + sparse.csr_array(pad)
        pull[own] += spring.motion.T @ spring.stiffness @ spring.far
    free = sparse.csr_array(sparse.block_diag([sparse.csr_array(block) for block in blocks]))
    return _Held(system, free, sparse.csr_array(sparse.block_diag(pads)), taken, pull)


def _fields(
    network: Network, held: _Held, found: _Settled, columns: Ints, springs: list[_Spring]
) -> Fields:
    """Return the fields of one grip set; two rigid grips on one brick share with least forces."""
    system, moved = held.system, held.moved(found.motion)
    wrench = np.zeros((len(network.springs.since), 6))
    wrench[system.acting] = system.bed_wrenches(found.force)
    exerted = -held.reaction(found.motion, found.force)
    (force, moment), compliant = np.zeros((2, len(columns), 3)), np.zeros(len(columns), dtype=bool)
    for spring in springs:
        both, twist = np.zeros(6), moved[6 * spring.body : 6 * spring.body + 6]
        both[spring.ways] = spring.stiffness @ (spring.far - spring.motion @ twist)
        force[spring.grip], moment[spring.grip] = both[:3], both[3:]
        compliant[spring.grip] = 0 in spring.ways
    nodes = network.node_position[network.inner.ravel()[columns]]
    for body in np.unique(columns[~compliant] // 2):
        mine = np.flatnonzero(~compliant & (columns // 2 == body))
        rows = slice(6 * body, 6 * body + 6)
        if len(mine) == 1:
            force[mine[0]] = exerted[rows][:3]
        else:
            maps = point_motion(nodes[mine] - network.centroid[body]).reshape(-1, 6).T
            pulls = np.linalg.lstsq(maps, exerted[rows] / system.unit[rows], rcond=None)[0]
            force[mine] = pulls.reshape(-1, 3)
    twist = (system.unit * moved)[None, : 6 * system.bricks]
    solution = Solution(twist, wrench[None], force[None], moment[None], compliant[None])
    return respond(network, node_motion(network, system.bricks), columns[None], solution)
