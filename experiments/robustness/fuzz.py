"""Claim: no input gives a traceback, a hang, a result that is not finite, or a half-written file.

Method: scenes, plans and words of the command line are changed at random from some that are right,
by the number of the case: values of other kinds, numbers scaled or beyond all bounds, entries
removed, doubled or swapped, text cut off, and changes that get past the first checks (springs
without stiffness, joints at nodes, odd names and payloads). Each case runs as the shell would run
it, in a folder of its own. Its end is a fault if there is

- a traceback, a warning that is no line of the program's own, or a status that is not documented;
- no end within 60 s;
- an error without its line, or with files left; a file left over, a changed input, a part of a
  folder of results;
- a table or an archive with a response that is not finite, or a robot that grips and has no force.

Then programs are ended from outside at 50 random moments (SIGKILL, SIGTERM and SIGINT in turn),
half while they optimize, half while they do nothing but write. They must leave nothing or whole
folders. After SIGKILL, which no program can answer, a hidden folder may be left beside them.

Optimizing is not drawn with discrete elements, which take minutes for hundreds of grip sets.

Inputs: five small scenes. Command: ``python -m experiments.robustness.fuzz [--quick] [--cases N]``.
Writes ``experiments/results/fuzz.csv`` and ``fuzz_kills.csv``.
"""

from __future__ import annotations

import pandas as pd

from experiments.harness.claim import Claim, Finding, Option, Options, Times
from experiments.harness.places import RESULTS
from experiments.robustness.parts.kills import killed
from experiments.robustness.parts.wording import COMMANDS
from experiments.robustness.parts.worker import judged

CASES, QUICK_CASES = 20_000, 200
KILLS, QUICK_KILLS = 50, 4
GOOD = {"nothing", "whole"}
KILLED = {f"{left}, and a hidden folder" for left in GOOD}  # by what no program can answer


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return how many cases of a kind and command ended with a status, and with a fault."""
    known = table["command"].where(table["command"].isin(COMMANDS), "other")
    groups = table.assign(command=known, fault=table["fault"] != "").groupby(
        ["kind", "command", "status"]
    )
    found = groups.agg(
        cases=("number", "size"), faults=("fault", "sum"), longest_s=("seconds", "max")
    )
    return found.reset_index().round({"longest_s": 1})


def is_clean(row: dict[str, object]) -> bool:
    """Return whether what a killed program left is nothing or whole."""
    left = row["left"]
    return left in GOOD or (row["signal"] == "SIGKILL" and left in KILLED)


def holds(table: pd.DataFrame, kills: pd.DataFrame) -> bool:
    """Return whether no case had a fault, and no killed program left a part of a folder."""
    return not table["faults"].any() and all(is_clean(row) for row in kills.to_dict("records"))


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    cases = QUICK_CASES if quick else int(options.cases)
    table = pd.DataFrame(list(judged(0, cases)))
    counts = summary(table)
    kills = pd.DataFrame(
        killed("optimize" if number % 2 else "write", number)
        for number in range(QUICK_KILLS if quick else KILLS)
    )
    print(counts.to_string(index=False))
    ends = kills.groupby(["program", "signal", "left"]).size()
    print(f"\n{ends.rename('kills').reset_index().to_string(index=False)}\n")
    for row in table[table["fault"] != ""].itertuples():
        print(f"fault in case {row.number}: {row.fault}")
    if not quick:
        counts.to_csv(RESULTS / "fuzz.csv", index=False)
        kills.to_csv(RESULTS / "fuzz_kills.csv", index=False, float_format="%.3f")
    return Finding(holds(counts, kills), f": {cases} cases, {len(kills)} kills")


CLAIM = Claim(
    experiment,
    quick=f"{QUICK_CASES} cases, {QUICK_KILLS} kills, nothing written",
    times=Times.SHOWN,
    options=(Option("--cases", "how many cases", str(CASES)),),
)

if __name__ == "__main__":
    CLAIM.main()
