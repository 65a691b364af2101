"""Elastic limits: whether the stress in joints stays below the strength of their mortar.

The wrench (force and moment) of a joint is distributed linearly over its face: force over area,
moment over second moment. The stress is largest at the corners, so it is checked there: tension
against the tensile strength, and shear against cohesion and friction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seqopt.arrays import Bools, Floats, FrozenValue
from seqopt.contact.assembly import Assembly
from seqopt.contact.faces import bare_assembly
from seqopt.contact.mortar import Mortar
from seqopt.contact.quadrature import (
    face_quadrature,
    first_points,
    opening_maps,
    quadrature_stiffness,
)
from seqopt.network.network import Network

STRESS_MARGIN = 1e-6  # stress above a limit that counts as none, over the stress scale


@dataclass(frozen=True, eq=False, repr=False)
class ElasticLimits(FrozenValue):
    """The faces of a structure and the strength of their mortar; joints in the network's order.

    Attributes
    ----------
    assembly : Assembly
    mortar : Mortar
    stress : (K, 3, 6) float
        Compression and shear at the corners for unit wrenches of their joints, Pa/N, Pa/(N m).
    """

    assembly: Assembly
    mortar: Mortar
    stress: Floats

    def excess(self, wrench: Floats) -> Floats:
        """Return by how much wrenches exceed the limits of the joints.

        Parameters
        ----------
        wrench : (S, J, 6) float
            As of `seqopt.engines.interface.Fields`, N and N m.

        Returns
        -------
        (S, J) float
            Pa; negative is within.
        """
        face, mortar = self.assembly.contact, self.mortar
        stress = np.einsum("kij,skj->ski", self.stress, wrench[:, face])
        shear = np.linalg.norm(stress[..., 1:], axis=2)
        beyond = np.maximum(
            -stress[..., 0] - mortar.tensile_strength,
            shear - mortar.cohesion - mortar.friction * stress[..., 0],
        )
        most = np.maximum.reduceat(beyond, first_points(face, wrench.shape[1]), axis=1)
        return np.asarray(np.where(np.any(wrench, axis=2), most, -np.inf))

    def exceeded(self, wrench: Floats) -> Bools:
        """Return which grip sets leave the elastic limits anywhere, beyond rounding.

        Parameters
        ----------
        wrench : (S, J, 6) float
            As of `excess`.

        Returns
        -------
        (S,) bool
        """
        margin = STRESS_MARGIN * self.assembly.stress_scale
        if self._bound(wrench) <= margin:  # as a rule, and a tenth of the work
            return np.zeros(len(wrench), dtype=bool)
        return np.asarray(self.excess(wrench).max(axis=1, initial=-np.inf) > margin)

    def _bound(self, wrench: Floats) -> float:
        """Return what no wrench (S, J, 6) exceeds its limits by, Pa, from the largest of each."""
        most, least = wrench.max(axis=0, initial=0.0), wrench.min(axis=0, initial=0.0)
        largest = np.maximum(most, -least)[self.assembly.contact]
        stress = (np.abs(self.stress) @ largest[:, :, None])[:, :, 0]
        shear = np.linalg.norm(stress[:, 1:], axis=1) + self.mortar.friction * stress[:, 0]
        tension = stress[:, 0] - self.mortar.tensile_strength
        return float(np.maximum(tension, shear - self.mortar.cohesion).max())


def find_elastic_limits(network: Network, mortar: Mortar) -> ElasticLimits:
    """Return the elastic limits of a structure's joints.

    Parameters
    ----------
    network : Network
    mortar : Mortar
        Of all joints.

    Returns
    -------
    ElasticLimits

    Raises
    ------
    SceneError
        If the faces of a joint do not overlap.
    """
    assembly = bare_assembly(network, len(network.inner))
    where = network.springs.position
    bed = face_quadrature(assembly)
    maps = opening_maps(assembly, bed.point, bed.face, where)
    evenly = quadrature_stiffness(bed, maps, np.ones((len(where), 2)))
    corner = opening_maps(assembly, assembly.corner, assembly.contact, where)
    return ElasticLimits(assembly, mortar, corner @ np.linalg.inv(evenly)[assembly.contact])
