"""How joints resist: laws with one pair of stiffnesses, and the pair that fits the tests best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.calibration.parts.barrel_vaults import (
    Parts,
    Vault,
    chain,
    planar_parts,
    planar_stiffness,
)
from seqopt.arrays import Floats

LAWS: dict[str, Callable[[Vault], float]] = {
    "b t": lambda v: v.width * v.thickness,
    "b t2": lambda v: v.width * v.thickness**2,
    "b t3/12": lambda v: v.width * v.thickness**3 / 12,
}  # what multiplies k_r
BED = "b t3/12"
RATIOS = (1e-6, 1e6)  # searched ratios k_r / k_t, in SI units


@dataclass(frozen=True)
class Law:
    """Vaults under one law: ``curves`` gives their stiffnesses (T, R) per unit k_t."""

    name: str
    tests: tuple[Vault, ...]
    parts: tuple[Parts, ...]
    bounds: tuple[float, float] = RATIOS

    def curves(self, ratio: Floats) -> Floats:
        """Return the stiffness of every vault for ratios (R,), per unit k_t."""
        rows = []
        for vault, parts in zip(self.tests, self.parts, strict=True):
            area = vault.width * vault.thickness
            turn = LAWS[self.name](vault) * ratio
            rows.append(planar_stiffness(parts, np.full_like(ratio, area), turn))
        return np.array(rows)

    def relative(self, ratio: Floats) -> Floats:
        """Return stiffnesses over the measured ones, per unit k_t."""
        measured = np.array([[vault.measured] for vault in self.tests])
        return np.asarray(self.curves(ratio) / measured)


def median_scale(share: Floats) -> Floats:
    """Return the factor per column that minimizes the sum of ``|factor * share - 1|``."""
    order = np.argsort(1 / share, axis=0)
    weight = np.cumsum(np.take_along_axis(share, order, axis=0), axis=0)
    place = (weight >= 0.5 * weight[-1]).argmax(axis=0)
    rows = np.take_along_axis(order, place[None], axis=0)
    return np.asarray(1 / np.take_along_axis(share, rows, axis=0)[0])


def square_scale(share: Floats) -> Floats:
    """Return the factor per column that minimizes the sum of ``(factor * share - 1)²``."""
    return np.asarray(share.sum(axis=0) / (share**2).sum(axis=0))


MEASURES: dict[str, tuple[Callable[[Floats], Floats], int]] = {
    "absolute": (median_scale, 1),
    "squares": (square_scale, 2),
}  # best factor, and the power of the errors that are summed


def fit(law: Law, measure: str, kept: Floats) -> tuple[float, float]:
    """Return the k_t and k_r that fit the tests in ``kept`` (T,) bool best."""
    scale_of, power = MEASURES[measure]
    low, high = np.log(law.bounds)
    for _ in range(4):
        ratio = np.exp(np.linspace(low, high, 401))
        share = law.relative(ratio)[kept]
        scale = scale_of(share)
        best = int((np.abs(scale * share - 1) ** power).sum(axis=0).argmin())
        step = (high - low) / 400
        center = np.log(ratio[best])
        low = max(center - 2 * step, np.log(law.bounds[0]))
        high = min(center + 2 * step, np.log(law.bounds[1]))
    return float(scale[best]), float(scale[best] * ratio[best])


def errors(law: Law, pair: tuple[float, float]) -> Floats:
    """Return the relative errors (T,) at given k_t and k_r."""
    return np.asarray(pair[0] * law.relative(np.array([pair[1] / pair[0]]))[:, 0] - 1)


def laws(tests: tuple[Vault, ...]) -> dict[str, Law]:
    """Return the laws by label; the last one has a single number."""
    parts = tuple(planar_parts(chain(vault)) for vault in tests)
    out = {name: Law(name, tests, parts) for name in LAWS}
    return out | {f"{BED}, k_r = k_t": Law(BED, tests, parts, (1.0, 1.0))}
