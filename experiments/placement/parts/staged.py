"""Staged construction analysis: forces and displacements that earlier steps lock in.

From scratch, a step knows nothing of the steps before it: all weight acts at once, and every robot
holds its node where the plan has it. Here the build goes through its steps. A brick comes without
stress onto the structure as it has deformed, and its weight acts from then on; a grip closes
without force where it finds its node, and holds it there; a release lets its force go. A load comes
with the brick that it begins with, and a ground end moves when it closes. Every change is a linear
increment on the structure as it then stands, and all of them are added up.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from types import MappingProxyType

import numpy as np
import pandas as pd
from scipy import linalg

from seqopt.arrays import Floats, FrozenValue, Ints
from seqopt.engines.interface import Fields, GripCompliance, grip_columns, read_compliance
from seqopt.engines.rigid._mixed import (
    Ungripped,
    edge_forces,
    reactions,
    solve_load,
    split_pairs,
    ungripped_system,
)
from seqopt.errors import StepError
from seqopt.network._mechanics import deformation, spring_stiffness
from seqopt.network.network import Network, network_of
from seqopt.responses.quantities import CHOSEN_BY, lengths
from seqopt.responses.table import response_table, step_named
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step, StepKind, check_sequence, require_steps


def spring_maps(network: Network, bricks: int) -> tuple[Ints, Floats, Floats]:
    """Return which springs act (s,), their `deformation` (s, 6, 6b) and stiffness (s, 6, 6)."""
    springs, center = network.springs, network.centroid[:bricks]
    acting = springs.acting(bricks)
    gap = deformation(springs.bodies[acting], springs.position[acting], center)
    gaps = gap.toarray().reshape(len(acting), 6, 6 * bricks)
    return acting, gaps, spring_stiffness(network, acting)


class Placing(Enum):
    """Where a brick is placed, which affects displacements but not forces."""

    FITTED = "fitted"  # onto the deformed structure, so that its joints are as planned
    PLANNED = "planned"  # where the plan has it; its joints take up what the structure moved


@dataclass(frozen=True, eq=False, repr=False)
class StagedState(FrozenValue):
    """Accumulated displacements and forces of a partial structure.

    ``twist`` (6b,): of the bricks from where the plan has them, m and rad; ``wrench`` (J, 6): of
    every spring of the network on its second body, N and N m; ``carried`` (E,): by the edges,
    tension positive, N; ``grips`` (6,): forces and moments of the grips on their nodes, as indices
    into ``network.inner.ravel()``, N and N m.
    """

    bricks: int
    twist: Floats
    wrench: Floats
    carried: Floats
    grips: Mapping[int, Floats] = field(default_factory=lambda: MappingProxyType({}))


def analyze_staged(
    network: Network | Scene, steps: Sequence[Step], placing: Placing = Placing.FITTED
) -> pd.DataFrame:
    """Return the responses of every step, with forces that earlier steps lock in, as `analyze`.

    ``steps``: from the first brick on, with every grip given; displacements are from where the plan
    has the nodes.
    """
    network = network_of(network)
    return response_table(network, zip(steps, staged_fields(network, steps, placing), strict=True))


def staged_fields(
    network: Network, steps: Sequence[Step], placing: Placing = Placing.FITTED
) -> Iterator[Fields]:
    """Yield the full fields of every step, of one grip set each; see `analyze_staged`."""
    if require_steps(steps)[0].number > 1 or any(s.kind is StepKind.REMOVE for s in steps):
        raise StepError("what was locked in before is not known; give a whole build from step 1 on")
    check_sequence(network.scene, steps)
    state = StagedState(0, np.zeros(0), np.zeros((len(network.springs.since), 6)), np.zeros(0))
    parts: Ungripped | None = None
    for step in steps:
        if parts is None or parts.bricks != step.bricks:
            parts = ungripped_system(network, step.bricks)
        with step_named(step):
            state = next_state(parts, state, step, placing)
        yield state_fields(parts, state)


def next_state(parts: Ungripped, before: StagedState, step: Step, placing: Placing) -> StagedState:
    """Return the state after a step, its grips in the order of the robots.

    ``parts``: of the structure after the step; ``step``: that places one brick at most.
    """
    network, bricks = parts.network, step.bricks
    load = np.zeros((2 * bricks, 3))
    new_edges = network.count_edges(bricks) - len(before.carried)
    carried = np.concatenate([before.carried, np.zeros(new_edges)])
    state = replace(before, bricks=bricks, carried=carried)
    if bricks > before.bricks:
        load[-2:] = network.inner_weight[2 * bricks - 2 : 2 * bricks]
        new = _fitted(network, before) if placing is Placing.FITTED else np.zeros(6)
        state = replace(state, twist=np.concatenate([before.twist, new]))
    numbers = np.array([network.scene.grip_numbers(step.grips, bricks)], dtype=np.int64)
    columns, turn = grip_columns(network, bricks, numbers), np.zeros((bricks, 3))
    held = columns[0].tolist()
    for grip in set(before.grips) - set(held):
        load[grip] -= before.grips[grip][:3]
        turn[grip // 2] -= before.grips[grip][3:]
    state = replace(state, grips={grip: before.grips.get(grip, np.zeros(6)) for grip in held})
    compliance = read_compliance(network, columns, numbers, None)
    return _loaded(parts, state, (load, turn), before.bricks, compliance)


def state_fields(parts: Ungripped, state: StagedState) -> Fields:
    """Return the fields of a state. ``parts``: of its structure. Result: of one grip set."""
    borne = np.array(list(state.grips.values())).reshape(1, -1, 6)
    return Fields(
        edge_force=state.carried[None].copy(),
        displacement=(parts.motion @ state.twist).reshape(1, -1, 3)
        + parts.network.ground_motion(state.bricks),
        grip_force=borne[..., :3].copy(),
        support=reactions(parts.network, state.wrench[None]),
        joint_wrench=state.wrench[None].copy(),
        brick_twist=state.twist.reshape(1, -1, 6).copy(),
        grip_moment=borne[..., 3:].copy(),
    )


def worst_ratio(network: Network, fields: Fields, limits: tuple[tuple[str, float], ...]) -> float:
    """Return the largest ratio of a response of one grip set to its limit."""
    found = {"F_largest": lengths(fields.grip_force).max(axis=1, initial=0.0)}
    names = [name for name, _ in limits if name not in found]
    found |= {name: CHOSEN_BY[name].of(network, fields) for name in names}
    return max(float(found[name][0]) / limit for name, limit in limits)


def _loaded(
    parts: Ungripped,
    state: StagedState,
    pulls: tuple[Floats, Floats],
    before: int,
    compliance: GripCompliance,
) -> StagedState:
    """Return a state with further forces (2b, 3) at inner nodes and moments (b, 3) on bricks.

    Held nodes are fixed, or supported by the ``compliance`` of their grips. Loads and movements of
    the ground that begin after ``before`` bricks are added.
    """
    load, turn = pulls
    network, applied = parts.network, parts.network.applied(state.bricks, before)
    new = np.repeat(network.springs.since[parts.acting] > before, 6)
    moved = np.where(new, parts.moved, 0.0)
    if not (load.any() or turn.any() or applied.any() or moved.any()):
        return state
    columns: Ints = np.array(list(state.grips), dtype=np.int64)
    inner = (3 * network.inner[: state.bricks].ravel()[:, None] + np.arange(3)).ravel()
    pull = parts.motion[inner].T @ load.ravel() * parts.twist_unit / parts.unit
    pull += applied.ravel() * parts.twist_unit / parts.unit
    pull += np.pad(turn, ((0, 0), (3, 0))).ravel() * parts.twist_unit / parts.unit
    solution = solve_load(parts, columns, pull, moved, compliance)
    load += np.repeat(0.5 * applied[:, :3], 2, axis=0)
    force = solution.force.copy()
    load[columns] += force[0]
    carried = edge_forces(network, solution.wrench, load[None])
    split_pairs(network, columns[None], force, carried, solution.compliant)
    twist, wrench = state.twist + solution.twist[0], state.wrench + solution.wrench[0]
    borne = np.concatenate([force, solution.moment], axis=2)[0]
    pairs = zip(state.grips.items(), borne, strict=True)
    grips = {grip: before + more for (grip, before), more in pairs}
    return StagedState(state.bricks, twist, wrench, state.carried + carried[0], grips)


def _fitted(network: Network, state: StagedState) -> Floats:
    """Return the twist (6,) with which the next brick fits the structure.

    Its springs are then undeformed; if several bricks or the ground are incompatible, the twist of
    least energy, with the remaining gaps filled without stress.
    """
    bricks = state.bricks + 1
    acting, gap, stiffness = spring_maps(network, bricks)
    new = network.springs.since[acting] == bricks
    gap, stiffness = gap[new], stiffness[new]
    own, others = gap[:, :, -6:], gap[:, :, :-6] @ state.twist
    matrix = np.einsum("sik,sij,sjl->kl", own, stiffness, own)
    pull = -np.einsum("sik,sij,sj->k", own, stiffness, others)
    if not matrix.any():
        return np.zeros(6)
    size = np.sqrt(np.where(np.diag(matrix) > 0, np.diag(matrix), 1.0))
    fitted = linalg.lstsq(matrix / np.outer(size, size), pull / size, cond=1e-12)[0]
    return np.asarray(fitted / size)
