"""What is in a scene and its network, in numbers and words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from seqopt.network.network import Network
from seqopt.scene.parts import Prop, Robot
from seqopt.scene.scene import Scene


def size_line(scene: Scene) -> str:
    """Describe name and size of a scene."""
    size = f"{len(scene.bricks)} bricks, {len(scene.joints)} joints"
    return f"{scene.name}: {size}, {len(scene.grounds)} ground ends"


def network_facts(network: Network) -> dict[str, object]:
    """Return size and weight of a scene's network, and properties of its robots."""
    scene, count = network.scene, len(network.scene.bricks)
    robots = {robot.name: robot for robot in scene.robots}
    return {
        "nodes": network.count_nodes(count),
        "edges": network.count_edges(count),
        "weight_N": float(np.linalg.norm(network.weight.sum(axis=0))),
        "loading": scene.loading,
        "payloads_N": {name: robot.payload for name, robot in robots.items()},
        "grips_N_per_m": {name: robot.stiffness for name, robot in robots.items()},
        "grips_Nm_per_rad": {n: robot.rotational_stiffness for n, robot in robots.items()},
        "joints_Nm_per_rad": {n: r.arm.joint_stiffness for n, r in robots.items() if r.arm},
        "props": [prop.node for prop in scene.props],
        "reaches": {n: type(robot.reach).__name__.lower() for n, robot in robots.items()},
        "provenance": scene.provenance,
    }


def _grip(robot: Robot | Prop) -> str:
    """Describe the stiffness of a robot's grip; empty if it is rigid."""

    def said(stiffness: Any) -> str:
        each = stiffness if len({*stiffness}) > 1 else stiffness[:1]
        return " x ".join(f"{one:g}" for one in each)

    out = "" if robot.stiffness is None else f", grip of {said(robot.stiffness)} N/m"
    if isinstance(robot, Robot) and robot.rotational_stiffness is not None:
        out += f", which resists turning by {said(robot.rotational_stiffness)} N m/rad"
    if isinstance(robot, Robot) and robot.arm is not None and robot.arm.joint_stiffness:
        out += f", joints of {' x '.join(f'{k:g}' for k in robot.arm.joint_stiffness)} N m/rad"
    return out


def scene_lines(scene: Scene, facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is in a scene, in words; ``facts``: of its network."""
    yield size_line(scene)
    yield f"network: {facts['nodes']} nodes, {facts['edges']} edges"
    for robot in scene.robots:
        at = "" if robot.arm is None else ", arm at ({:g}, {:g}, {:g})".format(*robot.arm.position)
        yield f"{robot.name}: payload {robot.payload:g} N, reach {robot.reach}{at}{_grip(robot)}"
    for prop in scene.props:
        bears = _grip(prop).replace(", grip of", ":", 1) or ": rigid"
        if prop.direction is not None:
            bears += ", pushes along ({:g}, {:g}, {:g}) only".format(*prop.direction)
        most = "" if prop.capacity is None else f", up to {prop.capacity:g} N"
        yield f"{prop.label}{bears}{most}"
    yield f"weight: {facts['weight_N']:.1f} N"
    if scene.loading:
        yield f"beside the weight: {scene.loading}"
    for i, line in enumerate(scene.provenance.splitlines()):
        yield line if i else f"provenance: {line}"
