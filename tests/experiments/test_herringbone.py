"""The generator of herringbone vaults, and the built-in scene that it made."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from experiments.harness.herringbone import VAULT, VaultShape, herringbone_vault
from seqopt.contact.faces import bare_assembly
from seqopt.errors import SceneError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.boxes import _separations
from seqopt.scene.library import WallShape, chain, wall
from seqopt.scene.scene_file import _find_warnings, load_scene
from seqopt.sequence.schedule import islands
from tests.builders import small_arch


def even_arch(count):
    """A closed arch in the pattern VLR that ends with a brick along it."""
    return arch_scene(ArchShape(pitch=np.linspace(1.3, -1.3, count).tolist()))


@st.composite
def small_vaults(draw):
    arch = even_arch(draw(st.sampled_from([10, 13, 16])))
    shape = VaultShape(
        bricks=draw(st.integers(len(arch.bricks), 70)),
        spacing=draw(st.floats(0.131, 0.14)),
        plan_angle=draw(st.floats(-0.03, 0.03)),
        skew=draw(st.floats(-0.5, 0.5)),
        widening=draw(st.floats(0.0, 0.03)),
    )
    return herringbone_vault(arch, shape)


@settings(max_examples=20)
@given(scene=small_vaults())
def test_bricks_are_apart_and_joints_lie_between_their_faces(scene):
    pairs, distance = _separations(scene.bricks)
    assert distance.min(initial=0.0) >= -1e-6 * min(min(b.dimensions) for b in scene.bricks)
    assert _find_warnings(scene) == ()
    names = [brick.name for brick in scene.bricks]
    near = {frozenset((names[i], names[j])) for i, j in pairs.tolist()}
    assert {frozenset(joint.bricks) for joint in scene.joints} <= near
    network = build_network(scene)
    assert (bare_assembly(network, len(scene.bricks)).area > 0).all()
    assert all(islands(network, count) == () for count in range(1, len(scene.bricks) + 1))


def test_the_built_in_vault_is_what_it_makes():
    made, stored = herringbone_vault(load_scene("arch25"), VAULT), load_scene("vault338")
    assert made.build_order == stored.build_order
    assert [joint.bricks for joint in made.joints] == [joint.bricks for joint in stored.joints]
    for mine, other in zip(made.bricks, stored.bricks, strict=True):
        assert np.allclose(mine.position, other.position, atol=1e-9)
        assert np.allclose(mine.frame, other.frame, atol=1e-9)
    narrower = herringbone_vault(load_scene("arch25"), VaultShape(bricks=338, skew=1.74))
    ends = [scene.bricks[-1].position for scene in (narrower, stored)]
    assert not np.allclose(*ends, atol=1e-3)  # the control


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: VaultShape(bricks=0), "vault: bricks is 0; give a whole number from 1"),
        (lambda: VaultShape(bricks=30, skew=math.inf), "vault: skew is inf; give a finite number"),
        (lambda: VaultShape(bricks=30, plan_angle=5.1), "vault: plan_angle is 5.1 rad; give at"),
        (lambda: VaultShape(bricks=30, spacing=0.0), "vault: spacing is 0.0; give a positive"),
        (
            lambda: herringbone_vault(even_arch(13), VaultShape(bricks=12)),
            "vault: bricks is 12, and its arch has 13; give at least as many",
        ),
        (
            lambda: herringbone_vault(even_arch(13), VaultShape(bricks=40, spacing=0.11)),
            "vault: bricks .* interpenetrate by .* mm; give a wider spacing",
        ),
        (
            lambda: herringbone_vault(small_arch(12), VaultShape(bricks=40)),
            "vault: scene arch is not an arch to start from; give a closed chain of equal bricks",
        ),
        (
            lambda: herringbone_vault(wall(WallShape(columns=7, courses=1)), VaultShape(bricks=40)),
            "vault: scene wall 7 x 1 is not an arch to start from",
        ),
        (
            lambda: herringbone_vault(chain(13, pattern="V"), VaultShape(bricks=40)),
            "vault: brick 2 of chain 13 does not lie as L in the pattern VLR",
        ),
        (lambda: herringbone_vault("arch25", VaultShape(bricks=40)), "vault: a str is not an arch"),
    ],
)
def test_one_line_says_what_is_wrong(make, named):
    with pytest.raises(SceneError, match=named) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_vault_is_as_large_as_asked_and_a_skew_of_either_sign_builds_from_its_foot():
    arch = load_scene("arch25")
    for skew in (-1.0, 0.0, 1.0):
        scene = herringbone_vault(arch, VaultShape(bricks=150, skew=skew))
        assert len(scene.bricks) == 150
        left = [brick for brick in scene.bricks[25:] if brick.position[1] > 0.1]
        foot = left[0].position[0] < 1.0
        assert foot == (skew < 0)
