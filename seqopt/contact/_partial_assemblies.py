"""Partial structures with grips, cut from one whole: nothing is found or checked again for a step.

The parts of a partial structure come first in a network, and so do its contacts and corners in the
assembly of the whole. Only what is largest or heaviest in it, and all lengths over a lever, differ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from seqopt.contact._prop_grips import grip_fields
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import bare_assembly
from seqopt.network.network import GROUND, Network

_KEPT = 3000  # bricks in all partial structures that are kept, some 5 kB each


class PartialAssemblies:
    """Cuts the assemblies of steps, as of `step_assembly`, from one whole.

    Its maps differ by rounding, and all else in no bit. Raises a `SceneError` if bricks that share
    a joint do not touch, even in a step that is not asked for.
    """

    def __init__(self, network: Network, bricks: int) -> None:
        self.network, self.bricks = network, bricks
        self._whole = whole = bare_assembly(network, bricks)
        self._heaviest = np.maximum.accumulate(np.linalg.norm(whole.weight, axis=1))
        lever = np.zeros(len(whole.corner))
        for body in whole.bodies[whole.contact].T:
            real = body != GROUND
            arm = whole.corner[real] - whole.centroid[body[real]]
            lever[real] = np.maximum(lever[real], np.linalg.norm(arm, axis=1))
        self._lever = np.maximum.accumulate(lever)
        self._map = whole.contact_map.tocsc()
        self._turning = self._map.indices % 6 >= 3  # which entries are moments
        self._last: dict[tuple[int, float], sparse.csr_array] = {}  # asked again by its next step
        self._made: dict[tuple[int, tuple[int | None, ...]], Assembly] = {}

    def __call__(self, bricks: int, grips: Sequence[int | None]) -> Assembly:
        """Return a partial structure with the grips that hold it; those made last are kept.

        Grips beyond those of the scene's robots bear what the strongest of these does.
        """
        key = bricks, (*grips,)
        if key not in self._made:
            if len(self._made) >= max(_KEPT // bricks, 1):
                self._made.clear()
            self._made[key] = self._cut(*key)
        return self._made[key]

    def _cut(self, bricks: int, grips: Sequence[int | None]) -> Assembly:
        whole = self._whole
        contacts = len(self.network.springs.acting(bricks))
        corners = int(np.searchsorted(whole.contact, contacts))
        payload = [robot.payload for robot in self.network.scene.robots]
        payload += [max(payload, default=0.0)] * (len(grips) - len(payload))
        pairs = zip(grips, payload, strict=True)
        held = [(node, most) for node, most in pairs if node is not None]
        part: Assembly = Assembly.__new__(Assembly)
        part.__setstate__(  # as one that was checked before
            {
                "block_name": whole.block_name[:bricks],
                "centroid": whole.centroid[:bricks],
                "weight": whole.weight[:bricks],
                "contact_name": whole.contact_name[:contacts],
                "bodies": whole.bodies[:contacts],
                "normal": whole.normal[:contacts],
                "corner": whole.corner[:corners],
                "contact": whole.contact[:corners],
                **grip_fields(self.network, bricks, held),
                "bond": np.zeros(0),
                "corner_area": whole.corner_area[:corners],
                "area": whole.area[:contacts],
                "axes": whole.axes[:contacts],
            }
        )
        levers = np.linalg.norm(part.grip_position - part.centroid[part.grip_block], axis=1)
        longest = max(self._lever[:corners].max(initial=0.0), levers.max(initial=0.0))
        scales = float(self._heaviest[bricks - 1]) or 1.0, float(longest) or 1.0
        key = bricks, scales[1]
        if key not in self._last:
            ends = self._map.indptr[: 3 * corners + 1]
            kept = slice(0, int(ends[-1]))
            ratio = np.where(self._turning[kept], whole.scales[1] / scales[1], 1.0)  # of levers
            entries = self._map.data[kept] * ratio, self._map.indices[kept], ends
            shape = 6 * bricks, 3 * corners
            self._last = {key: sparse.csc_array(entries, shape=shape).tocsr()}
        part.__setstate__({"scales": scales, "contact_map": self._last[key]})
        return part
