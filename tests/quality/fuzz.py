"""No input gives a traceback, a hang, a result that is not finite, or a half-written file.

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

Files of every kind that is read are damaged too, and read without a command: each ends in a line
of its own, or is read.

Optimizing is not drawn with discrete elements, which take minutes for hundreds of grip sets.

Inputs: five small scenes. Command: ``python -m tests.quality.fuzz [--cases N] [--files N]
[--kills N]``; the exit status is 1 if there is a fault.
"""

from __future__ import annotations

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from tests.builders import ROOT
from tests.quality.fuzz_cases import COMMANDS
from tests.quality.fuzz_files import read_damaged, right_files
from tests.quality.fuzz_judge import judged

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
OPTIMIZE = (
    "plan.csv",
    "selection.csv",
    "trace.csv",
    "summary.json",
    "scene.json",
    "report.html",
    "tasks.csv",
    "tasks.json",
)
BARE = ("plan.csv", "summary.json", "scene.json", "trace.csv")  # of one that is ended at the end
BLOCKS = tuple(f"block{i}" for i in range(24))
WRITER = """
import signal
from pathlib import Path
from seqopt._files import write_folder
signal.signal(signal.SIGTERM, signal.default_int_handler)  # as the command line takes it
for name in range(1000):
    write_folder(Path("{out}", str(name)), {{f"block{{i}}": "x" * 500_000 for i in range(24)}})
"""


def optimizing(folder: Path) -> list[str]:
    """Return a program that optimizes arch25 into ``out/0``."""
    words = ["optimize", "--formulation", "overlap_dp", "--out", str(folder / "0")]
    return [sys.executable, "-m", "seqopt", *words]


def writing(folder: Path) -> list[str]:
    """Return a program that does nothing but write folders, ``out/0`` and so on."""
    return [sys.executable, "-c", WRITER.format(out=folder)]


def killed(program: str, number: int) -> dict[str, object]:
    """End a program at a random moment; return what it left."""
    rng = np.random.default_rng(number)
    make, names, longest = {
        "optimize": (optimizing, OPTIMIZE, 3.0),
        "write": (writing, BLOCKS, 2.0),
    }[program]
    how = SIGNALS[number % len(SIGNALS)]
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background of a shell, and it
        signal.signal(signal.SIGINT, signal.default_int_handler)  # would be so in what is started
    with tempfile.TemporaryDirectory() as name:
        out = Path(name) / "out"
        process = subprocess.Popen(
            make(out), cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        moment = rng.uniform(0.0, longest)
        time.sleep(moment)
        process.send_signal(how)
        said = process.communicate(timeout=60)[1]
        left = _left(out, names)
    if how == signal.SIGINT and program == "optimize" and moment > 0.3 and "Traceback" in said:
        left = "traceback"
    return {"program": program, "signal": how.name, "moment": moment, "left": left}


def _left(out: Path, names: Sequence[str]) -> str:
    """Return whether all folders under their names are whole, and whether anything else is left."""
    if not out.exists():
        return "nothing"
    folders = [path for path in out.iterdir() if not path.name.startswith(".")]
    least = BARE if names == OPTIMIZE else names
    for folder in folders:
        if not {*least} <= {path.name for path in folder.iterdir()} <= {*names}:
            return "a part"
        if "summary.json" in names:
            json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        elif {path.stat().st_size for path in folder.iterdir()} != {500_000}:
            return "a part"
    hidden = len(list(out.iterdir())) > len(folders)
    return ("whole" if folders else "nothing") + (", and a hidden folder" if hidden else "")


CASES, KILLS, FILES = 20_000, 50, 1000
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


def _damaged(count: int) -> list[str]:
    """Return what is wrong with how damaged files of every kind are read."""
    every = [(kind, n) for kind in (right_files() if count else ()) for n in range(count)]
    with tempfile.TemporaryDirectory() as folder:
        found = (read_damaged(kind, number, Path(folder)) for kind, number in every)
        return [each for each in found if each]


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=CASES, help="how many cases")
    parser.add_argument("--kills", type=int, default=KILLS, help="how many programs are ended")
    parser.add_argument("--files", type=int, default=FILES, help="how many damaged ones of a kind")
    options = parser.parse_args(arguments)
    table = pd.DataFrame(list(judged(0, options.cases)))
    counts = summary(table)
    kills = pd.DataFrame(
        killed("optimize" if number % 2 else "write", number) for number in range(options.kills)
    )
    print(counts.to_string(index=False))
    if len(kills):
        ends = kills.groupby(["program", "signal", "left"]).size()
        print(f"\n{ends.rename('kills').reset_index().to_string(index=False)}\n")
    for row in table[table["fault"] != ""].itertuples():
        print(f"fault in case {row.number}: {row.fault}")
    wrong = _damaged(options.files)
    print("".join(f"fault: {each}\n" for each in wrong), end="")
    clean = holds(counts, kills) and not wrong
    print(f"{'no' if clean else 'a'} fault: {len(table)} cases, {len(kills)} kills")
    return int(not clean)


if __name__ == "__main__":
    sys.exit(main())
