"""Frame packages asked what the engines are asked: PyNite, OpenSeesPy and pyconmech.

Each model is kept for one brick count and only its pins are swapped. OpenSeesPy carries
half-edges as rigid offsets of the joints' beams, which leaves it two nodes a brick; the two others
need a bar for each half-edge. See `experiments.peers.parts.chain` for how they show rigid bricks.
"""

import ctypes
import importlib
import importlib.util
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from experiments.peers.parts.chain import CONTRAST, Answer, Chain, Peer, about_anchor, beams
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Want
from seqopt.network.network import GROUND

CASE = "Combo 1"  # PyNite's name of the one load combination
LIBRARIES = ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3")
NOTHING: Floats = np.zeros(0)
AXES = ("X", "Y", "Z")
MODULES = {"PyNite": "Pynite", "OpenSeesPy": "openseespy", "pyconmech": "pyconmech"}


class OpenSees:
    """OpenSeesPy: two nodes a brick, banded Cholesky, single-point constraints swapped."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.held = chain, np.zeros(0, dtype=np.int64)
        self.ops = ops = _open_sees()
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        count = len(chain.position)
        for i, x in enumerate(chain.position.tolist()):
            ops.node(i + 1, *x)
        self.bars = range(1, chain.bricks + 1)
        self.joints = range(chain.bricks + 1, chain.bricks + 1 + len(chain.joints))
        for tag in self.bars:
            span = chain.position[2 * tag - 1] - chain.position[2 * tag - 2]
            ops.geomTransf("Linear", tag, *_aside(span))
            self._beam(tag, 2 * tag - 1, 2 * tag, CONTRAST, float(np.linalg.norm(span)))
        for tag, (i, j), s in zip(self.joints, chain.joints, range(len(chain.joints)), strict=True):
            first = i + 1 if i != GROUND else count + 1 + s
            start = chain.position[i] if i != GROUND else chain.anchor[s]
            if i == GROUND:
                ops.node(int(first), *start.tolist())
                ops.fix(int(first), *[1] * 6)
            offsets = (chain.ends[s] - np.stack([start, chain.position[j]])).ravel().tolist()
            ops.geomTransf("Linear", tag, *_aside(chain.across[s]), "-jntOffset", *offsets)
            self._beam(tag, int(first), int(j) + 1, 1.0, chain.length)
        self.bases = (count + 1 + chain.support).tolist()
        ops.timeSeries("Constant", 1)
        ops.pattern("Plain", 1, 1)
        for i, force in enumerate(self.chain.load.tolist()):
            ops.load(i + 1, *force, 0.0, 0.0, 0.0)
        ops.constraints("Plain")
        ops.numberer("Plain")
        ops.system("BandSPD")
        ops.algorithm("Linear")
        ops.integrator("LoadControl", 1.0)
        ops.analysis("Static", "-noWarnings")

    def _beam(self, tag: int, first: int, second: int, factor: float, length: float) -> None:
        axial, turn = (factor * length * self.chain.stiffness).tolist()
        ends = (first, second)
        self.ops.element("elasticBeamColumn", tag, *ends, axial, 1.0, 1.0, turn, turn, turn, tag)

    def solve(self, grips: Ints, want: Want) -> Answer:
        """See `Peer.solve`."""
        ops, chain = self.ops, self.chain
        for node in self.held.tolist():
            for axis in (1, 2, 3):
                ops.remove("sp", node, axis)
        self.held = grips + 1
        ops.reset()
        for node in self.held.tolist():
            ops.fix(node, 1, 1, 1, 0, 0, 0)
        if ops.analyze(1):
            raise ArithmeticError("OpenSees: analysis failed")
        ops.reactions()
        held = np.array([ops.nodeReaction(n)[:3] for n in self.held.tolist()]).reshape(-1, 3)
        base = np.array([ops.nodeReaction(node) for node in self.bases])
        force = bars = state = NOTHING
        if want & Want.EDGES:
            force = -np.array([ops.eleForce(tag)[6:9] for tag in self.joints])
            bars = np.array([ops.basicForce(tag)[0] for tag in self.bars])
        if want & Want.DISPLACEMENTS:
            state = np.array([ops.nodeDisp(n + 1) for n in range(len(chain.position))])
        return chain.answer(state, force, bars, held, base)


def _open_sees() -> Any:
    """Return OpenSees after loading the libraries that its wheel brings but does not find."""
    found = importlib.util.find_spec("openseespylinux")
    if found is not None and found.origin is not None:
        for name in LIBRARIES:
            path = Path(found.origin).parent / "lib" / name
            if path.exists():
                ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    return importlib.import_module("openseespy.opensees")


def _aside(direction: Floats) -> list[float]:
    """Return a direction well off the given one."""
    axis = int(np.abs(direction).argmin())
    return [float(i == axis) for i in range(3)]


class PyNite:
    """PyNite: beams alone, sparse solver, no check of stability; supports redefined."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.held = chain, np.zeros(0, dtype=np.int64)
        self.beams = parts = beams(chain)
        self.model = model = importlib.import_module("Pynite").FEModel3D()
        model.add_material("unit", 1.0, 1.0, 0.0, 0.0)
        for i, x in enumerate(parts.position.tolist()):
            model.add_node(f"n{i}", *x)
        for b, (i, j) in enumerate(parts.pairs.tolist()):
            axial, turn = parts.sections(chain)[b].tolist()
            model.add_section(f"s{b}", axial, turn, turn, turn)
            model.add_member(f"b{b}", f"n{i}", f"n{j}", "unit", f"s{b}")
        for node in parts.fixed.tolist():
            model.def_support(f"n{node}", *[True] * 6)
        for i, force in enumerate(chain.load.tolist()):
            for axis, part in zip(AXES, force, strict=True):
                model.add_node_load(f"n{i}", f"F{axis}", part)

    def solve(self, grips: Ints, want: Want) -> Answer:
        """See `Peer.solve`."""
        model, chain = self.model, self.chain
        for nodes, flags in ((self.held, [False] * 6), (grips, [True] * 3 + [False] * 3)):
            for node in nodes.tolist():
                model.def_support(f"n{node}", *flags)
        self.held = grips
        model.analyze_linear(check_stability=False)
        held = np.array([self._read("RxnF", n) for n in grips.tolist()]).reshape(-1, 3)
        bases = self.beams.support.tolist()
        reaction = np.array([[*self._read("RxnF", n), *self._read("RxnM", n)] for n in bases])
        force = bars = state = NOTHING
        if want & Want.EDGES:
            bricks, members = chain.bricks, model.members
            joints = range(bricks, bricks + len(chain.joints))
            bars = np.array([members[f"b{b}"].f(CASE)[6, 0] for b in range(bricks)])
            force = -1.0 * np.array([members[f"b{b}"].F(CASE)[6:9, 0] for b in joints])
        if want & Want.DISPLACEMENTS:
            inner = range(len(chain.position))
            state = np.array([[*self._read("D", n), *self._read("R", n)] for n in inner])
        return chain.answer(state, force, bars, held, about_anchor(chain, reaction))

    def _read(self, what: str, node: int) -> list[float]:
        """Return three components of a result at a node."""
        found = self.model.nodes[f"n{node}"]
        return [float(getattr(found, what + axis)[CASE]) for axis in AXES]


