"""Arches of any number of bricks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.library.chain import chain
from seqopt.scene.scene import Scene
from seqopt.study.presets import ROBOTS


def half_circle(count: int) -> Network:
    """Return the network of an arch that turns from upright to upright."""
    return build_network(chain(count, robots=ROBOTS))


def longer(scene: Scene, times: float) -> Scene:
    """Return an arch of the same shape and bricks, about as many times longer.

    The line of the reference arch, without its twists; 24 bricks more each time end in the brick
    that lies along.
    """
    joints = [scene.grounds[0].position, *(j.position for j in scene.joints)]
    line = np.array([*joints, scene.grounds[1].position])
    chord = np.diff(line, axis=0)
    angle = np.unwrap(np.arctan2(chord[:, 2], chord[:, 0]))
    count = round(24 * times) + 1
    pitch = np.interp(np.linspace(0, 1, count), np.linspace(0, 1, len(angle)), angle)
    joint = scene.joints[0]
    shape = ArchShape(
        pitch=pitch.tolist(),
        translational_stiffness=joint.translational_stiffness,
        rotational_stiffness=joint.rotational_stiffness,
    )
    robots = [replace(robot, payload=times * robot.payload) for robot in ROBOTS]
    return arch_scene(shape, f"{count} bricks", robots=robots)
