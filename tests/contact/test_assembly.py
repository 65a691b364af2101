"""What is wrong with an assembly or a mortar is named."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from experiments.stability.parts.blocks import stack
from seqopt.contact.mortar import DRY, EPOXY, Mortar, _is_as_strong
from seqopt.errors import SceneError
from seqopt.network.network import GROUND


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"corner": np.zeros((8, 3))}, "contact ground-1: its face has no area"),
        ({"weight": np.full((2, 3), np.nan)}, "weight holds a number that is not finite"),
        ({"bodies": np.array([[GROUND, 0], [0, 2]])}, "beyond 0 to 1"),
        ({"bodies": np.array([[0, GROUND], [0, 1]])}, "name it first"),
    ],
)
def test_a_wrong_assembly_is_named(change, message):
    with pytest.raises(SceneError, match=message):
        replace(stack([0.1]).assembly(2000.0), **change)


def carries(mortar, press, slide):
    """Where a corner bears stresses: pressure, negative where it is pulled, and shear."""
    sticks = slide <= mortar.cohesion + mortar.friction * press
    return (press >= -mortar.tensile_strength) & sticks


def test_a_mortar_is_as_strong_as_another_where_it_carries_all_of_it():
    rng, levels = np.random.default_rng(5), [0.0, 0.5, 1.0]
    names = ("friction", "tensile_strength", "cohesion")
    every = [Mortar(**dict(zip(names, each, strict=True))) for each in product(levels, repeat=3)]
    press, slide = rng.uniform(-1.2, 3.0, 4000), rng.uniform(0.0, 4.0, 4000)
    borne = [carries(mortar, press, slide) for mortar in every]
    for (weak, first), (strong, second) in product(zip(every, borne, strict=True), repeat=2):
        assert not _is_as_strong(strong, weak) or (second | ~first).all()
    assert _is_as_strong(EPOXY, DRY)
    assert _is_as_strong(Mortar(friction=1.0), Mortar(friction=0.5))
    pulled = Mortar(friction=0.5, tensile_strength=1.0, cohesion=1.0)
    rough = replace(pulled, friction=1.0)
    assert not _is_as_strong(rough, pulled)  # it slides where it is pulled
    assert carries(pulled, -1.0, 0.3)
    assert not carries(rough, -1.0, 0.3)
