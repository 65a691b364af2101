"""Claim: where its condition is met, a simpler model gives the answer of the next one in less time.

That is, to 1e-8 between rigid and discrete bricks and to 1e-5 from rigid bricks to the stiff-bar
frame; and where its condition is not met a level is wrong by more than a tenth. For less: in the
median of rounds it takes less time; for `auto`, which where joints give way takes the discrete
elements themselves, no more than a tenth above theirs. The lowest ratio of a round is stored beside
the median.

Method: a level and the next answer the same grip sets. Rigid bricks: every step of the sequential
method against the frame, and against discrete elements with the paper's epoxy (met: all joints stay
within their limits) and without bonds (not met; some steps in which the bricks come to rest). The
error is the largest difference of the inner nodes' displacements over the largest displacement, in
the worst set. Times are medians of rounds in one process on one core, ratios those within rounds.

Inputs: the shipped scene; seed 0. Command: ``OPENBLAS_NUM_THREADS=1 python -m
experiments fidelity_ladder [--quick]``.
"""

import time
from collections.abc import Iterator
from statistics import median
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.charts import note, subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import best, drawn, two
from experiments.harness.scenes import arch25
from seqopt import DRY, Scene, build_network, sequential
from seqopt.arrays import Floats, Ints
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine, Want
from seqopt.engines.registry import AutoEngine
from seqopt.report._style import BLUE, GRAY, VERMILION, dress, plain, styled

EXACT, FRAME, WRONG = 1e-8, 1e-5, 0.1
SAME = 0.9  # ratio of times that are alike
MET, NOT_MET = "met", "not met"
RESTING = (3, 7, 13, 24, 40)  # steps of the sequential method that rest unbonded
LOOKS = {"rigid": (BLUE, "o"), "auto": (VERMILION, "D")}


Question = tuple[int, Ints]
"""Brick count and grip sets (S, r) of one partial structure."""


class Pair(NamedTuple):
    """A level and what it is held against, and what both are asked."""

    level: str
    against: str
    case: str
    condition: str
    first: Engine
    second: Engine
    questions: list[Question]


def steps_of(scene: Scene, numbers: tuple[int, ...] | None = None) -> list[Question]:
    """Return the steps of the sequential method, or some of them."""
    steps = sequential(build_network(scene))
    chosen = [step for step in steps if numbers is None or step.number in numbers]
    return [(s.bricks, np.array([s.held], dtype=np.int64).reshape(1, -1)) for s in chosen]


def pairs(*, quick: bool) -> Iterator[Pair]:
    rigid = arch25()
    net, scene = rigid.network, rigid.network.scene
    all_steps = steps_of(scene)[: 12 if quick else None]
    yield Pair("rigid", "frame", "arch25", MET, rigid, FrameEngine(net), all_steps)
    bonded, dry = DiscreteEngine(net), DiscreteEngine(net, DRY)
    yield Pair("rigid", "discrete", "arch25, epoxy", MET, rigid, bonded, all_steps)
    yield Pair("auto", "discrete", "arch25, epoxy", MET, AutoEngine(net), bonded, all_steps)
    resting = steps_of(scene, RESTING[: 2 if quick else None])
    yield Pair("rigid", "discrete", "arch25, no bonds", NOT_MET, rigid, dry, resting)
    yield Pair("auto", "discrete", "arch25, no bonds", MET, AutoEngine(net, DRY), dry, resting)


def answer(engine: Engine, questions: list[Question]) -> list[Floats]:
    """Return the displacements (S, N, 3) of the inner nodes, per question."""
    out = []
    for bricks, grips in questions:
        moved = engine.solve(bricks, grips, Want.DISPLACEMENTS).displacement
        out.append(moved[:, engine.network.inner[:bricks].ravel()])
    return out


def _largest(values: Floats) -> Floats:
    return np.abs(values).max(axis=(1, 2))


