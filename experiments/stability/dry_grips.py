"""Claim: all 19,601 grip sets of a dry `arch25` are decided, a twentieth solved; two robots fail.

Method: every set of two or three nodes that holds the newest of 2 to 25 bricks (the
first one is held alone) is screened as rigid bricks laid dry (friction 25 degrees, the robots'
payloads): does it stand? A linear program is solved where nothing known decides it, and the
certificate, by cone programs, must contradict none of a random sample of every brick count. The
same is asked with a bond of 3 kPa, and dry with a tilt of 3 degrees. Then robots build with hands
free: any of them may hold or release any node, one at a time, as long as every state stands. A
state that is not proven to fall counts as standing for two robots, who must end before the last
brick, and one not proven to stand as falling for three, who must place it. Reach is left out, so
that what two robots cannot do no two robots can; what three can do needs reach.

Inputs: the shipped scene. Command: ``python -m experiments dry_grips [--quick]``.
"""

import time
from itertools import combinations

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.scenes import arch25
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt import Network
from seqopt.arrays import Ints
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import DRY, Mortar, bond_mortar
from seqopt.stability._prover import Prover
from seqopt.stability._screens import FALLS, OPEN, STANDS, Screen
from seqopt.stability.assessment import Verdict, _verdict_of, bonded

SAMPLE = 8  # of the sets of every brick count
SHARE = 0.05  # of the sets that are solved at most
CASES = (("dry", DRY, 0.0), ("bond 3 kPa", bond_mortar(3e3), 0.0), ("dry, tilted 3°", DRY, 3.0))
VERDICTS = {STANDS: Verdict.STANDS, FALLS: Verdict.FALLS}


def grip_sets(bricks: int) -> Ints:
    """Return the sets of two or three nodes that hold the newest brick, as places from 1."""
    newest, places = {2 * bricks - 1, 2 * bricks}, range(2, 2 * bricks + 1)
    if bricks == 1:
        return np.array([[2, 0, 0]])
    sets = [held for count in (2, 3) for held in combinations(places, count) if newest & {*held}]
    return np.array([held + (0,) * (3 - len(held)) for held in sets])


def contradictions(network: Network, bricks: int, sets: Ints, found: Ints, mortar: Mortar) -> int:
    """Return how many of a sample the certificate decides otherwise."""
    rng = np.random.default_rng(bricks)
    nodes = [node for brick in network.scene.placed for node in brick.nodes]
    wrong = 0
    for i in rng.choice(len(sets), min(SAMPLE, len(sets)), replace=False).tolist():
        grips = [nodes[place - 1] if place else None for place in sets[i].tolist()]
        assembly = step_assembly(network, bricks, grips)
        proven = _verdict_of(Prover(assembly, compile_equilibrium)(bonded(assembly, mortar)))
        own = VERDICTS.get(int(found[i]), Verdict.UNDECIDED)
        wrong += Verdict.UNDECIDED not in (own, proven) and own is not proven
    return wrong


def screened(network: Network, case: tuple[str, Mortar, float], counts: range) -> pd.DataFrame:
    name, mortar, tilt = case
    screen, rows = Screen(network, mortar, np.radians(tilt)), []
    for bricks in counts:
        sets, before, start = grip_sets(bricks), screen.solved, time.process_time()
        found = screen.stands(bricks, sets)
        seconds = time.process_time() - start
        wrong = 0 if tilt else contradictions(network, bricks, sets, found, mortar)
        row = {"case": name, "bricks": bricks, "sets": len(sets), "solved": screen.solved - before}
        row |= {"stand": int((found == STANDS).sum()), "fall": int((found == FALLS).sum())}
        row |= {"open": int((found == OPEN).sum()), "seconds": seconds}
        row |= {"sample": 0 if tilt else min(SAMPLE, len(sets)), "contradicted": wrong}
        rows.append(row)
    return pd.DataFrame(rows)


Sets = frozenset[frozenset[int]]


def reached(screen: Screen, robots: int, *, proven: bool) -> int:
    """Return how many bricks can be placed by robots that hold and release wherever they like.

    Between two states one grip is taken or let go; a brick is placed by a robot that is free, and
    held by it at either node. Reach counts for nothing, so that no schedule of as many robots of
    less reach comes farther. A state must be proven to stand, or else not be proven to fall.
    """
    before: Sets = frozenset([frozenset()])
    total = len(screen.network.inner)
    for bricks in range(1, total + 1):
        new = {2 * bricks - 1, 2 * bricks}
        placed = {held | {node} for held in before if len(held) < robots for node in new}
        fit = _standing(screen, bricks, robots, proven=proven)
        before = _connected(fit, frozenset(placed) & fit)
        if not before:
            return bricks - 1
    return total


def _standing(screen: Screen, bricks: int, robots: int, *, proven: bool) -> Sets:
    """Return the sets of nodes with which a partial structure stands."""
    places = range(1, 2 * bricks + 1)
    every = [held for count in range(robots + 1) for held in combinations(places, count)]
    found = screen.stands(bricks, np.array([held + (0,) * (robots - len(held)) for held in every]))
    kept = found == 1 if proven else found != -1
    return frozenset(frozenset(every[i]) for i in np.flatnonzero(kept))


def _connected(fit: Sets, start: Sets) -> Sets:
    """Return the sets that grips taken and let go one at a time lead to."""
    nodes = frozenset().union(*fit) if fit else frozenset[int]()
    seen, front = set(start), set(start)
    while front:
        steps = {held - {node} for held in front for node in held}
        steps |= {held | {node} for held in front for node in nodes - held}
        front = {held for held in steps if held in fit and held not in seen}
        seen |= front
    return frozenset(seen)


def built_by(network: Network, robots: int, *, proven: bool) -> dict[str, object]:
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
    network = arch25().network
    counts = range(1, len(network.inner) + 1)
    cases = CASES[:1] if options.quick else CASES
    table = pd.concat([screened(network, case, counts) for case in cases], ignore_index=True)
    built = pd.DataFrame([built_by(network, 2, proven=False), built_by(network, 3, proven=True)])
    sums = table.drop(columns="bricks").groupby("case", sort=False).sum()
    print(sums.to_string(float_format="%.2f"))
    print(built.to_string(index=False, float_format="%.1f"))
    return Finding(holds(table, built), tables={"dry_grips": table, "dry_grips_build": built})


CLAIM = Claim(experiment, digits=3, quick="dry and upright alone")
