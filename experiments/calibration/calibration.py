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
the ratio finds the global optimum, which is computed again with the compliance operator of the
scene. Every test is also predicted from a fit to the other seven. The confidence region holds all
pairs whose sum of squares is at most ``1 + p F(p, 8 - 2) / (8 - 2)`` times the smallest, ``p = 2``;
a profile has ``p = 1``. What else bounds ``k_r`` is in `calibration_spread`, how the paper's own
column comes about in `calibration_readings`, both of `experiments.calibration.parts`.

Inputs: ``arch_tests.csv``, ``arch_stiffness.csv`` in ``seqopt/data/paper``. Command: ``python -m
experiments calibration [--quick]``.
"""

from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.calibration.parts import barrel_vaults as barrel
from experiments.calibration.parts import calibration_spread as spread
from experiments.calibration.parts.barrel_vaults import BED, LAWS, MEASURES, Law, laws, vaults
from experiments.calibration.parts.calibration_chart import chart
from experiments.calibration.parts.calibration_readings import entries, readings, summary
from experiments.calibration.parts.calibration_spread import left_out, threshold, whole
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
        out[f"{name}_from"], out[f"{name}_to"] = spread.interval(values, sums, limit)
    return out


def geometries(tests: tuple[barrel.Vault, ...]) -> pd.DataFrame:
    rows = []
    for line, place in product(barrel.LINES, barrel.PLACES):
        chains = (barrel.chain(vault, line, place) for vault in tests)
        law = Law(BED, tests, tuple(map(barrel.planar_parts, chains)))
        pair = barrel.fit(law, "absolute", whole(law))
        row = {"line": line, "place": place, "k_t": pair[0], "k_r": pair[1]}
        row |= {"mean_absolute_percent": spread.mean_size(barrel.errors(law, pair))}
        rows.append(row | {"left_out_percent": spread.mean_size(left_out(law, "absolute")[1])})
    return pd.DataFrame(rows)


def tabulate(law: Law, measure: str, label: str) -> tuple[pd.DataFrame, dict[str, object]]:
    pair = barrel.fit(law, measure, whole(law))
    error, out = barrel.errors(law, pair), left_out(law, measure)[1]
    share = turning_share(law, pair)
    rows, gap = [], 0.0
    for i, vault in enumerate(law.tests):
        made = barrel.scene(vault, pair[0] * vault.area, pair[1] * LAWS[law.name](vault))
        k = barrel.load_stiffness(made, barrel.chain(vault).loads[0])
        gap = max(gap, abs(k / (vault.measured * (1 + error[i])) - 1))
        row = {"law": label, "measure": measure, "test": vault.test, "k_e": vault.measured / 1e6}
        row |= {"k_m": vault.study / 1e6, "k_fit": k / 1e6, "turning_share": share[i]}
        row |= {"paper_percent": 100 * (vault.study / vault.measured - 1)}
        rows.append(row | {"fit_percent": 100 * error[i], "left_out_percent": 100 * out[i]})
    total = {"law": label, "measure": measure, "k_t": pair[0], "k_r": pair[1]}
    total |= {"mean_absolute_percent": spread.mean_size(error)}
    total |= {"root_mean_square_percent": spread.root_mean_square(error)}
    total |= {"left_out_percent": spread.mean_size(out), "left_out_worst": 100 * max(abs(out))}
    return pd.DataFrame(rows), total | {"engine_gap": gap}


def experiment(options: Options) -> Finding:
    models = laws(vaults())
    parts = [tabulate(law, m, label) for label, law in models.items() for m in MEASURES]
    table, fits = pd.concat([p[0] for p in parts]), pd.DataFrame([p[1] for p in parts])
    if not options.quick:
        ends = {label: intervals(law) for label, law in models.items()}
        fits = fits.join(pd.DataFrame([ends[label] for label in fits["law"]]))
    print(fits.to_string(index=False, float_format="%.4g"))
    bed = table[(table["law"] == BED) & (table["measure"] == "absolute")]
    print(bed.drop(columns=["law", "measure"]).to_string(index=False, float_format="%.3g"))
    beside = spread.comparison(models)
    print(beside.to_string(index=False, float_format="%.2f", na_rep=""))
    good = holds(fits, beside) and bool(fits["engine_gap"].max() <= 1e-9)
    if options.quick:
        return Finding(good)
    kept = fits.drop(columns="engine_gap")  # rounding, another on every machine
    tables = {"": table, "_fits": kept, "_comparison": beside, **others(models[BED])}
    return Finding(good, tables={f"calibration{end}": rows for end, rows in tables.items()})


def holds(fits: pd.DataFrame, beside: pd.DataFrame) -> bool:
    error = fits[fits["measure"] == "absolute"].set_index("law")["mean_absolute_percent"]
    own, paper = (beside.set_index("what")[f"{name}_percent"] for name in ("bed", "paper"))
    leads = error[BED] < paper[spread.IN_SAMPLE] < error[["b t", "b t2"]].min()
    unsure = own[spread.GAIN_LOW] < 0 < own[spread.GAIN_HIGH]
    return bool(leads and unsure and own[spread.ANEW] > paper[spread.ANEW])


def others(bed: Law) -> dict[str, pd.DataFrame]:
    scan, single, other = readings(), entries(), geometries(bed.tests)
    print(summary(scan))
    bounds = spread.rotational(bed.tests)
    for frame in (single, other, bounds):
        print(frame.to_string(index=False, float_format="%.4g"))
    return {"_readings": scan, "_entries": single, "_routes": bounds}


def picture() -> Figure:
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
    rows, fits = stored("calibration"), stored("calibration_fits")
    bed_rows = rows[rows["law"] == BED]
    return chart(bed_rows, fits, region=region, levels=levels, outs=outs, profiles=curves)


CLAIM = Claim(experiment, digits=4, quick="no readings", pictures={"calibration.png": picture})
