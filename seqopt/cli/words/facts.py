"""What scripts are told of scenes."""

from __future__ import annotations

import numpy as np

from seqopt.network.network import Network
from seqopt.scene.scene import Scene


def scene_facts(scene: Scene) -> dict[str, object]:
    """Return what a scene is called, and how large it is.

    Result: ``name``, ``bricks``, ``joints``, ``ground_ends`` and the names of ``robots``.
    """
    return {
        "name": scene.name,
        "bricks": len(scene.bricks),
        "joints": len(scene.joints),
        "ground_ends": len(scene.grounds),
        "robots": [robot.name for robot in scene.robots],
    }


def network_facts(network: Network) -> dict[str, object]:
    """Return how large the network of a scene is, what it weighs, and what its robots can do.

    Result: ``nodes`` and ``edges`` of the whole structure, ``weight_N``, ``payloads_N`` and
    ``reaches`` by robot, ``provenance``.
    """
    scene = network.scene
    count = len(scene.bricks)
    return {
        "nodes": network.count_nodes(count),
        "edges": network.count_edges(count),
        "weight_N": float(np.linalg.norm(network.weight.sum(axis=0))),
        "payloads_N": {robot.name: robot.payload for robot in scene.robots},
        "reaches": {robot.name: type(robot.reach).__name__.lower() for robot in scene.robots},
        "provenance": scene.provenance,
    }
