"""Claim: all 19,601 grip sets of a dry `arch25` are decided, a twentieth solved; two robots fail.

Method: every set of two or three nodes that holds the newest of 2 to 25 bricks (the first one is
held alone) is screened as rigid bricks laid dry (friction 25 degrees, the robots' payloads): does
it stand? A linear program is solved where nothing known decides it. A random sample of every brick
count is put to the certificate by cone programs. The same is asked with a bond of 3 kPa, and dry
with a tilt of 3 degrees. Then robots build with hands free: any of them may hold or release any
node, one at a time, as long as every state stands; two of them are compared with three. A state
that is not proven to fall counts as standing for two, and one not proven to stand as falling for
three, so that either answer is proven.

The claim holds if no set stays open, the certificate contradicts none of the sample, at most one
program in twenty sets is solved for the dry arch, two robots end before the last brick, and three
place it.

Reach is left out of the build, so that what two robots cannot do no two robots can; what three can
do needs reach. The three robots of the scene are a matter of the free schedule.

Inputs: the shipped scene. Command: ``python -m experiments.stability.dry_grips [--quick]``. Writes
``experiments/results/dry_grips.csv``, ``dry_grips_build.csv`` and ``docs/figures/dry_grips.png``.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import combinations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from experiments.harness.claim import Claim, Finding, Options, Times
from experiments.harness.plotting import RESULTS, save_all, stored
from experiments.stability.parts.dry_chart import chart
from experiments.stability.parts.free_hands import reached
from formulations.limit_analysis import compile_equilibrium
from seqopt.arrays import Ints
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.scene.scene_file import load_scene
from seqopt.stability.assessment import Verdict, bonded, verdict_of
from seqopt.stability.prover import Prover
from seqopt.stability.screens import FALLS, OPEN, STANDS, Screen

SAMPLE = 8  # of the sets of every brick count
SHARE = 0.05  # of the sets that are solved at most
CASES = (("dry", DRY, 0.0), ("bond 3 kPa", bond_mortar(3e3), 0.0), ("dry, tilted 3°", DRY, 3.0))
VERDICTS = {STANDS: Verdict.STANDS, FALLS: Verdict.FALLS}


def grip_sets(bricks: int) -> Ints:
    """Return the sets of two or three nodes that hold the newest brick, as places from 1."""
    newest, places = {2 * bricks - 1, 2 * bricks}, range(2, 2 * bricks + 1)
    if bricks == 1:
        return np.array([[2, 0, 0]])
    return np.array(
        [
            held + (0,) * (3 - count)
            for count in (2, 3)
            for held in combinations(places, count)
            if newest & set(held)
        ]
    )


def contradictions(network: Network, bricks: int, sets: Ints, found: Ints, mortar: Mortar) -> int:
    """Return how many of a sample the certificate decides otherwise."""
    rng = np.random.default_rng(bricks)
    nodes = [node for brick in network.scene.placed for node in brick.nodes]
    wrong = 0
    for i in rng.choice(len(sets), min(SAMPLE, len(sets)), replace=False).tolist():
        grips = [nodes[place - 1] if place else None for place in sets[i].tolist()]
        assembly = step_assembly(network, bricks, grips)
        proven = verdict_of(Prover(assembly, compile_equilibrium)(bonded(assembly, mortar)))
        own = VERDICTS.get(int(found[i]), Verdict.UNDECIDED)
        wrong += Verdict.UNDECIDED not in (own, proven) and own is not proven
    return wrong


def screened(network: Network, case: tuple[str, Mortar, float], counts: range) -> pd.DataFrame:
    """Return a row per brick count."""
    name, mortar, tilt = case
    screen, rows = Screen(network, mortar, np.radians(tilt)), []
    for bricks in counts:
        sets, before, start = grip_sets(bricks), screen.solved, time.process_time()
        found = screen.stands(bricks, sets)
        seconds = time.process_time() - start
        rows.append(
            {
                "case": name,
                "bricks": bricks,
                "sets": len(sets),
                "solved": screen.solved - before,
                "stand": int((found == STANDS).sum()),
                "fall": int((found == FALLS).sum()),
                "open": int((found == OPEN).sum()),
                "seconds": seconds,
                "sample": 0 if tilt else min(SAMPLE, len(sets)),
                "contradicted": 0 if tilt else contradictions(network, bricks, sets, found, mortar),
            }
        )
    return pd.DataFrame(rows)


def build(network: Network, robots: int, *, proven: bool) -> dict[str, object]:
    """Return a row on what robots that reach everything can build dry."""
    screen, start = Screen(network, DRY), time.process_time()
    placed = reached(screen, robots, proven=proven)
    seconds = time.process_time() - start
    row = {"robots": robots, "placed": placed, "bricks": len(network.inner)}
    return row | {"solved": screen.solved, "seconds": seconds}


def holds(table: pd.DataFrame, built: pd.DataFrame) -> bool:
    dry, end = table[table["case"] == "dry"], built.set_index("robots")
    return bool(
        (table["open"] == 0).all()
        and (table["contradicted"] == 0).all()
        and dry["solved"].sum() <= SHARE * dry["sets"].sum()
        and end.loc[2, "placed"] < end.loc[2, "bricks"]
        and end.loc[3, "placed"] == end.loc[3, "bricks"]
    )


def experiment(options: Options) -> Finding:
    network = build_network(load_scene("arch25"))
    counts = range(1, len(network.inner) + 1)
    cases = CASES[:1] if options.quick else CASES
    table = pd.concat([screened(network, case, counts) for case in cases], ignore_index=True)
    built = pd.DataFrame([build(network, 2, proven=False), build(network, 3, proven=True)])
    sums = table.drop(columns="bricks").groupby("case", sort=False).sum()
    print(sums.to_string(float_format="%.2f"))
    print(built.to_string(index=False, float_format="%.1f"))
    if not options.quick:
        RESULTS.mkdir(exist_ok=True)
        table.to_csv(RESULTS / "dry_grips.csv", index=False, float_format="%.3g")
        built.to_csv(RESULTS / "dry_grips_build.csv", index=False, float_format="%.3g")
        save_all(PICTURES)
    return Finding(holds(table, built))


PICTURES: dict[str, Callable[[], Figure]] = {
    "dry_grips.png": lambda: chart(stored("dry_grips")),
}
CLAIM = Claim(
    experiment, quick="dry and upright alone, nothing written", times=Times.SHOWN, pictures=PICTURES
)

if __name__ == "__main__":
    CLAIM.main()
