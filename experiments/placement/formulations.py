"""Claim: on loops and free schedules all formulations that prove a plan find one least value.

No plan of another one is better, and no lower bound is above it. From 25 bricks on no program
of integers is sooner than dynamic programming, and within a budget none sooner than labels. Of the
exact ones the search by thresholds computes the fewest responses where the worst step of a free
schedule counts.

Method: the loop of three robots by the paper's sum of ranks, the same within nine tenths of the
travel that its best plan takes, the loop's worst step, and worst step and sum of a free schedule,
criterion `worst-ratio-published`, on arches in the shape of `arch25` of 7 to 145 bricks. Every
formulation and exhibit that is registered is asked every question, in a process of its own with at
most `MEMORY`: it may choose for `LIMIT`, and its plan is then proven, unless that takes more than
`MOST` in all. Seconds are of the processor, from the scene to the proof, the best of three runs
where they are less than one. Beside them the bare cut (`strict_cut`), which computes responses of
the states strictly below the least worst step and nothing else: it is what a proof cannot do
without. What is refused, fails or does not end is not asked on a larger arch.

Inputs: the shipped scenes. Command: ``python -m experiments formulations --store`` appends a row
as soon as it is known, leaves out what is stored already, and begins nothing after `MINUTES`; give
it again to go on. It takes two cores; to begin anew, remove the stored file.
"""

import resource
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from itertools import product
from multiprocessing import get_context
from textwrap import wrap
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from experiments.harness.charts import subplots
from experiments.harness.claim import Claim, Finding, Option, Options
from experiments.harness.results import RESULTS, drawn, stored
from experiments.harness.scenes import scene_named
from seqopt import CRITERIA, FreeRules, Search, build_network, make_engine, optimize
from seqopt.errors import InfeasibleError, ProblemError, TimeUpError
from seqopt.graph.formulation import exhibits, formulations
from seqopt.graph.states import build_states
from seqopt.report._style import SMALL, plain, styled


class Question(NamedTuple):
    """What is asked, and whose time others are compared with."""

    moves: str
    criterion: str
    aim: str | None
    base: tuple[str, str]  # question and name of a row


LEAST, RANKS, BUDGET, WORST, FREE, SUM = (
    *("sum", "loop, ranks", "loop, ranks in a budget", "loop, worst step"),
    *("free, worst step", "free, sum"),
)
LOOP, RATIO, CUT, DP = "three-robot", "worst-ratio-published", "strict cut", "overlap_dp"
QUESTIONS = {
    RANKS: Question(LOOP, "equations-2-3", None, (RANKS, DP)),
    BUDGET: Question(LOOP, "equations-2-3", None, (RANKS, DP)),
    WORST: Question(LOOP, RATIO, "minmax", (WORST, DP)),
    FREE: Question("free", RATIO, "minmax", (FREE, CUT)),
    SUM: Question("free", RATIO, "sum", (SUM, DP)),
}
SIZES = (7, 13, 25, 49, 97, 145)
TRAVEL = 0.9  # of what the best plan takes
LIMIT, MOST, MINUTES, TOGETHER = 20.0, 60.0, 23.0, 2  # s to choose, s of a cell, min in all
MEMORY = 5 * 2**30  # bytes of a process
SHORT = 1.0  # s
CLOSE = 1e-6
FROM = 25  # bricks from which on times are compared
NAME = "formulations"
KEY = ["question", "bricks", "formulation"]
COLUMNS = [*KEY, "kind", "ended", "value", "bound", "gap", "proven", "models", "seconds", "said"]
ENDINGS: dict[type[BaseException], str] = {
    InfeasibleError: "infeasible",
    ProblemError: "refused",
    TimeUpError: "out of time",
    MemoryError: "out of memory",
    Exception: "failed",
    KeyboardInterrupt: "out of time",
}  # the first that fits
PLANS = ("optimal", "feasible")  # how a row ended that goes on to larger arches
PROGRAMS = ("overlap_mip", *exhibits())
Cell = tuple[str, int, str, float]  # the key of a row, and a number: a budget, or where to cut


