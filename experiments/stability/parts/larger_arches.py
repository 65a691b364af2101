"""The bond that methods need as arches grow: longer, larger, of heavier bricks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from experiments.harness.arches import longer
from formulations.limit_analysis import compile_equilibrium
from seqopt.arrays import Vector
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.problem import pose
from seqopt.placement.solving import solve
from seqopt.responses.table import analyze, force_column
from seqopt.scene.parts import Spring
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import bonded
from seqopt.stability.prover import Prover
from seqopt.study.presets import EQUATIONS

Rows = Iterator[dict[str, object]]
Plans = dict[str, tuple[Step, ...]]


def scaled(scene: Scene, size: float, density: float) -> Scene:
    """Return the scene with lengths and densities multiplied.

    Joints keep their thickness and material: stiffness grows with the area, for turning also with
    the square of the length. Payloads grow with the weight of a brick.
    """

    def point(values: Vector, factor: float = size) -> Vector:
        x, y, z = values
        return factor * x, factor * y, factor * z

    def stiff(spring: Spring) -> dict[str, Vector]:
        return {
            "position": point(spring.position),
            "translational_stiffness": point(spring.translational_stiffness, size**2),
            "rotational_stiffness": point(spring.rotational_stiffness, size**4),
        }

    return replace(
        scene,
        bricks=tuple(
            replace(
                brick,
                position=point(brick.position),
                dimensions=point(brick.dimensions),
                density=density * brick.density,
            )
            for brick in scene.bricks
        ),
        joints=tuple(replace(joint, **stiff(joint)) for joint in scene.joints),
        grounds=tuple(
            replace(ground, anchor=point(ground.anchor), **stiff(ground))
            for ground in scene.grounds
        ),
        robots=tuple(
            replace(robot, payload=robot.payload * density * size**3) for robot in scene.robots
        ),
    )


def bonds(net: Network, steps: tuple[Step, ...]) -> list[float]:
    """Return the bond that every step needs, Pa."""
    out = []
    for step in steps:
        assembly = step_assembly(net, step.bricks, step.grips)
        proven = Prover(assembly, compile_equilibrium)(bonded(assembly, DRY))
        out.append(proven.value * assembly.stress_scale)
    return out


def extremes(label: str, times: float, scene: Scene, methods: Plans) -> Rows:
    """Yield the largest bond and responses of every method on a scene."""
    engine = ComplianceEngine(build_network(scene))
    for name, steps in methods.items():
        table = analyze(engine, steps)
        robots = [force_column(robot) for robot in scene.robots]
        needed = np.array(bonds(engine.network, steps))
        yield {
            "scaling": label,
            "times": times,
            "bricks": len(scene.bricks),
            "method": name,
            "bond_needed_Pa": needed.max(),
            "steps_without_bond_pct": 100 * float((needed <= 1e-6 * needed.max()).mean()),
            "F_largest_N": float(table[robots].abs().to_numpy(float)[~table[robots].isna()].max()),
            "M_sup_Nm": table["M_sup_Nm"].max(),
            "D_max_1e-3mm": table["D_max_1e-3mm"].max(),
        }


def growth(scene: Scene, methods: Plans, sizes: tuple[int, ...]) -> Rows:
    """Yield the extremes of longer, of larger and of heavier arches."""
    for times in sizes:
        for label, size, density in (("larger", times, 1.0), ("heavier", 1.0, times)):
            yield from extremes(label, times, scaled(scene, size, density), methods)
        line = longer(scene, times)
        net = build_network(line)
        made = {name: method(net) for name, method in METHODS.items()}
        if times <= 2:  # the choice for longer arches is a study of its own
            loop = pose(ComplianceEngine(net), three_robot_loop(net), EQUATIONS)
            made["three-robot, optimized"] = solve(loop, "overlap_dp").steps
        yield from extremes("longer", times, line, made)
