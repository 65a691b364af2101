"""Arches that free robots build dry, how far two come, and the bond that larger arches need."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from math import atan

import numpy as np

from experiments.harness.scenes import longer
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt import FreeRules, Network, Scene, Step, build_network, make_engine, pose, solve
from seqopt.arrays import Vector
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, Mortar
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.states.explored import explore
from seqopt.graph.states.states import build_states
from seqopt.problem.standing import Standing
from seqopt.responses.table import analyze, force_column
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Robot, Spring
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.stability._prover import Prover
from seqopt.stability._screens import Screen
from seqopt.stability.assessment import bonded
from seqopt.study.published import CRITERIA, EQUATIONS

STEEPEST = 2.0  # slope of the catenary at its ends
LENGTH, WIDTH, GAP = 0.246, 0.116, 0.01  # m
MOST = 4.0  # payload over the arch's weight beyond which none is looked for
CLOSE = 1.1  # ratio to which the least payload is found
RULES = FreeRules(least_grips=0, newest="free")  # any robot may do anything at any time
Cell = tuple[int, float, float, int]  # bricks, thickness (m), friction, robots


def catenary(bricks: int, thickness: float, robots: int, payload: float) -> Scene:
    """Return an arch of bricks end to end whose line of thrust is nearly its own; payload in N."""
    along = np.linspace(1.0, -1.0, bricks)
    shape = ArchShape(
        pitch=[atan(STEEPEST * x) for x in along.tolist()],
        pattern="VLR",
        dimensions=(LENGTH, WIDTH, thickness),
        gap=GAP,
    )
    team = [Robot(name=f"rob{i + 1}", payload=payload) for i in range(robots)]
    return arch_scene(shape, f"catenary{bricks}", robots=team)


def can_build(cell: Cell, payload: float) -> bool:
    """Return whether some free schedule builds an arch dry, every state proven to stand."""
    bricks, thickness, friction, robots = cell
    engine = make_engine("compliance", catenary(bricks, thickness, robots, payload))
    standing = Standing(Mortar(friction=friction))
    problem = build_states(engine, RULES, CRITERIA["weighted"], "steps", stands=standing)
    return explore(problem, width=50).whole or explore(problem).whole


def least_payload(cell: Cell) -> dict[str, float]:
    """Return a row on the least payload with which an arch is built dry, within 5 %.

    ``least_payload`` and ``too_little`` are over the arch's weight, infinite and `MOST` where none
    is enough.
    """
    bricks, thickness, friction, robots = cell
    scene = catenary(bricks, thickness, robots, 1.0)
    first, last = (ground.position for ground in scene.grounds)
    weight = sum(float(np.prod(b.dimensions)) * b.density * 9.81 for b in scene.bricks)
    low, high = 0.0, MOST
    if not can_build(cell, MOST * weight):
        low, high = MOST, np.inf
    while high < np.inf and high > CLOSE * low:
        middle = float(np.sqrt(low * high)) if low else high / 4
        low, high = (low, middle) if can_build(cell, middle * weight) else (middle, high)
    row = {"bricks": bricks, "thickness_m": thickness, "friction": friction, "robots": robots}
    row |= {"span_m": abs(last[0] - first[0]), "weight_N": weight, "least_payload": high}
    return row | {"too_little": low}


Sets = frozenset[frozenset[int]]


def reached(screen: Screen, robots: int, *, proven: bool) -> int:
    """Return how many bricks can be placed by robots that hold and release wherever they like.

    Between two states one grip is taken or let go; a brick is placed by a robot that is free, and
    held by it at either node. Reach counts for nothing, so that no schedule of as many robots of
    less reach comes farther. A state must be proven to stand, or else not be proven to fall.
    """
    before: Sets = frozenset([frozenset()])
    total = len(screen.network.inner)
    for bricks in range(1, total + 1):
        new = {2 * bricks - 1, 2 * bricks}
        placed = {held | {node} for held in before if len(held) < robots for node in new}
        fit = _standing(screen, bricks, robots, proven=proven)
        before = _connected(fit, frozenset(placed) & fit)
        if not before:
            return bricks - 1
    return total


def _standing(screen: Screen, bricks: int, robots: int, *, proven: bool) -> Sets:
    """Return the sets of nodes with which a partial structure stands."""
    places = range(1, 2 * bricks + 1)
    every = [held for count in range(robots + 1) for held in combinations(places, count)]
    found = screen.stands(bricks, np.array([held + (0,) * (robots - len(held)) for held in every]))
    kept = found == 1 if proven else found != -1
    return frozenset(frozenset(every[i]) for i in np.flatnonzero(kept))


def _connected(fit: Sets, start: Sets) -> Sets:
    """Return the sets that grips taken and let go one at a time lead to."""
    nodes = frozenset().union(*fit) if fit else frozenset[int]()
    seen, front = set(start), set(start)
    while front:
        steps = {held - {node} for held in front for node in held}
        steps |= {held | {node} for held in front for node in nodes - held}
        front = {held for held in steps if held in fit and held not in seen}
        seen |= front
    return frozenset(seen)


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
        powers = {"position": 1, "translational_stiffness": 2, "rotational_stiffness": 4}
        return {name: point(getattr(spring, name), size**power) for name, power in powers.items()}

    bricks = [
        replace(b, position=point(b.position), dimensions=point(b.dimensions))
        for b in (replace(brick, density=density * brick.density) for brick in scene.bricks)
    ]
    joints = [replace(joint, **stiff(joint)) for joint in scene.joints]
    grounds = [replace(end, anchor=point(end.anchor), **stiff(end)) for end in scene.grounds]
    robots = [replace(r, payload=r.payload * density * size**3) for r in scene.robots]
    parts = {"bricks": bricks, "joints": joints, "grounds": grounds, "robots": robots}
    return replace(scene, **{name: tuple(made) for name, made in parts.items()})


def bond(net: Network, step: Step) -> float:
    """Return the bond that a step needs, Pa."""
    assembly = step_assembly(net, step.bricks, step.grips)
    proven = Prover(assembly, compile_equilibrium)(bonded(assembly, DRY))
    return proven.value * assembly.stress_scale


def extremes(label: str, times: float, scene: Scene, methods: Plans) -> Rows:
    """Yield the largest bond and responses of every method on a scene."""
    engine = ComplianceEngine(build_network(scene))
    for name, steps in methods.items():
        table = analyze(engine, steps)
        robots = [force_column(robot) for robot in scene.robots]
        needed = np.array([bond(engine.network, step) for step in steps])
        row = {"scaling": label, "times": times, "bricks": len(scene.bricks), "method": name}
        row |= {"bond_needed_Pa": needed.max()}
        row |= {"steps_without_bond_pct": 100 * float((needed <= 1e-6 * needed.max()).mean())}
        row |= {"F_largest_N": float(table[robots].astype(float).abs().max(axis=None))}
        yield row | table[["M_sup_Nm", "D_max_1e-3mm"]].max().to_dict()


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