def compare(pair: Pair, rounds: int) -> dict[str, object]:
    answers = (answer(engine, pair.questions) for engine in (pair.first, pair.second))
    errors = np.concatenate(
        [_largest(own - true) / _largest(true) for own, true in zip(*answers, strict=True)]
    )
    sets = sum(len(grips) for _, grips in pair.questions)
    times = []
    for _ in range(rounds):
        first = best(lambda: answer(pair.first, pair.questions), 3)
        start = time.perf_counter()
        answer(pair.second, pair.questions)
        times.append((first / sets, (time.perf_counter() - start) / sets))
    row = {"level": pair.level, "against": pair.against, "case": pair.case}
    row |= {"condition": pair.condition, "sets": sets, "error": errors.max()}
    row |= {"error_median": np.median(errors), "set_us": 1e6 * median(a for a, _ in times)}
    row |= {"against_us": 1e6 * median(b for _, b in times)}
    row |= {"ratio": median(b / a for a, b in times)}
    return row | {"ratio_lowest": min(b / a for a, b in times)}


def judge(table: pd.DataFrame) -> bool:
    met = table[table["condition"] == MET]
    limit = np.where(met["against"] == "frame", FRAME, EXACT)
    other = table[table["condition"] == NOT_MET]
    return bool((met["error"] <= limit).all() and (other["error"] > WRONG).all())


def cheaper(table: pd.DataFrame) -> bool:
    met = table[table["condition"] == MET]
    return bool((met["ratio"] > np.where(met["level"] == "auto", SAME, 1.0)).all())


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure, (left, right) = subplots(4.0, 1, 2, sharey=True, width_ratios=(1, 1.3))
    at = -np.arange(len(table))
    for y, (_, row) in zip(at, table.iterrows(), strict=True):
        color, marker = LOOKS[str(row["level"])]
        look = {"color": color, "ms": 7, "mfc": color if row["condition"] == MET else "white"}
        left.plot(max(float(row["error"]), 1e-16), y, marker, **look)
        times = [row["set_us"], row["against_us"]]
        right.plot(times, [y, y], color="#cccccc", lw=1, zorder=1)
        right.plot(times[1], y, "X", ms=6, color=GRAY)
        right.plot(times[0], y, marker, **look)
        note(right, f"{two(float(row['ratio']))} times", (max(times), y), (7, 0), va="center")
    left.set_yticks(at, table["level"] + " for " + table["against"] + ": " + table["case"])
    left.set(xscale="log", xlabel="error against the other model", xlim=(1e-17, 30))
    left.set_xticks([1e-16, 1e-12, 1e-8, 1e-4, 1], ["none", "1e-12", "1e-8", "1e-4", "1"])
    right.set(xscale="log", xlabel="time per set of grips [µs]", xlim=(0.7, 2e7))
    plain(right.xaxis)
    for axes in (left, right):
        dress(axes)
        axes.minorticks_off()
        axes.grid(visible=False, axis="y")
    names = {f"{name} bricks": look for name, look in LOOKS.items() if name != "auto"}
    names |= {"automatic choice": LOOKS["auto"], "its condition is not met": (GRAY, "o")}
    names |= {"the model that it stands for": (GRAY, "X")}
    for text, (color, marker) in names.items():
        face = "white" if "not met" in text else color
        left.plot([], [], marker, color=color, mfc=face, ms=6 if marker == "X" else 7, label=text)
    keys = left.get_legend_handles_labels()
    figure.legend(*keys, loc="outside lower center", ncols=5, columnspacing=1.2)
    return figure


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    table = pd.DataFrame(compare(pair, 1 if quick else 3) for pair in pairs(quick=quick))
    print(table.to_string(index=False, float_format="%.3g"))
    return Finding(judge(table) and (quick or cheaper(table)), tables={"fidelity_ladder": table})


CLAIM = Claim(
    experiment,
    digits=3,
    quick="few cases",
    pictures={"fidelity_ladder.png": drawn(chart, "fidelity_ladder")},
)
