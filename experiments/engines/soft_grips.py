"""Claim: the contrast of two methods that rigid grips show is gone with grips as soft as arms.

Method: on `arch25` the fixed sequences, the published plan, the plan of the loop (criterion
`equations-2-3`) and a free schedule with the smallest worst step, all chosen for rigid grips, step
by step with grips of 1e5 to 1e10 N/m and rigid ones. Where grips are rigid the cantilever method
moves the structure less than a tenth as far as the sequential one. The claim fails if that is not
so, if the cantilever still has less than half with grips of 1e6 N/m, if both are within their
payloads with rigid grips or one is not with grips of 1e6 N/m, or if the free plan is not the one
that moves least at 1e6 N/m. Also: how long a grip set takes with soft grips over rigid ones, in
turns in one process (the core's time): the claim fails too if the median is more than 1.1.

Inputs: the shipped scene. Command: ``python -m experiments soft_grips [--quick]``.
"""

import time
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import seqopt
from experiments.engines.parts.softness import (
    grip_range,
    held_softly,
    softness_chart,
    turning_points,
)
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import drawn
from experiments.harness.scenes import arch25, grip_sets
from seqopt.engines.interface import Engine, Want
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import published_plan

ARM = 1e6  # N/m
BAND = (2e5, 2e6)  # N/m; about where arms of industry are, see docs/robots.md
MOST = 1.1  # time of a soft set over that of a rigid one
RIGID = float("inf")


def builds(engine: Engine) -> dict[str, pd.DataFrame]:
    """Return the responses of every step of the builds, by name."""
    network = engine.network
    steps = {name: method(network) for name, method in METHODS.items()}
    steps["published"] = published_plan(network.scene)
    steps["loop"] = seqopt.optimize(network.scene, "three-robot").steps
    steps["free"] = seqopt.optimize(network.scene, "free").steps
    return {name: seqopt.analyze(engine, each) for name, each in steps.items()}


def ratio_of_times(sets: int, rounds: int) -> float:
    """Return the median time of a grip set with soft grips over that with rigid ones."""
    rigid = arch25()
    soft = seqopt.make_engine("compliance", rigid.network.scene.with_grips(ARM))
    held, asked = grip_sets(rigid.network, 17, sets), Want.EDGES | Want.DISPLACEMENTS
    calls = [partial(engine.solve, 17, held, asked) for engine in (rigid, soft)]
    ratios = []
    for call in calls:
        call()
    for _ in range(rounds):
        spent = []
        for call in calls:
            start = time.process_time()
            call()
            spent.append(time.process_time() - start)
        ratios.append(spent[1] / spent[0])
    return float(np.median(ratios))


def holds(table: pd.DataFrame, ratio: float) -> dict[str, bool]:
    """Return whether each part of the claim holds."""
    at = {k: rows.set_index("build") for k, rows in table.groupby("stiffness")}
    moved = {k: rows["D_max"] for k, rows in at.items()}
    share = {k: rows.loc[list(METHODS), "payload_share"] for k, rows in at.items()}
    return {
        "rigid: the cantilever method moves a tenth of the sequential one at most": (
            moved[RIGID]["cantilever"] <= 0.1 * moved[RIGID]["sequential"]
        ),
        "arms: more than half of it": (moved[ARM]["cantilever"] > 0.5 * moved[ARM]["sequential"]),
        "rigid: both ask more than a payload": bool((share[RIGID] > 1).all()),
        "arms: neither does": bool((share[ARM] <= 1).all()),
        "arms: the free plan moves least": moved[ARM].idxmin() == "free",
        "a soft grip set takes a tenth longer at most": ratio <= MOST,
    }


def experiment(options: Options) -> Finding:
    engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    grid = (ARM, RIGID) if options.quick else grip_range(1e5, 1e10)
    table = held_softly(engine, builds(engine), grid)
    ratio = 1.0 if options.quick else ratio_of_times(2048, 60)
    print(table.to_string(index=False, float_format="%.4g"))
    for line in turning_points(table, [*METHODS]):
        print(line)
    if not options.quick:
        print(f"time of a soft grip set over a rigid one: {ratio:.3f}")
    speed = pd.DataFrame([{"ratio_median": ratio}])
    return Finding(holds(table, ratio), tables={"soft_grips": table, "soft_grips_speed": speed})


def chart(table: pd.DataFrame) -> Figure:
    return softness_chart(table, [*dict.fromkeys(table["build"])], BAND)


CLAIM = Claim(
    experiment,
    digits=5,
    quick="two stiffnesses",
    pictures={"soft_grips.png": drawn(chart, "soft_grips")},
)
