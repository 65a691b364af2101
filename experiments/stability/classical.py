"""Claim: classical results of rigid blocks are found again, and none of them is fitted.

Method: every structure is built from its geometry alone. Sizes and friction are bisected by
verdicts until what is proven to fall and what is proven to stand differ by 1e-5; a push is the
largest that forces and a motion prove. What is known is as printed, in closed form, or from a line
of thrust: a linear program in two unknowns, which shares only the geometry.

Every row tells how far it may be off, for digits of a print, blocks in place of a continuous arch,
and weights on the middle line (Cocchetti and Rizzi, whose numbers a line of thrust gives with such
weights). The 0.042 of Heyman's dome is 1.9 % off; our line of thrust is with us.
No print of the factors of the walls 2 to 6 was at hand: these rows are told, and not judged.
"""

from collections.abc import Callable
from dataclasses import replace
from math import nan, radians, tan
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.stability.parts.blocks import (
    Blocks,
    Contact,
    courses,
    ring,
    stack,
    touching,
    voussoirs,
)
from seqopt.arrays import Floats
from seqopt.contact.assembly import Assembly
from seqopt.contact.mortar import DRY, Mortar
from seqopt.network.network import GROUND
from seqopt.report._style import styled
from seqopt.stability.assessment import bonded, verdict
from seqopt.stability.limit_analysis import Case, Proven, Prover, Sense, compile_equilibrium
from seqopt.stability.verdict import Verdict

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


def _draw(axes: Axes, blocks: Blocks, found: Proven, title: str) -> None:
    """Draw the outlines of blocks in x and z, at rest and moved."""
    assembly = blocks.assembly(1.0)
    motion = found.answer.motion[:, None] / np.repeat([1.0, assembly.scales[1]], 3)
    step = motion[..., :3] + np.cross(motion[..., 3:], blocks.vertex - assembly.centroid[:, None])
    step *= 0.1 * np.ptp(blocks.vertex[..., 0]) / np.linalg.norm(step, axis=2).max()
    for moved, look in ((0.0, ("0.95", "0.8")), (1.0, ("#9cc4e4", "k"))):
        seen = (blocks.vertex + moved * step)[..., [0, 2]]
        outlines = [points[ConvexHull(points).vertices] for points in seen]
        axes.add_collection(PolyCollection(outlines, lw=0.5, fc=look[0], ec=look[1]))
    axes.autoscale_view()
    axes.set(aspect="equal")
    axes.set_title(title, loc="center")
    axes.set_axis_off()


@styled
def picture() -> Figure:
    figure, axes = subplots(5.2, 2, 2)
    semicircle, arch = whole(half_arch(30, 0.1)), ring(7, 10.0, 1.5, radians(78.75))
    _draw(axes[0, 0], semicircle, proven(semicircle, ROUGH), "semicircle, t/R 0.1: by its weight")
    _draw(axes[0, 1], arch, pushed(arch, ROUGH), "Oppenheim's arch: by a push of 0.37")
    _draw(axes[1, 0], wall(1), pushed(wall(1), 0.65), "wall 1: by a push of 0.64")
    _draw(axes[1, 1], wall(3), pushed(wall(3), 0.65), "wall 3: by a push of 0.40")
    return figure


Find = Callable[[int], float]  # finds a number by arches of so many blocks in each half


class Classic(NamedTuple):
    """A result: by whom it is known (NaN if no print was at hand), and how far we may be off."""

    name: str
    source: str
    known: float | Find
    ours: Find
    within: float = 1e-3


def push(blocks: Blocks, friction: float = ROUGH) -> Find:
    return lambda _: pushed(blocks, friction).value


def thin(*shape: float, opening: float | None = None) -> Find:
    """Return what finds the least thickness of an arch, or of such a part of a dome."""
    return lambda n: least(lambda t: stands(whole(half_arch(n, t, *shape), opening)), 0.01, 0.2)


def line(*shape: float, dome: bool = False) -> Find:
    """Return what finds the same by a line of thrust through the same joints."""
    return lambda n: least(lambda t: thrust_line(half_arch(n, t, *shape), dome=dome), 0.01, 0.2)


def friction(thickness: float) -> Find:
    """Return what finds the least friction of a semicircular arch."""
    return lambda n: least(lambda mu: stands(whole(half_arch(n, thickness)), mu), 0.2, 0.6)


def reach(blocks: int) -> Find:
    """Return what finds how far a harmonic stack reaches over the edge of one block more."""
    shifts = 0.5 / np.arange(blocks, 0, -1)
    return lambda _: -shifts.sum() * least(lambda less: stands(stack(-less * shifts)), -2.0, 0.0)


