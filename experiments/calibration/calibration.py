"""Claim: a bed of springs fits the eight vault tests better than the paper only where it is fitted.

A bed of springs over the area of a joint has a linear stiffness ``k_t b t`` and a rotational one
``k_r b t³ / 12``. Minimized over one pair of values, its mean absolute error over the measured
stiffnesses is below the 19.0 % of the column that Bruun et al. print; two tests are then met
exactly, by construction. With a rotational stiffness in proportion to the area or to ``b t²`` no
pair of values is below it. Beyond that the tests do not say which is closer: the paired gain is
within its 95 % interval of none, and with the law chosen anew for every test left out the paper's
column is closer. The claim fails if any of this does not come out.

Method: every vault is a chain of rigid bricks with joints at both abutments. Under each law the
stiffness is ``k_t`` times a function of ``k_r / k_t``. For a given ratio the best ``k_t`` is known
in closed form (a weighted median for absolute errors, a quotient for squares), so one search over
the ratio finds the global optimum. Every test is also predicted from a fit to the other seven. The
confidence region holds all pairs whose sum of squares is at most ``1 + p F(p, 8 - 2) / (8 - 2)``
times the smallest, ``p = 2``; a profile has ``p = 1``. What bounds ``k_r`` is found by other routes
too, and with joints stiffer or softer across (`experiments.calibration.parts.calibration_spread`).
Every fitted stiffness is computed again with the compliance operator of the scene. How the paper's
own column comes about is the subject of `experiments.calibration.parts.calibration_readings`.

Inputs: ``arch_tests.csv``, ``arch_stiffness.csv`` in ``seqopt/data/paper``. Command: ``python -m
experiments.calibration.calibration [--quick]``. Writes ``experiments/results/calibration.csv``,
``calibration_fits.csv``, ``calibration_comparison.csv``, ``calibration_routes.csv``,
``calibration_geometry.csv``, ``calibration_readings.csv``, ``calibration_entries.csv`` and
``docs/figures/calibration.png``.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.calibration.parts.barrel_vaults import (
    BED,
    LAWS,
    LINES,
    MEASURES,
    PLACES,
    Law,
    Vault,
    chain,
    errors,
    fit,
    laws,
    load_stiffness,
    planar_parts,
    scene,
    vaults,
)
from experiments.calibration.parts.calibration_chart import chart
from experiments.calibration.parts.calibration_readings import entries, readings, summary
from experiments.calibration.parts.calibration_spread import (
    ANEW,
    GAIN_HIGH,
    GAIN_LOW,
    IN_SAMPLE,
    comparison,
    interval,
    left_out,
    rotational,
    threshold,
    whole,
)
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import stored
from seqopt.arrays import Floats


def turning_share(law: Law, pair: tuple[float, float]) -> Floats:
    """Return d ln k / d ln k_r (T,); that of k_t is one minus it."""
    step = 1e-4
    near = pair[1] / pair[0] * np.exp([-step, step])
    return np.asarray(np.diff(np.log(law.curves(near)), axis=1)[:, 0] / (2 * step))


def squares(law: Law, k_t: Floats, k_r: Floats) -> Floats:
    """Return sums of squares for pairs of any shape; curves are interpolated."""
    place = np.log(k_r / k_t)
    low, high = float(np.exp(place.min())), float(np.exp(place.max()))
    ratio = np.geomspace(low, high, 4001 if high > low else 1)
    curves = np.log(law.relative(ratio))
    shares = (np.exp(np.interp(place, np.log(ratio), curve)) for curve in curves)
    return np.asarray(sum((k_t * share - 1) ** 2 for share in shares))


def profiles(law: Law) -> dict[str, tuple[Floats, Floats]]:
    """Return values of k_t and of k_r with the least sum of squares for each, the other free."""
    k_t, k_r = np.geomspace(1e8, 1e14, 801), np.geomspace(1e7, 1e15, 1001)
    if law.bounds[0] == law.bounds[1]:
        return {"k_t": (k_t, squares(law, k_t, k_t)), "k_r": (k_r, squares(law, k_r, k_r))}
    plane = squares(law, k_t[:, None], k_r)
    return {"k_t": (k_t, plane.min(axis=1)), "k_r": (k_r, plane.min(axis=0))}


def intervals(law: Law) -> dict[str, float]:
    """Return the 95 % profile intervals of k_t and k_r; an open end is 0 or infinite."""
    limit = threshold(1, 1 if law.bounds[0] == law.bounds[1] else 2)
    out = {}
    for name, (values, sums) in profiles(law).items():
        out[f"{name}_from"], out[f"{name}_to"] = interval(values, sums, limit)
    return out


def geometries(tests: tuple[Vault, ...]) -> pd.DataFrame:
    """Return the fit of the bed of springs under other readings of span, rise and load."""
    rows = []
    for line, place in product(LINES, PLACES):
        law = Law(BED, tests, tuple(planar_parts(chain(v, line, place)) for v in tests))
        pair = fit(law, "absolute", whole(law))
        row: dict[str, object] = {"line": line, "place": place, "k_t": pair[0], "k_r": pair[1]}
        row["mean_absolute_percent"] = 100 * np.abs(errors(law, pair)).mean()
        row["left_out_percent"] = 100 * np.abs(left_out(law, "absolute")[1]).mean()
        rows.append(row)
    return pd.DataFrame(rows)


def tabulate(law: Law, measure: str, label: str) -> tuple[pd.DataFrame, dict[str, object]]:
    """Return a row per test and one summary row for one law and measure."""
    pair = fit(law, measure, whole(law))
    error, out = errors(law, pair), left_out(law, measure)[1]
    share = turning_share(law, pair)
    rows, gap = [], 0.0
    for i, vault in enumerate(law.tests):
        area, turn = vault.width * vault.thickness, LAWS[law.name](vault)
        k = load_stiffness(scene(vault, pair[0] * area, pair[1] * turn), chain(vault).loads[0])
        gap = max(gap, abs(k / (vault.measured * (1 + error[i])) - 1))
        row = {"law": label, "measure": measure, "test": vault.test, "k_e": vault.measured / 1e6}
        row |= {"k_m": vault.study / 1e6, "k_fit": k / 1e6, "turning_share": share[i]}
        row |= {"paper_percent": 100 * (vault.study / vault.measured - 1)}
        rows.append(row | {"fit_percent": 100 * error[i], "left_out_percent": 100 * out[i]})
    total = {"law": label, "measure": measure, "k_t": pair[0], "k_r": pair[1]}
    total |= {"mean_absolute_percent": 100 * np.abs(error).mean()}
    total |= {"root_mean_square_percent": 100 * np.sqrt((error**2).mean())}
    total |= {"left_out_percent": 100 * np.abs(out).mean(), "left_out_worst": 100 * max(abs(out))}
    return pd.DataFrame(rows), total | {"engine_gap": gap}


def experiment(options: Options) -> Finding:
    quick: bool = options.quick
    tests = vaults()
    models = laws(tests)
    parts = [tabulate(law, m, label) for label, law in models.items() for m in MEASURES]
    table, fits = pd.concat([p[0] for p in parts]), pd.DataFrame([p[1] for p in parts])
    if not quick:
        ends = {label: intervals(law) for label, law in models.items()}
        fits = fits.join(pd.DataFrame([ends[label] for label in fits["law"]]))
    print(fits.to_string(index=False, float_format="%.4g"))
    bed = table[(table["law"] == BED) & (table["measure"] == "absolute")]
    print(bed.drop(columns=["law", "measure"]).to_string(index=False, float_format="%.3g"))
    beside = comparison(models)
    print(beside.to_string(index=False, float_format="%.2f", na_rep=""))
    good = holds(fits, beside) and bool(fits["engine_gap"].max() <= 1e-9)
    if quick:
        return Finding(good)
    kept = fits.drop(columns="engine_gap")  # rounding, another on every machine
    tables = {"": table, "_fits": kept, "_comparison": beside, **spread(models[BED])}
    return Finding(good, tables={f"calibration{end}": rows for end, rows in tables.items()})


def holds(fits: pd.DataFrame, beside: pd.DataFrame) -> bool:
    """Return whether the bed alone leads in what is minimized, and nothing else says it leads."""
    error = fits[fits["measure"] == "absolute"].set_index("law")["mean_absolute_percent"]
    own, paper = (beside.set_index("what")[f"{name}_percent"] for name in ("bed", "paper"))
    leads = error[BED] < paper[IN_SAMPLE] < error[["b t", "b t2"]].min()
    open_still = own[GAIN_LOW] < 0 < own[GAIN_HIGH] and own[ANEW] > paper[ANEW]
    return bool(leads and open_still)


def spread(bed: Law) -> dict[str, pd.DataFrame]:
    """Return what else is stored of the bed of springs, by the ends of the tables' names."""
    scan, single, other = readings(), entries(), geometries(bed.tests)
    print(summary(scan))
    bounds = rotational(bed.tests)
    for frame in (single, other, bounds):
        print(frame.to_string(index=False, float_format="%.4g"))
    return {"_readings": scan, "_entries": single, "_geometry": other, "_routes": bounds}


def picture() -> Figure:
    """Return the figure from stored rows and the curves around them."""
    models = laws(vaults())
    bed = models[BED]
    k_t, k_r = np.geomspace(1e10, 2e12, 161), np.geomspace(3e10, 1e12, 161)
    joint = next(v for v in bed.tests if v.thickness == 0.215)
    curves = {}
    for label, section in LAWS.items():
        values, sums = profiles(models[label])["k_r"]
        curves[label] = (values * section(joint) / joint.width, sums)
    region = (k_t, k_r, squares(bed, k_t[:, None], k_r))
    outs = {measure: left_out(bed, measure)[0] for measure in MEASURES}
    levels = threshold(1, 2), threshold(2, 2)
    table = stored("calibration")
    rows = table[table["law"] == BED]
    return chart(
        rows, stored("calibration_fits"), region=region, levels=levels, outs=outs, profiles=curves
    )


CLAIM = Claim(
    experiment,
    digits=4,
    quick="no readings, nothing written",
    pictures={"calibration.png": picture},
)

if __name__ == "__main__":
    CLAIM.main()
