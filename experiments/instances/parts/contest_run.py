"""One instance solved in one way: our formulations, and solvers that read what is exported.

Command: ``python -m experiments.instances.parts.contest_run NAME SOLVER SECONDS`` prints a row as
JSON, and the path that was found.
"""

import json
import math
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from experiments.instances.parts.library import instance
from formulations.solvers import _solve_file
from seqopt import judge_instance, save_instance, solve
from seqopt.errors import SeqoptError
from seqopt.graph.formulation import find_formulation
from seqopt.graph.instance import Instance
from seqopt.graph.paths import fewest_moves, reached
from seqopt.plan._paths import _claims

OUTSIDE = ("HiGHS", "CP-SAT")
MOST_ARCS = 20_000  # of what outside solvers are given


def solvers(one: Instance) -> tuple[str, ...]:
    """Return the ways to solve an instance: formulations that fit, then outside solvers."""
    return (*one.fitting, *(OUTSIDE if one.arcs <= MOST_ARCS else ()))


def run(name: str, solver: str, seconds: float) -> dict[str, object]:
    """Return a row: values and bounds of the first goal, and the path."""
    one = instance(name)
    start = time.process_time()
    try:
        found = _outside(one, solver, seconds) if solver in OUTSIDE else _own(one, solver, seconds)
    except SeqoptError as error:
        found = {"end": str(error)[:60]}
    row = {"instance": name, "solver": solver, "value": math.nan, "bound": math.nan}
    row |= {"proven": math.nan, "end": "", "nodes": [], "claims": []} | found
    return row | {"seconds": time.process_time() - start}


def _own(one: Instance, solver: str, seconds: float) -> dict[str, object]:
    formulation = find_formulation(solver)
    timed = formulation.watched or "seconds" in formulation.options
    plan = solve(one, formulation, time_limit=seconds if timed else math.inf)
    proof = plan.certificate
    return {
        "value": proof.values[0],
        "values": [*proof.values],
        "bound": max(plan.selection.bound[0], proof.bounds[0]),
        "proven": proof.bounds[0],
        "bounds": [*proof.bounds],
        "end": str(plan.status),
        "nodes": [*plan.nodes],
        "claims": [_plain(claim) for claim in _claims(one, plan.selection)],
    }


def _plain(claim) -> dict[str, object]:
    """Return a claim as JSON holds it."""
    out: dict[str, object] = {"prices": dict(claim.prices)} if claim.prices else {}
    if claim.value is not None and math.isfinite(claim.value):
        out["value"] = claim.value
    for name in ("weights", "shares"):
        if getattr(claim, name) is not None:
            out[name] = getattr(claim, name).tolist()
    if claim.labels is not None:
        nodes, values = claim.labels
        out["labels"] = {"nodes": nodes.tolist(), "values": values.tolist()}
    return out


def _outside(one: Instance, solver: str, seconds: float) -> dict[str, object]:
    """Return what a solver finds that reads a file."""
    with TemporaryDirectory() as folder:
        end, bound, taken = WAYS[solver](one, Path(folder), seconds)
    if taken is None:
        return {"end": end, "bound": bound}
    arcs = np.asarray(taken) > 0.5
    if one.asks_time:
        arcs = np.isin(np.arange(one.arcs), one.timed.move[arcs])
    part = one.graph.only(arcs)
    if not part.ends[reached(part)].any():
        return {"end": f"{end}, no path", "bound": bound}
    nodes = fewest_moves(part)
    proof = judge_instance(one, nodes)
    found = {"value": proof.values[0], "values": [*proof.values], "proven": proof.bounds[0]}
    return {**found, "bound": bound, "end": end, "nodes": [*map(int, nodes)]}


def _highs(one: Instance, folder: Path, seconds: float):
    save_instance(one, folder / "x.mps")
    end, value, bound, found = _solve_file(str(folder / "x.mps"), seconds)
    count = one.arcs if not one.asks_time else len(one.timed.move)
    known = math.isfinite(value) and len(found) > 0 and abs(value) < 1e30
    return end.removeprefix("k"), bound, found[:count] if known else None


def _cp_sat(one: Instance, folder: Path, seconds: float):
    from google.protobuf import text_format  # noqa: PLC0415  # comes with OR-tools, an extra
    from ortools.sat.python import cp_model  # noqa: PLC0415

    save_instance(one, folder / "x.pbtxt")
    model, solver = cp_model.CpModel(), cp_model.CpSolver()
    text_format.Parse((folder / "x.pbtxt").read_text("utf-8"), model.Proto())
    solver.parameters.max_time_in_seconds = seconds
    solver.parameters.num_workers = 1
    status = solver.solve(model)
    known = status in (cp_model.OPTIMAL, cp_model.FEASIBLE)
    count = one.arcs if not one.asks_time else len(one.timed.move)
    found = [*solver.response_proto.solution][:count] if known else None
    return solver.status_name(status).capitalize(), solver.best_objective_bound, found


WAYS = {"HiGHS": _highs, "CP-SAT": _cp_sat}

if __name__ == "__main__":
    name, solver, seconds = sys.argv[1:]
    print(json.dumps(run(name, solver, float(seconds))))