def contenders() -> dict[str, str]:
    """Return the kinds of all formulations by their names, exact ones first, exhibits last."""
    order = ("exact", "bound", "heuristic")
    own = sorted(formulations().items(), key=lambda item: order.index(item[1].kind.value))
    shown = dict.fromkeys(exhibits(), "exhibit")
    return {name: each.kind.value for name, each in own} | shown | {CUT: "yardstick"}


def scene(bricks: int):
    return scene_named("arch25" if bricks == 25 else f"chain{bricks}")


def strict_cut(bricks: int, value: float) -> tuple[bool, int]:
    """Return whether states strictly below a worst step reach an end, and models that this took.

    Level by level, with responses computed anew and in whole batches.
    """
    engine = make_engine("compliance", build_network(scene(bricks)))
    problem = build_states(engine, FreeRules(), CRITERIA[RATIO], "minmax")
    space, most = problem.space, value * (1 - 1e-9)
    entering = {space.first: [space.start()]}
    for level in range(space.first, space.levels + 1):
        fresh, known = np.concatenate(entering.pop(level, [space.start()[:0]])), np.zeros(0, int)
        while len(fresh):
            codes, first = np.unique(space.codes(fresh), return_index=True)
            states = fresh[first[~np.isin(codes, known, assume_unique=True)]]
            known = np.union1d(known, codes)
            if level > space.first:
                values, allowed = problem.values(level, states)
                states = states[allowed & (values[:, 0] < most)]
            if level == space.levels and space.ended(states).any():
                return True, problem.models
            inner = space.within(level, states) if level else ()
            fresh = np.concatenate([states[:0], *(moves.states for moves, _ in inner)])
            if level < space.levels:
                onward = space.onward(level, states[space.may_place(level, states)])
                entering.setdefault(level + 1, []).extend(moves.states for moves, _ in onward)
    return False, problem.models


def cut(bricks: int, value: float) -> dict[str, object]:
    """Return the row of the bare cut at a value."""
    open_end, models = strict_cut(bricks, value)
    ended, bound = ("feasible", np.nan) if open_end else ("optimal", value)
    return {"ended": ended, "bound": bound, "proven": not open_end, "models": models}


def plan(question: str, bricks: int, name: str, budget: float) -> dict[str, object]:
    """Return the row of a plan and its proof, made from the scene on."""
    asked = QUESTIONS[question]
    found = optimize(
        scene(bricks),
        *(asked.moves, asked.criterion, name),
        aim=asked.aim,
        limits="linear_range=any",  # else a plan beyond it is sought anew
        budgets=f"travel={budget}m" if budget else (),
        search=Search(time_limit=LIMIT),
    )
    proof, aim = found.certificate, asked.aim or LEAST
    if aim not in found.objective:
        raise ProblemError(f"{name} minimizes {', '.join(found.objective)}, not the {aim}")
    bound, gap = (proof.bounds[0], proof.gap) if proof else (-np.inf, np.inf)
    ended = "stopped" if found.stopped else "optimal" if gap <= CLOSE else "feasible"
    row = {"ended": ended, "value": found.objective[aim], "bound": bound, "gap": gap}
    return row | {"proven": gap <= CLOSE, "models": found.models}


def run(*cell: object) -> dict[str, object]:
    """Return a row, or why there is none, with the seconds of this process."""
    question, bricks, name, number = cell
    start = time.process_time()
    try:
        row = cut(bricks, number) if name == CUT else plan(question, bricks, name, number)
    except (Exception, KeyboardInterrupt) as error:  # a cell that fails is a row, whatever fails
        ended = next(word for kind, word in ENDINGS.items() if isinstance(error, kind))
        row = {"ended": ended, "said": str(error)}
    return row | {"seconds": time.process_time() - start}


def best(*cell: object) -> dict[str, object]:
    """Return the row of a run, of the best of three where it is short."""
    first = run(*cell)
    again = 2 * (first["seconds"] < SHORT and first["ended"] in PLANS)
    return min([first, *(run(*cell) for _ in range(again))], key=lambda row: row["seconds"])


def limited(memory: float, most: float) -> None:
    """Let this process have so much memory, and end what it does after so many seconds, twice."""

    def end(*_: object) -> None:
        raise KeyboardInterrupt  # a proof that is interrupted leaves a plan without it

    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CPU, (int(2 * most) + 1, int(2 * most) + 1))
    signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, most)


