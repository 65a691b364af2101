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
from typing import TypeVar

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options, told
from experiments.harness.results import drawn
from seqopt.engines.interface import Engine, Fields
from seqopt.engines.rigid._mechanism import Ungripped, ungripped_system
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.plan.solving import pose, solve
from seqopt.report._style import BLUE, INK, VERMILION, dress, new_figure, styled
from seqopt.responses._staged import Placing, StagedState, next_state, staged_fields, state_fields
from seqopt.responses.quantities import CHOSEN_BY, RESPONSES, TO_1E_3MM, lengths
from seqopt.responses.table import step_fields
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.schedule import OpenGrip, OpenStep, Schedule
from seqopt.sequence.steps import Step
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import EQUATIONS, PUBLISHED_BEST, published_plan

History = TypeVar("History")
Advance = Callable[[History, Step], tuple[History, Fields]]
"""Takes what came before and a step; returns what has come then, and the step's fields."""


def worst_ratio(network: Network, fields: Fields, limits: tuple[tuple[str, float], ...]) -> float:
    """Return the largest ratio of a response of one grip set to its limit."""
    found = {"F_largest": lengths(fields.grip_force).max(axis=1, initial=0.0)}
    names = [name for name, _ in limits if name not in found]
    found |= {name: CHOSEN_BY[name].of(network, fields) for name in names}
    return max(float(found[name][0]) / limit for name, limit in limits)


def from_scratch(engine: Engine) -> Advance[None]:
    """Return how an engine goes on: it knows nothing of the steps before."""
    return lambda _, step: (None, step_fields(engine, step))


def staged_way(network: Network, placing: Placing) -> Advance[StagedState]:
    """Return how a staged analysis goes on."""
    parts: dict[int, Ungripped] = {}

    def advance(before: StagedState, step: Step) -> tuple[StagedState, Fields]:
        if step.bricks not in parts:
            parts[step.bricks] = ungripped_system(network, step.bricks)
        after = next_state(parts[step.bricks], before, step, placing)
        return after, state_fields(parts[step.bricks], after)

    return advance


def nothing_yet(network: Network) -> StagedState:
    """Return the state before the first brick."""
    return StagedState(0, np.zeros(0), np.zeros((len(network.springs.since), 6)), np.zeros(0))


def choose(
    schedule: Schedule, advance: Advance[History], start: History, cost: Callable[[Fields], float]
) -> tuple[int, ...]:
    """Return a node for every move; of two as good the first.

    A move is judged by the worst step from the one in which it takes its grip to the one before
    the next move takes its own.
    """
    history, nodes = start, []
    for step in schedule.steps[: schedule.moves[0].step - 1 if schedule.moves else None]:
        history, _ = advance(history, _closed(step, []))
    for number in range(len(schedule.moves)):
        ways = [
            (*_until_next(schedule, [*nodes, node], advance, history, cost), node)
            for node in _free(schedule, number, nodes)
        ]
        _, history, node = min(ways, key=lambda way: way[0])
        nodes.append(node)
    return tuple(nodes)


def _until_next(
    schedule: Schedule,
    nodes: list[int],
    advance: Advance[History],
    history: History,
    cost: Callable[[Fields], float],
) -> tuple[float, History]:
    """Return the worst cost of the steps that the last of the nodes decides, and what then is."""
    worst = 0.0
    for step in _decided(schedule, len(nodes) - 1):
        history, fields = advance(history, _closed(step, nodes))
        worst = max(worst, cost(fields))
    return worst, history


def _decided(schedule: Schedule, number: int) -> Iterator[OpenStep]:
    """Yield the steps from a move to the next one."""
    ends = [move.step for move in schedule.moves[1:]] + [len(schedule.steps) + 1]
    yield from schedule.steps[schedule.moves[number].step - 1 : ends[number] - 1]


def _free(schedule: Schedule, number: int, nodes: list[int]) -> list[int]:
    """Return the candidates of a move that the move before does not hold at the same time."""
    step = schedule.steps[schedule.moves[number].step - 1]
    taken = {nodes[move] for move in step.moves if move < number}
    return [node for node in schedule.moves[number].candidates if node not in taken]


def _closed(step: OpenStep, nodes: list[int]) -> Step:
    grips = tuple(nodes[g.move] if isinstance(g, OpenGrip) else g for g in step.grips)
    return Step(step.number, step.kind, step.bricks, grips)


SHOWN = {
    "cantilever": "cantilever method, two robots",
    "three-robot, published": "published plan, three robots",
}
LABELS = {
    "F_largest_N": "largest robot\nforce [N]",
    "M_sup_Nm": "support moment\nM_sup [N m]",
    "T_max_N": "largest tension\nT_max [N]",
    "D_max_1e-3mm": "largest displacement\nD_max [1e-3 mm]",
}
STYLES = {
    "scratch": (BLUE, "-", "every step from scratch"),
    "fitted": (VERMILION, "--", "staged, bricks fitted to the deformed structure"),
    "planned": (INK, ":", "staged, bricks where they are planned (the same forces)"),
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw a row of panels per response, and a column per build."""
    figure = new_figure(7.6)
    axes = figure.subplots(len(LABELS), len(SHOWN), sharex="col", sharey="row")
    for cells, name in zip(axes.T, SHOWN, strict=True):
        mine = table[table["method"] == name]
        for cell, column in zip(cells, LABELS, strict=True):
            for analysis, (color, dash, text) in STYLES.items():
                if analysis == "planned" and column != "D_max_1e-3mm":
                    continue  # the same forces
                rows = mine[mine["analysis"] == analysis]
                cell.plot(rows["step"], rows[column], color=color, ls=dash, lw=1.2, label=text)
        cells[0].set_title(SHOWN[name])
        cells[-1].set_xlabel("step")
    for cell, label in zip(axes[:, 0], LABELS.values(), strict=True):
        cell.set_ylabel(label)
    dress(*axes.ravel())
    handles, texts = axes[-1, 0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside lower center", ncols=2)
    return figure


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
        nodes[placing.value] = choose(schedule, staged_way(network, placing), start, cost)
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
    tables = {"staged_construction": table, "staged_choice": chosen}
    return Finding(told(parts), tables=tables)


CLAIM = Claim(
    experiment,
    digits=5,
    quick="two-robot methods and the published plan alone, nothing written",
    pictures={"staged_construction.png": drawn(chart, "staged_construction")},
)

if __name__ == "__main__":
    CLAIM.main()
