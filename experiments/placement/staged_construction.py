"""Claim: locked-in effects change three of the published plan's four maxima, and most grips.

Method: staged construction analysis of every method on `arch25`, beside the analysis of every step
from scratch that the paper makes. Staged, a brick comes without stress onto the deformed structure
(or to where it is planned, which changes displacements alone), and a grip closes without force
where it finds its node. Compared are the largest responses over the build, the share of steps at
which a response differs by more than a tenth of its largest value, and the grips of the
three-robot loop: chosen move by move, each for the least worst ratio to the best published maxima
over the steps that it decides, once by responses from scratch and once by staged ones. Only what
responses are computed from differs between the two choices.

The claim holds if for the published plan at least three of the four largest responses change by
more than 10 % either way; if the largest tension falls with every method, and no method's largest
robot force changes by as much as half; if more than half of the loop's grips are chosen otherwise,
and the staged choice is better by staged responses; and if every step is in equilibrium to 1e-6 N.
The bounds were set after a first look at the methods.

Both are models. Mortar that creeps or shrinks, and robots that give way, lie between them; and
joints that would part under what is locked in are taken as bonded here.

Inputs: the shipped scene and plan. Command: ``python -m experiments.placement.staged_construction
[--quick]``. Writes ``experiments/results/staged_construction.csv``,
``staged_choice.csv`` and ``docs/figures/staged_construction.png``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.placement.parts.staged_chart import chart
from experiments.placement.parts.step_by_step import (
    choose,
    from_scratch,
    nothing_yet,
    staged,
    worst_ratio,
)
from seqopt.engines.interface import Fields
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.placement.problem import pose
from seqopt.placement.solving import solve
from seqopt.responses.quantities import RESPONSES, TO_1E_3MM, lengths
from seqopt.responses.staged import Placing, staged_fields
from seqopt.responses.table import step_fields
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.study.presets import EQUATIONS, PUBLISHED_BEST
from seqopt.study.published import published_plan

PUBLISHED = "three-robot, published"
SCRATCH = "scratch"
COMPARED = ("F_largest_N", "M_sup_Nm", "T_max_N", "D_max_1e-3mm")
TENTH = 0.1


def builds(engine: ComplianceEngine) -> dict[str, tuple[Step, ...]]:
    """Return the steps of every method that is compared."""
    network = engine.network
    out = {name: tuple(method(network)) for name, method in METHODS.items()}
    out[PUBLISHED] = published_plan(network.scene)
    loop = pose(engine, three_robot_loop(network), EQUATIONS)
    out["three-robot, optimized"] = solve(loop, "overlap_dp").steps
    out["three-robot, minimax"] = solve(loop, "minimax").steps
    return out


def analyses(
    engine: ComplianceEngine, steps: tuple[Step, ...]
) -> Iterator[tuple[str, Iterator[Fields]]]:
    """Yield the fields of all steps by analysis."""
    yield SCRATCH, (step_fields(engine, step) for step in steps)
    for placing in Placing:
        yield placing.value, staged_fields(engine.network, steps, placing)


def row(network: Network, step: Step, fields: Fields) -> dict[str, float]:
    """Return the compared responses of a step, and what its equilibrium lacks, N."""
    total = network.weight[: step.bricks].sum(axis=0) + fields.grip_force[0].sum(axis=0)
    total = total + fields.support[0, :, :3].sum(axis=0)
    return {
        "step": step.number,
        "bricks": step.bricks,
        "F_largest_N": float(lengths(fields.grip_force[0]).max(initial=0.0)),
        "M_sup_Nm": float(RESPONSES["M_sup"].of(network, fields)[0]),
        "T_max_N": float(RESPONSES["T_max"].of(network, fields)[0]),
        "D_max_1e-3mm": TO_1E_3MM * float(RESPONSES["D_max"].of(network, fields)[0]),
        "imbalance_N": float(np.abs(total).max()),
    }


def tabulate(engine: ComplianceEngine, made: dict[str, tuple[Step, ...]]) -> pd.DataFrame:
    """Return a row per method, analysis and step."""
    rows = [
        {"method": name, "analysis": analysis, **row(engine.network, step, fields)}
        for name, steps in made.items()
        for analysis, answers in analyses(engine, steps)
        for step, fields in zip(steps, answers, strict=True)
    ]
    return pd.DataFrame(rows)


def choices(engine: ComplianceEngine) -> pd.DataFrame:
    """Return a row per move of the loop, with the node that each way of analysis chooses."""
    network, schedule = engine.network, three_robot_loop(engine.network)

    def cost(fields: Fields) -> float:
        return worst_ratio(network, fields, PUBLISHED_BEST)

    nodes = {SCRATCH: choose(schedule, from_scratch(engine), None, cost)}
    start = nothing_yet(network)
    for placing in Placing:
        nodes[placing.value] = choose(schedule, staged(network, placing), start, cost)
    out = pd.DataFrame({"move": range(1, len(schedule.moves) + 1)})
    for way, chosen in nodes.items():
        steps = schedule.fill(chosen)
        out[way] = chosen
        for placing in Placing:
            worst = max(map(cost, staged_fields(network, steps, placing)))
            out[f"{way}_worst_{placing.value}"] = worst
    return out


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the largest responses by method and analysis, and shares of steps that differ."""
    largest = table.groupby(["method", "analysis"], sort=False)[[*COMPARED]].max()
    base = table[table["analysis"] == SCRATCH].set_index(["method", "step"])
    shares = {}
    for placing in Placing:
        other = table[table["analysis"] == placing.value].set_index(["method", "step"])
        for name, steps in base.groupby(level="method", sort=False):
            most = steps[[*COMPARED]].max()
            gap = (other.loc[[name], [*COMPARED]] - steps[[*COMPARED]]).abs()
            shares[name, placing.value] = (gap > TENTH * most).mean()
    differs = pd.DataFrame(shares).T.rename_axis(largest.index.names).add_suffix(" differs")
    return largest.join(differs)