def alone(*cell: object, memory: float = MEMORY, most: float = MOST) -> dict[str, object]:
    """Return the row of a process of its own."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["experiments.placement.formulations"])
    with ProcessPoolExecutor(1, context, limited, (memory, most)) as pool:
        try:
            return dict(pool.submit(best, *cell).result())
        except (BrokenProcessPool, KeyboardInterrupt, MemoryError):  # of its own limits
            return {"ended": "killed", "said": "by a limit of time or memory"}


def cells(bricks: int, rows: pd.DataFrame) -> Iterator[tuple[str, int, str]]:
    """Yield what is to be asked of an arch, given the rows that there are."""
    smaller = rows[(rows["bricks"] < bricks) & ~rows["ended"].isin(PLANS)]
    done = {*zip(rows["question"], rows["bricks"], rows["formulation"], strict=True)}
    over = {*zip(smaller["question"], smaller["formulation"], strict=True)}
    for question in QUESTIONS:
        for name in contenders():
            fits = question == FREE if name == CUT else True
            if fits and (question, name) not in over and (question, bricks, name) not in done:
                yield question, bricks, name


def number_for(question: str, bricks: int, rows: pd.DataFrame, *, cuts: bool) -> float:
    """Return the value of a cut or the budget, m; zero where a question has none."""
    if cuts:
        own = rows[(rows["question"] == question) & (rows["bricks"] == bricks)]
        return float(own["value"].min())
    if question != BUDGET:
        return 0.0
    asked = QUESTIONS[RANKS]
    least = optimize(scene(bricks), asked.moves, asked.criterion, "labels", budgets="travel=1e9m")
    return TRAVEL * least.objective["travel"]


def measured(wanted: list[Cell], end: float, *, apart: bool) -> Iterator[dict[str, object]]:
    """Yield rows as they come, two at a time; nothing is begun after the end."""
    kinds = contenders()

    def row(*cell: object) -> dict[str, object] | None:
        if time.monotonic() > end:
            return None
        key = dict(zip([*KEY, "kind"], [*cell[:3], kinds[cell[2]]], strict=True))
        return key | {"said": ""} | (alone if apart else run)(*cell)

    pool = ThreadPoolExecutor(TOGETHER if apart else 1)
    try:
        for job in as_completed([pool.submit(row, *cell) for cell in wanted]):
            if (found := job.result()) is not None:
                yield found
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def append(row: dict[str, object]) -> None:
    """Add a row to those that are stored."""
    path = RESULTS / f"{NAME}.csv"
    line = pd.DataFrame([row]).reindex(columns=COLUMNS)
    form = {"index": False, "float_format": "%.9g", "lineterminator": "\n"}
    line.to_csv(path, mode="a", header=not path.exists(), **form)


def experiment(options: Options) -> Finding:
    end = time.monotonic() + 60 * MINUTES
    known = options.store and (RESULTS / f"{NAME}.csv").exists()
    rows = stored(NAME) if known else pd.DataFrame(columns=COLUMNS)
    for bricks in (n for n in SIZES if n <= (SIZES[0] if options.quick else int(options.most))):
        for last in (False, True):  # the cut needs a value
            asked = [cell for cell in cells(bricks, rows) if (cell[2] == CUT) == last]
            if asked and time.monotonic() > end:
                print("the time is over: give the command again to go on")
                return Finding(holds(rows.reindex(columns=COLUMNS)), ", rows are lacking")
            questions = dict.fromkeys(question for question, *_ in asked)
            numbers = {each: number_for(each, bricks, rows, cuts=last) for each in questions}
            wanted = [(*cell, numbers[cell[0]]) for cell in asked if np.isfinite(numbers[cell[0]])]
            found = []
            for row in measured(wanted, end, apart=not options.quick):
                print(*(row.get(name, "") for name in COLUMNS), sep=", ", flush=True)
                found.append(row)
                if options.store:
                    append(row)
            rows = pd.concat([rows, pd.DataFrame(found)]) if len(rows) else pd.DataFrame(found)
    return Finding(holds(rows.reindex(columns=COLUMNS)))


def ratios(rows: pd.DataFrame) -> pd.Series:
    """Return how many times as long as the base of its question each row took."""
    seconds = rows.set_index(["question", "formulation", "bricks"])["seconds"]
    keys = zip(rows["question"].map(lambda q: QUESTIONS[q].base), rows["bricks"], strict=True)
    return rows["seconds"] / [seconds.get((*base, bricks), np.nan) for base, bricks in keys]


def holds(rows: pd.DataFrame) -> dict[str, bool]:
    """Return whether each part of the claim does."""
    plans = rows[rows["value"].notna()]
    by = [plans["question"], plans["bricks"]]
    least = plans["value"].where(plans["proven"].astype(bool)).groupby(by).transform("min")
    values, bounds = plans["value"].astype(float), plans["bound"].astype(float)
    proven = plans["proven"].astype(bool) & least.notna()
    one = (values <= least * (1 + CLOSE))[proven] & (values >= least * (1 - CLOSE))[proven]
    large = plans[(plans["bricks"] >= FROM) & (plans["kind"] != "heuristic")]
    large = large[large["ended"] != "stopped"]  # the seconds of others are the limit's
    times = large.pivot_table("seconds", ["question", "bricks"], "formulation")
    programs = times[times.columns.intersection(PROGRAMS)].min(axis=1)
    other = times[DP].fillna(times["labels"]) if len(times) else programs
    worst = plans[(plans["question"] == FREE) & (plans["kind"] == "exact")]
    models = worst[worst["ended"] == "optimal"].pivot_table("models", "bricks", "formulation")
    return {
        "all that are proven have one value": bool(one.all()),
        "no plan is better": bool((~(values < least * (1 - CLOSE))).all()),
        "no bound is above it": bool((~(bounds > least * (1 + CLOSE))).all()),
        "programs are no sooner": bool((~(programs < other)).all()),
        "thresholds need the fewest responses": models.empty
        or bool((models.min(axis=1) == models["schedule_search"]).all()),
    }


@styled
def chart(rows: pd.DataFrame) -> Figure:
    """Draw how long each formulation takes, and what it leaves open, a panel per question."""
    plans = rows.assign(ratio=ratios(rows))[rows["value"].notna()]
    names = [name for name in contenders() if name in {*plans["formulation"]}]
    sizes = sorted(plans["bricks"].unique())
    figure, panels = subplots(0.19 * len(names) + 1.9, 1, len(QUESTIONS), sharey=True)
    for panel, question in zip(panels, QUESTIONS, strict=True):
        own = plans[plans["question"] == question]
        grid = own.pivot_table("ratio", "formulation", "bricks").reindex(names, columns=sizes)
        image = panel.imshow(grid, cmap="YlOrBr", norm=LogNorm(0.5, 200), aspect="auto")
        cells = own.set_index(["formulation", "bricks"])
        for name, bricks in product({*own["formulation"]}, sizes):
            text = told(cells.loc[name, bricks]) if (name, bricks) in cells.index else "–"
            place = sizes.index(bricks), names.index(name)
            panel.text(*place, text, ha="center", va="center", fontsize=SMALL)
        panel.set_xticks(range(len(sizes)), sizes, rotation=90)
        panel.set_title("\n".join(wrap(question, 11)))
        panel.tick_params(length=0)
    panels[0].set_yticks(range(len(names)), [each.replace("_", " ") for each in names])
    figure.supxlabel("bricks")
    bar = figure.colorbar(image, ax=list(panels), location="top", aspect=60, shrink=0.7)
    bar.set_label("times as long as dynamic programming (free, worst step: as the bare cut)")
    plain(bar.ax.xaxis)
    return figure


def told(row: pd.Series) -> str:
    """Return what a cell says: nothing where a plan is proven, else its gap in percent."""
    if row["proven"]:
        return ""
    if not np.isfinite(row["gap"]):
        return "?"
    return f"{100 * row['gap']:.0f}" if row["gap"] >= 0.01 else "<1"


CLAIM = Claim(
    experiment,
    quick="seven bricks, one after the other in this process",
    options=(Option("--most", "bricks of the largest arch", str(SIZES[-1])),),
    pictures={f"{NAME}.png": drawn(chart, NAME)},
)
