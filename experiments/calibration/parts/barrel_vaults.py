"""Eight full-scale barrel-vault load tests: their geometry, scenes, and stiffness by two routes.

A vault is a chain of rigid bricks with a joint between neighbors and one at either abutment. A
line load across its whole width acts at one place; stiffness is load over vertical displacement
there. `load_stiffness` takes it from the compliance operator of a scene. `planar_parts` and
`planar_stiffness` derive it by hand: cut one abutment, let statics give what every joint transmits,
and let the energy of the springs (Castigliano) give the three unknowns and the displacement.
Lengths are in m, forces in N.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats
from seqopt.engines.rigid._growth import grow_tree
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.network.network import build_network
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene import Scene
from seqopt.study import SOURCE, printed


@dataclass(frozen=True)
class Vault:
    """One tested vault: as printed, with measured and the paper's stiffness in N/m."""

    test: int
    reference: str
    span: float
    rise: float
    width: float
    thickness: float
    bricks: int
    fill: float
    load_at: float
    density: float
    measured: float
    study: float

    @property
    def area(self) -> float:
        """Area of a joint, m²."""
        return self.width * self.thickness


PRINTED = [
    "test", "reference", "L_m", "r_m", "b_m", "t_mm", "n_bricks", "h_mm", "x_m",
    "gamma_m_kg_m3", "k_e_kN_mm", "k_m_kN_mm",
]  # columns, in the order of `Vault`  # fmt: skip


def vaults() -> tuple[Vault, ...]:
    """Return the eight tests; column ``r`` is the rise (see the documentation)."""
    table = printed("arch_tests").merge(printed("arch_stiffness"), on=["test", "reference"])
    table[["t_mm", "h_mm"]] /= 1e3
    table[["k_e_kN_mm", "k_m_kN_mm"]] *= 1e6
    return tuple(Vault(*row) for row in table[PRINTED].itertuples(index=False, name=None))


class Chain(NamedTuple):
    """Joints (J, 2) from the first abutment to the last, slopes (J,), and where loads act (Q,)."""

    points: Floats
    slope: Floats
    loads: Floats


def chain(vault: Vault) -> Chain:
    """Return the joints, at half the thickness, and the load of a vault.

    The printed span and rise are of the intrados, an arc; the load stands off the springing.
    """
    half = 2 * np.arctan(2 * vault.rise / vault.span)
    radius = vault.span / 2 / np.sin(half) + vault.thickness / 2
    turn = np.linspace(-half, half, vault.bricks + 1)
    points = radius * np.stack([np.sin(turn), np.cos(turn)], axis=1)
    at = np.array([vault.load_at - vault.span / 2])
    return Chain(points - points[0], -turn, at - points[0, 0])


def scene(vault: Vault, translational: float, rotational: float) -> Scene:
    """Return a vault as a scene; every joint has these stiffnesses in all directions."""
    points = chain(vault).points
    step = np.diff(points, axis=0)
    shape = ArchShape(
        pitch=np.arctan2(step[:, 1], step[:, 0]).tolist(),
        pattern="V",
        gap=0.0,
        dimensions=(float(np.hypot(*step[0])), vault.width, vault.thickness),
        density=vault.density,
        translational_stiffness=(translational,) * 3,
        rotational_stiffness=(rotational,) * 3,
    )
    source = f"test {vault.test}, {vault.reference}, after {SOURCE}"
    return arch_scene(shape, f"vault{vault.test}", provenance=source)


def load_stiffness(built: Scene, at: float) -> float:
    """Return load over vertical displacement of a line load at a distance from the first joint.

    A brick is rigid: a load between its inner nodes acts on both in inverse proportion to the
    distance, and what it displaces follows from theirs in the same proportion.
    """
    frame = build_network(built)
    tree = grow_tree(frame)
    bricks = len(built.bricks)
    if len(tree.spring) < bricks:
        raise ValueError("a joint has no stiffness; give it some")
    vertical = OperatorBuilder(frame, tree).operator(bricks).flexibility[2::3, 2::3]
    x = frame.node_position[frame.inner, 0]
    far_ends = x.mean(axis=1) + (x[:, 1] - x[:, 0])
    brick = int((far_ends[:-1] <= at).sum())
    share = (at - x[brick, 0]) / (x[brick, 1] - x[brick, 0])
    weight = np.zeros(2 * bricks)
    weight[2 * brick : 2 * brick + 2] = 1 - share, share
    return float(1 / (weight @ vertical @ weight))