def holds(table: pd.DataFrame, chosen: pd.DataFrame) -> dict[str, bool]:
    """Return the parts of the claim and whether the tables bear them out."""
    largest = summary(table)[[*COMPARED]]
    ratio = largest.xs(Placing.FITTED.value, level=1) / largest.xs(SCRATCH, level=1)
    changed = (chosen[Placing.FITTED.value] != chosen[SCRATCH]).mean()
    fitted = f"worst_{Placing.FITTED.value}"
    return {
        "of the published plan three of four largest responses change by more than 10 %": bool(
            ((ratio.loc[PUBLISHED] - 1).abs() > TENTH).sum() >= 3
        ),
        "no method's largest robot force changes by as much as half": bool(
            ((ratio["F_largest_N"] - 1).abs() < 0.5).all()
        ),
        "the largest tension falls with every method": bool((ratio["T_max_N"] < 1).all()),
        "more than half of the loop's grips are chosen otherwise": bool(changed > 0.5),
        "the staged choice is the better one by staged responses": bool(
            (chosen[f"{Placing.FITTED.value}_{fitted}"] < chosen[f"{SCRATCH}_{fitted}"]).all()
        ),
        "every step is in equilibrium": bool((table["imbalance_N"] < 1e-6).all()),
    }


def experiment(options: Options) -> Finding:
    engine = ComplianceEngine(build_network(load_scene("arch25")))
    made = builds(engine)
    if options.quick:
        made = {name: made[name] for name in (*METHODS, PUBLISHED)}
    table, chosen = tabulate(engine, made), choices(engine)
    print(summary(table).to_string(float_format="%.4g"))
    print(chosen.to_string(index=False, float_format="%.4g"))
    parts = holds(table, chosen)
    for text, true in parts.items():
        print(f"{'yes' if true else 'NO'}: {text}")
    if not options.quick:
        RESULTS.mkdir(exist_ok=True)
        table.to_csv(RESULTS / "staged_construction.csv", index=False, float_format="%.5g")
        chosen.to_csv(RESULTS / "staged_choice.csv", index=False, float_format="%.5g")
        save_all(PICTURES)
    return Finding(all(parts.values()))


PICTURES: dict[str, Callable[[], Figure]] = {
    "staged_construction.png": lambda: chart(stored("staged_construction")),
}
CLAIM = Claim(
    experiment,
    quick="two-robot methods and the published plan alone, nothing written",
    pictures=PICTURES,
)

if __name__ == "__main__":
    CLAIM.main()
