"""A partial structure as bodies, elastic layers and beds, ready to be settled.

Points of a bed are springs until a bond breaks, then contact and friction. A bond breaks where
tension exceeds the strength or shear exceeds cohesion and friction, and is then lost for good. What
is broken carries compression and shear up to friction; it slips along the shear and keeps its slip,
as long as it is closed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg, sparse

from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.contact._elastic_limits import Quadrature, face_quadrature, first_points, opening_maps
from seqopt.contact._elastic_limits import quadrature_stiffness as bed_stiffness
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import bare_assembly
from seqopt.contact.mortar import Mortar
from seqopt.errors import SceneError
from seqopt.network._mechanics import deformation, spring_stiffness
from seqopt.network.network import Network

_EXCESS = 1e-9  # stress above a limit that counts as none, over the stress scale


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

    def trial(self, opening: Floats, slip: Floats) -> Floats:
        """Return the forces of unbroken springs that have slipped.

        ``opening`` (P, 3); ``slip`` (P, 2). Result (P, 3): compression first, N.
        """
        stiffness = np.stack([self.normal, self.tangential, self.tangential], axis=1)
        force = -stiffness * opening
        force[:, 1:] += self.tangential[:, None] * slip
        return force

    def slipped(self, opening: Floats, force: Floats) -> Floats:
        """Return the slip that is left when points carry forces.

        ``opening`` (P, 3); ``force`` (P, 3): N. Result (P, 2): m.
        """
        return np.asarray(opening[:, 1:] + force[:, 1:] / self.tangential[:, None])

    def exceeds(self, force: Floats) -> Bools:
        """Return at which points bonds do not hold forces. ``force`` (P, 3): N. Result (P,)."""
        mortar, margin = self.mortar, _EXCESS * self.stress_scale
        normal, shear = force[:, 0] / self.area, np.linalg.norm(force[:, 1:], axis=1) / self.area
        return np.asarray(
            (-normal > mortar.tensile_strength + margin)
            | (shear > mortar.cohesion + mortar.friction * normal + margin)
        )

    def forces(self, opening: Floats, slip: Floats, broken: Bools) -> tuple[Floats, Floats]:
        """Return forces on the second bodies, and how fast they fall.

        ``opening`` (P, 3); ``slip`` (P, 2); ``broken`` (P,): where the bond is lost. Results:
        ``force`` (P, 3): N; ``slope`` (P, 3, 3): minus its derivative by the opening, N/m.
        """
        force = self.trial(opening, slip)
        slope = np.zeros((len(force), 3, 3))
        slope[:, 0, 0] = self.normal
        slope[:, 1, 1] = slope[:, 2, 2] = self.tangential
        size = np.linalg.norm(force[:, 1:], axis=1)
        limit = self.mortar.friction * np.maximum(force[:, 0], 0.0)
        slips = np.flatnonzero(broken & (size > limit))
        along = force[slips, 1:] / size[slips, None]
        share = limit[slips] / size[slips] * self.tangential[slips]
        slope[slips, 1:, 1:] = share[:, None, None] * (
            np.eye(2) - along[:, :, None] * along[:, None, :]
        )
        slope[slips, 1:, 0] = self.mortar.friction * self.normal[slips, None] * along
        force[slips, 1:] = limit[slips, None] * along
        apart = broken & (force[:, 0] <= 0)
        force[apart], slope[apart] = 0.0, 0.0
        return force, slope


_BED_OVER_JOINT = 10.0  # how much stiffer a bed is than its joint, whichever way it moves


@dataclass(frozen=True)
class BedStiffness:
    """Stiffness of a joint or pad per area.

    ``normal``, ``tangential``: N/m³. Raises `SceneError` if one is not a positive number.
    """

    normal: float
    tangential: float

    def __post_init__(self) -> None:
        for name in ("normal", "tangential"):
            if not 0 < getattr(self, name) < np.inf:
                raise SceneError(f"bed: {name} is {getattr(self, name)}; give a positive number")


@dataclass(frozen=True, eq=False, repr=False)
class System(FrozenValue):
    """Bodies, what holds them together, and what pulls at them; the bricks are the first bodies.

    Twists are in m and rad over ``unit``, wrenches in N and N m times it.
    """

    bricks: int
    acting: Ints  # (J,); the springs whose joints these are
    points: _Points
    face: Ints  # (P,); the joint of every point, in ascending order
    maps: Floats  # (P, 3, 6); openings for unit twists across a joint, taken at its spring
    gap: sparse.csr_array  # (6J, 6n); twists across the beds for unit twists of the n bodies
    layers: sparse.csr_array  # (6n, 6n); stiffness of the elastic layers
    load: Floats  # (6n,)
    unit: Floats  # (6n,)
    length: float  # of a brick, m

    def bed_wrenches(self, force: Floats) -> Floats:
        """Return the wrenches of point forces on second bodies, about the springs.

        ``force`` (P, 3): N. Result (J, 6): N and N m.
        """
        each = np.einsum("pij,pi->pj", self.maps, force)
        return np.asarray(np.add.reduceat(each, self._starts, axis=0))

    def stiffness(self, slope: Floats) -> sparse.csr_array:
        """Return the stiffness of layers and beds.

        ``slope`` (P, 3, 3): how fast the forces of the points fall, from `Points.forces`, N/m.
        Result (6n, 6n): for twists over ``unit``.
        """
        each = self.maps.transpose(0, 2, 1) @ slope @ self.maps
        joints = _diagonal(np.add.reduceat(each, self._starts, axis=0))
        return sparse.csr_array(self.gap.T @ joints @ self.gap + self.layers)

    def openings(self, twist: Floats) -> Floats:
        """Return the openings of the points for twists of the bodies.

        ``twist`` (6n,): over ``unit``. Result (P, 3): m.
        """
        across = (self.gap @ twist).reshape(-1, 6)
        return np.asarray(np.einsum("pij,pj->pi", self.maps, across[self.face]))

    @cached_property
    def scale(self) -> float:
        """The heaviest body's weight, N."""
        return float(np.abs(self.load).max()) or 1.0

    @property
    def _starts(self) -> Ints:
        return first_points(self.face, len(self.acting))


