"""Bricks that hang one on another without closing a loop: answers by one factor for all of them.

Each brick but the first ones hangs on one earlier by one spring. The forces follow from equilibrium
alone, and the motions from the springs one after the other: the matrix of what springs part by is
triangular in the order of building, so the one of a whole build answers all of its beginnings.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse.linalg import SuperLU, splu

from seqopt.arrays import Floats
from seqopt.engines.rigid._mechanism import Ungripped
from seqopt.network._mechanics import deformation
from seqopt.network.network import Network


class Hanging:
    """The first bricks of a structure for as long as each hangs on one spring.

    ``bricks``: how many, zero if the first one does not.
    """

    def __init__(self, network: Network) -> None:
        self._network, springs = network, network.springs
        each = np.arange(min(len(network.inner), len(springs.since)))
        alone = (springs.since[each] == each + 1) & (springs.bodies[each, 1] == each)
        count = int(alone.argmin()) if not alone.all() else len(each)
        more = springs.since[count:].min(initial=len(network.inner) + 1)
        self.bricks = min(count, int(more) - 1)

    @cached_property
    def factors(self) -> SuperLU:
        """Of what springs part by for unit twists, in the scene's axes."""
        springs, first = self._network.springs, slice(self.bricks)
        center = self._network.centroid[first]
        gap = deformation(springs.bodies[first], springs.position[first], center).tocsc()
        return splu(gap, "NATURAL", diag_pivot_thresh=0.0, options={"Equil": False})


@dataclass(frozen=True)
class HangingSystem:
    """The system of a partial structure that hangs, as `_HeldSystem` of loose ones."""

    parts: Ungripped
    hanging: Hanging
    loose: int = 0  # nothing is, as springs resist every motion

    def solve(self, loads: Floats, _: Floats | None = None) -> tuple[Floats, Floats]:
        """Return scaled states (S, 6s + 6b), and no forces (S, 0) at loose motions.

        ``loads`` (S, 6s + 6b): scaled, of the springs' equations and of equilibrium.
        """
        parts, size = self.parts, 6 * self.parts.bricks
        lever = parts.wrench_unit / parts.unit
        row = 1 / np.maximum(1.0, parts.stiffness)
        borne = self._along_springs(self._sums(loads[:, size:] / parts.twist_unit, "T"))
        wrench = -borne / lever
        given = (loads[:, :size] - row * wrench) / (row * parts.stiffness) / lever
        twist = self._sums(self._along_springs(given, back=True), "N") / parts.twist_unit
        return np.hstack([wrench, twist]), np.zeros((len(loads), 0))

    def _sums(self, right: Floats, which: str) -> Floats:
        """Return what leads to right sides (S, 6b), of the matrix or its transpose."""
        whole = np.zeros((6 * self.hanging.bricks, len(right)), order="F")
        whole[: right.shape[1]] = right.T
        found: Floats = self.hanging.factors.solve(whole, which)  # type: ignore[call-overload]
        return found[: right.shape[1]].T

    def _along_springs(self, values: Floats, *, back: bool = False) -> Floats:
        """Return vectors (S, 6s) in the springs' own axes; ``back``: from there in the scene's."""
        axes = self.parts.network.springs.axes[: self.parts.bricks]
        own = values.reshape(len(values), -1, 2, 3)
        how = "nshi,sij->nshj" if back else "nshj,sij->nshi"
        return np.asarray(np.einsum(how, own, axes).reshape(values.shape))
