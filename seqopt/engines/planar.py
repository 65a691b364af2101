"""The planar engine: three unknowns per brick, for structures held and loaded in their own plane.

If bricks, springs and gravity lie in one plane and every grip holds a node in it, nothing moves or
turns out of the plane, and forces across it are zero. Half of the unknowns are then not needed.
This is exact, not an approximation. Motions out of the plane are not considered.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.named import NamedEngine
from seqopt.engines.plane import NoPlane, Plane, find_plane, off_plane
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, SceneError
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene

ELSE = "use the compliance engine"


class PlanarEngine(NamedEngine):
    """Computes any batch of grip sets on any partial structure of a planar scene.

    Parameters
    ----------
    network : Network or Scene
    plane : Plane, optional
        The structure's, if it is known; by default it is found.

    Raises
    ------
    SceneError
        If bricks, springs or gravity leave the scene's plane.
    """

    def __init__(self, network: Network | Scene, plane: Plane | None = None) -> None:
        network = network_of(network)
        found = find_plane(network) if plane is None else plane
        if isinstance(found, NoPlane):
            raise SceneError(f"{found.reason}; {ELSE}")
        self.plane = found
        self._engine = ComplianceEngine(network, found.basis)

    @property
    def network(self) -> Network:
        """The network whose nodes and edges the fields follow."""
        return self._engine.network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Return the fields of a partial structure for many grip sets.

        Parameters
        ----------
        bricks : int
            How many bricks stand.
        grips : (S, r) int
            Node numbers.
        want : Want, optional

        Raises
        ------
        GripError
            As of `seqopt.engines.interface.Engine`, and if a grip lies outside the plane.
        MechanismError, SolverError
            As of `seqopt.engines.interface.Engine`.
        """
        away = off_plane(self.network, self.plane, grip_columns(self.network, bricks, grips))
        if away.any():
            node = np.asarray(grips).ravel()[away.argmax()]
            raise GripError(
                f"grip on node {node}: it lies {1e3 * away.max():.3g} mm outside the scene's "
                f"plane; {ELSE}"
            )
        return self._engine.solve(bricks, grips, want)
