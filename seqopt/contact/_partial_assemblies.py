"""Partial structures with grips, cut from one whole: nothing is found or checked again for a step.

The parts of a partial structure come first in a network, and so do its contacts and corners in the
assembly of the whole. Only what is largest or heaviest in it, and all lengths over a lever, differ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from seqopt.contact._prop_grips import added, prop_grips
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import _applied_rows, bare_assembly
from seqopt.network.network import GROUND, Network

_KEPT = 3000  # bricks in all partial structures that are kept, some 5 kB each


class PartialAssemblies:
    """Gives what `step_assembly` does for steps of up to so many bricks.

    Its maps differ by rounding, and all else in no bit. Raises a `SceneError` if bricks that share
    a joint do not touch, even in a step that is not asked for.
    """

    def __init__(self, network: Network, bricks: int) -> None:
        self.network, self.bricks = network, bricks
        self._whole = whole = bare_assembly(network, bricks)
        placed = network.scene.placed
        self._block = {node: i for i, brick in enumerate(placed) for node in brick.nodes}
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
        whole, scene = self._whole, self.network.scene
        contacts = len(self.network.springs.acting(bricks))
        corners = int(np.searchsorted(whole.contact, contacts))
        payload = [robot.payload for robot in scene.robots]
        payload += [max(payload, default=0.0)] * (len(grips) - len(payload))
        pairs = zip(grips, payload, strict=True)
        held = [(node, most) for node, most in pairs if node is not None]
        props = prop_grips(self.network, bricks, held=bool(held))
        nodes = [*(node for node, _ in held), *props.nodes]
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
                "grip_block": np.array([self._block[node] for node in nodes], dtype=np.int64),
                "grip_position": np.array([scene.node_position(n) for n in nodes]).reshape(-1, 3),
                "payload": np.array([*(payload for _, payload in held), *props.payload]),
                "applied": added(_applied_rows(self.network, bricks), props.applied),
                "grip_line": np.concatenate([np.zeros((len(held), 3)), props.line]),
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
            self._last = {key: self._contact_map(bricks, corners, scales[1])}
        part.__setstate__({"scales": scales, "contact_map": self._last[key]})
        return part

    def _contact_map(self, bricks: int, corners: int, length: float) -> sparse.csr_array:
        """Return the first lines and columns of the whole's map, moments over another length."""
        ends = self._map.indptr[: 3 * corners + 1]
        kept = slice(0, int(ends[-1]))
        ratio = np.where(self._turning[kept], self._whole.scales[1] / length, 1.0)
        entries = self._map.data[kept] * ratio, self._map.indices[kept], ends
        return sparse.csc_array(entries, shape=(6 * bricks, 3 * corners)).tocsr()
