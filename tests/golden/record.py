"""What must not change: questions as commands, and the proven values that answer them.

``python -m tests.golden.record`` writes the values of all questions anew; do so only where a change
is meant, and list old and new values in the changelog.
"""

import io
import json
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from seqopt._cli.main import main

VALUES = Path(__file__).parent / "values.csv"
WORST = "--criterion worst-ratio-published"
FREE = "optimize arch25 --schedule free"
DURATIONS = "fetch=30,place=10,approach=10,grip=5,release=5"
QUICK = {
    "free, ratios": f"{FREE} --aim minmax,steps",
    "free, wall": "optimize wall:columns=4,courses=3 --schedule free --aim minmax,steps",
}
SLOW = {
    "loop, ranks": "optimize arch25",
    "loop, budget of travel": "optimize arch25 --budget travel=16m",
    "loop, ranks, cascade": "optimize arch25 --formulation cascade",
    "loop, ratios, layers": f"optimize arch25 {WORST}",
    "loop, ranks, linear program": "optimize arch25 --formulation overlap_lp",
    "loop, ranks, integer program": "optimize arch25 --formulation overlap_mip",
    "loop, ranks, labels": "optimize arch25 --formulation labels",
    "loop, ranks, multipliers": "optimize arch25 --formulation lagrangian",
    "loop, ranks, rank search": "optimize arch25 --formulation rank_search",
    "loop, ranks, beam": "optimize arch25 --formulation beam",
    "loop, ranks, least peak": "optimize arch25 --formulation minimax",
    "loop, ratios, sum": f"optimize arch25 {WORST} --aim sum",
    "loop, ratios, least peak": f"optimize arch25 {WORST} --aim minmax",
    "loop, budget of steps": "optimize arch25 --budget steps_over:F_largest=300:4",
    "modified sequential": "optimize arch25 --schedule modified-sequential",
    "free, published ratios": f"{FREE} --aim minmax,steps {WORST}",
    "free, dry": f"{FREE} --aim minmax,steps --stands dry {WORST}",
    "free, four robots": f"{FREE} --robots 4 {WORST}",
    "free, sum of tension": f"{FREE} --aim sum(T_max) {WORST}",
    "free, budget": f"{FREE} --aim minmax --budget sum(T_max)=1150 {WORST}",
    "free, budget of regrips": f"{FREE} --aim steps,minmax --budget regrips=1",
    "free, worst of scenarios": f"{FREE} {WORST} --robust worst-peak --scenarios 5",
    "free, total of scenarios": f"optimize chain:bricks=9 --schedule free {WORST} "
    "--robust worst-total --scenarios 3",
    "loop, total of scenarios": f"optimize arch25 {WORST} --robust worst-total --scenarios 5",
    "loop, tail of scenarios": f"optimize arch25 {WORST} --robust cvar=0.5 --scenarios 5",
    "free, time": "optimize chain:bricks=7 --schedule free --aim makespan,steps "
    f"--durations {DURATIONS}",
    "taken down": f"{FREE} --direction take-down {WORST}",
    "chain of 49": "optimize chain:bricks=49 --schedule free --aim minmax,steps "
    "--criterion worst-ratio",
}
LONG = {
    "order": f"{FREE} --order search {WORST}",
    "front": "pareto arch25",
    "chain of 97": "optimize chain:bricks=97 --schedule free --criterion worst-ratio",
}
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
WORTH = ["--criterion", "worst-ratio-published"]
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


def composed() -> dict[str, str]:
    """Return every schedule with everything that goes with it, on an arch of seven bricks."""
    out = {}
    for schedule, place in SCHEDULES.items():
        for word, words in GOES.items():
            front = words[:1] == ["pareto"]
            given = ["pareto" if front else "optimize", "chain:bricks=7", *place, *words[front:]]
            out[f"{schedule}: {word}"] = " ".join(given)
    return out


def answer(command: str, folder: Path) -> dict[str, float] | None:
    """Return the values of every goal, or how many plans a front has; None where it is refused.

    What a plan spends of a budget is its own: other plans that are as good spend another share.
    """
    (folder / "own.csv").write_text(OPEN, encoding="utf-8")
    words = [str(folder / word) if word in FILES else word for word in command.split()]
    said, refused = io.StringIO(), io.StringIO()
    with redirect_stdout(said), redirect_stderr(refused):
        try:
            code = main([*words, "--json"])
        except SystemExit as end:
            code = int(end.code or 0)
    if not said.getvalue():
        sys.stderr.write(refused.getvalue())
        return None
    found = json.loads(said.getvalue())
    if "points" in found:
        return {"points": float(len(found["points"]))}
    del code  # a plan that is no good build has a value, too
    summary = found["summary"]
    values, capped = summary["objective"], summary.get("budgets") or {}
    return {name: float(value) for name, value in values.items() if name not in capped}


def stored() -> dict[str, dict[str, float]]:
    """Return the values of every question, by goal."""
    out: dict[str, dict[str, float]] = {}
    for row in pd.read_csv(VALUES).itertuples():
        out.setdefault(str(row.question), {})[str(row.goal)] = float(row.value)
    return out


def _record() -> None:
    rows = []
    for question, command in (QUICK | SLOW | LONG | composed()).items():
        with TemporaryDirectory() as name:
            found = answer(command, Path(name))
        print(question, found, flush=True)
        rows += [(question, goal, repr(value)) for goal, value in (found or {}).items()]
    pd.DataFrame(rows, columns=["question", "goal", "value"]).to_csv(VALUES, index=False)


if __name__ == "__main__":
    _record()
