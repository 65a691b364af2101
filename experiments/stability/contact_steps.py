"""Claim: dry bricks that come to rest are proven to stand; some that could stand become unstable.

Method: every step of the sequential and the cantilever method on `arch25` without bonds, once by
discrete elements (do the bricks come to rest, from rest, with grips that only react?) and once by
the certificate (are there forces in balance that friction, compression and payloads allow?). What
comes to rest shows such forces, so no step may rest that is proven to fall. The converse is open:
forces may exist that nothing brings about. The claim fails if a step rests that is not proven to
stand, or if none that is proven to stand becomes unstable; steps that were not followed to an end
count for neither. One arch and two methods: how many steps differ elsewhere is not said.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import drawn
from experiments.harness.scenes import arch25
from seqopt import DRY, Network, Step
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SolverError
from seqopt.report._style import BLUE, GRAY, VERMILION, plain, styled
from seqopt.sequence.methods import METHODS
from seqopt.stability._steps import assess_steps
from seqopt.stability.verdict import Verdict

RESTS, GOES, NEITHER = "rests", "goes", "neither"
SHOWN: dict[str, dict[str, Any]] = {
    RESTS: {"color": BLUE, "marker": "o", "ls": "none"},
    GOES: {"color": VERMILION, "marker": "x", "ls": "none", "ms": 6, "mew": 1.5},
    NEITHER: {"color": GRAY, "marker": "|", "ls": "none", "ms": 7, "mew": 1.5},
}
FALLING = "#fbe3d3"
TOP = 3e3  # 1e-3 mm, where steps that do not rest are marked
TO_1E_3MM = 1e6


def ending(engine: DiscreteEngine, step: Step) -> tuple[str, float]:
    """Return how a step ends by discrete elements, and its largest displacement, m."""
    try:
        return RESTS, largest(engine, step)
    except MechanismError:
        return GOES, np.nan
    except SolverError:
        return NEITHER, np.nan


def largest(engine: Engine, step: Step) -> float:
    """Return the largest displacement of a node, m."""
    grips = np.array([step.held], dtype=np.int64).reshape(1, -1)
    fields = engine.solve(step.bricks, grips, Want.DISPLACEMENTS)
    return float(np.linalg.norm(fields.displacement, axis=2).max())


def rows(net: Network, method: str, steps: Sequence[Step]) -> list[dict[str, object]]:
    discrete, rigid = DiscreteEngine(net, DRY), ComplianceEngine(net)
    out: list[dict[str, object]] = []
    for step, result in zip(steps, assess_steps(net, steps, DRY), strict=True):
        ends, moved = ending(discrete, step)
        row = {"method": method, "step": step.number, "bricks": step.bricks}
        row |= {"certificate": result.verdict.value, "discrete": ends}
        row |= {"D_max_1e-3mm": TO_1E_3MM * moved}
        out.append(row | {"D_max_rigid_1e-3mm": TO_1E_3MM * largest(rigid, step)})
    return out


@styled
def chart(table: pd.DataFrame) -> Figure:
    figure, panels = subplots(4.8, table["method"].nunique(), 1, sharex=True)
    for axes, (method, part) in zip(panels, table.groupby("method", sort=False), strict=True):
        axes.plot(part["step"], part["D_max_rigid_1e-3mm"], color=GRAY, lw=1.2)
        rests = part[part["discrete"] == RESTS]
        axes.plot(rests["step"], rests["D_max_1e-3mm"], **SHOWN[RESTS])
        for ends in (GOES, NEITHER):
            those = part[part["discrete"] == ends]
            axes.plot(those["step"], np.full(len(those), TOP), clip_on=False, **SHOWN[ends])
        for step in part[part["certificate"] == Verdict.FALLS.value]["step"]:
            axes.axvspan(step - 0.5, step + 0.5, color=FALLING, lw=0)
        axes.set(yscale="log", ylim=(1e-3, TOP), xlim=(0, table["step"].max() + 1))
        axes.set(ylabel="largest displacement\nD_max [1e-3 mm]")
        axes.set_title(f"{method} method, bricks laid dry", pad=9)
        plain(axes.yaxis)
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("step")
    words = {RESTS: "comes to rest", GOES: "becomes unstable", NEITHER: "neither was found"}
    keys: list[Artist] = [Line2D([], [], label=words[end], **look) for end, look in SHOWN.items()]
    keys += [Patch(color=FALLING, label="proven to fall")]
    keys += [Line2D([], [], color=GRAY, label="the same, bricks bonded")]
    figure.legend(handles=keys, loc="outside lower center", ncols=3)
    return figure


def holds(table: pd.DataFrame) -> bool:
    stands = table["certificate"] == Verdict.STANDS.value
    rests, goes = (table["discrete"] == ending for ending in (RESTS, GOES))
    return bool(stands[rests].all() and rests.any() and (stands & goes).any())


def experiment(options: Options) -> Finding:
    net, found = arch25().network, []
    for method in ("sequential",) if options.quick else ("sequential", "cantilever"):
        found += rows(net, method, METHODS[method](net)[: 10 if options.quick else None])
    table = pd.DataFrame(found)
    print(pd.crosstab([table["method"], table["certificate"]], table["discrete"]).to_string())
    return Finding(holds(table), tables={"contact_steps": table})


CLAIM = Claim(
    experiment,
    digits=4,
    quick="ten steps",
    pictures={"contact_steps.png": drawn(chart, "contact_steps")},
)
