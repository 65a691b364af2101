"""The samples that ship with compas_cra, and its solvers as witnesses.

`force_only` (RBE) asks, as we do, whether contact forces hold the blocks up. It allows tension but
prices it a million times higher than compression: an assembly falls where tension remains. A price
is no ban, and a little remains where much is pressed; what that leaves open, `without_tension`
decides from RBE's own constraints. They bound friction by an octagon *around* Coulomb's circle, up
to 8 % too wide in its corners.
"""

import contextlib
import io
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog

from experiments.stability.parts.blocks import BOX, Blocks, Contact, ring, stack, touching
from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.network.network import GROUND
from seqopt.stability.verdict import Verdict

SLOPE = np.pi / 6
VOUSSOIRS = 24


@dataclass(frozen=True)
class Solid:
    """A closed polyhedron: vertices (V, 3) and faces, counterclockwise from outside."""

    vertex: Floats
    faces: tuple[tuple[int, ...], ...]

    @property
    def mass(self) -> tuple[float, Floats]:
        """Volume and centroid; every face is a fan of triangles around its middle."""
        corner = self.vertex - self.vertex.mean(axis=0)
        parts = []
        for fan in (corner[list(face)] for face in self.faces):
            middle = np.broadcast_to(fan.mean(axis=0), fan.shape)
            parts.append(np.stack([fan, np.roll(fan, -1, axis=0), middle], 1))
        triangles = np.concatenate(parts)
        volume = np.linalg.det(triangles) / 6
        total = float(volume.sum())
        return total, (volume @ triangles.sum(axis=1) / 4 / total) + self.vertex.mean(axis=0)

    @property
    def convex(self) -> bool:
        """Whether no vertex lies before a face, but for a ten-thousandth of the size."""
        for face in self.faces:
            middle = self.vertex[list(face)].mean(axis=0)
            spoke = self.vertex[list(face)] - middle
            normal = np.cross(spoke, np.roll(spoke, -1, axis=0)).sum(axis=0)
            height = (self.vertex - middle) @ normal
            if height.max() > 1e-4 * np.linalg.norm(normal) * np.ptp(self.vertex, axis=0).max():
                return False
        return True


@dataclass(frozen=True)
class Touch:
    """A face between two solids: its corners (m, 3), and two axes whose cross product is normal.

    The normal points from the first solid into the second.
    """

    pair: tuple[int, int]
    corner: Floats
    axes: Floats

    @property
    def normal(self) -> Floats:
        """Unit vector from the first solid into the second."""
        return np.asarray(np.cross(self.axes[0], self.axes[1]))


@dataclass(frozen=True)
class Scene:
    """Solids, some of them supports, and the faces where they touch."""

    solids: tuple[Solid, ...]
    supports: frozenset[int]
    touches: tuple[Touch, ...] = field(default=())

    @property
    def free(self) -> list[int]:
        """The solids that are no supports."""
        return [i for i in range(len(self.solids)) if i not in self.supports]

    @property
    def volume(self) -> float:
        """Volume of the solids that are no supports."""
        return float(sum(self.solids[i].mass[0] for i in self.free))

    def assembly(self, density: float = 1.0) -> Assembly:
        """Return the free solids under a gravity of 1; the supports are the ground."""
        number = {block: i for i, block in enumerate(self.free)}
        masses = [self.solids[i].mass for i in self.free]
        weight = np.array([[0.0, 0.0, -density * volume] for volume, _ in masses])
        contacts, normals = [], []
        for touch in self.touches:
            a, b = (number.get(block, GROUND) for block in touch.pair)
            turned = b == GROUND
            contacts.append(Contact((b, a) if turned else (a, b), touch.corner))
            normals.append(-touch.normal if turned else touch.normal)
        plain = touching(np.array([middle for _, middle in masses]), weight, contacts)
        return replace(plain, normal=np.array(normals))


