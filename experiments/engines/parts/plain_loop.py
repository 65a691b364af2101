"""The loop that somebody would write in C++, compiled where a compiler is there.

It has what the engine knows of the loads, and nothing that a user is owed: no names of nodes are
read, no grips are checked, two grips on one brick have no answer, and no digit is looked after.
"""

import ctypes
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from seqopt.arrays import Floats, Ints
from seqopt.engines.interface import Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine

SOURCE = Path(__file__).with_suffix(".cpp")
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp-simd", "-fPIC")
# not for linking: a library that is linked so sets small numbers to zero in the whole process
SURE = 1e-6  # least pivot from which on its answers are compared


@cache
def compiled() -> ctypes.CDLL | None:
    """Return the compiled loop; None without a compiler."""
    compiler = shutil.which("g++")
    if compiler is None:
        return None
    with TemporaryDirectory() as folder:
        part, library = Path(folder, "plain_loop.o"), Path(folder, "plain_loop.so")
        subprocess.run([compiler, *FLAGS, "-c", str(SOURCE), "-o", str(part)], check=True)
        subprocess.run([compiler, "-shared", str(part), "-o", str(library)], check=True)
        return ctypes.CDLL(str(library))


class PlainLoop:
    """Extremes of sets of three grips on one partial structure, as `Extremes` has them."""

    def __init__(self, engine: ComplianceEngine, bricks: int, sets: Ints) -> None:
        engine.solve(bricks, sets)
        operator, network = engine._kept[bricks], engine.network
        columns = grip_columns(network, bricks, sets)
        nodes = operator.load_index(columns)[:, ::3] // 3
        self._index = np.ascontiguousarray(nodes)
        loads, means = len(operator.flexibility), operator.mean
        moved = means("displacement").reshape(loads + 1, -1, 3).transpose(2, 0, 1)
        turned = means("support").reshape(loads + 1, -1, 6)[..., 3:]
        each = means("edge_force"), moved, turned.reshape(loads + 1, -1)
        rows = [np.ascontiguousarray(one, dtype=float) for one in each]
        widths = rows[0].shape[1], rows[1].shape[2], rows[2].shape[1] // 3
        held = operator.flexibility, operator.dead_displacement
        self._fixed = loads, [np.ascontiguousarray(one) for one in held], rows, widths
        self.out = np.empty((len(sets), 5))

    def __call__(self) -> None:
        """Fill ``out`` (S, 5): largest tension, displacement, moment, force; least pivot."""
        library = compiled()
        assert library is not None
        loads, held, rows, widths = self._fixed
        pairs = [part for pair in zip(widths, map(_at, rows), strict=True) for part in pair]
        sized = [ctypes.c_int64(p) if isinstance(p, int) else p for p in pairs]
        library.extremes_of_three(
            ctypes.c_int64(len(self._index)),
            _at(self._index),
            ctypes.c_int64(loads),
            *map(_at, held),
            *sized,
            _at(self.out),
        )

    def off(self, engine: ComplianceEngine, bricks: int, sets: Ints) -> Floats:
        """Return by how much extremes (4,) differ from the engine's, over the largest of each."""
        own = engine._extremes(bricks, sets, Want.RESPONSES)
        wanted = np.stack([own.most, own.shift, own.moment, own.force.max(axis=1)], axis=1)
        sure = self.out[:, 4] > SURE
        gap = np.abs(self.out[sure, :4] - wanted[sure]).max(axis=0)
        return np.asarray(gap / wanted[sure].max(axis=0))


def _at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
