"""Claim: no interpretation tried of the paper's discrete-element models gives its printed errors.

Method: Bruun et al. compare their model with discrete elements on four partial arches (17, 18, 23
and 24 bricks, one robot holding the last) and print the mean difference of the displacements of all
inner nodes that no robot holds (section 3.2.3, table 3). Here
`seqopt.engines.discrete.engine.DiscreteEngine` solves the same arches with rigid bricks on beds of
100e6 kN/m³ normal and 10e6 kN/m³ tangential. What print leaves open is read in several ways:

- the robot holds the node, or pinches the brick between two square pads, ten times as stiff as the
  joints, across its width or through its thickness; no size is printed, so pads have 12, 20, 30 mm;
- joints are as printed, as stiff tangentially as normally, two halves in series (one per brick), or
  springs at the corners of the faces only, as discrete elements with rigid blocks may have.

Tension and shear stay within the printed limits (3 MPa, 25 degrees, 2 MPa), hence nothing breaks or
slips. A scan over pads of 4, 5, ... 50 mm finds the readings whose worst arch is least off. The
claim fails if any reading is within 10 points on all four arches, or if a limit is exceeded.

Inputs: the shipped scene. Command: ``python -m experiments discrete_arches [--quick]``.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from experiments.discrete.parts.arch_pads import JOINTS, Across, Pinch, Reading, readings
from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import stored
from experiments.harness.scenes import arch25
from experiments.harness.yardstick import STEPS, error, moved
from seqopt import EPOXY, Step, sequential
from seqopt.arrays import Floats
from seqopt.contact._elastic_limits import find_elastic_limits
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.report._style import BLUE, ORANGE, SMALL, VERMILION, dress, name_panels, styled
from seqopt.study.published import STUDY_PADS, printed

PANELS = ("as printed", "springs at corners")  # joints
COLORS = {"node": (BLUE, "o"), "pads, width": (VERMILION, "^"), "pads, thickness": (ORANGE, "v")}
DASHES = (":", "-", "--")  # of the sizes of pads, in ascending order
NAMES = {
    "node": "node held",
    "pads, width": "pads across the width",
    "pads, thickness": "pads across the thickness",
}
NEAR = 10.0  # points of percent within which an error counts as reproduced
TICKS = (-90, -80, -50, 0, 100, 200, 500)  # %


@styled
def chart(errors: pd.DataFrame, best: pd.DataFrame, study: pd.Series[float]) -> Figure:
    figure, panels = subplots(5.6, 1, 3)
    first, second, third = panels
    for axes, joint in zip((first, second), PANELS, strict=True):
        draw_readings(
            axes, errors[errors.index.get_level_values("joint") == joint].droplevel("joint")
        )
        axes.plot(study.to_numpy(), "ks", ms=6, label="printed (3DEC)", zorder=5)
        axes.set_title(f"joints {joint}" if joint == "as printed" else f"joints as {joint}")
        # the ratio of displacements is drawn evenly
        even = (lambda e: (e / 100 + 1) ** 0.3, lambda r: 100 * (r ** (1 / 0.3) - 1))
        axes.set_yscale("function", functions=even)
        axes.set(ylim=(-95, 650), yticks=TICKS)
    with_best_pads(third, best)
    look = {"fmt": "ks", "ms": 6, "capsize": 4, "zorder": 5}
    third.errorbar(range(len(study)), study, NEAR, label=f"printed, ± {NEAR:g} points", **look)
    third.set(ylim=(-30, 40))
    for axes in panels:
        tidy(axes, list(study.index))
    dress(*panels)
    name_panels(*panels)
    first.set_ylabel("mean difference of the double-cross model\nfrom the discrete elements [%]")
    look = {"loc": "outside lower left", "title": "(a) and (b)", "ncols": 2, "columnspacing": 1}
    figure.legend(*first.get_legend_handles_labels(), alignment="left", **look)
    look = {"loc": "outside lower right", "title": "(c)", "alignment": "left"}
    figure.legend(*third.get_legend_handles_labels(), **look)
    figure.suptitle(words(best, study), fontsize=SMALL, x=0.01, ha="left")
    return figure


def draw_readings(axes: Axes, errors: pd.DataFrame) -> None:
    sides = sorted({side for _, side in errors.index if side})
    for grip, side in errors.index:
        dashes = DASHES[sides.index(side)] if side else "-"
        name = f"{NAMES[grip]}, {side:g} mm" if side else NAMES[grip]
        color, marker = COLORS[grip]
        row = errors.loc[(grip, side)].to_numpy()
        axes.plot(row, color=color, marker=marker, mfc="white", ls=dashes, lw=1.3, label=name)


def with_best_pads(axes: Axes, best: pd.DataFrame) -> None:
    """Draw a line per grip and joint, the best of all thick."""
    named: set[tuple[str, bool]] = set()
    for (grip, side, joint), values in zip(best.index, best.to_numpy(), strict=True):
        first = not named
        name = f"best: {NAMES[grip]}, {side:g} mm,\njoints {joint}"
        name = name if first else f"{NAMES[grip]}, other joints"
        label = None if (grip, first) in named else name
        named.add((grip, first))
        color, marker = COLORS[grip]
        look = {"color": color, "marker": marker, "ms": 4, "mfc": None if first else "white"}
        axes.plot(values, lw=2.5 if first else 0.8, label=label, **look)
    axes.set_title("best pads of 4 to 50 mm")


def tidy(axes: Axes, bricks: list[int]) -> None:
    axes.set_xlim(-0.3, len(bricks) - 0.7)
    axes.set_xticks(range(len(bricks)), [f"{count}" for count in bricks])
    axes.set_xlabel("bricks placed")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:+.0f}" if y else "0"))
    axes.axhline(0, color="0.5", lw=0.8, zorder=0)


def words(best: pd.DataFrame, study: pd.Series[float]) -> str:
    off = farthest(best, study).min()
    return (
        "Disagrees with print: no reading of the discrete elements gives the printed errors on all "
        f"four arches;\nthe best is {off:.1f} points off on one."
    )


SIDES = 1e-3 * np.arange(4.0, 51.0)  # m, of the scan
KEYS = ["grip", "side_mm", "joint"]


def row_of(engine: ComplianceEngine, step: Step, reading: Reading) -> dict[str, object]:
    """Return the mean error of our model against a reading, as Bruun et al. take it."""
    discrete = reading.engine(engine.network)
    own, ours = moved(engine, step), moved(discrete, step)
    tension, shear = stresses(discrete, step)
    row = {"grip": reading.grip}
    row |= {"side_mm": 0.0 if reading.pinch is None else round(1e3 * reading.pinch.side, 3)}
    row |= {"joint": reading.joint, "bricks": step.bricks, "error_pct": error(own, ours)}
    row |= {"D_max_1e-3mm": 1e6 * ours.max(), "double_cross_1e-3mm": 1e6 * own.max()}
    return row | {"tension_MPa": tension / 1e6, "shear_used": shear}


def stresses(engine: DiscreteEngine, step: Step) -> tuple[float, float]:
    """Return the largest tension of the joints, Pa, and shear over what the epoxy allows."""
    wrench = engine.solve(step.bricks, [list(step.held)], Want.ALL).joint_wrench[0]
    limits = find_elastic_limits(engine.network, EPOXY)
    stress = np.einsum("kij,kj->ki", limits.stress, wrench[limits.assembly.contact])
    shear = np.linalg.norm(stress[:, 1:], axis=1)
    allowed = EPOXY.cohesion + EPOXY.friction * stress[:, 0]
    return float(-stress[:, 0].min()), float((shear / allowed).max())


def scan(engine: ComplianceEngine, steps: list[Step], sides: Floats) -> pd.DataFrame:
    """Return the errors for all pads and joints, a row per size and a column per arch."""
    own = {step.bricks: moved(engine, step) for step in steps}
    rows = []
    for across, joint, side in product(Across, JOINTS, sides):
        reading = Reading(joint, Pinch(across, STUDY_PADS, side=float(side)))
        discrete = reading.engine(engine.network)
        row = {"grip": reading.grip, "side_mm": round(1e3 * float(side), 3), "joint": joint}
        gaps = {step.bricks: error(own[step.bricks], moved(discrete, step)) for step in steps}
        rows.append(row | gaps)
    return pd.DataFrame(rows).set_index(KEYS)


def farthest(errors: pd.DataFrame, study: pd.Series[float]) -> pd.Series[float]:
    """Return by how many points readings are off on their worst arch."""
    return (errors - study).abs().max(axis=1)


def best_sides(scanned: pd.DataFrame, study: pd.Series[float]) -> pd.DataFrame:
    """Return the best size of pads for every grip and joint, the best of all first."""
    off = farthest(scanned, study)
    least = off.groupby(["grip", "joint"]).idxmin()
    return scanned.loc[off.loc[list(least)].sort_values().index]


def largest_fall(scanned: pd.DataFrame, study: pd.Series[float]) -> str:
    """Tell by how much errors fall between the arches where print falls most."""
    high, low = (study.index[int(i)] for i in (study.argmax(), study.argmin()))
    fall = (scanned[high] - scanned[low]).reset_index(name="points")
    most = fall.loc[fall["points"].idxmax()]
    return (
        f"from {high} to {low} bricks print falls by {study.max() - study.min():.1f} points, "
        f"of {len(fall)} readings none by more than {most['points']:.1f}: "
        f"{most['grip']}, {most['side_mm']:g} mm, {most['joint']}"
    )


def arches(engine: ComplianceEngine, *, quick: bool) -> list[Step]:
    """Return the four steps, or two: pads of some size suit any single arch."""
    steps = [sequential(engine.network)[number - 1] for number in STEPS.values()]
    return steps[::2] if quick else steps


def report(errors: pd.DataFrame, study: pd.Series[float]) -> None:
    shown = errors.assign(farthest=farthest(errors, study))
    print("mean error of the double-cross model [%], and points off at worst:")
    print(shown.to_string(float_format="%+.1f"))
    print("printed:", ", ".join(f"{n} bricks {e:+.1f}" for n, e in study.items()))


def within_limits(table: pd.DataFrame) -> bool:
    """Tell, and return, whether nothing breaks or slips."""
    tension, shear = table["tension_MPa"].max(), table["shear_used"]
    print(f"tension at most {tension:.2g} MPa, shear {100 * shear.max():.2g} % of what is allowed")
    elastic = bool(tension < EPOXY.tensile_strength / 1e6 and shear.between(0, 1).all())
    print(f"all within the elastic limits: {'yes' if elastic else 'NO'}")
    return elastic


def holds(table: pd.DataFrame, study: pd.Series[float]) -> bool:
    """Return whether nothing breaks or slips and no reading is near on all arches.

    The rows hold the stated readings and the best size of every pad, so the nearest is among them.
    """
    errors = table.pivot_table(index=["pads", *KEYS], columns="bricks", values="error_pct")
    return within_limits(table) and bool(farthest(errors, study).min() > NEAR)


def experiment(options: Options) -> Finding:
    engine = arch25()
    steps = arches(engine, quick=options.quick)
    study = printed("de_validation").set_index("bricks")["error_percent"]
    study = study.loc[[step.bricks for step in steps]]
    scanned = scan(engine, steps, SIDES[:: 24 if options.quick else 1])
    best = best_sides(scanned, study)
    every = {"stated": readings(), "best of 4 to 50 mm": [Reading.of(*key) for key in best.index]}
    table = pd.DataFrame(
        {"pads": pads, **row_of(engine, step, reading)}
        for pads, some in every.items()
        for reading, step in product(some, steps)
    )
    stated = table[table["pads"] == "stated"]
    errors = stated.pivot_table(index=KEYS, columns="bricks", values="error_pct", sort=False)
    report(errors, study)
    print("the best pads of 4 to 50 mm, for every grip and joint:")
    report(best, study)
    print(largest_fall(scanned, study))
    return Finding(holds(table, study), tables={"discrete_arches": table})


def picture() -> Figure:
    study = printed("de_validation").set_index("bricks")["error_percent"]
    errors, best = (
        rows.pivot_table(index=KEYS, columns="bricks", values="error_pct", sort=False)
        for _, rows in stored("discrete_arches").groupby("pads", sort=False)
    )
    nearest = farthest(best, study).sort_values().index
    return chart(errors, best.loc[nearest], study)


CLAIM = Claim(experiment, digits=4, quick="two arches", pictures={"discrete_arches.png": picture})
