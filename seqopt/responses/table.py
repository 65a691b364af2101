"""Responses of steps: the columns of the study's Tables A.1 and A.2, from the full fields."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine, Fields
from seqopt.errors import MechanismError, SolverError
from seqopt.responses.quantities import step_responses
from seqopt.sequence.steps import Step

TO_1E_3MM = 1e6  # from m to the tables' unit of length, 1e-3 mm


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
    answer = step_responses(engine, step_fields(engine, step))
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
