"""Claim: two processes answer a large scene's states at least 1.6 times as fast as one, by fields.

That is by the time that they compute, with a core each: on a shared machine the clock says more of
others. Where compiled loops are installed one process keeps two cores busy already, which is
measured beside it. The answers are the same to the last bit, on Dask's local cluster too.

Method: the states of the three-robot loop's steps with one open grip, those that a search without
proof needs, of the vault of 338 bricks (``--scene`` takes another: ``chain100``, ``wall``, or a
name of `seqopt.load_scene`; ``--pairs`` takes all steps). One process and two take turns, then
comes Dask's local cluster of two, in one run and each from a new engine; starting the processes
counts, the cluster is started before. Load is what waited for the cores of the machine when the run
began.

Inputs: none. Command: ``python -m experiments parallel [--quick] [--scene NAME]
[--pairs]``; stored rows of other scenes stay.
"""

import os
import resource
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Option, Options
from experiments.harness.results import RESULTS
from experiments.harness.scenes import half_circle, running_bond
from seqopt import Network, Schedule, build_network, load_scene, make_engine, three_robot_loop
from seqopt.engines.rigid._extremes import can_compile
from seqopt.responses import _choices
from seqopt.responses._blocks import StepChoices
from seqopt.responses._choices import Evaluation
from seqopt.responses.resources import Resources
from seqopt.work._workers import hire, map_ordered

TWO = 1.6  # times as fast as one process that two have to be
WANTED = frozenset({"T_max", "M_sup", "D_max", "F_largest"})
ROUNDS = 1
SMALL = "chain30"  # too small for compiled loops
STORE = RESULTS / "parallel.csv"


@dataclass(frozen=True)
class Run:
    """One way's answers, and what they took, s."""

    steps: tuple[StepChoices, ...]
    models: int
    seconds: float
    cpu: float


def network_of(name: str) -> Network:
    """Return the network of a scene by name; ``chain`` and a number is a half circle."""
    if name.startswith("chain"):
        return half_circle(int(name.removeprefix("chain")))
    return build_network(running_bond(12, 8) if name == "wall" else load_scene(name))


def cpu() -> float:
    """Return the time that this process and its ended children computed, s."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(each.ru_utime + each.ru_stime for each in used)


def run(network: Network, schedule: Schedule, resources: Resources) -> Run:
    start, before = time.perf_counter(), cpu()
    found = Evaluation(make_engine("compliance", network), schedule, lambda _: WANTED, resources)
    return Run(found.steps, found.models, time.perf_counter() - start, cpu() - before)


HERE = {"one process": Resources(), "two processes": Resources(workers=2)}


@contextmanager
def cluster() -> Iterator[dict[str, Resources]]:
    """Have Dask's local cluster where it is installed, which keeps its memory as processes do.

    By default it gives memory back all the time, and so do all processes that are started after.
    """
    if find_spec("distributed") is None:
        yield {}
        return
    import dask  # noqa: PLC0415  # an extra
    from distributed import Client, LocalCluster  # noqa: PLC0415

    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        dask.config.set({"distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**27}),
        LocalCluster(processes=True, **options) as local,
        Client(local) as client,
    ):
        yield {"dask, two processes": Resources(2, client.get_executor())}


def overhead(resources: Resources, calls: int = 64) -> float:
    """Return what sending one call that does nothing, and its answer, takes, s."""
    with hire(resources.executor, resources.workers) as crew:
        list(map_ordered(abs, range(2), crew))  # the processes are there
        start = time.perf_counter()
        list(map_ordered(abs, range(calls), crew))
        return (time.perf_counter() - start) / calls


@contextmanager
def loops(kind: str) -> Iterator[None]:
    """Have extremes by compiled loops where there is much to do, or always by fields."""
    usual = _choices.COMPILED
    try:
        _choices.COMPILED = usual if kind == "compiled" else np.inf
        yield
    finally:
        _choices.COMPILED = usual


def measured(name: str, rounds: int, *, single: bool) -> pd.DataFrame:
    """Return a row per way, by fields and, where they are installed and used, by compiled loops."""
    kinds = ("fields", "compiled") if can_compile() and name != SMALL else ("fields",)
    tables = []
    for kind in kinds:
        with loops(kind):
            tables.append(by_ways(name, rounds, single=single).assign(loops=kind))
    return pd.concat(tables, ignore_index=True)


def by_ways(name: str, rounds: int, *, single: bool) -> pd.DataFrame:
    """Return a row per way, the ways having taken turns."""
    network, load = network_of(name), os.getloadavg()[0]
    schedule, most = three_robot_loop(network), 1 if single else 2  # grips that are open
    steps = tuple(step for step in schedule.steps if len(step.moves) <= most)
    schedule = replace(schedule, steps=steps)
    runs: dict[str, list[Run]] = {}
    sent: dict[str, float] = {}

    def _take_turns(ways: Mapping[str, Resources]) -> None:
        for _ in range(rounds):
            for way, resources in ways.items():
                runs.setdefault(way, []).append(run(network, schedule, resources))
        sent.update({way: overhead(resources) for way, resources in ways.items()})

    _take_turns(HERE)
    with cluster() as ways:
        _take_turns(ways)
    alone = runs["one process"]
    rows = []
    for way, mine in runs.items():
        took, base = (
            np.array([[each.seconds, each.cpu] for each in some]) for some in (mine, alone)
        )
        if "dask" in way:
            took[:, 1] = np.nan  # its processes go on: what they computed is not known
        clock, computed = np.median(base / took, axis=0)
        row = {"scene": name, "states": "single moves" if single else "all", "way": way}
        row |= {"models": mine[0].models}
        row |= dict(zip(("seconds", "cpu_s"), np.median(took, axis=0), strict=True))
        row |= {"times_as_fast_by_clock": clock}
        row |= {"times_as_fast_by_cpu": (1 if way == "one process" else 2) * computed}
        row |= {"call_s": sent[way], "same": all(own.steps == alone[0].steps for own in mine)}
        rows.append(row | {"load": load, "cores": os.cpu_count()})
    return pd.DataFrame(rows)


def holds(table: pd.DataFrame) -> bool:
    two = table[(table["way"] == "two processes") & (table["loops"] == "fields")]
    return bool(table["same"].all() and len(two) and (two["times_as_fast_by_cpu"] >= TWO).all())


def experiment(options: Options) -> Finding:
    name = SMALL if options.quick else options.scene
    table = measured(name, 1 if options.quick else ROUNDS, single=not options.pairs)
    print(table.to_string(index=False, float_format="%.4g"))
    old = pd.read_csv(STORE) if STORE.exists() else table[:0]
    kept = old[(old["scene"] != name) | (old["states"] != table["states"][0])]
    merged = pd.concat([kept, table]) if len(kept) else table
    return Finding(holds(table), tables={"parallel": merged})


CLAIM = Claim(
    experiment,
    digits=4,
    quick="a chain of 30 bricks in one round, too few to gain",
    timed=True,
    options=(Option("--scene", "which scene", "vault338"), Option("--pairs", "all steps")),
)