class Parts(NamedTuple):
    """Energies of unit forces: of the three unknowns, mixed, and of the load.

    Those of translation are per unit compliance along a joint, those of rotation per unit
    compliance of turning.
    """

    unknown: tuple[Floats, Floats]
    mixed: tuple[Floats, Floats]
    load: tuple[float, float]


def _transmitted(points: Floats, slope: Floats, at: Floats) -> Floats:
    """Return thrust, shear and moment (J, 3, 3) at joints of a force in x, in y, a couple at x."""
    cos, sin = np.cos(slope), np.sin(slope)
    arm = at - points
    out = np.zeros((len(points), 3, 3))
    out[:, 0, 0], out[:, 0, 1] = cos, sin
    out[:, 1, 0], out[:, 1, 1] = -sin, cos
    out[:, 2, 0], out[:, 2, 1], out[:, 2, 2] = -arm[:, 1], arm[:, 0], 1.0
    return out


def planar_parts(chain: Chain) -> Parts:
    """Return the energies of a chain whose joints are as stiff across as along."""
    points, slope, loads = chain
    free = _transmitted(points, slope, points[-1])
    load = np.zeros((len(points), 3))
    for x in loads:
        acts = (points[:, 0] <= x)[:, None]
        load += acts * _transmitted(points, slope, np.array([x, 0.0]))[:, :, 1] / len(loads)
    return Parts(
        (
            np.einsum("jki,jkl->il", free[:, :2], free[:, :2]),
            np.einsum("ji,jl->il", free[:, 2], free[:, 2]),
        ),
        (
            np.einsum("jki,jk->i", free[:, :2], load[:, :2]),
            np.einsum("ji,j->i", free[:, 2], load[:, 2]),
        ),
        (float((load[:, :2] ** 2).sum()), float((load[:, 2] ** 2).sum())),
    )


def planar_stiffness(parts: Parts, translational: Floats, rotational: Floats) -> Floats:
    """Return load over displacement for pairs of joint stiffnesses (R,), N/m and N m/rad."""
    slide, turn = 1 / np.asarray(translational), 1 / np.asarray(rotational)
    matrix = slide[:, None, None] * parts.unknown[0] + turn[:, None, None] * parts.unknown[1]
    right = slide[:, None] * parts.mixed[0] + turn[:, None] * parts.mixed[1]
    unknown = np.linalg.solve(matrix, right[..., None])[..., 0]
    energy = slide * parts.load[0] + turn * parts.load[1] - (right * unknown).sum(axis=1)
    return np.asarray(1 / energy)


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
            slide, turn = np.full_like(ratio, vault.area), LAWS[self.name](vault) * ratio
            rows.append(planar_stiffness(parts, slide, turn))
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


MEASURES: dict[str, tuple[Callable[[Floats], Floats], int]] = {
    "absolute": (median_scale, 1),
    "squares": (lambda share: np.asarray(share.sum(axis=0) / (share**2).sum(axis=0)), 2),
}  # best factor, and the power of the errors that are summed


def fit(law: Law, measure: str, kept: Floats) -> tuple[float, float]:
    """Return the k_t and k_r that fit the tests in ``kept`` (T,) bool best."""
    ends = low, high = np.log(law.bounds)
    for _ in range(4):
        ratio = np.exp(np.linspace(low, high, 401))
        best, scale = best_of(law.relative(ratio)[kept], measure)
        near = np.log(ratio[best]) + np.array([-2, 2]) * (high - low) / 400
        low, high = np.clip(near, *ends)
    return scale, float(scale * ratio[best])


def best_of(share: Floats, measure: str) -> tuple[int, float]:
    """Return which column of model over measured (T, R) fits best with which factor."""
    _scale_of, power = MEASURES[measure]
    scale = _scale_of(share)
    best = int((np.abs(scale * share - 1) ** power).sum(axis=0).argmin())
    return best, float(scale[best])


def errors(law: Law, pair: tuple[float, float]) -> Floats:
    """Return the relative errors (T,) at given k_t and k_r."""
    return np.asarray(pair[0] * law.relative(np.array([pair[1] / pair[0]]))[:, 0] - 1)


def laws(tests: tuple[Vault, ...]) -> dict[str, Law]:
    """Return the laws by label; the last one has a single number."""
    parts = tuple(planar_parts(chain(vault)) for vault in tests)
    out = {name: Law(name, tests, parts) for name in LAWS}
    return out | {f"{BED}, k_r = k_t": Law(BED, tests, parts, (1.0, 1.0))}