class Conmech:
    """pyconmech: beams alone, SuperLU; it returns every field whatever is asked."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.beams = chain, beams(chain)
        io = importlib.import_module("pyconmech.frame_analysis.io_base")
        solver = importlib.import_module("pyconmech.frame_analysis.numpy_stiffness")
        self.support = io.Support
        parts, sections = self.beams, self.beams.sections(chain).tolist()
        fixed = set(parts.fixed.tolist())
        nodes = [io.Node(x, i, i in fixed) for i, x in enumerate(parts.position.tolist())]
        elements = [io.Element(pair, b, f"b{b}") for b, pair in enumerate(parts.pairs.tolist())]
        named = enumerate(sections)
        shapes = [io.CrossSec(axial, turn, turn, turn, [f"b{b}"]) for b, (axial, turn) in named]
        unit = [io.Material(1.0, 1.0, 1.0, 0.0, [element.elem_tag for element in elements])]
        supports = [io.Support([1] * 6, node) for node in sorted(fixed)]
        self.frame = solver.NumpyStiffness(io.Model(nodes, elements, supports, [], unit, shapes))
        zero = [0.0] * 3
        loads = enumerate(chain.load.tolist())
        self.frame.set_load({i: io.PointLoad(force, zero, i) for i, force in loads})
        self.fixed = dict(self.frame._supports)

    def solve(self, grips: Ints, want: Want) -> Answer:
        """See `Peer.solve`."""
        chain, frame = self.chain, self.frame
        pins = {n: self.support([1, 1, 1, 0, 0, 0], n) for n in grips.tolist()}
        frame._supports = self.fixed | pins
        with warnings.catch_warnings():  # it factors a matrix stored by rows
            warnings.simplefilter("ignore")
            frame.solve()
        _, moved, reaction, ends = frame.get_solved_results()
        at = {int(row[0]): row[1:] for row in reaction}
        held = np.array([at[n][:3] for n in grips.tolist()]).reshape(-1, 3)
        base = about_anchor(chain, np.array([at[n] for n in self.beams.support.tolist()]))
        bricks = chain.bricks
        force = bars = state = NOTHING
        if want & Want.EDGES:
            bars = ends[:bricks, 7]
            own = np.stack([frame._rot_list[b][:3, :3] for b in self.beams.joint_beams(chain)])
            force = -np.einsum("bji,bj->bi", own, ends[self.beams.joint_beams(chain), 7:10])
        if want & Want.DISPLACEMENTS:
            state = moved[np.argsort(moved[:, 0]), 1:][: len(chain.position)]
        return chain.answer(state, force, bars, held, base)


PACKAGES: dict[str, Callable[[Chain], Peer]]
PACKAGES = {"PyNite": PyNite, "OpenSeesPy": OpenSees, "pyconmech": Conmech}


def missing_packages() -> list[str]:
    out = []
    for name, module in MODULES.items():
        try:
            _open_sees() if name == "OpenSeesPy" else importlib.import_module(module)
        except (ImportError, OSError, RuntimeError):
            out.append(name)
    return out
