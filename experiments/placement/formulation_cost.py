"""Claim: where dynamic programming is enough, solvers take tens of times as long, or hundreds.

The ratio grows with the brick count. On every size it has to be 20 at least, on `arch25` 100.

Claim: with budgets, labels prove in a tenth of the time of an integer program, or less.

At 25, 49 and 100 bricks the answer of `labels` is proven within 0.1 % by the certificate, not by
the formulation's word, in under 1 s, 3 s and 20 s on one core, the certificate's proof included, in
less than 1 GB. HiGHS takes at least ten times as long to choose, or is stopped after at least ten
times as long, and chooses no better; up to 49 bricks it always finishes. No choice undercuts a
bound of `lagrangian`.

Claim: how an integer program is written decides what its relaxation proves.

On `arch25` the flow and the assignment with tight links have relaxations whose bound is the
optimum; with loose links it lies more than a twentieth below. Of the smallest worst cost the
epigraph per layer bounds to within a thousandth, the one per arc to less than a third, big-M to
nothing. HiGHS proves every shape with a tight bound in the first node or few, and at least one of
the others not within a minute.

Method, ``costs``: the three-robot loop on chains of growing length, criterion `weighted-published`;
every formulation of the sum solves the same posed problem in one process on one core, the best of
several rounds counts, and the answers are certified. Posing the problem (all responses) is timed
beside them.

``proofs``: the reference arch and longer ones of its shape, two criteria, no budget and five sets
of them on robot travel and on the numbers of steps over a force and over a moment, as shares of
what the optimum without budgets takes. Every formulation that takes the problem solves it, each in
a process of its own on one core; its peak memory is that of the process. Seconds are of the
processor; the limit, 60 s, is of the clock. At 100 bricks the linear and the integer program meet
one criterion and four of the sets: they take a minute each.

``shapes``: six programs of two problems, the loop on `arch25` under ``equations-2-3`` (sum) and
``worst-ratio-published`` (worst), all exact. Size is counted before presolve; the bound is that of
the linear relaxation, solved on its own; then the integer program is solved on one core up to a
time limit, and what it had found and proven at which time is stored.

Inputs: chains on a half circle, and `arch25`. Command: ``python -m
experiments.placement.formulation_cost [--quick] [--only PART]``.
"""

import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import partial

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.results import apart, drawn, stored
from experiments.harness.scenes import arch25, half_circle
from experiments.harness.timing import best
from experiments.placement.parts.budget_cases import CASES, COMPARED, NO_BUDGET
from experiments.placement.parts.formulation_charts import contest_chart, shape_chart
from experiments.placement.parts.program_size import anatomy
from formulations.exhibits import _big_m, _epigraph, _loose, _tight
from formulations.flow import _whole
from formulations.solvers import minimize_by_highs
from seqopt import Network, solve, three_robot_loop
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.graph.formulation import Watch, find_formulation, formulations, trace_rows
from seqopt.graph.layers.compiled import best_in_order, compile_layers
from seqopt.graph.layers.layers import Layers, candidate_layers
from seqopt.problem.problem import Aim
from seqopt.problem.requirements import Criterion
from seqopt.study.published import EQUATIONS, WEIGHTED, WORST_RATIO

GENERAL = ("overlap_lp", "overlap_mip")
ANYWHERE, ON_THE_ARCH = 20.0, 100.0  # ratios that are claimed


def problem_of(net: Network, criterion: Criterion) -> Layers:
    """Return the problem with its costs computed, its operators built anew."""
    problem = candidate_layers(ComplianceEngine(net), three_robot_loop(net), criterion)
    for aim in Aim:
        aim.costs(problem)
    return problem


def compared(net: Network, criterion: Criterion, rounds: int) -> dict[str, float]:
    """Return seconds to pose the problem and to solve it by every formulation of the sum."""
    pose, problem = best(partial(problem_of, net, criterion), rounds), problem_of(net, criterion)
    row = {"bricks": float(len(net.scene.bricks)), "pose": pose}
    row["models"] = float(problem.evaluation.models)
    for name, formulation in formulations("costs").items():
        if formulation.aim is Aim.SUM:
            graph = compile_layers(problem, Aim.SUM, alone=formulation.alone).instance
            row[name] = best(partial(formulation.solve, graph), rounds)
            row[f"gap_{name}"] = solve(problem, formulation).certificate.gap
    return row


