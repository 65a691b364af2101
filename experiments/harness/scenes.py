"""Arches of any number of bricks, tested vaults, and walls in running bond, open between bricks."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from seqopt import ArchShape, Network, Scene, arch_scene, build_network, load_scene
from seqopt.arrays import Ints
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.exchange.schedules import read_plan
from seqopt.plan.solve import pose, solve
from seqopt.scene.library.arch_form import chain
from seqopt.scene.library.common import MASONRY
from seqopt.sequence.methods import METHODS, modified_sequential, three_robot_loop
from seqopt.sequence.steps import Step
from seqopt.study import EQUATIONS, ROBOTS, SOURCE, printed, published_plan


def arch25() -> ComplianceEngine:
    """Return the fast engine of the paper's arch."""
    return ComplianceEngine(build_network(load_scene("arch25")))


def method_steps(engine: ComplianceEngine, names: Iterable[str]) -> dict[str, tuple[Step, ...]]:
    """Return the steps of methods of the reference arch: fixed, published and chosen ones."""
    net = engine.network
    modified, loop = (
        pose(engine, rules(net), EQUATIONS) for rules in (modified_sequential, three_robot_loop)
    )
    ways: dict[str, Callable[[], Sequence[Step]]] = {
        **{name: partial(method, net) for name, method in METHODS.items()},
        "modified sequential": lambda: solve(modified, "cascade").steps,
        "three-robot, published": lambda: published_plan(net.scene),
        "three-robot, optimized": lambda: solve(loop, "overlap_dp").steps,
        "three-robot, minimax": lambda: solve(loop, "minimax").steps,
    }
    return {name: tuple(ways[name]()) for name in names}


def scene_named(name: str) -> Scene:
    """Return ``arch25``, or an arch of the same shape by its brick count, as ``chain13``."""
    reference = load_scene("arch25")
    if name == "arch25":
        return reference
    return longer(reference, (int(name.removeprefix("chain")) - 1) / 24)


def barrel_vault(test: int) -> Scene:
    """Return one of the eight vaults whose load tests the paper calibrates its springs by.

    It is a chain of boxes as wide as the vault, built from one abutment to the other. Span and rise
    are taken to the inner face: neighbors touch there, and joints widen outward.
    """
    row = printed("arch_tests").set_index("test").loc[test]
    thickness, bricks, half = (
        row["t_mm"] / 1e3,
        row["n_bricks"],
        2 * np.arctan(2 * row["r_m"] / row["L_m"]),
    )
    turn = half / bricks  # of half a brick
    chord = 2 * (0.5 * row["L_m"] / np.sin(half) + 0.5 * thickness) * np.sin(turn)
    gap = thickness * np.tan(turn)
    shift, about = MASONRY.over_rectangle(row["b_m"], thickness)
    shape = ArchShape(
        pitch=[half - (2 * b + 1) * turn for b in range(bricks)],
        pattern="V",
        gap=gap,
        overhang=0.25 * row["b_m"],
        stub=0.5 * chord,
        translational_stiffness=shift,
        rotational_stiffness=about,
        dimensions=(chord - gap, row["b_m"], thickness),
        density=row["gamma_m_kg_m3"],
    )
    return arch_scene(
        shape, f"barrel vault {test}", provenance=f"{row['reference']}, after {SOURCE}"
    )


def half_circle(count: int) -> Network:
    """Return the network of an arch that turns from upright to upright."""
    return build_network(chain(count).with_robots(*ROBOTS))


def longer(scene: Scene, times: float) -> Scene:
    """Return an arch of the same shape and bricks, about as many times longer.

    The line of the reference arch, without its twists; 24 bricks more each time end in the brick
    that lies along.
    """
    joints = [scene.grounds[0].position, *(j.position for j in scene.joints)]
    chord = np.diff(np.array([*joints, scene.grounds[1].position]), axis=0)
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


def grip_sets(net: Network, bricks: int, count: int) -> Ints:
    """Return random sets of three different free nodes."""
    blocked = net.scene.blocked_nodes
    free = [n for b in net.scene.placed[:bricks] for n in b.nodes if n not in blocked]
    rng = np.random.default_rng(0)
    return np.array([rng.choice(free, 3, replace=False) for _ in range(count)])


def read_folder(folder: Path) -> tuple[Scene, tuple[Step, ...]]:
    """Return the scene and the steps of a plan's folder."""
    scene = load_scene(folder / "scene.json")
    return scene, read_plan(scene, folder / "plan.csv")
