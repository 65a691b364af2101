"""How far a table of responses is from a printed one, beyond the rounding of print."""

from __future__ import annotations

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.engines.interface import Engine, Want
from seqopt.network.network import Network
from seqopt.sequence.steps import Step

STEPS = {17: 33, 18: 35, 23: 45, 24: 47}
"""Steps of the sequential method, by bricks (table 3)."""


def inner_nodes(network: Network, step: Step) -> list[int]:
    """Return the inner nodes that no robot holds: as many as the paper compares (table 3)."""
    inner = network.inner[: step.bricks].ravel()
    return [int(i) for i in inner if network.node_name[i] not in step.held]


def moved(engine: Engine, step: Step) -> Floats:
    """Return how far the inner nodes move by an engine, m."""
    fields = engine.solve(step.bricks, [list(step.held)], Want.DISPLACEMENTS)
    inner = fields.displacement[0][inner_nodes(engine.network, step)]
    return np.asarray(np.linalg.norm(inner, axis=1))


def error(own: Floats, other: Floats) -> float:
    """Return the mean difference of displacements from others, as the paper's, %."""
    return 100 * float(np.mean((own - other) / other))


VALUES = (
    *("F_rob1_N", "F_rob2_N", "F_rob3_N", "F_sup_N", "M_sup_Nm", "F_min_N", "F_max_N", "F_avg_N"),
    *("D_max_1e-3mm", "D_avg_1e-3mm", "D_std_1e-3mm"),
)
ROUNDING = 0.0501  # the tables print one digit; a little more for binary fractions


def errors(produced: pd.DataFrame, printed: pd.DataFrame) -> pd.DataFrame:
    """Return errors in percent, a row per step and a column per response.

    It is what exceeds the rounding, over the printed size or 1, whichever is larger; NaN where the
    table prints nothing. F_rob and F_sup are compared without sign. Produced tables must be as
    printed (`seqopt.study.as_printed`).
    """
    unsigned = [name for name in VALUES if name.startswith("F_rob") or name == "F_sup_N"]
    want = printed.set_index("step")[[*VALUES]].astype(float)
    got = produced.set_index("step").loc[want.index, [*VALUES]].astype(float)
    want[unsigned], got[unsigned] = want[unsigned].abs(), got[unsigned].abs()
    excess = ((got - want).abs() - ROUNDING).clip(lower=0)
    return (100 * excess / want.abs().clip(lower=1)).rename_axis(None)


def percentiles(table: pd.DataFrame) -> tuple[float, float, float]:
    """Return the median, 90th and 95th percentile of all errors of a table."""
    a, b, c = np.nanpercentile(table.to_numpy(), [50, 90, 95])
    return float(a), float(b), float(c)


def tension_share(produced: pd.DataFrame, printed: pd.DataFrame) -> float:
    """Return the share of rows whose T_pct is within two edges of the printed one."""
    bricks = printed["bricks"].to_numpy(float)
    edges = np.where(bricks < bricks.max(), 3 * bricks + 1, 3 * bricks + 2)
    by_step = produced.set_index("step").loc[printed["step"]]
    gap = np.abs(by_step["T_pct"].to_numpy(float) - printed["T_pct"].to_numpy(float))
    return float(np.mean(gap <= 200 / edges + 0.0501))
