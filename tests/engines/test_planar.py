"""Bricks that lie in one plane, and what leaves it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from seqopt.engines._planar import PlanarEngine, find_plane
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import GripError, SceneError
from seqopt.network.build import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from tests.builders import HERE


def test_the_plane_is_looked_for():
    shape = ArchShape(pitch=[1.2, 0.8, 0.4], pattern="V")
    scene = arch_scene(shape)
    assert np.abs(find_plane(build_network(scene)).normal @ [0, 1, 0]) == pytest.approx(1)
    column = arch_scene(ArchShape(pitch=[math.pi / 2] * 3, pattern="V", closed=False))
    assert np.abs(find_plane(build_network(column)).normal[2]) < 1e-12
    x, y, z = scene.bricks[1].position
    off = replace(scene.bricks[1], position=(x, y + 0.01, z))
    with pytest.raises(SceneError, match=r"brick 2: its centroid lies 9\.\d+ mm outside"):
        PlanarEngine(build_network(replace(scene, bricks=(scene.bricks[0], off, scene.bricks[2]))))
    a, _, c = scene.joints[0].along
    turned = replace(
        scene.joints[0], across=(-0.8 * c, 0.6, 0.8 * a), translational_stiffness=(3e8, 2e8, 1e8)
    )
    with pytest.raises(SceneError, match="joint 1-2: its axes are turned"):
        PlanarEngine(build_network(replace(scene, joints=(turned, scene.joints[1]))))


def test_a_grip_outside_the_plane_is_refused_and_would_matter():
    """Bricks laid across and centered: their nodes lie on either side of the plane."""
    net = build_network(arch_scene(ArchShape(pitch=[1.2, 0.8, 0.4], pattern="L", overhang=0.0)))
    engine = PlanarEngine(net)
    engine.solve(3, HERE)
    with pytest.raises(GripError, match=r"grip on node 3: it lies 61\.5 mm outside"):
        engine.solve(3, [[3]])
    force = ComplianceEngine(net).solve(3, [[3]], Want.JOINTS).joint_wrench[0]
    assert np.abs(force[:, [3, 5]]).max() > 0.1  # moments that leave the plane, N m