def build_system(network: Network, bricks: int, mortar: Mortar, bed: BedStiffness | None) -> System:
    """Return the system of a partial structure.

    ``mortar``: what the beds hold. ``bed``: the joints themselves; by default beds in series with
    layers are as stiff as the scene says. Raises `SceneError` if the faces of a joint do not
    overlap.
    """
    assembly = bare_assembly(network, bricks)
    acting = network.springs.acting(bricks)
    points = face_quadrature(assembly)
    maps = opening_maps(assembly, points.point, points.face, network.springs.position[acting])
    stiffness = spring_stiffness(network, acting)
    moduli = _moduli(bed, stiffness, points, maps)
    own = None
    if bed is None:
        own = _without(stiffness, bed_stiffness(points, maps, moduli))
    length = max(network.scene.placed[0].dimensions)
    gap, layers, unit = _joined(network, bricks, length, own)
    return System(
        bricks=bricks,
        acting=acting,
        points=_points(points, moduli, mortar, assembly),
        face=points.face,
        maps=maps,
        gap=gap,
        layers=layers,
        load=_load(network, bricks, unit),
        unit=unit,
        length=length,
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


def _load(network: Network, bricks: int, unit: Floats) -> Floats:
    """Return the weight of the bricks as wrenches (6n,) times their unit; plates weigh nothing."""
    load = np.zeros((len(unit) // 6, 6))
    load[:bricks, :3] = network.weight[:bricks]
    return load.ravel() * unit


def _moduli(
    bed: BedStiffness | None, stiffness: Floats, points: Quadrature, maps: Floats
) -> Floats:
    """Return the moduli (J, 2) of given beds, or of some stiffer than their joints every way."""
    if bed is not None:
        return np.tile([bed.normal, bed.tangential], (len(stiffness), 1))
    even = np.ones((len(stiffness), 2))
    return even * (
        _BED_OVER_JOINT * _relative_stiffness(stiffness, bed_stiffness(points, maps, even))
    )


def _points(points: Quadrature, moduli: Floats, mortar: Mortar, assembly: Assembly) -> _Points:
    normal, tangential = (points.area * moduli[points.face, i] for i in (0, 1))
    return _Points(points.area, normal, tangential, mortar, assembly.stress_scale)


def _relative_stiffness(stiffness: Floats, bed: Floats) -> Floats:
    """Return how much stiffer a joint is than a bed (J, 6, 6 both) where most so, (J, 1)."""
    most = [linalg.eigh(k, b, eigvals_only=True)[-1] for k, b in zip(stiffness, bed, strict=True)]
    return np.array(most)[:, None]


def _without(stiffness: Floats, bed: Floats) -> Floats:
    """Return the layers (J, 6, 6) that make joints when in series with beds."""
    share = np.eye(6) - np.linalg.solve(bed, stiffness)
    out = np.linalg.solve(share.transpose(0, 2, 1), stiffness.transpose(0, 2, 1))
    return np.asarray(0.5 * (out + out.transpose(0, 2, 1)))


def _diagonal(blocks: Floats) -> sparse.csr_array:
    """Return blocks (J, 6, 6) as one matrix; SciPy deprecates `block_diag` of dense blocks."""
    index = np.arange(len(blocks) + 1)
    return sparse.csr_array(sparse.bsr_array((blocks, index[:-1], index)))