def costs(options: Options) -> Finding:
    rounds = 1 if options.quick else 3
    counts = [6, 9] if options.quick else [6, 9, 13, 18, 25, 36, 50]
    table = pd.DataFrame([compared(half_circle(n), WEIGHTED, rounds) for n in counts])
    print(table.to_string(index=False, float_format="%.3g"))
    reference = compared(arch25().network, EQUATIONS, rounds)
    whole = reference["pose"] + reference["overlap_dp"]
    print(f"arch25, equations 2 and 3: posed and solved exactly in {whole:.3f} s")
    for name, value in over_dp(table).items():
        own = reference[str(name)] / reference["overlap_dp"]
        chains = f"{value.min():.0f} to {value.max():.0f}"
        print(f"{name} over overlap_dp on arch25: {own:.0f}; on chains {chains}")
    frame = pd.concat([table, pd.DataFrame([reference])], ignore_index=True)
    return on_this_run(holds=costs_hold(table, reference), formulation_cost=frame)


def over_dp(table: pd.DataFrame) -> pd.DataFrame:
    """Return the times of the general solvers over that of dynamic programming."""
    return table[list(GENERAL)].div(table["overlap_dp"], axis=0)


def costs_hold(table: pd.DataFrame, reference: Mapping[str, float]) -> bool:
    arch = over_dp(pd.DataFrame([reference])).to_numpy().min()
    exact = max(table["gap_overlap_dp"].max(), table["gap_overlap_mip"].max())
    posed = reference["pose"] + reference["overlap_dp"] <= 0.5
    slower = over_dp(table).to_numpy().min() >= ANYWHERE and arch >= ON_THE_ARCH
    return bool(slower and exact <= 1e-6 and posed)


PROVEN_IN = {25: 1.0, 49: 3.0, 100: 20.0}
GAP, TIMES, MEMORY = 1e-3, 10.0, 1024.0
SAME = 1e-6  # of objectives
RARE, FEW = 100, (NO_BUDGET, "travel 0.8", "travel 0.5", "travel and force 0.8")
KEY = ["bricks", "criterion", "case"]
COLUMNS = [
    *(*KEY, "budgets", "formulation", "end", "objective", "bound", "proven_gap"),
    *("solve", "verify", "memory_MB", "said"),
]
Spec = tuple[int, str, str, str]


def specs() -> Iterator[Spec]:
    """Yield brick count, criterion, case and formulation of every run."""
    for bricks in PROVEN_IN:
        for criterion in COMPARED:
            for case in CASES:
                rare = bricks >= RARE and (criterion != COMPARED[0] or case not in FEW)
                for name, formulation in formulations("costs").items():
                    able = formulation.takes_budgets or case == NO_BUDGET
                    if able and not (rare and name in GENERAL):
                        yield bricks, criterion, case, name


def raced(spec: Spec, limit: float) -> dict[str, object]:
    """Return the row of a process of its own; one that died has run out of memory."""
    base: dict[str, object] = dict(zip((*KEY, "formulation"), spec, strict=True))
    try:
        return base | apart("experiments.placement.parts.budget_cases", *spec, limit)
    except subprocess.CalledProcessError as error:
        last = (error.stderr.splitlines() or [f"exit status {error.returncode}"])[-1]
        return base | {"end": "died", "said": last}


def budgeted(table: pd.DataFrame, name: str) -> pd.DataFrame:
    return table[(table["formulation"] == name) & (table["budgets"] > 0)].set_index(KEY)


def over_labels(table: pd.DataFrame) -> pd.Series:
    """Return the time of HiGHS, until it finished or was stopped, over that of labels."""
    return (budgeted(table, "overlap_mip")["solve"] / budgeted(table, "labels")["solve"]).dropna()


def proofs_hold(table: pd.DataFrame) -> bool:
    own, other, priced = (budgeted(table, n) for n in ("labels", "overlap_mip", "lagrangian"))
    whole, counts = own["solve"] + own["verify"], own.index.get_level_values("bricks")
    best = own["objective"]
    better = other["objective"] < best.reindex(other.index) * (1 - SAME)
    unfinished = other[other["end"] != "done"].index.get_level_values("bricks")
    return bool(
        (own["proven_gap"] <= GAP).all()
        and (whole <= counts.map(PROVEN_IN)).all()
        and (own["memory_MB"] <= MEMORY).all()
        and (over_labels(table) >= TIMES).all()
        and set(unfinished) <= {RARE}
        and not better.any()
        and (priced["bound"] <= best.reindex(priced.index) * (1 + SAME)).all()
    )


