"""Claim: with budgets, labels prove in a tenth of the time of an integer program, or less.

At 25, 49 and 100 bricks the answer of `labels` is proven within 0.1 % by the certificate, not by
the formulation's word, in under 1 s, 3 s and 20 s on one core, the certificate's proof included.
The integer program takes at least ten times as long to choose wherever it finishes within its
limit. The process that poses and solves the problems of one brick count takes less than 1 GB, but
what `labels` adds to the costs is a small part of that.

Method: arches of the reference arch's shape, two criteria, six sets of budgets on robot travel and
on the numbers of steps over a force and over a moment, as shares of what the optimum without
budgets takes. Every brick count and formulation has a process of its own on one core; both
formulations of one count run one after the other.

Inputs: none. Command: ``python -m experiments.placement.budget_proofs [--quick]``. Writes
``experiments/results/budget_proofs.csv``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.plotting import RESULTS

SECONDS = {25: 1.0, 49: 3.0, 100: 20.0}
LIMIT = 60.0  # s, of the integer program
GAP, TIMES, MEMORY = 1e-3, 10.0, 1024.0
KEY = ["bricks", "criterion", "case"]


def measure(bricks: int, formulation: str, limit: float) -> pd.DataFrame:
    """Return the rows of one process."""
    words = ["experiments.placement.parts.budget_cases", str(bricks), formulation, str(limit)]
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", *words], stdout=subprocess.PIPE, text=True, check=True, env=env
    )
    return pd.DataFrame(json.loads(done.stdout))


def ratios(table: pd.DataFrame) -> pd.Series:
    """Return the integer program's time over that of labels, where it finished."""
    own, other = (
        table[table["formulation"] == name].set_index(KEY) for name in ("labels", "overlap_mip")
    )
    finished = other[other["end"] == "done"]
    return (finished["solve"] / own["solve"]).dropna()


def holds(table: pd.DataFrame) -> bool:
    """Return whether the claim holds on rows of `measure`."""
    own = table[table["formulation"] == "labels"]
    whole = own["solve"] + own["verify"]
    return bool(
        (own["proven_gap"] <= GAP).all()
        and (whole <= own["bricks"].map(SECONDS)).all()
        and (own["memory_MB"] <= MEMORY).all()
        and (ratios(table) >= TIMES).all()
    )


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per brick count."""
    own = table[table["formulation"] == "labels"]
    out = own.groupby("bricks").agg(
        problems=("case", "size"),
        proven_gap=("proven_gap", "max"),
        solve_median=("solve", "median"),
        solve_most=("solve", "max"),
        verify_most=("verify", "max"),
        memory_MB=("memory_MB", "max"),
    )
    by = ratios(table).groupby(level="bricks")
    return out.assign(finished=by.size(), least_ratio=by.min(), median_ratio=by.median())


def experiment(options: Options) -> Finding:
    counts = [13] if options.quick else [*SECONDS]
    parts = [
        measure(bricks, name, LIMIT) for bricks in counts for name in ("labels", "overlap_mip")
    ]
    table = pd.concat(parts, ignore_index=True)
    print(summary(table).to_string(float_format="%.4g"))
    if options.quick:  # on thirteen bricks nothing takes time: the stored rows are judged
        return Finding(holds(pd.read_csv(RESULTS / "budget_proofs.csv")), ": stored rows")
    table.to_csv(RESULTS / "budget_proofs.csv", index=False, float_format="%.6g")
    return on_this_run(holds=holds(table))


CLAIM = Claim(
    experiment, quick="thirteen bricks, the stored rows judged, nothing written", times=Times.SHOWN
)

if __name__ == "__main__":
    CLAIM.main()
