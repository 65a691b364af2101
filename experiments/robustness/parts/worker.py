"""Cases in a process of their own, so that one that hangs can be ended.

Command: ``python -m experiments.robustness.parts.worker FIRST LAST`` prints a line of JSON for
every case.
"""

from __future__ import annotations

import json
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict

from experiments.harness.places import HOME
from experiments.robustness.parts.judging import LONGEST, judge
from experiments.robustness.parts.mutations import Mutator

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
    with subprocess.Popen(words, cwd=HOME.parent, stdout=subprocess.PIPE, text=True) as process:
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
