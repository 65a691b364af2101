"""What is wrong with an assembly or a mortar is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.stability.parts.blocks import stack
from seqopt.contact.mortar import Mortar
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


def test_a_wrong_mortar_is_named():
    with pytest.raises(SceneError, match=r"mortar: friction is -1.0; give a number"):
        Mortar(friction=-1.0)
