"""Many problems side by side: a row of a table for every design, robot, criterion or payload.

Each problem is solved by one worker, which pays where workers within one problem do not. Rows are
written as they come, so that what was interrupted goes on where it ended.
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

from seqopt._files import csv_text, write_text
from seqopt.errors import InfeasibleError, MechanismError, ProblemError, SeqoptError, SolverError
from seqopt.plan.plan import Plan
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.work._workers import hire, map_ordered
from seqopt.work.progress import Stage, Tell
from seqopt.workflow import optimize

NUMBER = r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
RANGE = re.compile(rf"(?P<low>{NUMBER})\.\.(?P<high>{NUMBER})/(?P<count>\d+)(?P<log>log)?")
MOST = 100_000  # problems of one sweep
WORDS = "words"  # of the scene of a case, which what differs tells apart already
DIGITS = 9  # of numbers in a table: a row that was read is one that was computed
WHY = {InfeasibleError: "infeasible", MechanismError: "mechanism", SolverError: "failed"}

Case = Mapping[str, Any]
"""What a problem is told apart by: values by name; as text they name its row."""


def _spread_values(text: str) -> tuple[str, ...]:
    """Return the values of a range, ``1.5..2.5/5`` or ``1e5..1e9/5log``, or the text alone.

    Whole ends with a whole step between values give whole numbers.

    >>> _spread_values("7..13/3"), _spread_values("1e3..1e5/3log"), _spread_values("0.5..1/2")
    (('7', '10', '13'), ('1000', '10000', '100000'), ('0.5', '1'))
    """
    found = RANGE.fullmatch(text)
    if found is None:
        return (text,)
    low, high, count = float(found["low"]), float(found["high"]), int(found["count"])
    if not 1 <= count <= MOST or (found["log"] and not 0 < low <= high):
        raise ProblemError(f"range {text}: give from 1 to {MOST} values, of a log range above 0")
    values = (np.geomspace if found["log"] else np.linspace)(low, high, count)
    return tuple(f"{value:.12g}" for value in values)


def _spread_words(words: str) -> list[tuple[dict[str, str], str]]:
    """Return what tells scenes in words with ranges apart, and the words of each.

    >>> _spread_words("arch:span=1.5..2/2,rise=0.7")
    [({'span': '1.5'}, 'arch:span=1.5,rise=0.7'), ({'span': '2'}, 'arch:span=2,rise=0.7')]
    """
    kind, colon, rest = words.partition(":")
    parts = [part.partition("=") for part in rest.split(",")]
    values = [_spread_values(value) for *_, value in parts]
    named = {n for (n, _, value), own in zip(parts, values, strict=True) if own != (value,)}
    out = []
    for chosen in product(*values):
        own = {n: v for (n, _, _), v in zip(parts, chosen, strict=True) if n in named}
        said = [name + sign + value for (name, sign, _), value in zip(parts, chosen, strict=True)]
        whole = kind + colon + ",".join(said)
        out.append((own or {"scene": whole}, whole))
    return out


def sweep(
    scenes: Sequence[Scene | Path | str] | str,
    plan: Callable[[Any], Plan] = optimize,
    *,
    mortars: Sequence[str] = (),
    out: Path | str | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Plan many scenes, each by one worker.

    Parameters
    ----------
    scenes : str or sequence of Scene, str or pathlib.Path
        Words with ranges, as ``"arch:span=1.5..2.5/5,rise=0.6..0.9/3"``, or any scenes.
    plan : callable, optional
        Takes a scene, returns its plan: `seqopt.optimize`, of which ``functools.partial`` fixes
        other arguments. Workers of other processes need a function of a module.
    mortars : sequence of str, optional
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
        A row per problem: what tells it apart, ``status``, every goal and its lower bound
        (``NAME_bound``), ``gap``, ``steps``, ``models``, ``falls_MORTAR``, ``outside_range``,
        ``seconds``; of one without a plan ``why``.

    Raises
    ------
    SeqoptError
        If words make no scene, or the file cannot be written. A problem without a plan is a row.

    Examples
    --------
    >>> from functools import partial
    >>> found = sweep("chain:bricks=7..9/2", partial(optimize, schedule="free"))
    >>> found[["bricks", "status", "minmax", "steps"]].round(4).to_dict("records")[0]
    {'bricks': '7', 'status': 'optimal', 'minmax': 1.0, 'steps': 12}
    """
    if isinstance(scenes, str):
        cases: list[Case] = [{**own, WORDS: words} for own, words in _spread_words(scenes)]
    else:
        cases = [{"scene": each} for each in scenes]
    solve = partial(_plan_scene, plan, tuple(mortars))
    return _solve_cases(cases, solve, out, workers, executor, progress)


