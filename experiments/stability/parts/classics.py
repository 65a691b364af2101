"""Classical structures of rigid blocks, and the questions that are asked of them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.optimize import linprog

from experiments.stability.parts.blocks import Blocks, Contact, courses, touching, voussoirs
from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import Mortar
from seqopt.network.network import GROUND
from seqopt.stability._prover import Proven, Prover
from seqopt.stability.assessment import Verdict, bonded, verdict
from seqopt.stability.limit_analysis import Case, Sense, compile_equilibrium

NARROW = 1e-5  # between what is proven to fall and to stand
ROUGH = 5.0  # friction with which no arch slides
SHORT = {"1": 4.0, "h": 2.0, "-": -4.0}  # lengths of blocks and, negative, of gaps
WALLS = {  # of Ferris and Tin-Loi, courses from the ground up
    1: "h1111h 11111 " * 3,
    2: "h1111h 11111 " * 5,
    3: "1111 h111h 1111 h1-1h 1h-h1 h1-1h 1h-h1 h1-1h 1111 h111h 1111",
    4: "h1111h 11111 h1111h 1-1-1 hh-hh-hh 1-1-1 hh-hh-hh 1-1-1 h1111h 11111 h1111h",
    5: "h11h 111 h11h 1-1 hh-hh 1-1 hh-hh 1-1 " * 2 + "h11h 111 h11h",
    6: "h111111h 1111111 h111111h 1111111 h1-11-1h 1h-h1h-h1 h1-11-1h 1h-h1h-h1 h1-11-1h "
    "1111111 h111111h 1111111 h1-11-1h 1h-h1h-h1 h1-11-1h 1h-h1h-h1 h1-11-1h "
    "1111111 h111111h 1111111 h111111h",
}


def wall(number: int) -> Blocks:
    rows = []
    for course in WALLS[number].split():
        size = np.array([SHORT[sign] for sign in course])
        start = np.cumsum([0, *abs(size)])[:-1]
        rows.append([*zip(start[size > 0], size[size > 0], strict=True)])
    return courses(rows, 1.75)


def least(says: Callable[[float], Verdict], low: float, high: float) -> float:
    """Return the least size that is proven to stand; what is less by `NARROW` is proven to fall."""
    while high - low > NARROW:
        middle = (low + high) / 2
        found = says(middle)
        if found is Verdict.UNDECIDED:
            return np.nan
        low, high = (low, middle) if found is Verdict.STANDS else (middle, high)
    return high


def stands(blocks: Blocks, friction: float = ROUGH) -> Verdict:
    return verdict(blocks.assembly(1.0), Mortar(friction=friction))


def proven(
    blocks: Blocks, friction: float, ask: Callable[[Case], Case] = lambda case: case
) -> Proven:
    """Return what is proven of a case, by default of the bond that is lacking."""
    assembly = blocks.assembly(1.0)
    case = bonded(assembly, Mortar(friction=friction))
    return Prover(assembly, compile_equilibrium)(ask(case))


def pushed(blocks: Blocks, friction: float) -> Proven:
    """Return the largest share of their weight that may push all blocks along x."""
    push = {"sense": Sense.LARGEST, "pull": (1.0, 0.0, 0.0)}
    return proven(blocks, friction, lambda case: replace(case.fixed(), **push))


def half_arch(blocks: int, ratio: float, off: float = 0.0, ends: float = 90.0) -> Floats:
    """Return the joints from the crown down, of radius 1: a center off the axis, m; degrees."""
    radius = np.array([1 - ratio / 2, 1 + ratio / 2])
    angle = np.linspace(np.arcsin(off / radius[0]), np.radians(ends), blocks + 1)
    points = np.einsum("s,dn->nsd", radius, [np.sin(angle), np.cos(angle)]) - [off, 0.0]
    points[0] = np.stack([0 * radius, np.sqrt(radius**2 - off**2)], axis=1)
    return np.asarray(points)


def hanging(blocks: int, ratio: float) -> Floats:
    """Return the joints of half a chain of equal links that hangs upside down, of a span of 2."""
    slope = 3.0 * (np.arange(blocks) + 0.5) / blocks
    link = np.stack([np.ones(blocks), -slope], axis=1) / np.hypot(1, slope)[:, None]
    ends = np.cumsum([[0.0, 0.0], *link], axis=0)
    along = np.array([[1.0, 0.0], *(link[1:] + link[:-1]), link[-1]])
    outward = along[:, ::-1] * [-1, 1] / np.linalg.norm(along, axis=1)[:, None]
    sides = np.multiply.outer([-ratio, ratio], outward).swapaxes(0, 1)
    return np.asarray(ends[:, None] / ends[-1, 0] + sides)


def whole(half: Floats, opening: float | None = None) -> Blocks:
    """Return an arch of two equal halves; of an opening, rad: two opposite parts of a dome."""
    joints = np.concatenate([half[:0:-1] * [-1.0, 1.0], half])
    wide = 1.0 if opening is None else np.maximum(opening * np.abs(joints[..., 0]), 1e-4)
    return voussoirs(joints, wide)


def thrust_line(half: Floats, *, dome: bool = False) -> Verdict:
    """Return whether a line of thrust fits between the points of the joints: two unknowns."""
    x, z = np.moveaxis(np.concatenate([half[:-1], half[1:, ::-1]], axis=1), 2, 0)
    after = np.roll(x, -1, axis=1)
    cross = (after * z - x * np.roll(z, -1, axis=1)) / 12
    powers = 6 * cross, 2 * (x + after) * cross, (x**2 + x * after + after**2) * cross
    sums = [np.append(0, np.cumsum(part.sum(axis=1))) for part in powers]
    weight, moment = (
        sums[1:] if dome else sums[:2]
    )  # a dome's part is as wide as it is off the axis
    sides = (half[:, 0], 1.0), (half[:, 1], -1.0)
    rows = [sign * np.stack([p[:, 1], -np.ones(len(p))], axis=1) for p, sign in sides]
    most = [sign * (moment - weight * p[:, 0]) for p, sign in sides]
    free = [(0, None), (None, None)]
    found = linprog([0, 0], np.concatenate(rows), np.concatenate(most), bounds=free)
    return Verdict.STANDS if found.status == 0 else Verdict.FALLS


def ladder(half_span: float, height: float) -> Assembly:
    """Two weightless bars that lean on each other, each with 1 N in its middle: three hinges."""
    edge = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1e-9, 1.0, 0.0], [1e-9, 0.0, 0.0]])
    upright = edge[:, [2, 1, 0]]
    foot = Contact((GROUND, 0), edge - np.array([half_span, 0, 0]))
    other = Contact((GROUND, 1), edge + np.array([half_span, 0, 0]))
    crown = Contact((0, 1), upright + np.array([0, 0, height]))
    centroid = np.array([[-half_span / 2, 0.5, height / 2], [half_span / 2, 0.5, height / 2]])
    weight = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    return touching(centroid, weight, [foot, other, crown])
