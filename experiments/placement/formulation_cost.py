"""Claim: where dynamic programming is enough, solvers take tens of times as long, or hundreds.

The ratio grows with the brick count. On every size it has to be 20 at least, on `arch25` 100.

Method: the three-robot loop on chains of growing length, criterion `weighted-published`; every
formulation of the sum solves the same posed problem in one process on one core, the best of several
rounds counts, and the answers are certified. Posing the problem (all responses) is timed beside
them.

Inputs: chains on a half circle, and `arch25`. Command: ``python -m
experiments.placement.formulation_cost [--quick]``. Writes
``experiments/results/formulation_cost.csv`` and ``docs/figures/formulation_cost.png``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.arches import half_circle
from experiments.harness.claim import Claim, Finding, Options, Times, on_this_run
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.harness.timing import best
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.formulation import formulations
from seqopt.placement.interface import Aim
from seqopt.placement.problem import Problem, pose
from seqopt.placement.requirements import Criterion
from seqopt.placement.solving import solve
from seqopt.report.style import GRAY, dress, looks, new_figure, plain, styled
from seqopt.report.wording import in_words
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import EQUATIONS, WEIGHTED

GENERAL = ("overlap_lp", "overlap_mip")
DRAWN = ("overlap_dp", "cascade", "beam", "overlap_lp", "overlap_mip")
ANYWHERE, ON_THE_ARCH = 20.0, 100.0  # ratios that are claimed


def problem_of(net: Network, criterion: Criterion) -> Problem:
    """Return the problem with its costs computed, its operators built anew."""
    problem = pose(ComplianceEngine(net), three_robot_loop(net), criterion)
    for aim in Aim:
        aim.costs(problem)
    return problem


def measure(net: Network, criterion: Criterion, rounds: int) -> dict[str, float]:
    """Return seconds to pose the problem and to solve it by every formulation of the sum."""
    row = {
        "bricks": float(len(net.scene.bricks)),
        "pose": best(partial(problem_of, net, criterion), rounds),
    }
    problem = problem_of(net, criterion)
    row["models"] = float(problem.evaluation.models)
    for name, formulation in formulations().items():
        if formulation.aim is not Aim.SUM:
            continue
        row[name] = best(partial(formulation.solve, problem), rounds)
        row[f"gap_{name}"] = solve(problem, formulation).certificate.gap
    return row


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure = new_figure(3.6)
    axes = figure.subplots()
    axes.plot(table["bricks"], table["pose"], "-", color=GRAY, lw=2.5, label="posing the problem")
    for name, style in looks(DRAWN).items():
        axes.plot(table["bricks"], table[name], label=in_words(name), **style.line())
    axes.set(xscale="log", yscale="log", xlabel="bricks", ylabel="time [s]")
    bricks = table["bricks"].astype(int)
    axes.set_xticks(bricks, map(str, bricks))
    axes.minorticks_off()
    plain(axes.yaxis)
    dress(axes)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center")
    return figure


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    rounds = 1 if quick else 3
    counts = [6, 9] if quick else [6, 9, 13, 18, 25, 36, 50]
    table = pd.DataFrame([measure(half_circle(n), WEIGHTED, rounds) for n in counts])
    print(table.to_string(index=False, float_format="%.3g"))
    reference = measure(build_network(load_scene("arch25")), EQUATIONS, rounds)
    whole = reference["pose"] + reference["overlap_dp"]
    print(f"arch25, equations 2 and 3: posed and solved exactly in {whole:.3f} s")
    for name, value in ratios(table).items():
        own = reference[str(name)] / reference["overlap_dp"]
        print(
            f"{name} over overlap_dp on arch25: {own:.0f}; on chains {value.min():.0f} to "
            f"{value.max():.0f}"
        )
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        frame = pd.concat([table, pd.DataFrame([reference])], ignore_index=True)
        frame.to_csv(RESULTS / "formulation_cost.csv", index=False, float_format="%.4g")
        save_all(PICTURES)
    return on_this_run(holds=holds(table, reference))


def ratios(table: pd.DataFrame) -> pd.DataFrame:
    """Return the times of the general solvers over that of dynamic programming."""
    return table[list(GENERAL)].div(table["overlap_dp"], axis=0)


def holds(table: pd.DataFrame, reference: Mapping[str, float]) -> bool:
    """Return whether solvers are slower on every size and on the arch, and the answers exact."""
    arch = ratios(pd.DataFrame([reference])).to_numpy().min()
    exact = max(table["gap_overlap_dp"].max(), table["gap_overlap_mip"].max())
    posed = reference["pose"] + reference["overlap_dp"] <= 0.5
    slower = ratios(table).to_numpy().min() >= ANYWHERE and arch >= ON_THE_ARCH
    return bool(slower and exact <= 1e-6 and posed)


PICTURES: dict[str, Callable[[], Figure]] = {
    "formulation_cost.png": lambda: chart(stored("formulation_cost").iloc[:-1]),
}
CLAIM = Claim(
    experiment, quick="small chains, nothing written", times=Times.JUDGED, pictures=PICTURES
)

if __name__ == "__main__":
    CLAIM.main()
