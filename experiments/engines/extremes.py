"""Claim: compiled loops compare grip sets at least 1.5 times as fast as fields and agree with them.

What optimization asks of a grip set is the largest tension of any edge, displacement of any node,
moment at any ground end, and the forces of its grips. Where numba is installed and there is much to
do, the engine computes these extremes by compiled loops and keeps no fields; else it takes them
from the fields. Both agree to 1e-11 of what adds up in them, the largest force of a grip times what
a unit force there means; to 1e-12 where these do not nearly cancel, as on long chains they do.

Method: random sets of three grips on `arch25` with 17 and with 25 bricks, a chain of 99 and the
vault with 100 and with 337. Fields and compiled loops take turns in one process on one core, whole
calls of the engine with all checks, as seconds of the processor; the least of rounds. Beside them
batches of a hundred sets by both, and single calls for fields.

Inputs: the shipped scenes; seed 0; numba. Command: ``OPENBLAS_NUM_THREADS=1 python -m experiments
extremes [--quick]``.
"""

import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Extra, Finding, Options
from experiments.harness.scenes import grip_sets
from seqopt import build_network, load_scene
from seqopt.arrays import Ints
from seqopt.engines.interface import Want
from seqopt.engines.rigid.compliance import ComplianceEngine

CASES = (
    ("arch25", 17, 20_000),
    ("arch25", 25, 20_000),
    ("chain:bricks=100", 99, 8000),
    ("vault338", 100, 4000),
    ("vault338", 337, 2100),
)
FASTER, CLOSE = 1.5, 1e-11
WANT, FEW = Want.RESPONSES | Want.SCREEN, 100  # as optimization asks


def taken(calls: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Return the least seconds of the processor that each call takes, in turns."""
    least = dict.fromkeys(calls, np.inf)
    for _ in range(rounds):
        for name, call in calls.items():
            start = time.process_time()
            call()
            least[name] = min(least[name], time.process_time() - start)
    return least


def difference(engine: ComplianceEngine, bricks: int, sets: Ints) -> float:
    """Return the largest difference of both loops, over what adds up in each extreme."""
    plain = engine._extremes(bricks, sets, WANT)
    fast = engine._extremes(bricks, sets, WANT, compiled=True)
    engine.solve(bricks, sets[:FEW])
    operator = engine._kept[bricks]
    pull = plain.force.max()
    unit = [np.abs(operator.mean(n)[:-1]).max() for n in ("edge_force", "displacement", "support")]
    scales = [unit[0], unit[0], unit[1], unit[2], 1.0]
    gaps = zip(plain, fast, scales, strict=True)
    return float(max(np.abs(a - b).max() / (pull * each) for a, b, each in gaps))


def row(name: str, bricks: int, count: int, rounds: int) -> dict[str, object]:
    """Return what sets of three grips take in one case, µs each."""
    engine = ComplianceEngine(build_network(load_scene(name)))
    sets = grip_sets(engine.network, bricks, count)
    ask = partial(engine._extremes, bricks, want=WANT, compiled=True)
    gap = difference(engine, bricks, sets)
    many = {"fields": lambda: engine._extremes(bricks, sets, WANT), "compiled": lambda: ask(sets)}
    few = {
        "fields_hundred": lambda: engine.solve(bricks, sets[:FEW]),
        "hundred": lambda: ask(sets[:FEW]),
    }
    one = {"call": lambda: engine.solve(bricks, sets[:1])}
    found = {"scene": name, "bricks": bricks}
    for calls, size, times in ((many, len(sets), 1), (few, FEW, 20), (one, 1, 50)):
        found |= {f"{k}_us": 1e6 * v / size for k, v in taken(calls, times * rounds).items()}
    return found | {"difference": gap, "times_fields": found["fields_us"] / found["compiled_us"]}


def holds(table: pd.DataFrame) -> bool:
    return bool((table["times_fields"] >= FASTER).all() and table["difference"].max() <= CLOSE)


def experiment(options: Options) -> Finding:
    cases, rounds = ([("arch25", 17, 500)], 2) if options.quick else (CASES, 7)
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