def proof_summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per brick count and formulation: problems with budgets."""
    capped = table[table["budgets"] > 0].assign(done=table["end"] == "done")
    by = capped.groupby(["bricks", "formulation"])
    most = by[["proven_gap", "solve", "verify", "memory_MB"]].max()
    counts = pd.DataFrame({"problems": by.size(), "done": by["done"].sum()})
    return counts.assign(solve_median=by["solve"].median()).join(most)


def proofs(options: Options) -> Finding:
    wanted = list(specs())
    if options.quick:
        wanted = [(13, COMPARED[0], "travel 0.8", name) for name in ("labels", "overlap_mip")]
    rows = []
    for spec in wanted:
        rows.append(raced(spec, LIMIT))
        print(*spec, *(f"{rows[-1].get(name)}" for name in ("end", "solve")), flush=True)
    table = pd.DataFrame(rows).reindex(columns=COLUMNS)
    print(proof_summary(table).to_string(float_format="%.4g"))
    if options.quick:  # on thirteen bricks nothing takes time: the stored rows are judged
        return Finding(proofs_hold(stored("budget_proofs")), ": stored rows")
    times = over_labels(table).groupby(level="bricks")
    print(f"HiGHS over labels:\n{times.agg(['size', 'min', 'median', 'max']).round(1)}")
    return on_this_run(holds=proofs_hold(table), budget_proofs=table)


SHAPES = {
    Aim.SUM: {"overlap_mip": _whole, "assignment_tight": _tight, "assignment_loose": _loose},
    Aim.PEAK: {
        "minimax_layer": partial(_epigraph, of_layers=True),
        "minimax_arc": partial(_epigraph, of_layers=False),
        "minimax_big_m": _big_m,
    },
}
TIGHT = ("overlap_mip", "assignment_tight", "minimax_layer")
LIMIT = 60.0  # s
CLOSE, FAR, THIRD, FEW_NODES = 1e-3, 0.05, 1 / 3, 10


def written(
    problem: Layers, aim: Aim, name: str, limit: float
) -> tuple[dict[str, object], pd.DataFrame]:
    """Return size, bound, nodes and time of a program, and what was found at which time."""
    costs = aim.costs(problem)
    optimum = aim.value_of(costs, best_in_order([(costs, aim)]))
    graph = compile_layers(problem, aim, alone=find_formulation(name).alone).instance.asked
    written = SHAPES[aim][name](graph)
    size, relaxed = anatomy(written.program)
    watch, start = Watch(limit), time.perf_counter()
    found = minimize_by_highs(written.program, feasible=True, watch=watch, told=written.bound)
    seconds = time.perf_counter() - start
    row = {"formulation": name, "aim": aim.value, **asdict(size)}
    row |= {"optimum": optimum, "relaxed": written.bound(relaxed)}
    row |= {"value": written.bound(found.value), "bound": written.bound(found.bound)}
    row |= {"nodes": found.nodes, "proven": not found.stopped, "seconds": seconds, "limit": limit}
    return row, pd.DataFrame(trace_rows(watch.trace)).assign(formulation=name)


def programs(network: Network, limit: float) -> Iterator[tuple[dict[str, object], pd.DataFrame]]:
    engine, schedule = ComplianceEngine(network), three_robot_loop(network)
    for aim, criterion in ((Aim.SUM, EQUATIONS), (Aim.PEAK, WORST_RATIO)):
        problem = candidate_layers(engine, schedule, criterion)
        for name in SHAPES[aim]:
            yield written(problem, aim, name, limit)


def shapes_hold(table: pd.DataFrame) -> bool:
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
        and (by.loc[list(TIGHT), "nodes"] <= FEW_NODES).all()
        and not loose["proven"].all()
        and np.allclose(values["value"], values["optimum"], rtol=1e-5)
    )


def shapes(options: Options) -> Finding:
    network = half_circle(6) if options.quick else arch25().network
    found = list(programs(network, 5.0 if options.quick else LIMIT))
    table = pd.DataFrame([row for row, _ in found])
    print(table.to_string(index=False, float_format="%.4g"))
    if options.quick:  # on six bricks everything is proven at once: the stored rows are judged
        return Finding(shapes_hold(stored("program_shapes")), ": stored rows")
    traces = pd.concat([trace for _, trace in found], ignore_index=True)
    return on_this_run(holds=shapes_hold(table), program_shapes=table, program_traces=traces)


CLAIM = Claim(
    {"costs": costs, "proofs": proofs, "shapes": shapes},
    quick="small chains, stored rows judged where these say nothing, nothing written",
    times=Times.JUDGED,
    digits={"formulation_cost": 4, "budget_proofs": 10, "program_shapes": 6, "program_traces": 6},
    pictures={
        "contest.png": drawn(contest_chart, "budget_proofs"),
        "program_shapes.png": drawn(shape_chart, "program_shapes", "program_traces"),
    },
)

if __name__ == "__main__":
    CLAIM.main()
