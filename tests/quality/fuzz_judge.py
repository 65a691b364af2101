"""Run a case as the shell would, and say what is wrong with how it ended.

Command: ``python -m tests.quality.fuzz_judge FIRST LAST`` prints a line of JSON for every case:
in a process of their own, cases that hang can be ended.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from seqopt._cli.answer import Status
from seqopt._cli.main import main
from seqopt.responses.quantities import RESPONSES, robot_response
from tests.builders import ROOT
from tests.quality.fuzz_cases import Case, Mutator, write_case

LONGEST = 60.0  # s; a case that takes longer hangs
ENDS = {status.value for status in Status} - {Status.INTERRUPTED.value}
STARTS = (  # of lines on standard error
    *(
        "seqopt",
        "engine: ",
        "enough: ",
        "left out: ",
        "grips: ",
        "proof: ",
        "robots: ",
        "payload: ",
        "payload exceeded: ",
        "not done, ",
        "rules: ",
        "kept: ",
        "stresses in joints are not checked: ",
        "stability: not proven; ",
    ),
    *("outside the linear range: ", "Do not rely on numbers outside the linear range. "),
)
ARCHIVE, IMAGE = b"PK", b"\x89PNG"  # how files of fields and of pictures begin
SET = {"plan.csv", "selection.csv", "summary.json"}


@dataclass(frozen=True)
class Verdict:
    """How a case ended.

    Attributes
    ----------
    status : int
        Exit status; -1 for a traceback.
    fault : str
        What is wrong with that; empty if nothing is.
    seconds : float
    """

    status: int
    fault: str
    seconds: float


def judge(case: Case) -> Verdict:
    """Run a case in a folder of its own; return what is wrong with its end."""
    with tempfile.TemporaryDirectory() as name, _inside(Path(name)) as folder:
        write_case(case, folder)
        out, err = io.StringIO(), io.StringIO()
        start = time.perf_counter()
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                status = int(main(list(case.words)))
        except Exception:  # a traceback is what this looks for
            last = traceback.format_exc().strip().splitlines()
            where = [
                line.strip() for line in last if "/seqopt/" in line or "/formulations/" in line
            ]
            return Verdict(-1, f"traceback: {last[-1][:200]} {where[-1:]}", 0.0)
        seconds = time.perf_counter() - start
        return Verdict(
            status, _fault(case, folder, status, (out.getvalue(), err.getvalue())), seconds
        )


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[Path]:
    before = Path.cwd()
    os.chdir(folder)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # but what the command line turns into lines
        try:
            yield folder
        finally:
            os.chdir(before)


def _fault(case: Case, folder: Path, status: int, said: tuple[str, str]) -> str:
    """Return what is wrong with the end of a case."""
    if status not in ENDS:
        return f"status {status}"
    lines = said[1].splitlines()
    if status >= Status.BAD_INPUT and not (lines and lines[-1].startswith("seqopt")):
        return f"status {status} without a reason: {said[1][:200]!r}"
    if any(not line.startswith(STARTS) for line in lines):
        return f"more than lines of its own on standard error: {said[1][:300]!r}"
    if "\x1b" in said[0] + said[1]:
        return "a sign that steers a terminal"
    if (folder / "scene.json").read_bytes() != case.scene and not _is_output(case.words):
        return "the input was changed"
    return _fault_of_files(case, folder, status) or _fault_of_text(case, status, said[0])


def _is_output(words: tuple[str, ...]) -> bool:
    """Return whether the scene's file is named as an output alone."""
    before = [first for first, second in pairwise(words) if second == "scene.json"]
    return bool(before) and all(word in ("--out", "--export", "--fields") for word in before)


def _fault_of_files(case: Case, folder: Path, status: int) -> str:
    left = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    new = left - {"scene.json", "plan.csv"}
    if any(Path(path).name.startswith(".") for path in left):
        return f"left over: {sorted(left)}"
    rows = status == Status.NO_ANSWER and case.words[0] == "analyze"  # of steps that are answered
    if new and status in (Status.BAD_INPUT, Status.NO_ANSWER) and not rows:
        return f"status {status}, and written: {sorted(new)}"
    for path in new:
        folder_of_path = (folder / path).parent
        names = {p.name for p in folder_of_path.iterdir()}
        if Path(path).name in SET and not names >= SET and folder_of_path != folder:
            return f"a part of a folder: {sorted(names)}"
        fault = _fault_of_content(folder / path)
        if fault:
            return f"{path}: {fault}"
    return ""


def _fault_of_content(path: Path) -> str:
    """Return what is not finite in a file, told by its content: names are drawn at random too."""
    content = path.read_bytes()
    if content.startswith(ARCHIVE):
        with np.load(io.BytesIO(content)) as fields:
            floats = [fields[n] for n in fields.files if fields[n].dtype.kind == "f"]
        return "" if all(np.isfinite(a).all() for a in floats) else "a field is not finite"
    if content.startswith(IMAGE):
        return ""
    text = content.decode()
    if text.startswith("{"):
        numbers = [v for v in json.loads(text).values() if isinstance(v, float)]
        return "" if np.isfinite(numbers).all() else "a number is not finite"
    return _fault_of_table(text)


def _fault_of_text(case: Case, status: int, text: str) -> str:
    if status < Status.BAD_INPUT and text.startswith("step,"):
        return _fault_of_table(text)
    if status < Status.BAD_INPUT and case.words[0] == "compare" and " inf" in text:
        return "compare prints inf"
    return ""


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


Row = dict[str, object]


def judged(first: int, last: int, longest: float = LONGEST) -> Iterator[Row]:
    """Yield how the cases of some numbers ended; one that takes longer is a fault, and ended."""
    while first < last:
        for row in _some(first, last, longest):
            first = int(str(row["number"])) + 1
            yield row


def _some(first: int, last: int, longest: float) -> Iterator[Row]:
    """Yield cases until all are judged or one hangs or ends its process."""
    words = [sys.executable, "-m", __name__, str(first), str(last)]
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        lines: queue.Queue[str] = queue.Queue()
        threading.Thread(target=_listen, args=(process, lines), daemon=True).start()
        try:
            while first < last:
                try:
                    line = lines.get(timeout=longest)
                except queue.Empty:
                    yield _ended(first, f"hangs: more than {longest:g} s")
                    return
                if not line:
                    yield _ended(first, f"ends its process: {process.wait()}")
                    return
                yield json.loads(line)
                first += 1
        finally:
            process.kill()


def _listen(process: subprocess.Popen[str], lines: queue.Queue[str]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        lines.put(line)
    lines.put("")


def _ended(number: int, fault: str) -> Row:
    case = Mutator().case(number)
    return {
        "number": number,
        "kind": case.kind,
        "command": case.words[0],
        "status": -1,
        "fault": fault,
        "seconds": LONGEST,
    }


def run(first: int, last: int) -> Iterator[Row]:
    """Yield how cases ended, judged in this process."""
    mutator = Mutator()
    for number in range(first, last):
        case = mutator.case(number)
        about = {"number": number, "kind": case.kind, "command": case.words[0]}
        yield about | asdict(judge(case))


if __name__ == "__main__":
    for found in run(int(sys.argv[1]), int(sys.argv[2])):
        print(json.dumps(found), flush=True)
