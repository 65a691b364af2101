"""Stress at the corners of a face."""

from __future__ import annotations

import math

import numpy as np
import pytest

from seqopt.contact._elastic_limits import find_elastic_limits
from seqopt.contact.mortar import DRY
from seqopt.network.build import build_network
from tests.builders import block


def test_stress_at_the_corners_is_that_of_a_beam():
    """Force over area, moment over section modulus, twist over the polar second moment."""
    size = length, width, _ = (0.4, 0.3, 0.5)
    limits = find_elastic_limits(build_network(block(size)), DRY)
    axes = {"N": (0, 0, 100.0, 0, 0, 0), "M": (0, 0, 0, 7.0, 0, 0), "T": (0, 0, 0, 0, 0, 5.0)}
    stress = {k: np.einsum("kij,j->ki", limits.stress, v) for k, v in axes.items()}
    assert stress["N"][:, 0] == pytest.approx(100 / (length * width))
    assert np.abs(stress["M"][:, 0]) == pytest.approx(7 * 6 / (length * width**2))
    polar = length * width * (length**2 + width**2) / 12
    shear = np.linalg.norm(stress["T"][:, 1:], axis=1)
    assert shear == pytest.approx(5 * math.hypot(length, width) / 2 / polar)
    wrench = np.array([[(0, 0, 100.0, 7.0, 0, 0)], [(0, 0, 100.0, 1.0, 0, 0)]])
    assert limits.exceeded(wrench).tolist() == [True, False]  # e = 70 mm and 10 mm, a sixth: 50
