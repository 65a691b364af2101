"""Dask's executor on a local cluster: the same results, also where a worker is killed."""

import os
import signal
import threading
import time

import numpy as np
import pytest

from seqopt.engines.registry import make_engine
from seqopt.plan.solve import graph_of, pose
from seqopt.responses import _grip_sets as batches
from seqopt.responses._grip_sets import HERE, Resources
from seqopt.study import EQUATIONS
from seqopt.work import _keep

distributed = pytest.importorskip("distributed", reason="extra dask")

pytestmark = [
    pytest.mark.slow,  # a cluster takes seconds to begin
    pytest.mark.filterwarnings("ignore"),  # what a cluster says as it starts, ends, loses workers
    pytest.mark.xdist_group("dask"),
]


@pytest.fixture(scope="module")
def client():
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None}
    with (
        distributed.LocalCluster(processes=True, **options) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


def evaluated(schedule, resources):
    engine = make_engine("auto", schedule.scene)
    graph = graph_of(pose(engine, schedule, EQUATIONS, resources=resources))
    levels = [k for k in range(1, graph.space.levels + 1) if graph.space.open_columns(k)]
    with _keep(resources.executor, resources.workers):
        every = [graph.seen(k, graph.space.candidates(k).states).responses for k in levels]
    return np.concatenate([own[name] for own in every for name in sorted(own)])


def require_same(found, expected):
    most = 1e-11 * np.nanmax(np.abs(expected))
    assert found == pytest.approx(expected, rel=1e-9, abs=most, nan_ok=True)


@pytest.fixture(scope="module")
def expected(loop25):
    return evaluated(loop25, HERE)


def test_a_machine_that_is_lost_takes_nothing_with_it(client, loop25, expected, monkeypatch):
    monkeypatch.setattr(batches, "BLOCK", 60)
    blocks = evaluated(loop25, HERE)
    before = client.run(os.getpid)
    victim = next(iter(before.values()))

    def kill():
        while client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)) < 2:
            time.sleep(0.005)
        os.kill(victim, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    found = evaluated(loop25, Resources(executor=client.get_executor(retries=2), workers=2))
    killer.join()
    require_same(found, blocks)
    assert victim not in client.run(os.getpid).values()
