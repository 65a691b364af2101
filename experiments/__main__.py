"""List the experiments with claim and last verdict, or run them all.

Command: ``python -m experiments`` lists; ``python -m experiments all [--quick]`` runs each one in
a process of its own and, unless quick, stores verdicts and seconds in
``experiments/results/verdicts.csv``. An experiment that an extra is missing for is named and left
out. The exit status is 1 if a claim does not hold.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd

from experiments.plotting import RESULTS

HOME = Path(__file__).parent
STORE = RESULTS / "verdicts.csv"
PREFIX = "verdict: the claim "
MISSING = 2  # exit status of an experiment whose extra is not installed


def claims() -> dict[str, str]:
    """Return the first sentence of every experiment that makes a claim, by its name."""
    out = {}
    for path in sorted(HOME.glob("*.py")):
        text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        if text.startswith("Claim: "):
            out[path.stem] = text.split("\n\n")[0].removeprefix("Claim: ").replace("\n", " ")
    return out


def run(name: str, *arguments: str) -> tuple[str, float]:
    """Return how an experiment ended and the seconds it took."""
    start = time.perf_counter()
    command = [sys.executable, "-m", f"experiments.{name}", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=HOME.parent)
    seconds = time.perf_counter() - start
    last = (done.stdout.splitlines() or [""])[-1]
    if done.returncode == 0 and last.startswith(PREFIX):
        return last.removeprefix(PREFIX).split(":")[0], seconds
    why = (done.stderr.splitlines() or [last])[-1]
    return ("left out: " if done.returncode == MISSING else "failed: ") + why, seconds


def run_all(*arguments: str) -> pd.DataFrame:
    """Run every experiment; return a row each."""
    rows = []
    for name, claim in claims().items():
        verdict, seconds = run(name, *arguments)
        print(f"{name:22}{seconds:7.1f} s  {verdict}", flush=True)
        rows.append({"experiment": name, "verdict": verdict, "seconds": seconds, "claim": claim})
    return pd.DataFrame(rows)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m experiments", description=__doc__.splitlines()[0]
    )
    parser.add_argument("what", nargs="?", choices=("list", "all"), default="list")
    parser.add_argument("--quick", action="store_true", help="reduced size, nothing stored")
    options = parser.parse_args()
    if options.what == "list":
        stored = pd.read_csv(STORE, index_col=0)["verdict"].to_dict() if STORE.exists() else {}
        for name, claim in claims().items():
            print(f"{name:22}{stored.get(name, 'not run'):14}{claim}")
        return 0
    table = run_all(*(["--quick"] if options.quick else []))
    if not options.quick:
        table.to_csv(STORE, index=False, float_format="%.1f", lineterminator="\n")
    good = table["verdict"].isin(["holds"]) | table["verdict"].str.startswith("left out")
    return int(not good.all())


if __name__ == "__main__":
    sys.exit(main())