def scene_of(blocks: Blocks, supports: set[int]) -> Scene:
    """Return the scene of eight-cornered blocks, some of them supports."""
    solids = []
    for vertex in blocks.vertex:
        solid = Solid(vertex, BOX)
        inward = solid.mass[0] < 0
        solids.append(Solid(vertex, tuple(face[::-1] for face in BOX)) if inward else solid)
    touches = []
    for contact in blocks.contacts:
        a, b = contact.bodies
        if a == GROUND or {a, b} <= supports:
            continue
        first = contact.corner[1] - contact.corner[0]
        normal = np.cross(first, contact.corner[-1] - contact.corner[0])
        if normal @ (solids[b].mass[1] - solids[a].mass[1]) < 0:
            normal = -normal
        axes = np.array([first, np.cross(normal, first)])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        touches.append(Touch((a, b), contact.corner, axes))
    return Scene(tuple(solids), frozenset(supports), tuple(touches))


def arch(ratio: float) -> Scene:
    """Return a semicircular arch of a thickness over radius, between two fixed springers."""
    count = VOUSSOIRS + 2
    return scene_of(ring(count, 5.0, 5.0 * ratio, 0.5 * np.pi * count / VOUSSOIRS), {0, count - 1})


def incline(turn: float = 0.0) -> Scene:
    """Return a cube on another one, both turned in plan and then tilted by the slope."""
    c, s = np.cos(turn), np.sin(turn)
    plan = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = np.cos(SLOPE), np.sin(SLOPE)
    tilt: Floats = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ plan
    flat = stack([0.0])
    contacts = tuple(Contact(x.bodies, x.corner @ tilt.T) for x in flat.contacts)
    return scene_of(Blocks(flat.vertex @ tilt.T, contacts), {0})


SOUND = 3e-5  # tension up to this, over the mean weight of the free blocks, is none
TORN = 1e-3  # from this on it is real; between the two it decides nothing
LIMIT = 120.0  # s, of a program that might not end


@dataclass(frozen=True)
class Sample:
    """How the examples of compas_cra use a sample; the last two numbers are for detection."""

    supports: tuple[int, ...]
    friction: float = 0.84
    area: float = 1e-2
    distance: float = 1e-2


SHELF = Sample((0,), 0.9, 1e-6, 1e-4)
TYPE = Sample((0, 1))
ONE = Sample((0,))
SAMPLES = {
    "armadillo_cra": Sample(()),  # the file marks its supports
    "bridge": Sample((0, 1), 0.9, 1e-6, 1e-4),
    **dict.fromkeys(("shelf", "shelf-s1", "shelf-s2", "shelf-s3", "shelf-stable"), SHELF),
    "cubes": ONE,
    **dict.fromkeys(("A", "H"), TYPE),
    "snake": Sample((0,), 0.7, 1e-4, 1e-2),
    **dict.fromkeys(("type-a", "type-b", "type-c", "type-d"), TYPE),
    **dict.fromkeys(("concave-short", "concave-long", "curve-3-blocks"), ONE),
    **dict.fromkeys(("cube-curve-short", "cube-curve-tall"), ONE),
}


def sample_scene(name: str) -> Scene:
    """Return a sample as its file has it; faces that no file stores are detected by compas_cra."""
    folder = Path(import_module("compas_cra").SAMPLE)
    graph = json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
    graph = graph["data"]["graph"]["data"]
    keys = {key: i for i, key in enumerate(graph["node"])}
    solids = tuple(_solid(**node["block"]["data"]) for node in graph["node"].values())
    marked = {keys[key] for key, node in graph["node"].items() if node.get("is_support")}
    supports = frozenset(marked | {keys[str(i)] for i in SAMPLES[name].supports})
    stored = []
    for u, ends in graph["edge"].items():
        for v, edge in ends.items():
            for face in (each["data"] for each in edge.get("interfaces", ())):
                axes = [face["frame"]["data"][name] for name in ("xaxis", "yaxis")]
                pair = keys[u], keys[v]
                stored.append(Touch(pair, np.array(face["points"]), np.array(axes)))
    scene = Scene(solids, supports, tuple(t for t in stored if not supports >= set(t.pair)))
    return scene if stored else detected(scene, SAMPLES[name])


