"""Beds of springs over contact faces, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.blocks import stack
from experiments.discrete_arches import bed, settle


def column(size):
    """One block on the ground, and its bed's second moments about the face's middle axes."""
    block = stack([], size).assembly(2000.0)
    points, contact, area = bed(block)
    away = points - block.corner.mean(axis=0)
    return block, area, away, contact


@pytest.mark.parametrize("size", [(1.0, 0.5, 0.2), (0.3, 0.9, 2.0)])
def test_a_bed_has_the_moments_of_its_face(size):
    length, width, _ = size
    _, area, away, contact = column(size)
    assert area.sum() == pytest.approx(length * width)
    assert area @ away[:, 0] ** 2 == pytest.approx(width * length**3 / 12)
    assert area @ away[:, 1] ** 2 == pytest.approx(length * width**3 / 12)
    assert area @ (away[:, 0] * away[:, 1]) == pytest.approx(0, abs=1e-12)
    assert set(contact) == {0}


def test_a_block_settles_leans_and_slips_as_springs_say():
    """Weight over normal stiffness; pulled sideways, force and moment over their stiffnesses."""
    size = length, width, height = 0.4, 0.3, 0.5
    block, *_ = column(size)
    weight = np.linalg.norm(block.weight)
    down, tension, shear = settle(block, 1e9, 1e8)
    assert down[0, 2] == pytest.approx(-weight / (1e9 * length * width))
    assert tension == pytest.approx(-weight / (length * width))
    assert shear == pytest.approx(0, abs=1e-9)
    side, tension, _ = settle(replace(block, weight=np.array([[weight, 0.0, 0.0]])), 1e9, 1e8)
    turning = 1e9 * width * length**3 / 12
    tilt = weight * height / 2 / turning
    assert side[0, 4] == pytest.approx(tilt)
    slip = weight / (1e8 * length * width)
    assert side[0, 0] == pytest.approx(slip + tilt * height / 2)
    assert tension == pytest.approx(1e9 * tilt * length / 2)  # at the edge


def test_the_bed_is_not_the_corners():
    """The control: springs at the corners alone would be three times too stiff in turning."""
    block, area, away, _ = column((1.0, 1.0, 1.0))
    corners = block.corner - block.corner.mean(axis=0)
    assert block.corner_area @ corners[:, 0] ** 2 == pytest.approx(3 * (area @ away[:, 0] ** 2))
