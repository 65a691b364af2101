"""Claim: compiled loops compare grip sets of large builds at least 1.5 times as fast as fields.

What optimization asks of a grip set is the largest tension of any edge, displacement of any node,
moment at any ground end, and the forces of its grips. Where numba is installed, there is much to do
and a structure has more nodes than there are grip sets, the engine reads these extremes from what
grows with the build, by compiled loops; else it takes them from the fields. Both agree to 1e-10 of
what adds up in them, the largest force of a grip times what a unit force there means, where 1e-6 is
promised; to 1e-13 where these do not nearly cancel, as on long chains they do.

Method: as in a search move by move, an engine answers random sets of three grips of eight brick
counts in ascending order, as many sets as nodes. Fields and compiled loops take turns in one
process on one core, from the first of the eight on, as seconds of the processor; the least of
rounds.

Inputs: the shipped scenes; seed 0; numba. Command: ``OPENBLAS_NUM_THREADS=1 python -m experiments
extremes [--quick]``.
"""

import time

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Extra, Finding, Options
from experiments.harness.scenes import grip_sets
from seqopt import build_network, load_scene
from seqopt.arrays import Ints
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import Network

CASES = ("chain:bricks=100", 99), ("vault338", 100), ("vault338", 337)
FASTER, CLOSE = 1.5, 1e-10
COUNTS = 8  # of bricks, the last of which is the case's
WANT = Want.RESPONSES | Want.SCREEN  # as optimization asks


def taken(network: Network, sets: dict[int, Ints], *, compiled: bool) -> float:
    """Return the seconds of the processor that the sets of ascending brick counts take."""
    engine = ComplianceEngine(network)
    first = min(sets)
    engine._extremes(first - 1, sets[first][:9], WANT, compiled=compiled)
    start = time.process_time()
    for bricks, each in sets.items():
        engine._extremes(bricks, each, WANT, compiled=compiled)
    return time.process_time() - start


def difference(network: Network, bricks: int, sets: Ints) -> float:
    """Return the largest difference of both ways, over what adds up in each extreme."""
    plain = ComplianceEngine(network)
    true = plain._extremes(bricks, sets, WANT)
    found = ComplianceEngine(network)._extremes(bricks, sets, WANT, compiled=True)
    operator, pull = plain._kept[bricks], true.force.max()
    names = "edge_force", "displacement", "support"
    unit = [np.abs(operator.of_loads(name)[:-1]).max() for name in names]
    scales = [unit[0], unit[0], unit[1], unit[2], 1.0]
    gaps = zip(true, found, scales, strict=True)
    return float(max(np.abs(a - b).max() / (pull * each) for a, b, each in gaps))


def row(name: str, bricks: int, rounds: int) -> dict[str, object]:
    """Return what sets of three grips take in one case, µs each."""
    network = build_network(load_scene(name))
    near = [*range(bricks - COUNTS + 1, bricks + 1)]
    sets = {count: grip_sets(network, count, 2 * count) for count in near}
    total = sum(map(len, sets.values()))
    turns = [
        [taken(network, sets, compiled=compiled) for compiled in (False, True)]
        for _ in range(rounds)
    ]
    fields, compiled = np.min(turns, axis=0).tolist()
    return {
        "scene": name,
        "bricks": bricks,
        "sets": total,
        "fields_us": 1e6 * fields / total,
        "compiled_us": 1e6 * compiled / total,
        "difference": difference(network, bricks, sets[bricks]),
        "times_fields": fields / compiled,
    }


def holds(table: pd.DataFrame) -> bool:
    return bool((table["times_fields"] >= FASTER).all() and table["difference"].max() <= CLOSE)


def experiment(options: Options) -> Finding:
    cases, rounds = ([("dome163", 60)], 2) if options.quick else (CASES, 5)
    table = pd.DataFrame([row(*case, rounds) for case in cases])
    print(table.to_string(index=False, float_format="%.3g"))
    return Finding(holds(table), tables={"extremes": table})


CLAIM = Claim(
    experiment,
    digits=4,
    quick="one case",
    timed=True,
    needs=(Extra("numba", "pip install 'seqopt[fast]'"),),
)
