"""OpenSeesPy asked what the engines are asked, the fastest of the frame packages that were tried.

A model is kept for one brick count and only its pins are swapped. Half-edges are rigid offsets of
the joints' beams, which leaves two nodes a brick; see `experiments.peers.parts.chain` for how bars
show rigid bricks. Its license restricts redistribution: it is installed by hand.
"""

import ctypes
import importlib
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from experiments.peers.parts.chain import CONTRAST, Answer, Chain
from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Want
from seqopt.network.network import GROUND

LIBRARIES = ("libquadmath.so.0", "libgfortran.so.4", "libblas.so.3", "liblapack.so.3")
NOTHING: Floats = np.zeros(0)


class OpenSees:
    """Two nodes a brick, banded Cholesky, single-point constraints swapped."""

    def __init__(self, chain: Chain) -> None:
        self.chain, self.held = chain, np.zeros(0, dtype=np.int64)
        self.ops = ops = open_sees()
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


def open_sees() -> Any:
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