def _solid(vertex: dict[str, Any], face: dict[str, Any], **_: Any) -> Solid:
    number = {key: i for i, key in enumerate(vertex)}
    faces = tuple(tuple(number[str(i)] for i in corners) for corners in face.values())
    return Solid(np.array([[v["x"], v["y"], v["z"]] for v in vertex.values()]), faces)


def detected(scene: Scene, sample: Sample) -> Scene:
    """Return the scene with the faces that compas_cra detects."""
    assembly = _compas(scene)
    find = import_module("compas_cra.algorithms").assembly_interfaces_numpy
    with contextlib.redirect_stdout(io.StringIO()):
        find(assembly, nmax=20, amin=sample.area, tmax=sample.distance)
    touches = []
    for pair, face in _faces(assembly):
        axes = np.array([[*face.frame.xaxis], [*face.frame.yaxis]])
        touches.append(Touch(pair, np.array(face.points), axes))
    return replace(scene, touches=tuple(touches))


def _compas(scene: Scene) -> Any:
    assembly = import_module("compas_cra.datastructures").CRA_Assembly()
    make = import_module("compas_assembly.datastructures").Block.from_vertices_and_faces
    frame = import_module("compas.geometry").Frame
    for i, solid in enumerate(scene.solids):
        assembly.add_block(make(solid.vertex.tolist(), [list(f) for f in solid.faces]), node=i)
    for i in scene.supports:
        assembly.set_boundary_condition(i)
    for touch in scene.touches:
        corner = touch.corner
        fan = np.cross(corner[1:-1] - corner[0], corner[2:] - corner[0]).sum(axis=0)
        assembly.add_to_interfaces(
            *touch.pair,
            size=0.5 * float(np.linalg.norm(fan)),
            points=corner.tolist(),
            frame=frame(corner.mean(axis=0).tolist(), *touch.axes.tolist()),
        )
    return assembly


def _faces(assembly: Any) -> Iterator[tuple[tuple[int, int], Any]]:
    for edge in assembly.graph.edges():
        for face in assembly.graph.edge_attribute(edge, "interfaces"):
            yield edge, face


@dataclass(frozen=True)
class Word:
    """What RBE says: largest tension over the mean weight of the free blocks, and its time, s.

    The tension is inf if not even tension helps.
    """

    tension: float
    seconds: float

    @property
    def verdict(self) -> Verdict:
        """What the tension means."""
        if self.tension <= SOUND:
            return Verdict.STANDS
        return Verdict.FALLS if self.tension >= TORN else Verdict.UNDECIDED


def force_only(scene: Scene, friction: float, density: float | None = None) -> Word:
    """Return what RBE says; without a density, with the free solids weighing 1 together."""
    density = density or 1 / scene.volume
    solve = import_module("compas_cra.equilibrium").rbe_solve
    assembly = _compas(scene)
    start = time.perf_counter()
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            solve(assembly, mu=friction, density=density)
    except ValueError as error:
        lost = np.inf if "infeasible" in str(error) else np.nan
        return Word(lost, time.perf_counter() - start)
    seconds = time.perf_counter() - start
    tension = max(corner["c_nn"] for _, face in _faces(assembly) for corner in face.forces)
    return Word(tension / (density * scene.volume / len(scene.free)), seconds)


def without_tension(scene: Scene, friction: float) -> Verdict:
    """Return whether RBE's equations and friction octagons have a solution without tension."""
    matrices = import_module("compas_cra.equilibrium.cra_helper")
    assembly = _compas(scene)
    with contextlib.redirect_stdout(io.StringIO()):
        balance = matrices.equilibrium_setup(assembly)
        octagon = matrices.friction_setup(assembly, friction)
        load = matrices.external_force_setup(assembly, len(scene.free) / scene.volume).ravel()
    corners = balance.shape[1] // 3
    parts = np.zeros(3 * corners), octagon, np.zeros(octagon.shape[0]), balance, -load
    bounds = [(0, None), (None, None), (None, None)] * corners
    found = linprog(*parts, bounds, method="highs-ipm", options={"time_limit": LIMIT})
    return {0: Verdict.STANDS, 2: Verdict.FALLS}.get(found.status, Verdict.UNDECIDED)
