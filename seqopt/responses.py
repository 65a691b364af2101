"""Responses of steps: the columns of the study's Tables A.1 and A.2, from the full fields."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.errors import MechanismError, SolverError
from seqopt.fields import Engine, Fields
from seqopt.network import Floats
from seqopt.steps import Step

SLACK = 1e-6  # an edge is in tension above this share of the mean weight of a brick
TO_1E_3MM = 1e6  # from m to the tables' unit of length, 1e-3 mm


@dataclass(frozen=True)
class Responses:
    """Scalar responses of S grip sets on one partial structure, SI units.

    Attributes
    ----------
    F_rob : (S, r) float
        Size of every grip force with the sign of its part against gravity, N.
    F_sup, M_sup : (S,) float
        Size of the support's force, signed like F_rob, N, and of its moment, N m.
    F_min, F_max, F_avg : (S,) float
        Over the axial forces of all edges, tension positive, N; the study's T_max is F_max.
    T_pct : (S,) float
        Share of edges in tension, percent.
    D_max, D_avg, D_std : (S,) float
        Over the displacements of all nodes, m.
    """

    F_rob: Floats
    F_sup: Floats
    M_sup: Floats
    F_min: Floats
    F_max: Floats
    F_avg: Floats
    T_pct: Floats
    D_max: Floats
    D_avg: Floats
    D_std: Floats


def responses(engine: Engine, fields: Fields) -> Responses:
    """Return the scalar responses of full fields."""
    network = engine.network
    up = np.array(network.scene.up)
    weight = float(np.linalg.norm(network.weight, axis=1).mean())
    force = fields.edge_force
    size = np.linalg.norm(fields.displacement, axis=2)
    return Responses(
        F_rob=_signed(fields.grip_force, up),
        F_sup=_signed(fields.support[:, :3], up),
        M_sup=np.linalg.norm(fields.support[:, 3:], axis=1),
        F_min=force.min(axis=1),
        F_max=force.max(axis=1),
        F_avg=force.mean(axis=1),
        T_pct=100 * (force > SLACK * weight).mean(axis=1),
        D_max=size.max(axis=1),
        D_avg=size.mean(axis=1),
        D_std=size.std(axis=1),
    )


def _signed(vectors: Floats, up: Floats) -> Floats:
    """Return the lengths of vectors (..., 3), negative where they point down."""
    return np.asarray(np.copysign(np.linalg.norm(vectors, axis=-1), vectors @ up))


def analyze(engine: Engine, steps: Sequence[Step]) -> pd.DataFrame:
    """Return the responses of every step, a row each, with the columns of Table A.1.

    Forces in N, moments in N m, displacements in 1e-3 mm; an empty cell is a robot that does not
    grip.
    """
    return pd.DataFrame([_row(engine, step) for step in steps])


def step_fields(engine: Engine, step: Step) -> Fields:
    """Return the full fields of one step.

    Raises
    ------
    MechanismError, SolverError
        As the engine does, the step named.
    """
    try:
        return engine.solve(step.bricks, np.array([step.held], dtype=np.int64).reshape(1, -1))
    except MechanismError as error:
        raise MechanismError(f"step {step.number}: {error}", error.mode) from error
    except SolverError as error:
        raise SolverError(f"step {step.number}: {error}") from error


def fields_archive(engine: Engine, steps: Sequence[Step]) -> bytes:
    """Return the full fields of every step as a NumPy archive (``.npz``).

    Arrays are named ``step1_edge_force``, ``step1_displacement``, ``step1_grip_force``,
    ``step1_support`` and so on, as in `Fields` without its first axis; ``edge_nodes`` (E, 2),
    ``node_position`` (N, 3) and ``node_name`` (N,) say what they run over.
    """
    network = engine.network
    arrays: dict[str, np.ndarray] = {
        "edge_nodes": network.edge_nodes,
        "node_position": network.node_position,
        "node_name": np.array([str(name) for name in network.node_name]),
    }
    for step in steps:
        fields = step_fields(engine, step)
        for name in ("edge_force", "displacement", "grip_force", "support"):
            arrays[f"step{step.number}_{name}"] = getattr(fields, name)[0]
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def _row(engine: Engine, step: Step) -> dict[str, object]:
    scene = engine.network.scene
    answer = responses(engine, step_fields(engine, step))
    forces = iter(answer.F_rob[0])
    row: dict[str, object] = {"step": step.number, "type": step.kind.value, "bricks": step.bricks}
    for robot, node in zip(scene.robots, step.grips, strict=True):
        row[f"{robot.name}_brick"] = pd.NA if node is None else scene.brick_of_node[node].name
        row[f"{robot.name}_node"] = pd.NA if node is None else node
    for robot, node in zip(scene.robots, step.grips, strict=True):
        row[f"F_{robot.name}_N"] = np.nan if node is None else next(forces)
    return row | {
        "F_sup_N": answer.F_sup[0],
        "M_sup_Nm": answer.M_sup[0],
        "F_min_N": answer.F_min[0],
        "F_max_N": answer.F_max[0],
        "F_avg_N": answer.F_avg[0],
        "T_pct": answer.T_pct[0],
        "D_max_1e-3mm": answer.D_max[0] * TO_1E_3MM,
        "D_avg_1e-3mm": answer.D_avg[0] * TO_1E_3MM,
        "D_std_1e-3mm": answer.D_std[0] * TO_1E_3MM,
    }
