"""The samples that ship with compas_cra, and its solvers as witnesses.

`force_only` (RBE) asks, as we do, whether contact forces hold the blocks up. It allows tension but
prices it a million times higher than compression: an assembly falls where tension remains. A price
is no ban, and a little remains where much is pressed; what that leaves open, `without_tension`
decides from RBE's own constraints. They bound friction by an octagon *around* Coulomb's circle, up
to 8 % too wide in its corners. `coupled` (CRA) asks also that the forces belong to small motions of
the blocks, which rejects blocks that are wedged; a local search, its "infeasible" is no proof.
"""

import contextlib
import io
import json
import multiprocessing
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import linprog

from experiments.stability.parts.witness_scenes import Scene, Solid, Touch
from seqopt.stability.assessment import Verdict

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


def coupled(scene: Scene, friction: float, density: float | None = None) -> str:
    """Return how CRA ends, in a process of its own that can be stopped."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        asked = pool.apply_async(_coupled, (scene, friction, density or 1 / scene.volume))
        try:
            return asked.get(timeout=LIMIT)
        except multiprocessing.TimeoutError:
            return "out of time"


def _coupled(scene: Scene, friction: float, density: float) -> str:
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said):
            solve = import_module("compas_cra.equilibrium").cra_solve
            solve(_compas(scene), mu=friction, density=density)
    except ValueError as error:
        return "infeasible" if "infeasible" in str(error) else "failed"
    return said.getvalue().rsplit("result:", 1)[-1].strip()
