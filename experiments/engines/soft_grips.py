"""Claim: the contrast of two methods that rigid grips show is gone with grips as soft as arms.

Method: on `arch25` the fixed sequences, the published plan, the plan of the loop (criterion
`equations-2-3`) and a free schedule with the smallest worst step, all chosen for rigid grips, step
by step with grips of 1e5 to 1e10 N/m and rigid ones. Where grips are rigid the cantilever method
moves the structure less than a tenth as far as the sequential one. The claim fails if that is not
so, if the cantilever still has less than half with grips of 1e6 N/m, if both are within their
payloads with rigid grips or one is not with grips of 1e6 N/m, or if the free plan is not the one
that moves least at 1e6 N/m.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import seqopt
from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import drawn
from seqopt.report._style import GRAY, dress, looks, plain, styled
from seqopt.report.comparison import largest
from seqopt.report.text import UNITS
from seqopt.sequence.methods import METHODS
from seqopt.study import published_plan

ARM, RIGID = 1e6, float("inf")  # N/m
BAND = (2e5, 2e6)  # N/m; about where arms of industry are, see docs/robots.md
GRID = (*np.geomspace(1e5, 1e10, 21).tolist(), RIGID)
Builds = Mapping[str, Sequence[seqopt.Step]]


def builds(network: seqopt.Network) -> Builds:
    """Return the steps of the builds by name."""
    steps = {name: method(network) for name, method in METHODS.items()}
    steps["published"] = published_plan(network.scene)
    steps["loop"] = seqopt.optimize(network.scene, "three-robot").steps
    return steps | {"free": seqopt.optimize(network.scene, "free").steps}


def held_softly(
    scene: seqopt.Scene, steps: Builds, grid: Sequence[float]
) -> Iterator[dict[str, object]]:
    """Yield the largest responses of builds for grips of several stiffnesses, N/m.

    ``payload_share``: the largest force of a grip over the payload that all robots have.
    """
    (payload,) = {robot.payload for robot in scene.robots}
    for stiffness in grid:
        soft = scene.with_grips(None if stiffness == RIGID else stiffness)
        engine = seqopt.make_engine("compliance", soft)
        for name, own in steps.items():
            found = largest(soft, seqopt.analyze(engine, own))
            row = {"build": name, "stiffness": stiffness, **found}
            yield row | {"payload_share": found["F_rob"] / payload}


def holds(table: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim holds."""
    at = {k: rows.set_index("build") for k, rows in table.groupby("stiffness")}
    moved = {k: rows["D_max"] for k, rows in at.items()}
    share = {k: rows.loc[list(METHODS), "payload_share"] for k, rows in at.items()}
    return {
        "rigid: the cantilever method moves a tenth of the sequential one at most": bool(
            moved[RIGID]["cantilever"] <= 0.1 * moved[RIGID]["sequential"]
        ),
        "arms: more than half of it": bool(
            moved[ARM]["cantilever"] > 0.5 * moved[ARM]["sequential"]
        ),
        "rigid: both ask more than a payload": bool((share[RIGID] > 1).all()),
        "arms: neither does": bool((share[ARM] <= 1).all()),
        "arms: the free plan moves least": moved[ARM].idxmin() == "free",
    }


def experiment(options: Options) -> Finding:
    network = seqopt.build_network(seqopt.load_scene("arch25"))
    grid = (ARM, RIGID) if options.quick else GRID
    table = pd.DataFrame(held_softly(network.scene, builds(network), grid))
    print(table.to_string(index=False, float_format="%.4g"))
    return Finding(holds(table), tables={"soft_grips": table})


TITLES = {
    "F_rob": "robot force",
    "M_sup": "support moment",
    "T_max": "edge tension",
    "D_max": "node displacement",
}


@styled
def chart(table: pd.DataFrame) -> Figure:
    """Draw the largest responses of builds over the stiffness of grips."""
    figure, grid = subplots(5.2, 2, 2, sharex=True)
    finite, rigid = (table[np.isfinite(table["stiffness"]) == each] for each in (True, False))
    end = 4 * float(finite["stiffness"].max())
    for panel, (response, unit) in zip(grid.ravel(), UNITS.items(), strict=True):
        panel.axvspan(*BAND, color=GRAY, alpha=0.2, lw=0, zorder=0, label="industrial arms")
        for name, style in looks(table["build"]).items():
            own = finite[finite["build"] == name].sort_values("stiffness")
            line = style.line() | {"markevery": 4, "label": name}
            panel.plot(own["stiffness"], own[response], **line)
            last = rigid.loc[rigid["build"] == name, response]
            panel.plot([end] * len(last), last, style.marker, color=style.color)
        panel.set(xscale="log", yscale="log", title=f"{TITLES[response]} [{unit}]")
        plain(panel.yaxis)
        dress(panel)
    for panel in grid[1]:
        panel.set_xlabel("stiffness of grips [N/m]; marks on the right: rigid")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


CLAIM = Claim(
    experiment,
    digits=5,
    quick="two stiffnesses",
    pictures={"soft_grips.png": drawn(chart, "soft_grips")},
)