def _plan_scene(plan: Callable[[Any], Plan], mortars: Sequence[str], case: Case) -> dict[str, Any]:
    scene = case.get(WORDS, case.get("scene"))
    return _plan_row(plan(load_scene(scene) if isinstance(scene, str | Path) else scene), mortars)


def _plan_row(plan: Plan, mortars: Sequence[str] = ()) -> dict[str, Any]:
    """Return what a table says of a plan; with mortars how many steps fall."""
    falls = {name: int((plan.stability(name)["verdict"] == "falls").sum()) for name in mortars}
    return {
        "status": str(plan.status),
        **plan.objective,
        **{f"{name}_bound": bound for name, bound in plan.bound.items()},
        "gap": plan.gap,
        "steps": len(plan.steps),
        "models": plan.models,
        **{f"falls_{name}": count for name, count in falls.items()},
        "outside_range": plan.outside,
    }


def _solve_cases(  # what a sweep takes
    cases: Sequence[Case],
    solve: Callable[[Case], dict[str, Any]],
    out: Path | str | None = None,
    workers: int = 1,
    executor: Executor | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Return a row for every case, in their order: its names, and what ``solve`` says of it."""
    if not 0 < len(cases) <= MOST:
        raise ProblemError(f"sweep: it has {len(cases)} problems; give from 1 to {MOST}")
    path = None if out is None else Path(out)
    names, keys = [*_key(cases[0])], [tuple(_key(case).values()) for case in cases]
    if len({*keys}) < len(keys):
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ProblemError(
            f"sweep: two problems are called {', '.join(twice)}; give scenes names of their own, "
            "as dataclasses.replace(scene, name='stiff')"
        )
    rows = {} if path is None or not path.exists() else _read_rows(path, names)
    todo = [case for case, key in zip(cases, keys, strict=True) if key not in rows]

    def done(case: Case, row: dict[str, Any]) -> None:
        rows[tuple(_key(case).values())] = row
        if path is not None:  # rows of other problems stay in the file
            every = [*dict.fromkeys([*keys, *rows])]
            write_text(path, csv_text(_table(names, every, rows), DIGITS))
        if progress is not None:
            progress(Stage("problems", sum(key in rows for key in keys) / len(keys)))

    with hire(executor, workers) as crew:
        found = map_ordered(partial(_row, solve), todo, crew, done)
        with closing(found):
            deque(found, maxlen=0)
    return _table(names, keys, rows)


def _key(case: Case) -> dict[str, str]:
    """Return the names and texts that tell a case apart."""
    own = ((name, value) for name, value in case.items() if name != WORDS)
    return {name: getattr(value, "name", None) or str(value) for name, value in own}


def _row(solve: Callable[[Case], dict[str, Any]], case: Case) -> dict[str, Any]:
    start = time.perf_counter()
    try:
        row = solve(case)
    except SeqoptError as error:
        status = next((said for kind, said in WHY.items() if isinstance(error, kind)), "refused")
        row = {"status": status, "why": str(error)}
    return {**row, "seconds": time.perf_counter() - start}


def _read_rows(path: Path, names: list[str]) -> dict[tuple[str, ...], dict[str, Any]]:
    """Return the rows of a file by what tells them apart."""
    try:
        table = pd.read_csv(path, dtype=dict.fromkeys(names, str))
    except (OSError, ValueError) as error:
        raise ProblemError(f"{path}: no table of a sweep: {error}; name another file") from None
    if (columns := [*table][: len(names)]) != names:
        raise ProblemError(
            f"{path}: it has columns {', '.join(columns)}, not {', '.join(names)}; "
            "it is of another sweep, name another file"
        )
    return {
        tuple(row[name] for name in names): {
            str(name): cell for name, cell in row.items() if name not in names and pd.notna(cell)
        }
        for row in table.to_dict("records")
    }


def _table(
    names: list[str], keys: list[tuple[str, ...]], rows: Mapping[tuple[str, ...], dict[str, Any]]
) -> pd.DataFrame:
    """Return the rows there are, in the order of cases; ``seconds`` and ``why`` stand last."""
    found = [dict(zip(names, key, strict=True)) | rows[key] for key in keys if key in rows]
    columns = dict.fromkeys(name for row in found for name in row)
    last = [name for name in ("seconds", "why") if name in columns]
    return pd.DataFrame(found, columns=[*(name for name in columns if name not in last), *last])