def counterweight(_: int) -> float:
    """Return how far a block reaches that lies on one end of another, a third on its other end."""
    rows = [(0, 1)], [(0.5, 1)]
    return -least(lambda less: stands(courses([*rows, [(0, 1), (-less, 1)]], 1.0)), -1.5, -1.0)


def leaning(_: int) -> float:
    return least(lambda mu: verdict(ladder(2.0, 1.5), Mortar(friction=mu)), 0.0, 2.0)


def catenary(_: int) -> float:
    return least(lambda t: stands(whole(hanging(FEW, t))), 0.0, 0.1)


BLOCKS, FEW = 60, 20  # of half an arch
CLOSED, THRUST = "closed form", "line of thrust"
STACKS, RIZZI = "Paterson et al. (2009), figure 1", "Cocchetti, Rizzi (2020), table 3"
TIN_LOI = "Ferris, Tin-Loi (2001)"
CUBE, TALL, OPPENHEIM = stack([]), stack([], (1.0, 1.0, 3.0)), ring(7, 10.0, 1.5, radians(78.75))
CASES = (
    Classic("push that slides a cube, 25°", CLOSED, tan(radians(25)), push(CUBE, DRY.friction)),
    Classic("push that tips a column, 3 by 1", CLOSED, 1 / 3, push(TALL)),
    Classic("friction of two bars that lean, 4 by 1.5", CLOSED, 2 / 3, leaning),
    Classic("reach of 3 blocks, one on another", STACKS, 11 / 12, reach(3)),
    Classic("reach of 4 blocks, one on another", STACKS, 25 / 24, reach(4)),
    Classic("reach of 3 blocks, one a counterweight", STACKS, 1.0, counterweight),
    Classic("t/span of a catenary", "Hooke (1675)", 0.0, catenary),
    Classic("t/R of a semicircle", "Milankovitch (1907)", 0.1075, thin()),
    Classic("t/R of a semicircle", THRUST, line(), thin()),
    Classic("t/R of a segment of 160°", THRUST, line(0.0, 80.0), thin(0.0, 80.0)),
    Classic("t/R of a segment of 140°", THRUST, line(0.0, 70.0), thin(0.0, 70.0)),
    Classic("t/R of a pointed arch, centers 0.2 R apart", THRUST, line(0.1), thin(0.1)),
    Classic("t/R of a pointed arch, centers 0.6 R apart", THRUST, line(0.3), thin(0.3)),
    Classic("t/R of a half sphere", "Heyman (1967)", 0.042, thin(opening=0.1), 0.025),
    Classic("t/R of a half sphere", THRUST, line(dome=True), thin(opening=0.1)),
    Classic("friction of the thinnest semicircle", RIZZI, 0.395832, friction(0.1076), 2e-3),
    Classic("friction of any semicircle, t/R 0.25", RIZZI, 0.309215, friction(0.25), 2e-3),
    Classic("push that fells an arch of 157.5°", "Oppenheim (1992)", 0.37, push(OPPENHEIM), 0.0135),
    Classic("push that fells wall 1", TIN_LOI, 0.643, push(wall(1), 0.65)),
    *(Classic(f"push that fells wall {k}", TIN_LOI, nan, push(wall(k), 0.65)) for k in range(2, 7)),
)


def row(case: Classic, blocks: int) -> dict[str, object]:
    known = case.known(blocks) if callable(case.known) else case.known
    ours = case.ours(blocks)
    out = {"result": case.name, "source": case.source, "known": known, "ours": ours}
    return out | {"off": (ours - known) / (known or 1.0), "within": case.within}


def faults(table: pd.DataFrame) -> list[str]:
    """Return the results that are not met; what is not known cannot be."""
    unlike = ~(table["off"].abs() <= table["within"]) & table["known"].notna()
    missed = table[unlike | ~np.isfinite(table["ours"])]
    return [f"{one.result}: {one.ours:.6g}, not {one.known:.6g}" for one in missed.itertuples()]


def experiment(options: Options) -> Finding:
    table = pd.DataFrame([row(case, FEW if options.quick else BLOCKS) for case in CASES])
    print(table.to_string(index=False, float_format="%.5g", na_rep=""))
    return Finding(dict.fromkeys(faults(table), False), tables={"classical": table})


CLAIM = Claim(
    experiment, digits=6, quick="arches of few blocks", pictures={"classical.png": picture}
)
