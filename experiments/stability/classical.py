"""Claim: classical results of rigid blocks are found again, and none of them is fitted.

Method: every structure is built from its geometry alone. Sizes and friction are bisected by
verdicts until what is proven to fall and what is proven to stand differ by 1e-5; a push is the
largest that forces and a motion prove. What is known is as printed, in closed form, or from a line
of thrust: a linear program in two unknowns, which shares only the geometry.

Every row tells how far it may be off, for digits of a print, blocks in place of a continuous arch,
and weights on the middle line (Cocchetti and Rizzi, whose numbers a line of thrust gives with such
weights). The 0.042 of Heyman's dome is 1.9 % off; our line of thrust is with us.
No print of the factors of the walls 2 to 6 was at hand: these rows are told, and not judged.

Inputs: none. Command: ``python -m experiments classical [--quick]``.
"""

from collections.abc import Callable
from math import nan, radians, tan
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
from experiments.stability.parts.blocks import Blocks, courses, ring, stack
from experiments.stability.parts.classic_chart import picture
from experiments.stability.parts.classics import (
    ROUGH,
    half_arch,
    hanging,
    ladder,
    least,
    pushed,
    stands,
    thrust_line,
    wall,
    whole,
)
from seqopt.contact.mortar import DRY, Mortar
from seqopt.stability.assessment import verdict

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
