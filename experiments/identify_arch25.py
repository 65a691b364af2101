"""Claim: numbers with a meaning reproduce both printed tables of the 25-brick arch.

The study prints span, height, brick and pattern of its arch but no coordinates, and joint
stiffnesses per area. This experiment recovers the rest from Tables A.1 and A.2 alone. The responses
of the three-robot plan take no part.

Method: the shape is a chain of bricks (`seqopt.arch`) with

- a pitch per brick (25 numbers), at first a catenary over the stated span and height;
- one angle by which the surface is turned in plan against the arch's plane, which tilts every
  brick that lies across by that angle times the sine of its pitch (1);
- a yaw of every brick that lies along the arch (9), so that the line may leave its plane;
- gap, overhang, stub, one linear and one rotational joint stiffness (5);
- in a second stage, a radial offset of every brick from the line between its joints (25), drawn
  towards zero, while the pitch is drawn towards a cubic spline through 9 knots.

Robust least squares (`scipy.optimize.least_squares`) on all responses but T_pct, relative to the
printed size or 1 and forgiving the rounding of print, with equal states counted once. There are
several local minima; the first stage starts from several plan angles and the best goes on.

Inputs: the tables that ship with the package. Command: ``python -m experiments.identify_arch25
[--quick] [--cross] [--variants]``. Writes ``seqopt/data/scenes/arch25.json`` and
``experiments/results/identify_arch25.csv``; ``--cross`` fits one table, scores the states that only
the other has, and writes ``identify_arch25_cross.csv``; ``--variants`` repeats the first stage with
other sets of numbers and writes ``identify_arch25_variants.csv``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, least_squares

from experiments.plotting import RESULTS
from experiments.yardstick import VALUES, errors, percentiles, tension_share
from seqopt.arch import ArchShape, arch_scene
from seqopt.compliance import ComplianceEngine
from seqopt.methods import METHODS
from seqopt.network import Floats, network
from seqopt.paper import printed_steps
from seqopt.responses import TO_1E_3MM, analyze, responses
from seqopt.scene import Scene
from seqopt.scene_file import load_scene, save_scene

SCENE = Path(__file__).parent.parent / "seqopt" / "data" / "scenes" / "arch25.json"
SPAN, HEIGHT, BRICKS = 2.08, 1.93, 25  # m, section 3.1
# Which node of a brick that lies across is on the arch line: the grips that twist in A.1 and A.2.
LINE_NODES = {2: 2, 3: 4, 5: 9, 6: 10, 8: 15, 9: 16, 11: 21, 12: 22, 14: 26, 15: 28,
              17: 32, 18: 34, 20: 39, 21: 40, 23: 45, 24: 46}  # fmt: skip
ALONG = [b for b in range(BRICKS) if b % 3 == 0]
ACROSS = [b for b in range(BRICKS) if b % 3 != 0]
PLAN_ANGLES = np.radians([-5.0, 5.0])
SOFTENING = (0.1, 0.03, 0.02, 0.01)  # residuals above this share count less and less
OFFSET_PRIOR = 5.0  # residual per m: an offset of 1 mm weighs like an error of 0.5 %
PITCH_PRIOR = 1.7  # residual per rad from a smooth pitch: 1 degree weighs like an error of 3 %
PROVENANCE = (
    "Geometry and joint stiffness identified from Tables A.1 and A.2 of Bruun et al., arXiv "
    "2104.04856, by experiments/identify_arch25.py; brick, density, payload and pattern as printed "
    "there (section 3.1)."
)


@dataclass(frozen=True)
class Free:
    """A group of fitted numbers: name, unit, how many, and a typical change."""

    name: str
    unit: str
    count: int
    step: float


SHAPE = (
    Free("pitch", "rad", BRICKS, 0.05),
    Free("plan_angle", "rad", 1, 0.03),
    Free("yaw", "rad", len(ALONG), 0.02),
    Free("gap", "m", 1, 1e-3),
    Free("overhang", "m", 1, 1e-3),
    Free("stub", "m", 1, 5e-3),
    Free("log_translational_stiffness", "ln N/m", 1, 0.05),
    Free("log_rotational_stiffness", "ln N m/rad", 1, 0.05),
)
OFFSETS = Free("offset", "m", BRICKS, 1e-3)
TILTS = Free("tilt", "rad", BRICKS - len(ALONG), 0.03)  # in the place of the plan angle
ALONG_AND_ACROSS = (
    Free("log_translational_stiffness", "ln N/m", 2, 0.05),
    Free("log_rotational_stiffness", "ln N m/rad", 2, 0.05),
)
NO_YAW = tuple(group for group in SHAPE if group.name != "yaw")
VARIANTS = {
    "first stage": SHAPE,
    "line in a plane": NO_YAW,
    "free tilts": tuple(TILTS if g.name == "plan_angle" else g for g in SHAPE),
    "free tilts, line in a plane": tuple(TILTS if g.name == "plan_angle" else g for g in NO_YAW),
    "joints along and across": (*SHAPE[:-2], *ALONG_AND_ACROSS),
}


def unpack(numbers: Floats, groups: Sequence[Free]) -> dict[str, Floats]:
    """Return the numbers by the name of their group."""
    ends = np.cumsum([group.count for group in groups])
    return dict(zip((g.name for g in groups), np.split(numbers, ends[:-1]), strict=True))


def scene_of(numbers: Floats, groups: Sequence[Free]) -> Scene:
    """Return the scene that the numbers describe."""
    part = unpack(numbers, groups)
    pitch = part["pitch"]
    yaw, roll = np.zeros(BRICKS), part.get("plan_angle", 0.0) * np.sin(pitch)
    if "yaw" in part:
        yaw[ALONG] = part["yaw"]
    if "tilt" in part:
        roll[ACROSS] = part["tilt"]
    linear, angular = (
        np.exp(part[f"log_{kind}_stiffness"]) for kind in ("translational", "rotational")
    )
    shape = ArchShape(
        pitch=pitch.tolist(),
        roll=roll.tolist(),
        yaw=yaw.tolist(),
        offset=part.get("offset", np.zeros(BRICKS)).tolist(),
        gap=float(part["gap"][0]),
        overhang=float(part["overhang"][0]),
        stub=float(part["stub"][0]),
        translational_stiffness=(float(linear[0]), float(linear[-1]), float(linear[-1])),
        rotational_stiffness=(float(angular[0]), float(angular[-1]), float(angular[-1])),
    )
    return arch_scene(shape, "arch25", line_nodes=LINE_NODES, provenance=PROVENANCE)


def starting_guess() -> Floats:
    """Return a catenary over the stated span and height, nominal joints, no tilt and no yaw."""
    half = SPAN / 2
    a = brentq(lambda c: c * (np.cosh(half / c) - 1) - HEIGHT, 0.1, 5.0)
    length = np.where(np.arange(BRICKS) % 3 == 0, 0.246, 0.116) + 0.014
    middle = np.cumsum(length) - length / 2
    along = (middle / length.sum() - 0.5) * 2 * a * np.sinh(half / a)
    pitch = np.arctan(-along / a)
    area = 0.116 * 0.053  # contact, m²; the study prints stiffness per area, two springs in series
    stiffness = np.log([100e9 * area / 2, 0.9e9 * area / 2])
    return np.concatenate([pitch, [0.0], np.zeros(len(ALONG)), [0.014, 0.0615, 0.09], stiffness])


@dataclass(frozen=True)
class Target:
    """Printed responses of different states, grouped so that each group is one batch."""

    groups: tuple[tuple[int, np.ndarray, np.ndarray], ...]  # bricks, grips (S, r), columns (r,)
    responses: Floats  # (states, columns of the yardstick)


def target(tables: Sequence[pd.DataFrame]) -> Target:
    """Return every different state of the tables once."""
    rows = pd.concat(tables, ignore_index=True)
    nodes = rows[[f"rob{i}_node" for i in (1, 2, 3)]].to_numpy(float)
    keys = [(int(b), *np.nan_to_num(n, nan=-1)) for b, n in zip(rows["bricks"], nodes, strict=True)]
    first = sorted({key: i for i, key in reversed(list(enumerate(keys)))}.values())
    by_shape: dict[tuple[int, tuple[int, ...]], list[int]] = {}
    for i in first:
        held = tuple(np.flatnonzero(~np.isnan(nodes[i])).tolist())
        by_shape.setdefault((keys[i][0], held), []).append(i)
    groups = tuple(
        (bricks, nodes[which][:, list(held)].astype(np.int64), np.array(held, dtype=np.int64))
        for (bricks, held), which in by_shape.items()
    )
    order = [i for which in by_shape.values() for i in which]
    return Target(groups, rows[list(VALUES)].to_numpy(float)[order])


def produced(scene: Scene, wanted: Target) -> Floats:
    """Return the responses of a scene in the states of a target, in its order and columns."""
    engine = ComplianceEngine(network(scene))
    out = []
    for bricks, grips, robots in wanted.groups:
        answer = responses(engine, engine.solve(bricks, grips))
        force = np.full((len(grips), 3), np.nan)
        force[:, robots] = answer.F_rob
        size = [TO_1E_3MM * d for d in (answer.D_max, answer.D_avg, answer.D_std)]
        rest = [answer.F_sup, answer.M_sup, answer.F_min, answer.F_max, answer.F_avg, *size]
        out.append(np.column_stack([force, *rest]))
    return np.vstack(out)


def residuals(scene: Scene, wanted: Target) -> Floats:
    """Return relative differences, small ones within the rounding of print shrunk."""
    got, want = produced(scene, wanted), wanted.responses.copy()
    got[:, :4], want[:, :4] = np.abs(got[:, :4]), np.abs(want[:, :4])
    gap = (got - want)[~np.isnan(want)]
    size = np.maximum(np.abs(want[~np.isnan(want)]), 1.0)
    beyond = np.where(np.abs(gap) < 0.04, 0.3 * gap, gap - 0.028 * np.sign(gap))
    return np.asarray(beyond / size)


def roughness() -> Floats:
    """Return the map from pitch to its deviation from the nearest cubic spline of 9 knots."""
    knots = np.linspace(0, BRICKS - 1, 9)
    splines = CubicSpline(knots, np.eye(len(knots)))(np.arange(BRICKS))
    return np.asarray(np.eye(BRICKS) - splines @ np.linalg.pinv(splines))


def fit(numbers: Floats, groups: Sequence[Free], wanted: Target, most: int) -> tuple[Floats, float]:
    """Return the fitted numbers and the robust cost that remains."""
    step = np.concatenate([np.full(group.count, group.step) for group in groups])
    rough = roughness()

    def cost(scaled: Floats) -> Floats:
        numbers = scaled * step
        out = residuals(scene_of(numbers, groups), wanted)
        if groups[-1] is not OFFSETS:
            return out
        prior = OFFSET_PRIOR * numbers[-BRICKS:], PITCH_PRIOR * rough @ numbers[:BRICKS]
        return np.concatenate([out, *prior])

    scaled, remaining = numbers / step, np.inf
    for softening in SOFTENING:
        answer = least_squares(cost, scaled, loss="soft_l1", f_scale=softening, max_nfev=most)
        scaled, remaining = answer.x, float(answer.cost)
    return scaled * step, remaining


def identify(wanted: Target, angles: Sequence[float], most: int) -> tuple[Floats, Sequence[Free]]:
    """Return the fitted numbers, and what they are, from the documented starting guess."""
    fits = []
    for angle in angles:
        start = starting_guess()
        start[BRICKS] = angle
        fits.append(fit(start, SHAPE, wanted, most))
        print(
            f"plan angle from {np.degrees(angle):5.1f}°: robust cost {fits[-1][1]:.4f}", flush=True
        )
    best = min(fits, key=lambda entry: entry[1])[0]
    groups = (*SHAPE, OFFSETS)
    numbers, remaining = fit(np.concatenate([best, np.zeros(BRICKS)]), groups, wanted, most)
    print(f"with offsets: robust cost {remaining:.4f}", flush=True)
    return numbers, groups


def scores(scene: Scene) -> pd.DataFrame:
    """Return the yardstick of a scene on both tables."""
    engine = ComplianceEngine(network(scene))
    rows, all_errors = {}, []
    for name, method in METHODS.items():
        printed, table = printed_steps(name), analyze(engine, method(engine.network))
        all_errors.append(errors(table, printed))
        rows[name] = (*percentiles(all_errors[-1]), 100 * tension_share(table, printed))
    rows["both"] = (*percentiles(pd.concat(all_errors)), np.nan)
    columns = ["median_pct", "p90_pct", "p95_pct", "T_pct_within_2_edges_pct"]
    return pd.DataFrame.from_dict(rows, orient="index", columns=columns)


def cross(most: int) -> pd.DataFrame:
    """Fit one table, score the rows that only the other has."""
    rows = []
    for known, other in (("sequential", "cantilever"), ("cantilever", "sequential")):
        numbers, groups = identify(target([printed_steps(known)]), PLAN_ANGLES, most)
        engine = ComplianceEngine(network(scene_of(numbers, groups)))
        table = errors(analyze(engine, METHODS[other](engine.network)), printed_steps(other))
        unseen = printed_steps(other)["same_in_both"].to_numpy() == 0
        rows.append((known, other, *percentiles(table[unseen])))
    return pd.DataFrame(rows, columns=["fitted", "scored", "median_pct", "p90_pct", "p95_pct"])


def start_of(groups: Sequence[Free]) -> Floats:
    """Return the starting guess for a set of numbers, tilted by the first plan angle."""
    begin = unpack(starting_guess(), SHAPE)
    begin["plan_angle"] = PLAN_ANGLES[:1]
    begin["tilt"] = (PLAN_ANGLES[0] * np.sin(begin["pitch"]))[ACROSS]
    return np.concatenate([np.resize(begin[group.name], group.count) for group in groups])


def compare_variants(wanted: Target, most: int) -> pd.DataFrame:
    """Fit the first stage with every set of numbers, from the same start."""
    rows = []
    for name, groups in VARIANTS.items():
        numbers, remaining = fit(start_of(groups), groups, wanted, most)
        limits = scores(scene_of(numbers, groups)).loc["both"]
        rows.append({"variant": name, "numbers": len(numbers), "cost": remaining, **limits})
        print(pd.DataFrame(rows[-1:]).to_string(index=False, header=len(rows) == 1), flush=True)
    return pd.DataFrame(rows).drop(columns="T_pct_within_2_edges_pct")


def report(numbers: Floats, groups: Sequence[Free]) -> pd.DataFrame:
    """Return every fitted number with its name and unit."""
    rows = [
        {"name": group.name, "index": i, "unit": group.unit, "value": value}
        for group in groups
        for i, value in enumerate(unpack(numbers, groups)[group.name].tolist())
    ]
    return pd.DataFrame(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="two iterations, nothing written")
    parser.add_argument("--cross", action="store_true", help="cross-validation between the tables")
    parser.add_argument("--variants", action="store_true", help="other sets of numbers")
    options = parser.parse_args()
    if options.cross:
        table = cross(40)
        print(table.to_string(index=False, float_format="%.2f"))
        table.to_csv(RESULTS / "identify_arch25_cross.csv", index=False, float_format="%.3f")
        return
    both = target([printed_steps(name) for name in METHODS])
    if options.variants:
        table = compare_variants(both, 40)
        table.to_csv(RESULTS / "identify_arch25_variants.csv", index=False, float_format="%.4g")
        return
    angles, most = (PLAN_ANGLES[:1], 2) if options.quick else (PLAN_ANGLES, 40)
    numbers, groups = identify(both, angles, most)
    print(scores(scene_of(numbers, groups)).to_string(float_format="%.2f"))
    if not options.quick:
        save_scene(scene_of(numbers, groups), SCENE)
        RESULTS.mkdir(exist_ok=True)
        report(numbers, groups).to_csv(
            RESULTS / "identify_arch25.csv", index=False, float_format="%.6g"
        )
    shipped = scores(load_scene("arch25"))
    print("shipped scene")
    print(shipped.to_string(float_format="%.2f"))
    limits = shipped.loc["both", ["median_pct", "p90_pct", "p95_pct"]].to_numpy(float)
    holds = bool((limits <= [0.15, 1.9, 4.0]).all())
    print(f"verdict: the claim {'holds' if holds else 'does not hold'}: {len(numbers)} numbers")


if __name__ == "__main__":
    main()
