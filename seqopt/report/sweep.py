"""Many problems side by side: a row of a table for every one, each solved by one worker.

Rows are written as they come, so that what was interrupted goes on where it ended.
"""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from seqopt._files import write_file
from seqopt.errors import InfeasibleError, MechanismError, ProblemError, SeqoptError, SolverError
from seqopt.exchange._files import csv_text
from seqopt.plan.plan import Plan
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.stability.verdict import Verdict
from seqopt.work import Stage, Tell, map_ordered, worker_pool
from seqopt.workflow import optimize

RANGE = re.compile(r"(?P<low>[^,=]+?)\.\.(?P<high>[^,=/]+)/(?P<count>\d+)(?P<log>log)?")
MOST = 10_000  # problems
DIGITS = 9  # of numbers in a table: a row that was read is one that was computed
WHY = {InfeasibleError: "infeasible", MechanismError: "mechanism", SolverError: "failed"}


def spread(text: str) -> tuple[str, ...]:
    """Return words with every value of every range in them: even, or with ``log`` in proportion.

    >>> spread("arch:span=1.5..2/2,rise=0.7")
    ('arch:span=1.5,rise=0.7', 'arch:span=2,rise=0.7')
    >>> spread("1e3..1e5/3log"), spread("1..12")  # the latter are bricks
    (('1000', '10000', '100000'), ('1..12',))
    """
    parts, last = list[Sequence[str]](), 0
    for found in RANGE.finditer(text):
        count = int(found["count"])
        try:
            ends = float(found["low"]), float(found["high"])
            values = (np.geomspace if found["log"] else np.linspace)(*ends, count)
        except ValueError as error:
            raise ProblemError(f"range {found[0]}: {error}; give LOW..HIGH/COUNT") from None
        parts += [text[last : found.start()]], [f"{value:.12g}" for value in values.tolist()]
        last = found.end()
    every = tuple(map("".join, product(*parts, [text[last:]])))
    if not 0 < len(every) <= MOST:
        raise ProblemError(f"range {text}: give from 1 to {MOST} values")
    return every


def sweep(
    problems: str | Sequence[Scene | Path | str] | Mapping[str, Mapping[str, str]],
    plan: Callable[[Any], Plan] = optimize,
    *,
    mortars: Sequence[str] | str = (),
    out: Path | str | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Plan many problems, each by one worker.

    Parameters
    ----------
    problems : str, sequence of Scene, str or pathlib.Path, or mapping of str to mapping
        Words with ranges, as ``"arch:span=2..3/5,rise=0.7"``; scenes, words or files, each with a
        name of its own; or by name what tells problems apart, a column each.
    plan : callable, optional
        Takes a scene, or what tells a problem apart, returns its plan: `seqopt.optimize`, of which
        ``functools.partial`` fixes other arguments. Other processes need a function of a module.
    mortars : sequence of str or str, optional
        With which it is proven how many steps fall: ``"dry"``, ``"epoxy"``.
    out : pathlib.Path or str, optional
        A CSV file that grows row by row; rows that it has are kept, and not computed again.
    workers, executor : optional
        How many processes solve problems, or who does, as ``client.get_executor()`` of dask.
    progress : callable, optional
        Called with the progress.

    Returns
    -------
    pandas.DataFrame
        A row per problem: ``problem``, ``status``, every goal and its lower bound
        (``NAME_bound``), ``gap``, ``steps``, ``models``, ``falls_MORTAR``, ``outside_range``,
        ``seconds``; of one without a plan ``why``.

    Raises
    ------
    SeqoptError
        If two problems have one name, or the file is none of a sweep; one without a plan is a row.

    Examples
    --------
    >>> from functools import partial
    >>> words = [f"chain:bricks={count}" for count in (7, 9)]
    >>> found = sweep(words, partial(optimize, schedule="free"))
    >>> found[["problem", "status", "minmax", "steps"]].round(4).to_dict("records")[0]
    {'problem': 'chain:bricks=7', 'status': 'optimal', 'minmax': 1.0, 'steps': 12}
    """
    given = spread(problems) if isinstance(problems, str) else problems
    every = [*given.values()] if isinstance(given, Mapping) else [*given]
    names = [getattr(each, "name", None) or str(each) for each in given]
    if twice := next((name for name in names if names.count(name) > 1), None):
        own = "give scenes names of their own, as dataclasses.replace(scene, name='stiff')"
        raise ProblemError(f"sweep: two problems are called {twice}; {own}")
    path = None if out is None else Path(out)
    rows = {} if path is None or not path.exists() else _read_rows(path)
    todo = [(name, each) for name, each in zip(names, every, strict=True) if name not in rows]

    def done(case: tuple[str, Any], row: dict[str, Any]) -> None:
        rows[case[0]] = {**case[1], **row} if isinstance(case[1], Mapping) else row
        if path is not None:  # rows of other problems stay in the file
            write_file(path, csv_text(_table(rows, [*dict.fromkeys([*names, *rows])]), DIGITS))
        if progress is not None:
            progress(Stage("problems", sum(name in rows for name in names) / len(names)))

    solve = partial(_row, plan, (mortars,) if isinstance(mortars, str) else tuple(mortars))
    with worker_pool(executor, workers) as pool:
        begun = todo if pool is None else todo[::-1]  # ranges go up: the largest is not left alone
        with closing(map_ordered(solve, begun, pool, done)) as found:
            deque(found, maxlen=0)
    return _table(rows, names)


def _row(
    plan: Callable[[Any], Plan], mortars: Sequence[str], case: tuple[str, Any]
) -> dict[str, Any]:
    """Return what a table says of a problem; with mortars how many steps fall."""
    start, (_, scene) = time.perf_counter(), case
    try:
        found = plan(load_scene(scene) if isinstance(scene, str | Path) else scene)
    except SeqoptError as error:
        status = next((text for kind, text in WHY.items() if isinstance(error, kind)), "refused")
        row: dict[str, Any] = {"status": status, "why": str(error)}
    else:
        falls = {name: found.verdicts(name) for name in mortars}
        row = {
            "status": str(found.status),
            **found.objective,
            **{f"{name}_bound": bound for name, bound in found.bound.items()},
            "gap": found.gap,
            "steps": len(found.steps),
            "models": found.models,
            **{f"falls_{name}": own.count(Verdict.FALLS) for name, own in falls.items()},
            "outside_range": found.outside,
        }
    return {**row, "seconds": time.perf_counter() - start}


def _read_rows(path: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of a file by problem."""
    try:
        table = pd.read_csv(path, dtype={"problem": str}).set_index("problem")
    except (OSError, ValueError, KeyError) as error:
        raise ProblemError(f"{path}: no table of a sweep: {error}; name another file") from None
    records = zip(table.index, table.to_dict("records"), strict=True)
    return {n: {str(k): v for k, v in row.items() if pd.notna(v)} for n, row in records}


def _table(rows: Mapping[str, dict[str, Any]], names: Sequence[str]) -> pd.DataFrame:
    """Return the rows there are, in the order of names; ``seconds`` and ``why`` stand last."""
    found = pd.DataFrame([{"problem": name, **rows[name]} for name in names if name in rows])
    last = [name for name in ("seconds", "why") if name in found]
    return found[[*(name for name in found if name not in last), *last]]
