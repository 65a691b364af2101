"""Work that splits: as a loop, whoever works; workers that die end in a line, and leave nothing."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial

import pytest

from seqopt import work
from seqopt.errors import SolverError, WorkerError
from seqopt.work import Progress, map_ordered, worker_pool
from tests.builders import ROOT
from tests.work.tasks import die_once, die_while_sending, own_error, square, square_or_fail

TASKS = range(12)
WANTED = [number * number for number in range(12)]


@pytest.mark.slow
def test_results_come_in_order_whoever_works():
    assert list(map_ordered(square, range(12))) == WANTED
    with worker_pool(workers=2) as pool:
        assert pool.workers == 2
        for _ in range(2):  # again, on the same processes
            assert list(map_ordered(square, TASKS, pool)) == WANTED
    assert multiprocessing.active_children() == []
    for kind in (ThreadPoolExecutor, ProcessPoolExecutor):
        with kind(2) as executor, worker_pool(executor) as pool:
            assert list(map_ordered(square, range(12), pool)) == WANTED


def test_tasks_are_taken_as_they_are_needed():
    taken = []

    def tasks():
        for number in range(1000):
            taken.append(number)
            yield number

    with ThreadPoolExecutor(2) as executor, worker_pool(executor) as pool:
        results = map_ordered(square, tasks(), pool)
        assert next(results) == 0
        assert len(taken) <= 8
        results.close()


@pytest.mark.slow
def test_the_first_error_is_raised_whoever_works():
    for workers in (1, 2):
        found, pool = [], worker_pool(workers=workers)
        with pytest.raises(SolverError, match="no square of 3"), pool as hired:
            found.extend(map_ordered(square_or_fail, TASKS[:9], hired))
    assert multiprocessing.active_children() == []


@pytest.mark.slow
@pytest.mark.parametrize("task", [die_once, die_while_sending])
def test_a_worker_that_dies_ends_in_a_line_and_keeps_nobody_waiting(tmp_path, task):
    """Amid an answer, the rest of it was waited for without end."""
    wanted = pytest.raises(WorkerError, match=r"ended without an answer .*BrokenProcessPool")
    with wanted as caught, worker_pool(workers=2) as pool:
        list(map_ordered(partial(task, tmp_path), TASKS, pool))
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir())  # it did die
    assert multiprocessing.active_children() == []


@pytest.mark.slow
@pytest.mark.parametrize("cancels", [False, True])
def test_a_run_that_is_ended_leaves_no_error_behind(monkeypatch, cancels):
    """Many calls wait when processes end; the control cancels them, over which a pool stumbles."""
    seen = []
    monkeypatch.setattr(threading, "excepthook", lambda seen_: seen.append(seen_.exc_type))
    with worker_pool(workers=2) as pool:
        if cancels:  # as calls of an executor of others
            monkeypatch.setattr(work, "_Processes", type(None))
        results = map_ordered(time.sleep, (0.0, *[30.0] * 20), pool)
        next(results)
        time.sleep(0.5)  # until the pool has nothing to do but wait
        results.close()
        for process in pool.executor._processes.values():
            process.kill()
        time.sleep(1.0)
    old = sys.version_info < (3, 12)  # its pools have the fault
    assert [error.__name__ for error in seen] == ["InvalidStateError"] * (cancels and old)


def test_an_executor_of_others_that_breaks_is_named(tmp_path):
    wanted = pytest.raises(WorkerError, match=r"without an answer .*BrokenProcessPool")
    with ProcessPoolExecutor(2) as executor, wanted, worker_pool(executor) as pool:
        list(map_ordered(partial(die_once, tmp_path), range(12), pool))


class Forgetful(Executor):
    """Loses every third task, or takes none: a cluster whose machines come and go."""

    def __init__(self, error):
        self.calls, self.error = 0, error

    def submit(self, function, /, *arguments, **named):
        self.calls += 1
        future = Future()
        if self.error:
            raise OSError(self.error)
        if self.calls % 3:
            future.set_result(function(*arguments, **named))
        else:
            future.set_exception(OSError("connection lost"))
        return future


@pytest.mark.parametrize("error", ["", "no machine yet"])
def test_what_an_executor_of_others_loses_is_named(error):
    wanted = pytest.raises(WorkerError, match=f"answer .*{error or 'connection lost'}")
    with wanted, worker_pool(Forgetful(error), workers=2) as pool:
        list(map_ordered(square, range(12), pool))


@pytest.mark.slow
def test_an_error_that_cannot_be_sent_is_an_error_in_a_line():
    with pytest.raises(WorkerError), worker_pool(workers=2) as pool:
        list(map_ordered(own_error, range(3), pool))


ENDLESS = """
import sys, time
from seqopt.work import map_ordered, worker_pool
if __name__ == "__main__":
    with worker_pool(workers=2) as pool:
        for _ in map_ordered(time.sleep, [0.1, 600, 600], pool):
            print("under way", flush=True)
"""


def alive(group):
    """Return the processes of a group that run."""
    shown = subprocess.run(
        ["ps", "-eo", "pgid,pid,stat"], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in shown.stdout.splitlines()[1:]]
    return [row[1] for row in rows if row[0] == str(group) and not row[2].startswith("Z")]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("how", ["SIGINT", "SIGKILL"])
def test_no_worker_outlives_its_master(tmp_path, how):
    script = tmp_path / "endless.py"
    script.write_text(ENDLESS, encoding="utf-8")
    run = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert run.stdout.readline() == "under way\n"
    assert len(alive(run.pid)) >= 3
    signal_ = getattr(signal, how)
    if how == "SIGINT":
        os.killpg(run.pid, signal_)  # as ctrl-C does: to all of them
    else:
        run.send_signal(signal_)
    run.stdout.close()
    said = run.stderr.read()
    run.wait(timeout=20)
    run.stderr.close()
    until = time.monotonic() + 20
    while alive(run.pid) and time.monotonic() < until:
        time.sleep(0.05)
    assert alive(run.pid) == []
    assert said.count("KeyboardInterrupt") == (how == "SIGINT")  # of the master alone


def test_progress_is_told_after_a_while_only(monkeypatch):
    said, now = [], [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    progress = Progress("responses", 10.0, said.append)
    for _ in range(10):
        now[0] += 0.4
        progress.add(1.0)
    assert str(said[0]) == "responses: 30 %, 3 s left"
    assert str(said[-1]) == "responses: 100 %, 0 s left"
    assert len(said) == 8
