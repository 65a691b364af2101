"""Programs ended from outside at random moments, and what they leave."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.harness.places import HOME

SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
OPTIMIZE = (
    "plan.csv",
    "selection.csv",
    "responses.csv",
    "trace.csv",
    "summary.json",
    "scene.json",
    "report.html",
)
BLOCKS = tuple(f"block{i}" for i in range(24))
WRITER = """
import signal
from pathlib import Path
from seqopt.files import write_folder
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
            make(out), cwd=HOME.parent, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
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
    for folder in folders:
        if {path.name for path in folder.iterdir()} != set(names):
            return "a part"
        if "summary.json" in names:
            json.loads((folder / "summary.json").read_text(encoding="utf-8"))
        elif {path.stat().st_size for path in folder.iterdir()} != {500_000}:
            return "a part"
    hidden = len(list(out.iterdir())) > len(folders)
    return ("whole" if folders else "nothing") + (", and a hidden folder" if hidden else "")
