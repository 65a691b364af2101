"""Points that stand for a face."""

from __future__ import annotations

import pytest

from experiments.stability.parts.blocks import stack
from seqopt.contact._elastic_limits import face_quadrature


@pytest.mark.parametrize("size", [(1.0, 0.5, 0.2), (0.3, 0.9, 2.0)])
def test_a_bed_has_the_moments_of_its_face(size):
    length, width, _ = size
    assembly = stack([], size).assembly(2000.0)
    bed = face_quadrature(assembly)
    away = bed.point - assembly.corner.mean(axis=0)
    assert bed.area.sum() == pytest.approx(length * width)
    assert bed.area @ away[:, 0] ** 2 == pytest.approx(width * length**3 / 12)
    assert bed.area @ away[:, 1] ** 2 == pytest.approx(length * width**3 / 12)
    assert bed.area @ (away[:, 0] * away[:, 1]) == pytest.approx(0, abs=1e-12)
    assert set(bed.face) == {0}
