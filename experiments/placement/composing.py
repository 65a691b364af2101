"""Claim: every schedule goes with every aim, limit, formulation and means, or one line says why.

What is refused has its reason in the problem: ranks and costs of moves need candidates, and an
order is chosen by its first aim alone.

Method: the command line is run for every pair of a schedule and something that goes with it, on an
arch of seven bricks. Either a plan ends in a value, which is stored, or
an error of one line, which is stored too. What is expected to be refused is listed here: one more
or one less, and the claim does not hold. Whether values are right is tested elsewhere, against
every plan of small builds.

Inputs: none. Command: ``python -m experiments.placement.composing [--quick]``. Writes
``experiments/results/composing.csv``.
"""

from __future__ import annotations

import io
import json
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options, Times
from seqopt._cli.main import main

SCENE = "chain:bricks=7"
OPEN = """step,type,bricks,rob1_node,rob2_node,rob3_node
1,place,1,?,,
2,place,2,?,?,
3,place,3,?,?,?
4,release,3,,?,?
5,place,4,?,?,?
6,release,4,?,,?
7,place,5,?,?,?
8,release,5,?,?,
9,place,6,?,?,?
10,release,6,,?,?
11,place,7,?,?,?
"""
SCHEDULES = {
    "three-robot": ["--schedule", "three-robot"],
    "modified-sequential": ["--schedule", "modified-sequential"],
    "own, up to three grips open": ["--schedule", "own.csv"],
    "free": ["--schedule", "free"],
    "free, order sought": ["--schedule", "free", "--order", "search"],
}
WORTH = ["--criteria", "worst-ratio-published"]
STATES = ["--aim", "minmax"]
SCENARIOS = ["--scenarios", "2", "--unseen", "1"]
GOES = {
    "as it is": [],
    "sum": [*WORTH, "--aim", "sum"],
    "minmax": [*WORTH, "--aim", "minmax"],
    "minmax, then steps": [*WORTH, "--aim", "minmax,steps"],
    "a response": ["--aim", "T_max"],
    "steps": ["--aim", "steps"],
    "regrips": ["--aim", "regrips"],
    "travel": ["--aim", "travel"],
    "friction": ["--stands", "bond=3e4", "--aim", "friction"],
    "a limit": [*WORTH, *STATES, "--limit", "F_largest=500"],
    "a budget": [*WORTH, *STATES, "--budget", "travel=20m"],
    "standing": [*WORTH, *STATES, "--stands", "bond=3e4"],
    "the worst step of scenarios": [*WORTH, *STATES, "--robust", "worst-peak", *SCENARIOS],
    "the worst total of scenarios": [*WORTH, "--robust", "worst-total", *SCENARIOS],
    "the mean of the worst scenarios": [*WORTH, "--robust", "cvar=0.5", *SCENARIOS],
    "candidates": [*WORTH, *STATES, "--candidates", "near:2"],
    "a time limit": [*WORTH, *STATES, "--time-limit", "60"],
    "lazily": [*WORTH, *STATES, "--lazy"],
    "workers": [*WORTH, *STATES, "--workers", "2"],
    "a folder of answers": [*WORTH, *STATES, "--cache", "answers"],
    "path_dp": [*WORTH, *STATES, "--formulation", "path_dp"],
    "path_labels": [*WORTH, *STATES, "--formulation", "path_labels"],
    "path_beam": [*WORTH, *STATES, "--formulation", "path_beam"],
    "best_first": [*WORTH, *STATES, "--formulation", "best_first"],
    "flow_lp": [*WORTH, *STATES, "--formulation", "flow_lp"],
    "flow_mip": [*WORTH, *STATES, "--formulation", "flow_mip"],
    "overlap_dp": [*WORTH, "--formulation", "overlap_dp"],
    "rank_search": ["--formulation", "rank_search"],
    "Pareto": ["pareto", "--aim", "T_max,F_largest"],
}
OWN, FREE, ORDERS = [*SCHEDULES][2:]
REFUSED = {
    (OWN, FREE, ORDERS): [
        *("overlap_dp", "rank_search")  # they need moves with candidates
    ],
    (ORDERS,): [*("friction", "a budget", "Pareto")],
}


def refused() -> set[tuple[str, str]]:
    """Return the pairs that are expected to be refused."""
    return {(one, word) for some, words in REFUSED.items() for one in some for word in words}


def cell(folder: Path, schedule: list[str], words: list[str]) -> tuple[float | None, str]:
    """Return the first value of a plan, or the line that says why there is none."""
    command = "pareto" if words[:1] == ["pareto"] else "optimize"
    rest = [word.replace("answers", str(folder / "answers")) for word in words]
    place = [word.replace("own.csv", str(folder / "own.csv")) for word in schedule]
    out = ["--out", str(folder / "front")] if command == "pareto" else []
    given = [command, SCENE, *place, *rest[command == "pareto" :], *out]
    printed, said = io.StringIO(), io.StringIO()
    with redirect_stdout(printed), redirect_stderr(said):
        try:
            code = main([*given, "--json"])
        except SystemExit as end:  # of the parser of arguments
            code = int(end.code or 0)
    if code:
        return None, " ".join(said.getvalue().rpartition("error: ")[2].split())
    return _value(json.loads(printed.getvalue())), ""


def _value(answer: dict[str, Any]) -> float:
    """Return the first value that an answer names; of a Pareto set the number of its plans."""
    if "points" in answer:
        return float(len(answer["points"]))
    found = answer["summary"].get("objective")
    return float(next(iter(found.values())) if isinstance(found, dict) else found)


def experiment(options: Options) -> Finding:
    goes = {word: GOES[word] for word in ("minmax", "steps", "a budget")} if options.quick else GOES
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "own.csv").write_text(OPEN, encoding="utf-8")
        for schedule, place in SCHEDULES.items():
            for word, words in goes.items():
                value, why = cell(folder, place, words)
                rows.append({"schedule": schedule, "with": word, "value": value, "reason": why})
    table = pd.DataFrame(rows)
    print(table.to_string(index=False, float_format="%.6g"))
    return Finding(holds(table), tables={"composing": table})


def holds(table: pd.DataFrame) -> bool:
    """Return whether what is refused is what is expected, each in a line that says something."""
    no = table[table["value"].isna() & table["reason"].fillna("").ne("")]
    asked = {*zip(table["schedule"], table["with"], strict=True)}
    pairs = {*zip(no["schedule"], no["with"], strict=True)}
    whole = (table["value"].notna() | table["reason"].fillna("").ne("")).all()
    return bool(whole) and pairs == refused() & asked


CLAIM = Claim(experiment, quick="three columns, nothing written", times=Times.NONE)

if __name__ == "__main__":
    CLAIM.main()
