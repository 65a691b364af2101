"""All cells of numbers under the kernel of this process; it prints their rows as JSON."""

import json
import pickle
import sys
from pathlib import Path

from experiments.failing.parts import choice_cells, engine_cells


def main(path: str, first: str, last: str, *words: str) -> None:
    quick = "quick" in words
    known = pickle.loads(Path(path).read_bytes())
    out = []
    for cell, exact in zip(engine_cells.cells(quick=quick), known, strict=True):
        out += [{"half": "engines", **row} for row in engine_cells.rows(cell, exact)]
    for problem in choice_cells.cells(quick=quick):
        found = choice_cells.rows(problem, range(int(first), int(last)))
        out += [{"half": "formulations", **row} for row in found]
    print(json.dumps(out, default=str))


if __name__ == "__main__":
    main(*sys.argv[1:])
