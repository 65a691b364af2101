"""Claim: two processes answer a large scene's states at least 1.6 times as fast as one, by fields.

That is by the time that they compute, with a core each: on a shared machine the clock says more of
others. Where compiled loops are installed one process keeps two cores busy already, which is
measured beside it. The answers are the same to the last bit, on Dask's local cluster too.

Method: the states of the three-robot loop's steps with one open grip, those that a search without
proof needs, of the vault of 338 bricks. One process and two take turns, then comes Dask's local
cluster of two, each from a new engine; starting the processes counts, the cluster is started
before. Load is what waited for the cores of the machine when the run began.

Inputs: the shipped scene. Command: ``python -m experiments parallel [--quick]``.
"""

import os
import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np
import pandas as pd

from experiments.harness.claim import Claim, Finding, Options
from seqopt import Network, Schedule, build_network, load_scene, make_engine, three_robot_loop
from seqopt.engines.rigid._extremes import can_compile
from seqopt.responses import _choices
from seqopt.responses._blocks import StepChoices
from seqopt.responses._choices import Evaluation
from seqopt.responses.resources import Resources
from seqopt.work._workers import hire, map_ordered

TWO = 1.6  # times as fast as one process that two have to be
WANTED = frozenset({"T_max", "M_sup", "D_max", "F_largest"})
SCENE, SMALL = "vault338", "chain:bricks=30"  # the latter too small for compiled loops


@dataclass(frozen=True)
class Run:
    """One way's answers, and what they took, s."""

    steps: tuple[StepChoices, ...]
    models: int
    seconds: float
    cpu: float


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


def measured(name: str, kind: str) -> pd.DataFrame:
    """Return a row per way, extremes being found by fields or by compiled loops."""
    network, load = build_network(load_scene(name)), os.getloadavg()[0]
    schedule = three_robot_loop(network)
    steps = tuple(step for step in schedule.steps if len(step.moves) <= 1)  # of grips that are open
    schedule, found = replace(schedule, steps=steps), dict[str, tuple[Run, float]]()
    with loops(kind):
        for way, resources in HERE.items():
            found[way] = run(network, schedule, resources), overhead(resources)
        with cluster() as others:
            for way, resources in others.items():
                found[way] = run(network, schedule, resources), overhead(resources)
    alone, rows = found["one process"][0], []
    for way, (own, sent) in found.items():
        computed = np.nan if "dask" in way else own.cpu  # what its processes computed is not known
        row = {"scene": name, "states": "single moves", "way": way, "models": own.models}
        row |= {"seconds": own.seconds, "cpu_s": computed}
        row |= {"times_as_fast_by_clock": alone.seconds / own.seconds}
        cores = 1 if way == "one process" else 2
        row |= {"times_as_fast_by_cpu": cores * alone.cpu / computed}
        row |= {"call_s": sent, "same": own.steps == alone.steps}
        rows.append(row | {"load": load, "cores": os.cpu_count(), "loops": kind})
    return pd.DataFrame(rows)


def holds(table: pd.DataFrame) -> bool:
    two = table[(table["way"] == "two processes") & (table["loops"] == "fields")]
    return bool(table["same"].all() and len(two) and (two["times_as_fast_by_cpu"] >= TWO).all())


def experiment(options: Options) -> Finding:
    kinds = ("fields", "compiled") if can_compile() and not options.quick else ("fields",)
    name = SMALL if options.quick else SCENE
    table = pd.concat([measured(name, kind) for kind in kinds], ignore_index=True)
    print(table.to_string(index=False, float_format="%.4g"))
    return Finding(holds(table), tables={"parallel": table})


CLAIM = Claim(
    experiment, digits=4, quick="a chain of 30 bricks, which are too few to gain", timed=True
)
