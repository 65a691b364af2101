"""Claim: a stiff-bar frame has one good stiffness contrast; exactly rigid bricks need none.

Method: every published state (Tables A.1, A.2 and the three-robot plan) of `arch25`, by the frame
at bar-to-joint contrasts from 1e2 to 1e11; largest difference from the exactly rigid bricks,
relative to the largest entry of the field in that state. The mixed solution of the same bricks is
the check of the fast engine. A solver that refuses is counted. The good contrast, 1e7, was found
in such a sweep on this arch. The claim fails if at another contrast the worst of all fields is
smaller, if it is not ten times as large at either end of the sweep (a refusal counts as well), or
if the two solutions of rigid bricks differ by more than 1e-9.

Inputs: the shipped scene. Command: ``python -m experiments frame_contrast [--quick]``.
"""

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.scenes import arch25
from seqopt import Step
from seqopt.engines.frame import CONTRAST, FrameEngine
from seqopt.engines.interface import Engine, Fields, grip_columns
from seqopt.engines.rigid._mixed import solve_mixed
from seqopt.errors import SolverError
from seqopt.responses.table import step_fields
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import published_plan

FIELDS = ("edge_force", "displacement", "grip_force", "support")


def published_steps(engine: Engine) -> list[Step]:
    """Return one step for every different state that Bruun et al. analyze."""
    steps = [step for method in METHODS.values() for step in method(engine.network)]
    steps += published_plan(engine.network.scene)
    return list({(step.bricks, frozenset(step.held)): step for step in steps}.values())


def difference(fields: Fields, reference: Fields) -> dict[str, float]:
    """Return the largest difference of every field, relative to its largest entry."""
    out = {}
    for name in FIELDS:
        want = getattr(reference, name)
        gap = np.abs(getattr(fields, name) - want).max(initial=0)
        out[name] = float(gap / max(np.abs(want).max(initial=0), np.finfo(float).tiny))
    return out


def sweep(steps: list[Step], fast: Engine, contrasts: list[float]) -> pd.DataFrame:
    """Return the worst difference of the frame over all steps, a row per contrast."""
    exact = [step_fields(fast, step) for step in steps]
    rows = []
    for contrast in contrasts:
        frame = FrameEngine(fast.network, contrast)
        gaps, refused = [], 0
        for step, reference in zip(steps, exact, strict=True):
            try:
                gaps.append(difference(step_fields(frame, step), reference))
            except SolverError:
                refused += 1
        worst = pd.DataFrame(gaps, columns=list(FIELDS)).max()
        rows.append({"contrast": contrast, **worst, "refused": refused, "states": len(steps)})
    return pd.DataFrame(rows)


def mixed_gap(step: Step, fast: Engine) -> float:
    """Return the worst difference of the mixed solution of rigid bricks over a step's fields."""
    grips = np.array([step.held], dtype=np.int64).reshape(1, -1)
    mixed = solve_mixed(fast.network, step.bricks, grip_columns(fast.network, step.bricks, grips))
    return max(difference(mixed, step_fields(fast, step)).values())


def experiment(options: Options) -> Finding:
    fast = arch25()
    steps = published_steps(fast)[:: 25 if options.quick else 1]
    powers = [2, 6, 10] if options.quick else np.arange(2, 11.5, 0.5).tolist()
    table = sweep(steps, fast, sorted({CONTRAST, *(10.0**p for p in powers)}))
    print(table.to_string(index=False, float_format="%.2g"))
    gap = max(mixed_gap(step, fast) for step in steps)
    print(f"mixed solution of the same rigid bricks: {gap:.2g}")
    return Finding(holds(table, gap), tables={"frame_contrast": table})


def holds(table: pd.DataFrame, gap: float) -> bool:
    worst = table.set_index("contrast")[list(FIELDS)].max(axis=1)
    ends = table.sort_values("contrast").iloc[[0, -1]].set_index("contrast")
    best = float(worst[CONTRAST])
    bad = (worst[ends.index] >= 10 * best) | (ends["refused"] > 0)
    return bool(best <= min(5e-6, worst.min()) and bad.all() and gap <= 1e-9)


CLAIM = Claim(experiment, digits=3, quick="few states")
