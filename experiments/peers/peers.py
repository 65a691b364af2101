"""Claim: on the full overlap of `arch25` the fast engine is tens of times as fast as other tools.

That is: in every round at least 60 times as fast as the best frame package at its leanest and 20
times as the best loop that one would write with SciPy, what is prepared once aside, whether what
the criterion needs is asked, or every edge force and node displacement.

Method: the distinct models of the three-robot loop under equations 2 and 3, which the paper counts
as 22,724. Engine and peers take turns in one process on one core. The engine answers all models; a
peer a few random ones of every brick count and number of grips, drawn anew in every round, and its
time is extended to all. Models kept by a peer and operators of the engine are timed and counted.
Medians of rounds.

Inputs: the shipped scene; seed 0; openseespy: nothing is stored if it is missing. Command:
``OPENBLAS_NUM_THREADS=1 python -m experiments peers [--quick]``.
"""

import time
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from experiments.harness.charts import note, subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import best, drawn
from experiments.harness.scenes import arch25
from experiments.peers.parts.models import (
    LOOP,
    Answer,
    Loop,
    OpenSees,
    Peer,
    chain_of,
    kept,
    open_sees,
)
from seqopt import Network, pose, solve, three_robot_loop
from seqopt.arrays import Ints
from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.report._style import BLUE, VERMILION, name_panels, plain, styled
from seqopt.study.published import EQUATIONS, paper_models

OURS, PACKAGE = "seqopt", "OpenSeesPy"
LABELS = {
    OURS: "seqopt, fast engine",
    PACKAGE: "OpenSeesPy, stiff bars",
    LOOP: "SciPy loop, stiff bars, banded Cholesky",
}
TITLES = {
    "criterion": "what the criterion needs",
    "all fields": "every edge force and node displacement",
}
AGAINST_PACKAGE, AGAINST_LOOP = 60.0, 20.0  # times as fast as is claimed
ALIKE = 1e-4  # largest difference of peers, whose bricks are stiff bars


class Case(NamedTuple):
    """The models of one brick count and number of grips: node numbers, places, what is asked."""

    bricks: int
    grips: Ints
    columns: Ints
    want: Want

    def asked(self, setting: str) -> Want:
        """Return what a setting asks of these models."""
        return self.want if setting == "criterion" else Want.RESPONSES


class Recorder:
    """An engine that remembers what it was asked."""

    def __init__(self, net: Network) -> None:
        self.engine = ComplianceEngine(net)
        self.cases: list[Case] = []

    @property
    def network(self) -> Network:
        """The engine's network."""
        return self.engine.network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Answer and remember."""
        columns = grip_columns(self.network, bricks, grips)
        self.cases.append(Case(bricks, np.asarray(grips), columns, want))
        return self.engine.solve(bricks, grips, want)


def workload(net: Network) -> list[Case]:
    """Return every distinct model of the loop that equations 2 and 3 need."""
    recorder = Recorder(net)
    models = solve(pose(recorder, three_robot_loop(net), EQUATIONS), "overlap_dp").models
    counts = np.cumsum([len(case.grips) for case in recorder.cases])
    return recorder.cases[: 1 + int(np.searchsorted(counts, models))]  # those after are of checks


def operators(net: Network, cases: list[Case]) -> ComplianceEngine:
    engine = ComplianceEngine(net)
    for case in cases:
        engine.solve(case.bricks, case.grips[:1], Want(0))
    return engine


class Round(NamedTuple):
    """One peer's turn: time to make kept models, times of all models, answers given."""

    setup: float
    seconds: dict[str, float]
    answers: list[tuple[Case, int, Answer]]


def make(net: Network, name: str, bricks: int) -> Peer:
    return Loop(kept(net, bricks)) if name == LOOP else OpenSees(chain_of(net, bricks))


def turn(net: Network, cases: list[Case], name: str, few: int, rng: np.random.Generator) -> Round:
    """Return what a peer takes for all models, from a few of each kind."""
    setup, seconds = 0.0, dict.fromkeys(TITLES, 0.0)
    answers = []
    for bricks in sorted({case.bricks for case in cases}):
        start = time.perf_counter()
        peer = make(net, name, bricks)
        setup += time.perf_counter() - start
        for case in (c for c in cases if c.bricks == bricks):
            size = len(case.columns)
            chosen = rng.choice(size, min(few, size), replace=False)
            peer.solve(case.columns[chosen[0]], Want.RESPONSES)
            for setting in TITLES:
                asked = case.asked(setting)
                start = time.perf_counter()
                found = [peer.solve(case.columns[i], asked) for i in chosen]
                seconds[setting] += (time.perf_counter() - start) * size / len(chosen)
            answers += [(case, int(i), a) for i, a in zip(chosen, found, strict=True)]
    return Round(setup, seconds, answers)


