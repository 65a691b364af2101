"""Claim: every schedule goes with every aim, limit, formulation and means.

Method: the command line is run for every pair of a schedule and something that goes with it, on an
arch of seven bricks. Every plan has a value, which is stored; where there is none, the line is that
says why. Whether values are right is tested elsewhere, against every plan of small builds.

Inputs: none. Command: ``python -m experiments composing [--quick]``.
"""

import io
import json
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from itertools import product
from pathlib import Path

import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
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
SCENARIOS = ["--scenarios", "2"]
OVER_STATES = ("path_dp", "path_labels", "path_beam", "best_first", "flow_lp", "flow_mip")
GOES = {
    "as it is": [],
    "sum": [*WORTH, "--aim", "sum"],
    "minmax": [*WORTH, "--aim", "minmax"],
    "minmax, then steps": [*WORTH, "--aim", "minmax,steps"],
    "a response": ["--aim", "T_max"],
    **{aim: ["--aim", aim] for aim in ("steps", "regrips", "travel")},
    "friction": ["--stands", "bond=3e4", "--aim", "friction"],
    "a limit": [*WORTH, *STATES, "--limit", "F_largest=500"],
    "a budget": [*WORTH, *STATES, "--budget", "travel=20m"],
    "standing": [*WORTH, *STATES, "--stands", "bond=3e4"],
    "the worst step of scenarios": [*WORTH, *STATES, "--robust", "worst-peak", *SCENARIOS],
    "the worst total of scenarios": [*WORTH, "--robust", "worst-total", *SCENARIOS],
    "the mean of the worst scenarios": [*WORTH, "--robust", "cvar=0.5", *SCENARIOS],
    "candidates": [*WORTH, *STATES, "--candidates", "near:2"],
    "a time limit": [*WORTH, *STATES, "--time-limit", "60"],
    "workers": [*WORTH, *STATES, "--workers", "2"],
    "a folder of answers": [*WORTH, *STATES, "--cache", "answers"],
    **{name: [*WORTH, *STATES, "--formulation", name] for name in OVER_STATES},
    "overlap_dp": [*WORTH, "--formulation", "overlap_dp"],
    "rank_search": ["--formulation", "rank_search"],
    "Pareto": ["pareto", "--aim", "T_max,F_largest"],
}
FILES = ("own.csv", "answers", "front")  # words that stand for files in a folder


def cell(folder: Path, schedule: list[str], words: list[str]) -> tuple[float | None, str]:
    """Return the first value of a plan, or the line that says why there is none.

    Of a Pareto set it is the number of plans.
    """
    front = words[:1] == ["pareto"]
    given = ["pareto" if front else "optimize", SCENE, *schedule, *words[front:]]
    given += ["--out", "front"] if front else []
    given = [str(folder / word) if word in FILES else word for word in given]
    printed, said = io.StringIO(), io.StringIO()
    with redirect_stdout(printed), redirect_stderr(said):
        try:
            code = main([*given, "--json"])
        except SystemExit as end:  # of the parser of arguments
            code = int(end.code or 0)
    if code:
        return None, " ".join(said.getvalue().rpartition("error: ")[2].split())
    answer = json.loads(printed.getvalue())
    if front:
        return float(len(answer["points"])), ""
    found = answer["summary"].get("objective")
    return float(next(iter(found.values())) if isinstance(found, dict) else found), ""


def experiment(options: Options) -> Finding:
    goes = {word: GOES[word] for word in ("steps", "overlap_dp")} if options.quick else GOES
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "own.csv").write_text(OPEN, encoding="utf-8")
        for (schedule, place), (word, words) in product(SCHEDULES.items(), goes.items()):
            value, why = cell(folder, place, words)
            rows.append({"schedule": schedule, "with": word, "value": value, "reason": why})
    table = pd.DataFrame(rows)
    print(table.to_string(index=False, float_format="%.6g"))
    return Finding(holds(table), tables={"composing": table})


def holds(table: pd.DataFrame) -> bool:
    return bool(table["value"].notna().all())


CLAIM = Claim(experiment, quick="two columns")
