"""Claim: three robots build dry what two cannot, and one more robot never needs a larger payload.

Method: arches of 7 to 16 bricks along a catenary, whose bricks stick out of the arch's
line to either side as those of `arch25` do, of three thicknesses, with four coefficients of
friction, are built without mortar by two, three and four mobile robots. Every robot may place, hold
or let go at any time, and the finished arch is released; every state must be proven to stand, with
no robot beyond its payload, neither there nor between springs. The least payload with which a
schedule exists is found to a tenth, up to four times the weight of the arch. Some must be built by
three robots and not by two. Not shown: other lines of an arch, other orders of its bricks, reach.
"""

from itertools import product
from math import atan

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import drawn
from seqopt import FreeRules, Scene, make_engine
from seqopt.contact.mortar import Mortar
from seqopt.graph._spaces import explore
from seqopt.graph.states import build_states
from seqopt.report._style import SMALL, styled
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.parts import Robot
from seqopt.stability.standing import Standing
from seqopt.study import CRITERIA

BRICKS, THICKNESSES = (7, 10, 13, 16), (0.03, 0.053, 0.116)  # m
FRICTIONS, ROBOTS = (0.2, 0.3, 0.466, 0.8), (2, 3, 4)
QUICK = ((7,), (0.053,), (0.2, 0.466), (2, 3))

STEEPEST = 2.0  # slope of the catenary at its ends
LENGTH, WIDTH, GAP = 0.246, 0.116, 0.01  # m
MOST = 4.0  # payload over the arch's weight beyond which none is looked for
CLOSE = 1.1  # ratio to which the least payload is found
RULES = FreeRules(least_grips=0, newest="free")  # any robot may do anything at any time
Cell = tuple[int, float, float, int]  # bricks, thickness (m), friction, robots


def catenary(bricks: int, thickness: float, robots: int, payload: float) -> Scene:
    """Return an arch of bricks end to end whose line of thrust is nearly its own; payload in N."""
    along = np.linspace(1.0, -1.0, bricks)
    shape = ArchShape(
        pitch=[atan(STEEPEST * x) for x in along.tolist()],
        pattern="VLR",
        dimensions=(LENGTH, WIDTH, thickness),
        gap=GAP,
    )
    team = [Robot(name=f"rob{i + 1}", payload=payload) for i in range(robots)]
    return arch_scene(shape, f"catenary{bricks}", robots=team)


def can_build(cell: Cell, payload: float) -> bool:
    """Return whether some free schedule builds an arch dry, every state proven to stand."""
    bricks, thickness, friction, robots = cell
    engine = make_engine("compliance", catenary(bricks, thickness, robots, payload))
    standing = Standing(Mortar(friction=friction))
    problem = build_states(engine, RULES, CRITERIA["weighted"], "steps", stands=standing)
    return explore(problem, width=50).whole or explore(problem).whole


def least_payload(cell: Cell) -> dict[str, float]:
    """Return a row on the least payload with which an arch is built dry, within 5 %.

    ``least_payload`` and ``too_little`` are over the arch's weight, infinite and `MOST` where none
    is enough.
    """
    bricks, thickness, friction, robots = cell
    scene = catenary(bricks, thickness, robots, 1.0)
    first, last = (ground.position for ground in scene.grounds)
    weight = sum(float(np.prod(b.dimensions)) * b.density * 9.81 for b in scene.bricks)
    low, high = 0.0, MOST
    if not can_build(cell, MOST * weight):
        low, high = MOST, np.inf
    while high < np.inf and high > CLOSE * low:
        middle = float(np.sqrt(low * high)) if low else high / 4
        low, high = (low, middle) if can_build(cell, middle * weight) else (middle, high)
    row = {"bricks": bricks, "thickness_m": thickness, "friction": friction, "robots": robots}
    row |= {"span_m": abs(last[0] - first[0]), "weight_N": weight, "least_payload": high}
    return row | {"too_little": low}


def never_more(table: pd.DataFrame, added: str) -> bool:
    """Return whether no arch needs more payload with more ``robots`` or ``friction``."""
    same = [name for name in ("bricks", "thickness_m", "friction", "robots") if name != added]
    for _, rows in table.sort_values(added).groupby(same):
        least = rows["least_payload"].to_numpy()
        if (least[1:] > least[:-1] * CLOSE).any():
            return False
    return True


def holds(table: pd.DataFrame) -> bool:
    least = table.pivot_table("least_payload", ["bricks", "thickness_m", "friction"], "robots")
    gained = (np.isfinite(least[3]) & ~np.isfinite(least[2])).any()
    return bool(gained and never_more(table, "robots") and never_more(table, "friction"))


def experiment(options: Options) -> Finding:
    sizes = QUICK if options.quick else (BRICKS, THICKNESSES, FRICTIONS, ROBOTS)
    table = pd.DataFrame(map(least_payload, product(*sizes)))
    print(table.to_string(index=False, float_format="%.3g"))
    found = np.isfinite(table["least_payload"]).groupby(table["robots"]).sum()
    built = ", ".join(f"{count} by {robots}" for robots, count in found.items())
    each = len(table) // table["robots"].nunique()
    return Finding(holds(table), f": of {each} arches robots build {built}", {"dry_map": table})


DARK = 0.52  # from where figures are white
LARGEST = 0.7  # payload over the arch's weight at the end of the scale


@styled
def chart(table: pd.DataFrame) -> Figure:
    thicknesses, robots = (sorted(table[c].unique()) for c in ("thickness_m", "robots"))
    look = {"sharex": True, "sharey": True, "squeeze": False}
    figure, axes = subplots(6.6, len(thicknesses), len(robots), **look)
    for row, thickness in zip(axes, thicknesses, strict=True):
        for axis, count in zip(row, robots, strict=True):
            part = table[(table["thickness_m"] == thickness) & (table["robots"] == count)]
            cells = part.pivot_table(index="friction", columns="bricks", values="least_payload")
            least = np.ma.masked_invalid(cells.to_numpy())
            image = axis.imshow(least, origin="lower", vmin=0.2, vmax=LARGEST, cmap="viridis_r")
            axis.set_facecolor("0.85")
            for i, j in np.ndindex(*cells.shape):
                value = cells.iloc[i, j]
                text = f"{value:.2f}" if np.isfinite(value) else "–"
                ink = "white" if DARK < value < np.inf else "black"
                axis.text(j, i, text, ha="center", va="center", fontsize=SMALL, color=ink)
            axis.set_xticks(range(cells.shape[1]), [str(n) for n in cells.columns])
            axis.set_yticks(range(cells.shape[0]), [f"{f:g}" for f in cells.index])
            if axis in axes[0]:
                axis.set_title(f"{count} robots")
            if axis in axes[-1]:
                axis.set_xlabel("bricks of the arch")
        row[0].set_ylabel(f"{1e3 * thickness:g} mm thick\ncoefficient of friction")
    figure.colorbar(image, ax=axes, label="least payload over the weight of the arch", shrink=0.6)
    none = Patch(color="0.85", label="no payload up to four times the weight is enough")
    figure.legend(handles=[none], loc="outside lower right")
    return figure


CLAIM = Claim(
    experiment,
    digits=4,
    quick="two small arches",
    pictures={"dry_map.png": drawn(chart, "dry_map")},
)