def difference(engine: ComplianceEngine, answers: list[tuple[Case, int, Answer]]) -> float:
    """Return the largest difference of any field from the engine's, over its largest entry.

    Forces and moments of the supports are fields of their own.
    """
    worst = 0.0
    for case, i, answer in answers:
        exact = engine.solve(case.bricks, case.grips[i : i + 1])
        pairs = {n: (x, getattr(exact, n)[0]) for n, x in answer._asdict().items()}
        found, true = pairs.pop("support")
        for part in (slice(3), slice(3, 6)):
            pairs[part.stop] = (found[:, part], true[:, part])
        gaps = (np.abs(a - b).max() / np.abs(b).max() for a, b in pairs.values())
        worst = max(worst, *map(float, gaps))
    return worst


def compete(
    net: Network, cases: list[Case], names: list[str], rounds: int, few: int
) -> pd.DataFrame:
    """Return a row per round, setting and tool; tools take turns."""
    rng, rows, engine = np.random.default_rng(0), [], operators(net, cases)
    for number in range(rounds):
        prepare = best(partial(operators, net, cases), 1)
        for s in TITLES:
            asked = [(case.bricks, case.grips, case.asked(s)) for case in cases]
            ours = best(lambda asked=asked: [engine.solve(*each) for each in asked], 3)
            rows.append((number, s, OURS, prepare, ours, np.nan))
        for name in names:
            done = turn(net, cases, name, few, rng)
            gap = difference(engine, done.answers)
            rows += [(number, s, name, done.setup, t, gap) for s, t in done.seconds.items()]
    columns = ["round", "setting", "tool", "setup_s", "models_s", "difference"]
    return pd.DataFrame(rows, columns=columns)


def summarize(rounds: pd.DataFrame, models: int) -> pd.DataFrame:
    """Return medians over rounds, and over ours the lowest ratio of a round."""
    ours = rounds[rounds["tool"] == OURS].set_index(["round", "setting"])
    index = pd.MultiIndex.from_frame(rounds[["round", "setting"]])
    whole = (ours["setup_s"] + ours["models_s"]).reindex(index).to_numpy()
    table = rounds.assign(
        model_us=rounds["models_s"] / models * 1e6,
        ratio=rounds["models_s"] / ours["models_s"].reindex(index).to_numpy(),
        ratio_whole=(rounds["models_s"] + rounds["setup_s"]) / whole,
    )
    grouped = table.groupby(["setting", "tool"], sort=False)
    times = ["setup_s", "models_s", "model_us", "ratio", "ratio_whole"]
    worst = {"ratio_lowest": grouped["ratio"].min(), "difference": grouped["difference"].max()}
    return grouped[times].median().assign(**worst).reset_index()


def holds(table: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim does."""
    peers = table[table["tool"] != OURS]
    packaged = peers["tool"] == PACKAGE
    return {
        "the package takes long": bool((peers["ratio_lowest"][packaged] >= AGAINST_PACKAGE).all()),
        "loops take long": bool((peers["ratio_lowest"][~packaged] >= AGAINST_LOOP).all()),
        "all agree": bool((peers["difference"] <= ALIKE).all()),
    }


def experiment(options: Options) -> Finding:
    net, quick = arch25().network, options.quick
    cases = workload(net)
    models, counted = sum(len(c.grips) for c in cases), paper_models(three_robot_loop(net))[1]
    print(f"{models} distinct models; the paper counts {counted}")
    without = ""
    try:
        names = [LOOP] if quick else [open_sees() and PACKAGE, LOOP]
    except (ImportError, OSError, RuntimeError):
        names, without = [LOOP], ", without OpenSeesPy, whose stored rows stay"
    cases = [c for c in cases if not quick or c.bricks % 8 == 1]
    rounds = compete(net, cases, names, *((1, 3) if quick else (9, 10)))
    table = summarize(rounds, sum(len(c.grips) for c in cases))
    print(table.to_string(index=False, float_format="%.3g"))
    return Finding(holds(table), without, {} if without else {"peers": table})


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw the time of a model by every tool, a panel for what is asked."""
    whole = table[table["setting"] == "all fields"].sort_values("model_us", ascending=False)
    order = [*whole["tool"]]
    figure, panels = subplots(3.6, 2, 1, sharex=True)
    for axes, (setting, title) in zip(panels, TITLES.items(), strict=True):
        part = table[table["setting"] == setting].set_index("tool")
        for row, tool in enumerate(order):
            value, ratio = float(part["model_us"][tool]), float(part["ratio"][tool])
            color, marker = (VERMILION, "D") if tool == OURS else (BLUE, "o")
            axes.plot([0.5, value], [row, row], color=color, lw=1, zorder=1)
            axes.plot(value, row, marker, color=color, ms=6)
            text = f"{value:.1f} µs" if tool == OURS else f"{value:.0f} µs, {ratio:.0f} times"
            note(axes, text, (value, row), (8, 0), va="center")
        axes.set(xscale="log", xlim=(0.5, 3e3), ylim=(len(order) - 0.4, -0.6), title=title)
        axes.set_yticks(range(len(order)), [LABELS[tool] for tool in order])
        axes.tick_params(axis="y", length=0)
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.minorticks_off()
    plain(panels[1].xaxis)
    panels[1].set_xlabel("time per structure analyzed [µs]")
    name_panels(*panels)
    return figure


CLAIM = Claim(
    experiment,
    digits=4,
    quick="the loop alone",
    timed=True,
    pictures={"peers.png": drawn(chart, "peers")},
)
