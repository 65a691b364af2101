"""How far an answer can be trusted: solved well, ill-conditioned, or a mechanism.

Two questions are kept apart. The backward error says whether the fields answer a problem next to
the one that was asked; a long chain may be solved well although its condition is huge and the plain
residual, relative to the load, looks like failure. Whether the structure resists every motion at
all is asked of the ties that springs and grips are, however soft; the smallest eigenvalue of the
stiffness, scaled by its diagonal, says how well it does.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Floats, FrozenValue
from seqopt.engines.eigenvalues import spectrum
from seqopt.engines.interface import Engine, Want, grip_columns
from seqopt.engines.residuals import Residuals, residual
from seqopt.engines.rigid.mechanism import free_motion
from seqopt.engines.rigid.mixed import solve_mixed
from seqopt.errors import MechanismError, SolverError
from seqopt.network.network import Network

LOOKED_INTO = 1e-15  # a smallest scaled eigenvalue below which a motion may be free
WELL = 1e-9  # largest backward error of fields that keep the nine digits an engine promises


class Finding(Enum):
    """What a diagnosis says."""

    SOLVED_WELL = "SOLVED WELL"
    ILL_CONDITIONED = "ILL-CONDITIONED"
    MECHANISM = "MECHANISM"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(FrozenValue):
    """The diagnosis of one grip set on one partial structure.

    Attributes
    ----------
    finding : Finding
    reason : str
    residuals : Residuals or None
        None if the engine refused.
    smallest_eigenvalue : float
        Of the constrained stiffness scaled by its diagonal, without unit; 0 of a mechanism.
    condition : float
        Largest over smallest scaled eigenvalue.
    mode : (b, 6) float
        The motion that is resisted least: translation of every brick's centroid over the length of
        the longest brick's inner edge, and rotation; the largest component is 1.
    """

    finding: Finding
    reason: str
    residuals: Residuals | None
    smallest_eigenvalue: float
    condition: float
    mode: Floats

    @property
    def backward_error(self) -> float:
        """Largest residual that measures quality; infinite if the engine refused."""
        return np.inf if self.residuals is None else self.residuals.backward_error


def diagnose(source: Engine | Network, bricks: int, grips: ArrayLike) -> Diagnosis:
    """Return whether one grip set is solved well, ill-conditioned or a mechanism.

    Parameters
    ----------
    source : Engine or Network
        The engine whose fields are judged; of a network, the mixed solution is.
    bricks : int
        How many bricks stand.
    grips : (r,) int
        Node numbers.

    Returns
    -------
    Diagnosis

    Raises
    ------
    GripError
        If the grips are not those of a grip set.
    """
    network = source if isinstance(source, Network) else source.network
    numbers = np.array(grips, dtype=np.int64).reshape(1, -1)
    columns = grip_columns(network, bricks, numbers)
    lowest, condition, mode = spectrum(network, bricks, columns[0])
    free = free_motion(network, bricks, columns[0]) if lowest < LOOKED_INTO else None
    if free is not None:
        lowest, condition, mode = 0.0, np.inf, free
    residuals, refusal = None, None
    try:
        if isinstance(source, Network):
            fields = solve_mixed(network, bricks, columns)
        else:
            fields = source.solve(bricks, numbers, Want.JOINTS | Want.BRICKS)
        residuals = residual(network, bricks, columns[0], fields)
    except (MechanismError, SolverError) as error:
        refusal = error
    finding, reason = _judge(lowest, condition, residuals, refusal)
    return Diagnosis(finding, reason, residuals, lowest, condition, mode)


def _judge(
    lowest: float,
    condition: float,
    residuals: Residuals | None,
    refusal: MechanismError | SolverError | None,
) -> tuple[Finding, str]:
    if not lowest:
        return (
            Finding.MECHANISM,
            "neither joints nor ground nor grips resist the motion",
        )
    if residuals is None:
        return Finding.ILL_CONDITIONED, f"condition {condition:.1e}; the engine refused: {refusal}"
    error = residuals.backward_error
    if error <= WELL:
        text = f"backward error {error:.1e}, at most {WELL:g}, at a condition of {condition:.1e}"
        return Finding.SOLVED_WELL, text
    text = f"backward error {error:.1e}, above {WELL:g}, at a condition of {condition:.1e}"
    return Finding.ILL_CONDITIONED, f"{text}: the fields do not solve the equations"
