"""Which readings of the printed vault tests reproduce the paper's stiffness column.

Part of `experiments.calibration.calibration`. Every reading says what span and rise measure, where
the load acts and over which width, how many bricks there are, how stiff joints are across, and what
multiplies the rotational stiffness. A reading is tried with the printed joint stiffnesses, each
full or half, and with free ones: then the smallest possible largest deviation from the column is
sought, over all tests and over some of them.
"""

from itertools import product

import numpy as np
import pandas as pd

from experiments.calibration.parts import barrel_vaults
from experiments.calibration.parts.barrel_vaults import Parts, Vault, chain, planar_parts, vaults
from seqopt.arrays import Floats

PRINTED = (1e11, 0.9e9)  # N/m³ and what is printed in kN/(rad m²), in N
POWERS = {"b": (0, 1.0), "b t": (1, 1.0), "b t2": (2, 1.0), "b t3/12": (3, 1 / 12)}
SHEAR = {"rigid": 0.0, "as along": 1.0, "a tenth": 10.0}  # compliance across over along
HALVES = ((1.0, 1.0), (0.5, 0.5), (1.0, 0.5), (0.5, 1.0))  # of k_t and of k_r
GROUPS = {"all": range(8), "2-8": range(1, 8), "3-8": range(2, 8)}
GROUPS |= {"2,3,4,6,7,8": (1, 2, 3, 5, 6, 7)}
RATIO = np.geomspace(1e-5, 1e4, 181)


def section(vault: Vault, law: str) -> float:
    """Return what multiplies the rotational stiffness."""
    power, factor = POWERS[law]
    return vault.width * vault.thickness**power * factor


def against_study(tests: tuple[Vault, ...], parts: list[Parts], law: str, k: Floats) -> Floats:
    """Return stiffnesses over the paper's (T, R) for rows (R, 2) of k_t and k_r."""
    rows = []
    for vault, part in zip(tests, parts, strict=True):
        slide, turn = k[:, 0] * vault.area, k[:, 1] * section(vault, law)
        rows.append(barrel_vaults.planar_stiffness(part, slide, turn) / vault.study)
    return np.array(rows)


def closest(logs: Floats) -> tuple[int, float, float]:
    """Return the column of logarithms with the least half-range, its middle, that half-range.

    Of some that are equal but for rounding it is the first.
    """
    top, bottom = logs.max(axis=0), logs.min(axis=0)
    half = (top - bottom) / 2
    best = int(np.argmax(half <= half.min() * (1 + 1e-9)))
    return best, float(top[best] + bottom[best]) / 2, float(half[best])


def _row(tests: tuple[Vault, ...], parts: list[Parts], law: str) -> dict[str, object]:
    """Return how one reading does with printed and with free joint stiffnesses."""
    printed = np.array([[PRINTED[0] * a, PRINTED[1] * b] for a, b in HALVES])
    ratio = against_study(tests, parts, law, printed)
    out: dict[str, object] = {}
    for percent in (5, 10):
        within = (np.abs(ratio - 1) <= percent / 100).sum(axis=0)
        out[f"within_{percent}"] = int(within.max())
        out[f"halves_{percent}"] = "{:g} {:g}".format(*HALVES[within.argmax()])
    for name, group in GROUPS.items():
        worst = np.abs(np.log(ratio[list(group)])).max(axis=0)
        out[f"printed_{name}"] = 100 * (np.exp(worst.min()) - 1)
        out[f"halves_{name}"] = "{:g} {:g}".format(*HALVES[worst.argmin()])
    for i, vault in enumerate(tests):
        out[f"printed_test_{vault.test}"] = ratio[i, 0]
    free = np.log(against_study(tests, parts, law, np.stack([np.ones_like(RATIO), RATIO], axis=1)))
    for name, group in GROUPS.items():
        best, middle, half = closest(free[list(group)])
        out[f"free_{name}"] = 100 * (np.exp(half) - 1)
        out[f"k_t_{name}"] = np.exp(-middle)
        out[f"k_r_{name}"] = np.exp(-middle) * RATIO[best]
    return out


def readings() -> pd.DataFrame:
    """Return a row per reading; ``free_*`` are the least largest deviations in percent."""
    tests, rows = vaults(), []
    lines, places = barrel_vaults.LINES, barrel_vaults.PLACES
    for line, place, fewer, spread, shear in product(lines, places, (0, 1), (0, 1), SHEAR):
        parts = [
            planar_parts(chain(v, line, place, fewer=fewer, strip=spread * v.fill), SHEAR[shear])
            for v in tests
        ]
        reading = {"line": line, "place": place, "fewer": fewer, "shear": shear}
        reading["load"] = "strip as wide as the fill is high" if spread else "line"
        rows += [{**reading, "law": law, **_row(tests, parts, law)} for law in POWERS]
    return pd.DataFrame(rows)
