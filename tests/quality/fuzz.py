"""No input gives a traceback, a hang, a result that is not finite, or a half-written file.

Method: scenes, plans and words of the command line are changed at random from some that are right,
by the number of the case: values of other kinds, numbers scaled or beyond all bounds, entries
removed, doubled or swapped, text cut off, and changes that get past the first checks (springs
without stiffness, joints at nodes, odd names and payloads). Each case runs as the shell would run
it, in a folder of its own. Its end is a fault if there is

- a traceback, a warning that is no line of the program's own, or a status that is not documented;
- an error without its line, or with files left; a file left over, a changed input, a part of a
  folder of results;
- a table with a response that is not finite, or a robot that grips and has no force.

A case that takes 60 s ends the run, with what it was at. Files of every kind that is read are
damaged too, and read without a command: each ends in a line of its own, or is read.

Optimizing is not drawn with discrete elements, which take minutes for hundreds of grip sets.

Inputs: five small scenes. Command: ``python -m tests.quality.fuzz [--cases N] [--files N]``; the
exit status is 1 if there is a fault.
"""

import argparse
import contextlib
import faulthandler
import io
import json
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from seqopt._cli.answer import Status
from seqopt._cli.main import main as run_command
from seqopt.responses.quantities import RESPONSES, robot_response
from tests.quality.fuzz_cases import Case, Mutator, write_case
from tests.quality.fuzz_files import read_damaged, right_files

CASES, FILES = 20_000, 1000
LONGEST = 60.0  # s; a case that takes longer hangs
ENDS = {status.value for status in Status} - {Status.INTERRUPTED.value}
STARTS = (  # of lines on standard error
    *("seqopt", "engine: ", "enough: ", "taken: ", "left out: ", "grips: ", "proof: ", "robots: "),
    *("rules: ", "payload: ", "payload exceeded: ", "not done, ", "kept: "),
    "stability: not proven; ",
    *("stresses in joints are not checked: ", "outside the linear range: "),
    "Do not rely on numbers outside the linear range. ",
)
IMAGE = b"\x89PNG"  # how files of pictures begin
SET = {"plan.csv", "tasks.csv", "summary.json"}


def judge(case: Case) -> tuple[int, str]:
    """Run a case in a folder of its own; return its status and what is wrong with its end."""
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name), warnings.catch_warnings():
        warnings.simplefilter("error")  # but what the command line turns into lines
        write_case(case, folder := Path(name))
        faulthandler.dump_traceback_later(LONGEST, exit=True, file=sys.__stderr__)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status = int(run_command(list(case.words)))
        except Exception:  # a traceback is what this looks for
            last = traceback.format_exc().strip().splitlines()
            own = [line.strip() for line in last if "/seqopt/" in line or "/formulations/" in line]
            return -1, f"traceback: {last[-1][:200]} {own[-1:]}"
        finally:
            faulthandler.cancel_dump_traceback_later()
        said = out.getvalue(), err.getvalue()
        return status, next(_faults(case, folder, status, said), "")


def _faults(case: Case, folder: Path, status: int, said: tuple[str, str]) -> Iterator[str]:
    """Yield what is wrong with the end of a case."""
    lines = said[1].splitlines()
    if status not in ENDS:
        yield f"status {status}"
    if status >= Status.BAD_INPUT and not (lines and lines[-1].startswith("seqopt")):
        yield f"status {status} without a reason: {said[1][:200]!r}"
    if any(not line.startswith(STARTS) for line in lines):
        yield f"more than lines of its own on standard error: {said[1][:300]!r}"
    if "\x1b" in said[0] + said[1]:
        yield "a sign that steers a terminal"
    before = [first for first, second in pairwise(case.words) if second == "scene.json"]
    outputs = before and all(word in ("--out", "--export") for word in before)
    if (folder / "scene.json").read_bytes() != case.scene and not outputs:
        yield "the input was changed"
    yield from _faults_of_files(case, folder, status)
    if status < Status.BAD_INPUT and (fault := _fault_of_table(said[0])):
        yield fault
    if status < Status.BAD_INPUT and case.words[0] == "compare" and " inf" in said[0]:
        yield "compare prints inf"


