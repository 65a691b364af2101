"""Whether the steps of a plan stand, bear on props and keep the linear range, recomputed.

It shares the engine and the cone program alone with the search: of the linear range the length and
the motions of nodes are found again from how bricks move as rigid bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi

import numpy as np

from seqopt.engines.interface import Engine, Fields, Want
from seqopt.errors import SolverError
from seqopt.graph.states import States
from seqopt.problem.requirements import LINEAR_RANGE, Limit
from seqopt.scene.parts import Prop
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.stability._steps import each_stability, step_verdicts
from seqopt.stability.assessment import MARGINS, Stability, Verdict
from seqopt.stability.standing import Standing, slack

SURE = 1e-3  # rad, or as a share: how far the cone program may be from what forces prove
_UNFELT = 1e-3  # of the mean weight of a brick, far more than forces err
_TENTH = 0.1  # of the smallest side of any brick
_LITTLE = 1e-6  # by which a motion may be larger, over its limit


def props_that_hold(scene: Scene, bricks: int, robots: int) -> list[tuple[int, Prop]]:
    """Return props by the numbers of their grips, with so many bricks and robots that hold."""
    if not robots and bricks >= len(scene.build_order):
        return []
    kinds, first, out = scene.grip_kinds, len(scene.robots), []
    stand = {node for brick in scene.placed[:bricks] for node in brick.nodes}
    for i, prop in enumerate(scene.props):
        if prop.node in stand:
            kind = int(kinds.of_robot[first + i]) if len(kinds.turns) > 1 else 0
            out.append((prop.node + kinds.span * kind, prop))
    return out


def _fields(engine: Engine, step: Step, want: Want) -> tuple[list[Prop], Fields]:
    """Return the props that hold in a step, and its fields; forces of props come last."""
    scene = engine.network.scene
    held = scene.grip_numbers(step.grips)
    props = props_that_hold(scene, step.bricks, len(held))
    grips = np.array([[*held, *(number for number, _ in props)]], dtype=np.int64)
    return [prop for _, prop in props], engine.solve(step.bricks, grips, want)


def check_props(engine: Engine, steps: Sequence[Step]) -> None:
    """Raise a `SolverError` if a prop pulls that may only push, or bears more than it may."""
    scene = engine.network.scene
    if not any(prop.direction or prop.capacity for prop in scene.props):
        return
    little = _UNFELT * (float(np.linalg.norm(engine.network.weight, axis=1).mean()) or 1.0)
    for step in steps:
        if not props_that_hold(scene, step.bricks, len(step.held)):
            continue  # as on the empty site, where a take-down ends
        props, fields = _fields(engine, step, Want(0))
        for prop, force in zip(props, fields.grip_force[0, -len(props) :], strict=True):
            size = float(np.linalg.norm(force))
            if prop.capacity is not None and size > prop.capacity + little:
                bears = f"bears {size:.4g} N of {prop.capacity:g} N"
                raise SolverError(f"step {step.number}: the {prop.label} {bears}")
            if prop.direction is not None and np.dot(force, prop.direction) < -little:
                raise SolverError(f"step {step.number}: the {prop.label} pulls, and may only push")


def check_shape(engine: Engine, steps: Sequence[Step], limits: Sequence[Limit]) -> None:
    """Raise a `SolverError` if a node moves farther than a limit of the linear range allows."""
    shares = [limit.shown(limit.bound) for limit in limits if limit.label == LINEAR_RANGE]
    placed = engine.network.scene.placed
    most = min(shares, default=np.inf) * _TENTH * min(min(b.dimensions) for b in placed)
    at = np.array([[brick.node_position(node) for node in brick.nodes] for brick in placed])
    lever = at - np.array([brick.position for brick in placed])[:, None]
    for step in steps if shares else ():
        if step.bricks:
            twist = _fields(engine, step, Want.BRICKS)[1].brick_twist[0][:, None]
            moved = twist[..., :3] + np.cross(twist[..., 3:], lever[: step.bricks])
            farthest = float(np.linalg.norm(moved, axis=2).max())
            if not farthest <= most * (1 + _LITTLE):
                raise SolverError(
                    f"step {step.number}: a node moves {farthest:.4g} m, and the linear range "
                    f"ends at {most:.4g} m"
                )


def proven_margins(
    problem: States, steps: Sequence[Step], claimed: Sequence[float]
) -> dict[str, float]:
    """Return the margins of a plan, as claimed if they are; every step must stand as demanded.

    ``claimed``: by goal, if any is. Worst margins are found only where they are asked for: ``bond``
    (Pa), ``friction``, and how far ``tilt`` is from a right angle (rad). A `SolverError` names the
    step that is not proven to stand, or a margin that is worse by more than its proven width.
    """
    standing = problem.standing
    said, stand = list[str](), list[bool]()
    results: tuple[Stability, ...] = ()
    if any(goal.margins for goal in problem.goals) or (standing and standing.tilt):
        results = certified(problem, steps)
        said = [f"{each.verdict.value}, tilt survived {each.tilt:.4g} rad" for each in results]
        least = (standing or Standing()).tilt - SURE
        stand = [r.verdict is Verdict.STANDS and not r.tilt < least for r in results]
    elif standing is not None:
        verdicts = step_verdicts(problem.network, steps, standing.mortar)
        said, stand = [v.value for v in verdicts], [v is Verdict.STANDS for v in verdicts]
    for step, what, does in zip(steps, said, stand, strict=bool(said)):
        if standing is not None and not does:
            raise SolverError(f"step {step.number} is not proven to stand as demanded: {what}")
    worst = {"bond": [r.bond for r in results], "friction": [r.friction for r in results]}
    worst["tilt"] = [pi / 2 - result.tilt for result in results]
    out = {}
    for k, name in [(k, goal.name) for k, goal in enumerate(problem.goals) if goal.margins]:
        proven = float(np.max(worst[name]))
        out[name] = claimed[k] if claimed else proven
        if not proven <= out[name] + slack(name, out[name]):
            raise SolverError(f"{name} is {proven:.6g}, not {out[name]:.6g} as claimed")
    return out


def certified(problem: States, steps: Sequence[Step]) -> tuple[Stability, ...]:
    """Return verdict and margins of every step by the cone program; of equal ones once."""
    mortar = (problem.standing or Standing()).mortar
    for step in steps:
        if (step.bricks, step.grips) not in problem.certified:
            (result,) = each_stability(problem.network, [step], mortar, MARGINS)
            problem.certified[step.bricks, step.grips] = result
    return tuple(problem.certified[step.bricks, step.grips] for step in steps)
