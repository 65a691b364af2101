"""When steps end, and that none comes before its mortar holds: found again for the judge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seqopt.contact.assembly import step_assembly
from seqopt.errors import SolverError
from seqopt.graph.states import States
from seqopt.judge.certificate import BETTER
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Site, Step, StepKind
from seqopt.stability.assessment import verdict
from seqopt.stability.standing import Standing
from seqopt.stability.verdict import Verdict

CLOSE = 1e-9  # of a time: what rounding may take from an age


def makespan_of_steps(problem: States, steps: Sequence[Step], starts: Sequence[float]) -> float:
    """Return how long a build takes, s, and require that no step comes before its mortar holds."""
    standing, scene, begin = problem.standing, problem.network.scene, problem.rules.begin
    if standing is None or standing.curing is None:
        return [0.0, *step_ends(scene, steps, begin=begin)][-1]
    return check_cured(problem.network, steps, standing, starts, begin)[-1]


def step_ends(
    scene: Scene, steps: Sequence[Step], starts: Sequence[float] = (), begin: Site | None = None
) -> tuple[float, ...]:
    """Return when steps end, s, at the earliest, or where they start at some times.

    ``begin``: where the build begins, with robots that are free from then on.

    Raises `SolverError` if one starts before the one before it ends, or its robot is ready.
    """
    ends, let_go = [0.0], dict[int, int]()
    grips: Sequence[int | None] = (None,) * len(scene.robots)
    held = dict[int, int]()  # where robots hold, or held last
    if begin is not None:
        grips = begin.holds(scene)
        for nodes in (begin.stays or (), grips):
            held |= {r: n for r, n in enumerate(nodes) if n is not None}
    for i, step in enumerate(steps, start=1):
        waits, acts = [ends[-1]], 0.0
        for r, (robot, old, new) in enumerate(zip(scene.robots, grips, step.grips, strict=True)):
            own = robot.durations
            if old == new or own is None:
                continue
            if new is None:
                acts, let_go[r] = max(acts, own.release), i
                continue
            placing = step.kind is StepKind.PLACE
            acts = own.place if placing else own.grip
            way = 0.0
            if own.speed is not None and r in held:
                between = np.subtract(scene.node_position(held[r]), scene.node_position(new))
                way = float(np.linalg.norm(between)) / own.speed
            ready = own.fetch if placing else own.approach
            waits.append(ends[let_go.get(r, 0)] + ready + way)
            held[r] = new
        start = max(waits)
        if starts:
            if not starts[i - 1] >= start - BETTER * abs(start):
                raise SolverError(f"step {i} starts at {starts[i - 1]:.6g} s, not from {start:.6g}")
            start = starts[i - 1]
        ends.append(start + acts)
        grips = step.grips
    return tuple(ends[1:])


def check_cured(
    network: Network,
    steps: Sequence[Step],
    standing: Standing,
    starts: Sequence[float],
    begin: Site | None = None,
) -> tuple[float, ...]:
    """Return when steps end, s; each must stand with what its joints have when it starts.

    ``starts``: of the steps, s; what is changed is in its place when the step ends; ``begin``:
    where the build begins; what stands there is as old as it says. Verdicts are of
    the cone program, one by one. Raises `SolverError` for a step that starts before its robot is
    ready, or is not proven to stand.
    """
    curing = standing.curing
    if len(starts) != len(steps):
        raise SolverError(f"{len(starts)} starts for {len(steps)} steps")
    ends = step_ends(network.scene, steps, starts, begin)
    if curing is None:
        return ends
    found = dict[object, Verdict]()
    placed = dict.fromkeys(range(0 if begin is None else begin.bricks), 0.0)
    placed |= {k: -age for k, age in enumerate(() if begin is None else begin.ages)}
    for step, start, end in zip(steps, starts, ends, strict=True):
        whole = step_assembly(network, step.bricks, step.grips)
        bond = []
        for bodies in whole.bodies.tolist():
            since = max(placed.get(body, start) for body in bodies if body >= 0)
            age = start - since + CLOSE * abs(start)
            bond.append(max((s for at, s in curing.points if at <= age), default=0.0))
        key = step.bricks, step.grips, tuple(bond)
        if key not in found:
            found[key] = verdict(whole.with_bond(np.array(bond)), standing.mortar)
        if found[key] is not Verdict.STANDS:
            raise SolverError(
                f"step {step.number} is not proven to stand with the bond that its joints have at "
                f"{start:.6g} s: it {found[key].value}"
            )
        if step.kind is StepKind.PLACE:
            placed[step.bricks - 1] = end
    return ends
