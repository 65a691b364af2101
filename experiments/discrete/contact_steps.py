"""Claim: dry bricks that come to rest are proven to stand; some that could stand become unstable.

Method: every step of the sequential and the cantilever method on `arch25` without bonds, once by
discrete elements (do the bricks come to rest, from rest, with grips that only react?) and once by
the certificate (are there forces in balance that friction, compression and payloads allow?). What
comes to rest shows such forces, so no step may rest that is proven to fall. The converse is open:
forces may exist that nothing brings about. The claim fails if a step rests that is not proven to
stand, or if none that is proven to stand becomes unstable; steps that were not followed to an end
count for neither. One arch and two methods: how many steps differ elsewhere is not said.

Inputs: the shipped scene. Command: ``python -m experiments.discrete.contact_steps [--quick]``.
Writes ``experiments/results/contact_steps.csv`` and ``docs/figures/contact_steps.png``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.plotting import RESULTS, new_figure, save_figure
from seqopt.contact.mortar import DRY
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, SolverError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.steps import Step
from seqopt.sequence.two_robots import METHODS
from seqopt.stability.assessment import Verdict
from seqopt.stability.steps import assess_steps

RESTS, GOES, NEITHER = "rests", "goes", "neither"
SHOWN = {RESTS: "#2166ac", GOES: "#b2182b", NEITHER: "#bbbbbb"}
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
    """Return a row per step."""
    discrete, rigid = DiscreteEngine(net, DRY), ComplianceEngine(net)
    results = assess_steps(net, steps, DRY)
    out: list[dict[str, object]] = []
    for step, result in zip(steps, results, strict=True):
        ends, moved = ending(discrete, step)
        out.append(
            {
                "method": method,
                "step": step.number,
                "bricks": step.bricks,
                "certificate": result.verdict.value,
                "discrete": ends,
                "D_max_1e-3mm": TO_1E_3MM * moved,
                "D_max_rigid_1e-3mm": TO_1E_3MM * largest(rigid, step),
            }
        )
    return out


def chart(table: pd.DataFrame) -> None:
    figure = new_figure(7.5, 4.5)
    panels = figure.subplots(table["method"].nunique(), 1, sharex=True)
    for axes, (method, part) in zip(panels, table.groupby("method", sort=False), strict=True):
        axes.plot(part["step"], part["D_max_rigid_1e-3mm"], color="#888888", lw=1)
        rests = part[part["discrete"] == RESTS]
        axes.plot(rests["step"], rests["D_max_1e-3mm"], "o", ms=4, color=SHOWN[RESTS])
        for ends in (GOES, NEITHER):
            those = part[part["discrete"] == ends]
            at = np.full(len(those), 3e3)
            axes.plot(those["step"], at, "x", ms=5, color=SHOWN[ends], clip_on=False)
        falls = part[part["certificate"] == Verdict.FALLS.value]["step"]
        for step in falls:
            axes.axvspan(step - 0.5, step + 0.5, color="#fddbc7", lw=0)
        axes.set(yscale="log", ylim=(1e-3, 3e3), ylabel="D_max [1e-3 mm]")
        axes.set_title(f"{method} method, bricks laid dry", fontsize=9, loc="left")
        axes.spines[["top", "right"]].set_visible(False)
    panels[-1].set_xlabel("step")
    for marker, color, text in (
        ("o", SHOWN[RESTS], "comes to rest"),
        ("x", SHOWN[GOES], "goes"),
        ("x", SHOWN[NEITHER], "neither found"),
        ("s", "#fddbc7", "proven to fall"),
        ("_", "#888888", "rigid bricks, bonded"),
    ):
        panels[0].plot([], [], marker, color=color, label=text)
    figure.legend(loc="outside lower center", ncols=5, fontsize=8, frameon=False)
    save_figure(figure, "contact_steps.png")


def holds(table: pd.DataFrame) -> bool:
    """Return whether all that rests stands, and something that stands becomes unstable."""
    stands = table["certificate"] == Verdict.STANDS.value
    rests, goes = (table["discrete"] == ending for ending in (RESTS, GOES))
    return bool(stands[rests].all() and rests.any() and (stands & goes).any())


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    net = build_network(load_scene("arch25"))
    methods = ("sequential",) if quick else ("sequential", "cantilever")
    table = pd.DataFrame(
        [
            row
            for method in methods
            for row in rows(net, method, METHODS[method](net)[: 10 if quick else None])
        ]
    )
    print(pd.crosstab([table["method"], table["certificate"]], table["discrete"]).to_string())
    stands = table["certificate"] == Verdict.STANDS.value
    rests = table["discrete"] == RESTS
    ratio = (table["D_max_1e-3mm"] / table["D_max_rigid_1e-3mm"])[rests]
    print(
        f"at rest the largest displacement is {ratio.median():.3g} times that of bonded bricks in "
        f"the median ({ratio.min():.3g} to {ratio.max():.3g})"
    )
    wrong = table[rests & ~stands]
    print(f"steps that rest and are not proven to stand: {len(wrong)}")
    if not quick:
        RESULTS.mkdir(exist_ok=True)
        table.to_csv(RESULTS / "contact_steps.csv", index=False, float_format="%.4g")
        chart(table)
    return Finding(holds(table))


CLAIM = Claim(experiment, quick="ten steps, nothing written")

if __name__ == "__main__":
    CLAIM.main()
