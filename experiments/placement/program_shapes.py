"""Claim: how an integer program is written decides what its relaxation proves.

On `arch25` the flow and the assignment with tight links have relaxations whose bound is the
optimum; with loose links it lies more than a twentieth below. Of the smallest worst cost the
epigraph per layer bounds to within a thousandth, the one per arc to less than a third, big-M to
nothing. HiGHS proves every shape with a tight bound in the first node or few, and at least one of
the others not within a minute.

Method: six programs of two problems, all exact, each written down for HiGHS as its module displays
it. Size is counted as it is handed over, before presolve; the bound is that of the linear
relaxation, solved on its own; then the integer program is solved on one core up to a time limit,
and what it had found and proven at which time is stored.

Inputs: the three-robot loop on `arch25`, criteria ``equations-2-3`` (sum) and
``worst-ratio-published`` (worst). Command: ``python -m experiments.placement.program_shapes
[--quick]``. Writes ``experiments/results/program_shapes.csv``, ``program_traces.csv`` and
``docs/figures/program_shapes.png``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from importlib import import_module

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.arches import half_circle
from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.placement.parts.shape_chart import chart
from formulations.solvers import anatomy, minimize_whole
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.certificate import least
from seqopt.placement.formulation import find_formulation
from seqopt.placement.interface import Aim
from seqopt.placement.problem import Problem, pose
from seqopt.placement.watch import Watch, trace_rows
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import EQUATIONS, WORST_RATIO

SHAPES = {
    Aim.SUM: ("overlap_mip", "assignment_tight", "assignment_loose"),
    Aim.PEAK: ("minimax_layer", "minimax_arc", "minimax_big_m"),
}
TIGHT = ("overlap_mip", "assignment_tight", "minimax_layer")
LIMIT = 60.0  # s
CLOSE, FAR, THIRD, FEW = 1e-3, 0.05, 1 / 3, 10


def measure(problem: Problem, name: str, limit: float) -> tuple[dict[str, object], pd.DataFrame]:
    """Return size, bound, nodes and time of a program, and what was found at which time."""
    formulation = find_formulation(name)
    costs = formulation.aim.costs(problem)
    written = import_module(f"formulations.{name}").write(problem)
    size, relaxed = anatomy(written.program)
    watch, start = Watch(limit), time.perf_counter()
    found = minimize_whole(written.program, feasible=True, watch=watch, told=written.bound)
    seconds = time.perf_counter() - start
    row = {
        "formulation": name,
        "aim": formulation.aim.value,
        **asdict(size),
        "optimum": least(costs, formulation.aim),
        "relaxed": written.bound(relaxed),
        "value": written.bound(found.value),
        "bound": written.bound(found.bound),
        "nodes": found.nodes,
        "proven": not found.stopped,
        "seconds": seconds,
        "limit": limit,
    }
    return row, pd.DataFrame(trace_rows(watch.trace)).assign(formulation=name)


def rows(network: Network, limit: float) -> Iterator[tuple[dict[str, object], pd.DataFrame]]:
    """Yield what is measured of every program."""
    engine, schedule = ComplianceEngine(network), three_robot_loop(network)
    for aim, criterion in ((Aim.SUM, EQUATIONS), (Aim.PEAK, WORST_RATIO)):
        problem = pose(engine, schedule, criterion)
        for name in SHAPES[aim]:
            yield measure(problem, name, limit)


def holds(table: pd.DataFrame) -> bool:
    """Return whether the claim holds on rows of `measure`."""
    by = table.set_index("formulation")
    share = by["relaxed"] / by["optimum"]
    loose = by.drop(index=list(TIGHT))
    values = by.loc[by["proven"], ["value", "optimum"]]
    return bool(
        (share[list(TIGHT)] >= 1 - CLOSE).all()
        and share["assignment_loose"] <= 1 - FAR
        and share["minimax_arc"] <= THIRD
        and share["minimax_big_m"] <= CLOSE
        and by.loc[list(TIGHT), "proven"].all()
        and (by.loc[list(TIGHT), "nodes"] <= FEW).all()
        and not loose["proven"].all()
        and np.allclose(values["value"], values["optimum"], rtol=1e-5)
    )


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    network = half_circle(6) if quick else build_network(load_scene("arch25"))
    found = list(rows(network, 5.0 if quick else LIMIT))
    table = pd.DataFrame([row for row, _ in found])
    print(table.to_string(index=False, float_format="%.4g"))
    if quick:  # on six bricks everything is proven at once: the stored rows are judged
        return Finding(holds(pd.read_csv(RESULTS / "program_shapes.csv")), ": stored rows")
    traces = pd.concat([trace for _, trace in found], ignore_index=True)
    table.to_csv(RESULTS / "program_shapes.csv", index=False, float_format="%.6g")
    traces.to_csv(RESULTS / "program_traces.csv", index=False, float_format="%.6g")
    save_all(PICTURES)
    return on_this_run(holds=holds(table))


PICTURES: dict[str, Callable[[], Figure]] = {
    "program_shapes.png": lambda: chart(stored("program_shapes"), stored("program_traces")),
}
CLAIM = Claim(
    experiment,
    quick="six bricks, the stored rows judged, nothing written",
    times=Times.SHOWN,
    pictures=PICTURES,
)

if __name__ == "__main__":
    CLAIM.main()
