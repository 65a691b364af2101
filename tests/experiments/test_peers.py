"""Peers: plain loops and general tools answer as we do, and a wrong one would be seen."""

from __future__ import annotations

import numpy as np
import pytest

from experiments.peers import peers
from experiments.peers.parts.models import Loop, OpenSees, chain_of, kept, open_sees
from experiments.peers.peers import Case, difference
from seqopt.engines.interface import Want, grip_columns

STATES = [(4, (1, 5, 7)), (17, (1, 20, 33)), (17, (1, 20, 21)), (25, (4, 47)), (25, (12, 13, 46))]


def gap(engine, solve):
    """Largest difference from the engine over a few states, two grips on one brick among them."""
    answers = []
    for bricks, grips in STATES:
        sets = np.array([grips])
        columns = grip_columns(engine.network, bricks, sets)
        case = Case(bricks, sets, columns, Want.RESPONSES)
        answers.append((case, 0, solve(bricks).solve(columns[0], Want.RESPONSES)))
    return difference(engine, answers)


def test_the_loop_agrees_with_the_engine_and_with_a_wrong_stiffness_does_not(engine25):
    """The joints a hundredth stiffer; forces hardly notice, displacements must."""
    right, wrong = (
        gap(engine25, lambda bricks, f=factor: Loop(kept(engine25.network, bricks, f)))
        for factor in (1.0, 1.01)
    )
    assert right <= peers.ALIKE
    assert wrong == pytest.approx(0.01, rel=0.05)


def test_opensees_agrees_with_the_engine(engine25):
    try:
        open_sees()
    except (ImportError, OSError, RuntimeError):
        pytest.skip("openseespy is not installed")
    made = gap(engine25, lambda bricks: OpenSees(chain_of(engine25.network, bricks)))
    assert made <= peers.ALIKE