def _faults_of_files(case: Case, folder: Path, status: int) -> Iterator[str]:
    left = {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}
    new = left - {Path("scene.json"), Path("plan.csv")}
    if any(path.name.startswith(".") for path in left):
        yield f"left over: {sorted(map(str, left))}"
    rows = status == Status.NO_ANSWER and case.words[0] == "analyze"  # of steps that are answered
    if new and status in (Status.BAD_INPUT, Status.NO_ANSWER) and not rows:
        yield f"status {status}, and written: {sorted(map(str, new))}"
    for path in new:
        names = {other.name for other in (folder / path).parent.iterdir()}
        if path.name in SET and not names >= SET and path.parent != Path():
            yield f"a part of a folder: {sorted(names)}"
        if fault := _fault_of_content(folder / path):
            yield f"{path}: {fault}"


def _fault_of_content(path: Path) -> str:
    """Return what is not finite in a file, told by its content: names are drawn at random too."""
    content = path.read_bytes()
    if content.startswith(IMAGE):
        return ""
    text = content.decode()
    if text.startswith("{"):
        numbers = [v for v in json.loads(text).values() if isinstance(v, float)]
        return "" if np.isfinite(numbers).all() else "a number is not finite"
    return _fault_of_table(text)


def _fault_of_table(text: str) -> str:
    """Return what is not finite in a table of steps."""
    if not text.startswith("step,type") or text.startswith("step,type,action"):  # tasks
        return ""
    table = pd.read_csv(io.StringIO(text))
    if "verdict" in table:
        tilts = table["tilt_survived_deg"]  # one is finite where one is asked for
        proven = (table["verdict"] == "stands") & (table["unproven"] == 0) & tilts.notna().any()
        return "" if np.isfinite(tilts[proven]).all() else "a tilt"
    columns = [r.column for r in RESPONSES.values()]
    if "finding" in table:  # steps without an answer have none
        table = table[table["finding"].isna()]
    if not len(table) or columns[0] not in table:  # steps alone, where time was over
        return ""
    if not np.isfinite(table[columns].to_numpy(float)).all():
        return "a response is not finite"
    for node in (column for column in table if column.endswith("_node")):
        force = f"{robot_response(node.removesuffix('_node'))}_N"
        if not (table[node].notna() == np.isfinite(table[force].astype(float))).all():
            return f"{force}: a robot that grips has no force"
    return ""


def run(first: int, last: int) -> Iterator[tuple[Case, int, str]]:
    """Yield the cases of some numbers, their status and what is wrong with their end."""
    mutator = Mutator()
    for number in range(first, last):
        yield (case := mutator.case(number), *judge(case))


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=CASES, help="how many cases")
    parser.add_argument("--files", type=int, default=FILES, help="how many damaged ones of a kind")
    options = parser.parse_args(arguments)
    counts: Counter[tuple[str, int]] = Counter()
    wrong = []
    for number, (case, status, fault) in enumerate(run(0, options.cases)):
        counts[case.kind, status] += 1
        wrong += [f"case {number}: {fault}"] if fault else []
    for (kind, status), count in sorted(counts.items()):
        print(f"{kind:8} status {status}: {count}")
    kinds = right_files() if options.files else ()
    with tempfile.TemporaryDirectory() as folder:
        every = ((kind, number) for kind in kinds for number in range(options.files))
        found = (read_damaged(*each, Path(folder)) for each in every)
        wrong += [each for each in found if each]
    print("".join(f"fault: {each}\n" for each in wrong), end="")
    print(f"{'a' if wrong else 'no'} fault: {options.cases} cases")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
