"""Claim: with budgets, labels prove in a tenth of the time of an integer program, or less.

At 25, 49 and 100 bricks the answer of `labels` is proven within 0.1 % by the certificate, not by
the formulation's word, in under 1 s, 3 s and 20 s on one core, the certificate's proof included,
in less than 1 GB. HiGHS takes at least ten times as long to choose, or is stopped after at least
ten times as long, and chooses no better; up to 49 bricks it always finishes. No choice undercuts a
bound of `lagrangian`.

Method: the reference arch and longer ones of its shape, two criteria, no budget and five sets of
them on robot travel and on the numbers of steps over a force and over a moment, as shares of what
the optimum without budgets takes. Every formulation that takes the problem solves it, each in a
process of its own on one core, one after the other; its peak memory is that of the process, from
the scene to the proof. Seconds are of the processor, since machines are shared; the limit, 60 s,
is of the clock. At 100 bricks the linear and the integer program meet one criterion and four of
the sets: they take a minute each.

Inputs: none. Command: ``python -m experiments.placement.budget_proofs [--quick]``. Writes
``experiments/results/budget_proofs.csv`` and ``docs/figures/contest.png``.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.placement.parts.budget_cases import CASES, COMPARED, NO_BUDGET
from experiments.placement.parts.contest_chart import chart
from seqopt.placement.formulation import formulations

SECONDS = {25: 1.0, 49: 3.0, 100: 20.0}
LIMIT = 60.0  # s
GAP, TIMES, MEMORY = 1e-3, 10.0, 1024.0
SAME = 1e-6  # of objectives
SOLVERS = ("overlap_lp", "overlap_mip")
LARGE, FEW = 100, (NO_BUDGET, "travel 0.8", "travel 0.5", "travel and force 0.8")
KEY = ["bricks", "criterion", "case"]
COLUMNS = [
    *(*KEY, "budgets", "formulation", "end", "objective", "bound", "proven_gap"),
    *("solve", "verify", "memory_MB", "said"),
]
Spec = tuple[int, str, str, str]


def specs() -> Iterator[Spec]:
    """Yield brick count, criterion, case and formulation of every run."""
    for bricks in SECONDS:
        for criterion in COMPARED:
            for case in CASES:
                rare = bricks >= LARGE and (criterion != COMPARED[0] or case not in FEW)
                for name, formulation in formulations().items():
                    able = formulation.takes_budgets or case == NO_BUDGET
                    if able and not (rare and name in SOLVERS):
                        yield bricks, criterion, case, name


def measure(spec: Spec, limit: float) -> dict[str, object]:
    """Return the row of a process of its own; one that died has run out of memory."""
    words = ["experiments.placement.parts.budget_cases", *map(str, spec), str(limit)]
    env = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", *words], capture_output=True, text=True, check=False, env=env
    )
    base = dict(zip((*KEY, "formulation"), spec, strict=True))
    if done.returncode:
        last = (done.stderr.splitlines() or [f"exit status {done.returncode}"])[-1]
        return base | {"end": "died", "said": last}
    return base | json.loads(done.stdout.splitlines()[-1])


def of(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return the rows of a formulation with budgets, by problem."""
    return table[(table["formulation"] == name) & (table["budgets"] > 0)].set_index(KEY)


def ratios(table: pd.DataFrame) -> pd.Series:
    """Return the time of HiGHS, until it finished or was stopped, over that of labels."""
    return (of(table, "overlap_mip")["solve"] / of(table, "labels")["solve"]).dropna()


def holds(table: pd.DataFrame) -> bool:
    """Return whether the claim holds on rows of `measure`."""
    own, other, priced = (of(table, n) for n in ("labels", "overlap_mip", "lagrangian"))
    whole, counts = own["solve"] + own["verify"], own.index.get_level_values("bricks")
    best = own["objective"]
    better = other["objective"] < best.reindex(other.index) * (1 - SAME)
    unfinished = other[other["end"] != "done"].index.get_level_values("bricks")
    return bool(
        (own["proven_gap"] <= GAP).all()
        and (whole <= counts.map(SECONDS)).all()
        and (own["memory_MB"] <= MEMORY).all()
        and (ratios(table) >= TIMES).all()
        and set(unfinished) <= {LARGE}
        and not better.any()
        and (priced["bound"] <= best.reindex(priced.index) * (1 + SAME)).all()
    )


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per brick count and formulation: problems with budgets."""
    capped = table[table["budgets"] > 0]
    by = capped.groupby(["bricks", "formulation"])
    return by.agg(
        problems=("case", "size"),
        done=("end", lambda ends: int((ends == "done").sum())),
        proven_gap=("proven_gap", "max"),
        solve_median=("solve", "median"),
        solve_most=("solve", "max"),
        verify_most=("verify", "max"),
        memory_MB=("memory_MB", "max"),
    )


def experiment(options: Options) -> Finding:
    wanted = list(specs())
    if options.quick:
        wanted = [(13, COMPARED[0], "travel 0.8", name) for name in ("labels", "overlap_mip")]
    rows = []
    for spec in wanted:
        rows.append(measure(spec, LIMIT))
        print(*spec, *(f"{rows[-1].get(name)}" for name in ("end", "solve")), flush=True)
    table = pd.DataFrame(rows).reindex(columns=COLUMNS)
    print(summary(table).to_string(float_format="%.4g"))
    if options.quick:  # on thirteen bricks nothing takes time: the stored rows are judged
        return Finding(holds(pd.read_csv(RESULTS / "budget_proofs.csv")), ": stored rows")
    table.to_csv(RESULTS / "budget_proofs.csv", index=False, float_format="%.10g")
    save_all(PICTURES)
    times = ratios(table).groupby(level="bricks")
    print(f"HiGHS over labels:\n{times.agg(['size', 'min', 'median', 'max']).round(1)}")
    return on_this_run(holds=holds(table))


PICTURES: dict[str, Callable[[], Figure]] = {
    "contest.png": lambda: chart(stored("budget_proofs")),
}
CLAIM = Claim(
    experiment,
    quick="thirteen bricks, the stored rows judged, nothing written",
    times=Times.SHOWN,
    pictures=PICTURES,
)

if __name__ == "__main__":
    CLAIM.main()
