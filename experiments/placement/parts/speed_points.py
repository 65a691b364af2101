"""One scene by every engine and formulation: the points of README's chart.

What is timed is the processor, on one core: other programs on the machine add nothing.

Command: ``python -m experiments.placement.parts.speed_points SCENE SECONDS`` prints rows as JSON.
"""

from __future__ import annotations

import _thread
import json
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pandas as pd

import seqopt
from seqopt.report._speed._measure import Timer, speed_accuracy
from seqopt.report._speed._table import SpeedTable
from seqopt.sequence.schedule_file import find_schedule

SCENES = ("arch25", "barrel:test=1", "wall:columns=4,courses=3")
REFERENCE, CRITERION = "compliance", "equations-2-3"
ABOUT = ["scene", "bricks", "method", "reference", "limit"]


@contextmanager
def ending_by_processor(seconds: float) -> Iterator[None]:
    """Raise `TimeoutError` in a block that takes more processor time than it may."""
    over: list[int] = []

    def end(number: int, _: object) -> None:
        over.append(number)
        _thread.interrupt_main()

    before = signal.signal(signal.SIGPROF, end)
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job hears none
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    except KeyboardInterrupt:
        if not over:
            raise
        raise TimeoutError from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
        signal.signal(signal.SIGINT, heard)


PROCESSOR = Timer(time.process_time, ending_by_processor)


def points(scene: str, seconds: float) -> pd.DataFrame:
    """Return a row for every engine and formulation, with what is said of all."""
    network = seqopt.build_network(seqopt.load_scene(scene))
    engine = seqopt.make_engine(REFERENCE, network)
    problem = seqopt.pose(engine, find_schedule(network), seqopt.CRITERIA[CRITERION])
    found = speed_accuracy(problem, seconds, timer=PROCESSOR)
    return found.table.assign(**{name: getattr(found, name) for name in ABOUT})


def speed_tables(rows: pd.DataFrame) -> list[SpeedTable]:
    """Return stored rows as what they were made from, a scene after the other."""
    rows = rows.assign(why=rows["why"].astype(object).fillna(""))
    return [
        SpeedTable(*about, own.reset_index(drop=True))  # type: ignore[misc]
        for about, own in rows.groupby(ABOUT, sort=False)
    ]


if __name__ == "__main__":
    print(json.dumps(points(sys.argv[1], float(sys.argv[2])).to_dict("records")))
