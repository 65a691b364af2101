"""The command ``scene``: check, describe and export a scene, or list those that there are."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np

from seqopt._cli import remarks
from seqopt._cli.answer import Answer, scene_facts
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt.network.network import Network, build_network
from seqopt.scene.parts import Prop, Robot
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import ABOUT, KINDS, builtin_scenes, find_scene, load_scene, save_scene
from seqopt.work import Tell, with_progress


def run(
    asked: Annotated[Call, ("call", find_scene)],
    *,
    progress: Tell,
    list: bool = False,  # noqa: A002  # the option's name
    export: File = None,
) -> Answer:
    """Check a scene, say what is in it, and write it as a JSON file if asked.

    Or list all built-in scenes and the words that make others.

    Parameters
    ----------
    list : bool, optional
        Name all built-in scenes, and the words that make others.
    export : pathlib.Path, optional
        JSON file to write.

    Examples
    --------
    $ seqopt scene --list
    $ seqopt scene arch:span=2,rise=0.8
    $ seqopt scene arch25 --export my.json
    """
    if list:
        told = with_progress("reading built-in scenes", builtin_scenes(), progress)
        every = {name: load_scene(name) for name in told}
        sizes = {n: f"{len(s.bricks)} bricks, {len(s.joints)} joints" for n, s in every.items()}
        listed = [f"{name}: {size}; {ABOUT[name]}" for name, size in sizes.items()]
        scenes = [{**scene_facts(scene), "about": ABOUT[name]} for name, scene in every.items()]
        return Answer({"scenes": scenes, "kinds": KINDS}, "\n".join([*listed, *KINDS.values()]))
    Output(export, asked.words.get("scene")).keep_apart(export)
    found = asked()
    facts = {**scene_facts(found), **_network_facts(build_network(found))}
    lines = [*_described(found, facts)]
    if export is not None:
        save_scene(found, export)
        lines.append(f"written to {export}")
    written = () if export is None else (export,)
    return Answer(facts={"scene": facts}, text="\n".join(lines), written=written)


def _network_facts(network: Network) -> dict[str, object]:
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


def _described(scene: Scene, facts: dict[str, Any]) -> Iterator[str]:
    yield remarks.size_line(scene)
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
