"""The linear program of plane statics, by another solver."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.stability.parts.blocks import ring, stack
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.mortar import Mortar
from seqopt.stability._prover import Prover
from seqopt.stability.assessment import bonded


def plane_bond(assembly, friction):
    """Least bond of blocks in a plane by scipy's simplex: Coulomb is linear there."""
    from scipy.optimize import linprog  # noqa: PLC0415

    k = len(assembly.corner)
    along = np.abs(assembly.axes[assembly.contact] @ [0.0, 1.0, 0.0]) < 1e-9
    share = assembly.corner_area * assembly.stress_scale / assembly.scales[0]
    matrix = assembly.contact_map.toarray()
    equal = np.hstack([matrix, np.zeros((len(matrix), 1))])
    rows, right = [], []
    for i in range(k):
        row = np.zeros(3 * k + 1)
        row[3 * i], row[-1] = -1.0, -share[i]
        rows.append(row)
        for j in (1, 2):
            if along[i, j]:
                for sign in (1.0, -1.0):
                    row = np.zeros(3 * k + 1)
                    row[3 * i + j], row[3 * i], row[-1] = (
                        sign,
                        -friction,
                        -share[i] * (1 + friction),
                    )
                    rows.append(row)
            else:
                for sign in (1.0, -1.0):
                    row = np.zeros(3 * k + 1)
                    row[3 * i + j] = sign
                    rows.append(row)
        right = np.zeros(len(rows))
    cost = np.eye(3 * k + 1)[-1]
    bounds = [(None, None)] * (3 * k) + [(0, None)]
    answer = linprog(
        cost, np.array(rows), right, equal, -assembly.load(), bounds=bounds, method="highs"
    )
    assert answer.status == 0
    return answer.fun


@pytest.mark.parametrize("friction", [0.2, 0.6])
@pytest.mark.parametrize(
    "blocks", [stack([0.7]), stack([0.3, 0.4, -0.1]), ring(9, 5.0, 0.4), ring(6, 5.0, 1.5)]
)
def test_a_simplex_finds_the_same_bond(blocks, friction):
    assembly = blocks.assembly(2000.0)
    own = Prover(assembly, compile_equilibrium)(bonded(assembly, Mortar(friction=friction)))
    assert own.value == pytest.approx(plane_bond(assembly, friction), rel=1e-4, abs=1e-6)
