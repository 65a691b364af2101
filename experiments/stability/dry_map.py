"""Claim: three robots build dry what two cannot, and one more robot never needs a larger payload.

Method: arches of 7 to 16 bricks along a catenary, whose bricks stick out of the arch's line to
either side as those of `arch25` do, of three thicknesses, with four coefficients of friction, are
built without mortar by two, three and four mobile robots. Every robot may place, hold or let go at
any time, and the finished arch is released; every state must be proven to stand, with no robot
beyond its payload, neither there nor between springs. The least payload with which a schedule
exists is found to a tenth, over the weight of the arch; up to four times that weight is tried.

The claim holds if no arch needs more payload with a robot or with friction added, beyond the tenth,
and some are built by three robots and not by two.

What it does not show: other lines of an arch, other orders of its bricks, reach. Bricks are placed
from one end; a state that is not proven to stand counts as one that falls.

Inputs: generated arches. Command: ``python -m experiments.stability.dry_map [--quick]``. Writes
``experiments/results/dry_map.csv`` and ``docs/figures/dry_map.png``.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.stability.parts.dry_arches import CLOSE, Cell, least_payload
from experiments.stability.parts.dry_map_chart import chart

BRICKS, THICKNESSES = (7, 10, 13, 16), (0.03, 0.053, 0.116)  # m
FRICTIONS, ROBOTS = (0.2, 0.3, 0.466, 0.8), (2, 3, 4)
QUICK = ((7,), (0.053,), (0.2, 0.466), (2, 3))


def never_more(table: pd.DataFrame, added: str) -> bool:
    """Return whether no arch needs more payload where there is more of something.

    Parameters
    ----------
    table : pandas.DataFrame
        Of `least_payload`.
    added : str
        ``robots`` or ``friction``.
    """
    same = [name for name in ("bricks", "thickness_m", "friction", "robots") if name != added]
    for _, rows in table.sort_values(added).groupby(same):
        least = rows["least_payload"].to_numpy()
        if (least[1:] > least[:-1] * CLOSE).any():
            return False
    return True


def holds(table: pd.DataFrame) -> bool:
    """Return whether robots and friction never hurt, and three robots do what two cannot."""
    built = table.assign(built=np.isfinite(table["least_payload"]))
    two, three = (
        built[built["robots"] == count].set_index(["bricks", "thickness_m", "friction"])["built"]
        for count in (2, 3)
    )
    return bool(
        never_more(table, "robots") and never_more(table, "friction") and (three & ~two).any()
    )


def experiment(options: Options) -> Finding:
    cells: list[Cell] = list(
        product(*(QUICK if options.quick else (BRICKS, THICKNESSES, FRICTIONS, ROBOTS)))
    )
    table = pd.DataFrame(map(least_payload, cells))
    print(table.to_string(index=False, float_format="%.3g"))
    if not options.quick:
        table.to_csv(RESULTS / "dry_map.csv", index=False, float_format="%.4g")
        save_all(PICTURES)
    found = np.isfinite(table["least_payload"]).groupby(table["robots"]).sum()
    built = ", ".join(f"{count} by {robots}" for robots, count in found.items())
    each = len(table) // table["robots"].nunique()
    return Finding(holds(table), f": of {each} arches robots build {built}")


PICTURES: dict[str, Callable[[], Figure]] = {
    "dry_map.png": lambda: chart(stored("dry_map")),
}
CLAIM = Claim(
    experiment, quick="two arches, two or three robots, nothing written", pictures=PICTURES
)

if __name__ == "__main__":
    CLAIM.main()
