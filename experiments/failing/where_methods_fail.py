"""Claim: no answer is off by more than it says, under any kernel, and no step's verdict is false.

Method, numbers: engines answer grip sets of chains whose stiffness, size, ground, joints, grips and
units go to extremes, and are held against sixty digits. Formulations answer small problems whose
costs and budgets go to extremes, and are held against enumeration. An engine states the error that
it promises, a formulation the gap of its certificate. Both run under every kernel of OpenBLAS that
the machine has, each in a process of its own. Where a method is refused, another one must answer,
or the message must say that double precision cannot. Two other parts of the claim can be seen
there: a mechanism is called one, and a solver that fails is a counted failure, never a verdict.

Method, steps: builds of three arches, with two mortars, over friction and tilt. Every verdict of
`seqopt.stability` is held against two linear programs that share nothing with it, with polyhedra
inside and around the cones: where they decide, they must agree, and they must decide nearly all.
"""

import json
import os
import pickle
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from experiments.failing.parts import choice_cells, engine_cells, step_cells
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import apart, drawn
from experiments.harness.scenes import scene_named
from seqopt import build_network, cantilever, sequential
from seqopt.report._style import SMALL, VERMILION, new_figure, styled
from tests.quality.kernels import VARIABLE, every

NONE_CAN = "double precision"  # of a message that says that no engine can answer
DRAWS = 1  # problems of a cell, others under every kernel
CELL = ["half", "axis", "value", "method"]
SCENES = ("chain9", "chain13", "arch25")
HOLDS = ("dry", "bond=2e4")
AXES = {"friction": (0.2, 0.3, 0.4663, 0.6, 0.8), "tilt": (2.0, 8.0)}
OPEN = 0.02  # share of steps that the own programs may leave open


def numbers(*, quick: bool) -> pd.DataFrame:
    """Return how every method ends on every case under every kernel."""
    kernels = dict([*every().items()][:1]) if quick else every()
    tables = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "exact.pickle"
        exact = [engine_cells.exact(cell) for cell in engine_cells.cells(quick=quick)]
        path.write_bytes(pickle.dumps(exact))
        for place, (kernel, name) in enumerate(kernels.items()):
            words = [path, DRAWS * place, DRAWS * (place + 1), *(["quick"] if quick else [])]
            own = {VARIABLE: name} if name else {}
            found = apart(f"{__package__}.where_methods_fail", *words, env=os.environ | own)
            tables.append(pd.DataFrame(found).assign(kernel=kernel))
            print(f"{kernel}: {len(found)} answers and refusals", flush=True)
    return pd.concat(tables, ignore_index=True)


def one_kernel(path: str, first: str, last: str, *words: str) -> list[dict[str, object]]:
    """Return the rows of all cells of numbers under the kernel of this process."""
    quick, out = "quick" in words, []
    known = pickle.loads(Path(path).read_bytes())
    for cell, exact in zip(engine_cells.cells(quick=quick), known, strict=True):
        out += [{"half": "engines", **row} for row in engine_cells.rows(cell, exact)]
    for problem in choice_cells.cells(quick=quick):
        found = choice_cells.rows(problem, range(int(first), int(last)))
        out += [{"half": "formulations", **row} for row in found]
    return out


def unexplained(table: pd.DataFrame) -> pd.Series:
    """Return of which refusals no other method has an answer, and none says that none can."""
    same = table.groupby(["half", "kernel", "axis", "value", "case"])
    answered = same["status"].transform(lambda each: (each == "answered").any())
    said = same["message"].transform(lambda each: each.str.contains(NONE_CAN).any())
    known = said | (table["half"] == "formulations")  # whose messages are asked for one by one
    return (table["status"] == "refused") & ~answered & ~known


def cells(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row for every cell of the map: how methods end, and their largest error."""
    table = table.fillna({"message": ""}).assign(unexplained=unexplained)
    table["off"] = table["error"] / table["stated"]
    counts = pd.crosstab([table[name] for name in CELL], table["status"])
    ends = ["answered", "refused", "mechanism", "infeasible", "failed", "wrong"]
    counts = counts.reindex(columns=ends, fill_value=0)
    groups = table.groupby(CELL, sort=False)
    worst = groups[["error", "off"]].max().join(groups["unexplained"].sum())
    return worst.join(counts).join(groups["kernel"].nunique().rename("kernels")).reset_index()


def steps(*, quick: bool) -> pd.DataFrame:
    """Return how many steps of builds fall, by seqopt and by the own programs."""
    out = []
    for name in SCENES[:1] if quick else SCENES:
        scene = scene_named(name)
        net = build_network(scene)
        builds = {"sequential": sequential(net)}
        builds |= {} if quick else {"cantilever": cantilever(net)}
        axes = {axis: values[1:2] for axis, values in AXES.items()} if quick else AXES
        out += step_cells.rows(scene, builds, HOLDS, axes)
    return pd.DataFrame(out)


def holds(number: pd.DataFrame, step: pd.DataFrame) -> dict[str, bool]:
    """Return every part of the claim and whether it holds."""
    asked = number["answered"] > 0
    parts = {
        "no answer is off by more than it says": (number.loc[asked, "off"] <= 1).all(),
        "no mechanism is missed, no refusal or infeasibility is false": (not number["wrong"].any()),
        "where one is refused another one answers, or it says that none can": (
            not number["unexplained"].any()
        ),
        "something is refused, something is counted as a failure, a mechanism is seen": (
            number[["refused", "failed", "mechanism"]].sum() > 0
        ).all(),
        "no verdict of a step contradicts the own programs": not step["contradicted"].any(),
        "they leave few steps open": step["own_open"].sum() <= OPEN * step["steps"].sum(),
        "some steps fall and some stand": 0 < step["fall"].sum() < step["steps"].sum(),
    }
    return {text: bool(true) for text, true in parts.items()}


LIMITS = (1e-12, 1e-9, 1e-6, np.inf)  # largest error of a color
ERRORS = ("error up to 1e-12", "up to 1e-9", "up to 1e-6", "more, and stated")
SHADES = ("#e8f3fa", "#b5d9ee", "#7dbbe0", "#3f93c9")
NONE, MECHANISM, OFF = "#d9d9d9", "#f2ddc4", VERMILION  # no answer; called a mechanism; wrong
ENDS = {
    NONE: "no answer, or not asked",
    MECHANISM: "called a mechanism",
    OFF: "off by more than it says",
}
LETTERS = {"refused": "r", "failed": "f", "infeasible": "i", "mechanism": "m"}  # the first counts
NAMES = {
    "compliance, to compare": "six digits",
    "beam": "beam search",
    "labels": "label setting",
    "lagrangian": "Lagrangian bound",
    "minimax": "least worst step",
    "overlap_dp": "dynamic program",
    "overlap_lp": "linear program",
    "overlap_mip": "integer program",
    "rank_search": "rank search",
}


def color(row: pd.Series) -> int:
    """Return the color of a cell, by its place in the shades, then the ends."""
    if row["wrong"] or row["off"] > 1:
        return len(SHADES) + 2
    if row["answered"]:
        return int(np.searchsorted(LIMITS, row["error"]))
    return len(SHADES) + (1 if row["mechanism"] else 0)


def paint(axes: Axes, part: pd.DataFrame, labels: Sequence[str], *, upright: bool) -> None:
    """Draw the cells of an axis, methods upwards, or across where it is ``upright``."""
    letters = [next((s for e, s in LETTERS.items() if row[e]), "") for _, row in part.iterrows()]
    part = part.assign(color=part.apply(color, axis=1), letter=letters)
    methods, values = ([*part[name].drop_duplicates()] for name in ("method", "value"))
    grid = [part.pivot_table(v, "method", "value", "first") for v in ("color", "letter")]
    shown, signs = (table.loc[methods, values].to_numpy() for table in grid)
    names = [NAMES.get(name, name) for name in methods]
    if upright:
        shown, signs = shown.T, signs.T
    colors = ListedColormap([*SHADES, *ENDS])
    axes.imshow(np.nan_to_num(shown.astype(float), nan=len(SHADES)), cmap=colors, vmin=-0.5,
                vmax=len(SHADES) + 2.5, aspect="auto")  # fmt: skip
    for (i, j), sign in np.ndenumerate(signs):
        if isinstance(sign, str) and sign:
            axes.text(j, i, sign, ha="center", va="center", fontsize=SMALL)
    across, up = (names, labels) if upright else (labels, names)
    axes.set_xticks(range(len(across)), across, rotation=90)
    axes.set_yticks(range(len(up)), up)
    axes.tick_params(length=0)


def short(value: str) -> str:
    """Return a power of ten as people write it, other values as they are."""
    try:
        number = float(value)
    except ValueError:
        return value
    if 1e-2 < number < 1e4:
        return f"{number:g}"
    return f"1e{round(np.log10(number))}"


def number_panels(figure: Figure, table: pd.DataFrame, half: str, columns: int) -> None:
    """Draw a panel for each numeric axis of a half."""
    own = table[(table["half"] == half) & table["axis"].ne("costs and budgets")]
    own = own[own["axis"].ne("a solver says")]
    axes = [*own["axis"].drop_duplicates()]
    rows = -(-len(axes) // columns)
    panels = figure.subplots(rows, columns, squeeze=False)
    for panel in panels.ravel()[len(axes) :]:
        panel.axis("off")
    for place, (panel, axis) in enumerate(zip(panels.ravel(), axes, strict=False)):
        part = own[own["axis"] == axis]
        paint(panel, part, [short(v) for v in part["value"].drop_duplicates()], upright=False)
        panel.set_title(axis, fontsize=SMALL)
        if place % columns:
            panel.set_yticks([])


def named(figure: Figure, table: pd.DataFrame) -> None:
    """Draw what is asked of formulations by name."""
    own = table[table["axis"].isin(["costs and budgets", "a solver says"])]
    says = own["axis"] == "a solver says"
    own = own.assign(value=own["value"].where(~says, "solver says: " + own["value"]))
    panel = figure.subplots()
    paint(panel, own, [*own["value"].drop_duplicates()], upright=True)
    panel.set_title("(c) the same: ties, budgets, solvers")


def falls(figure: Figure, table: pd.DataFrame) -> None:
    """Draw how many of 100 steps fall, by build and mortar over friction and tilt."""
    rows = [*table[["bricks", "method", "mortar"]].drop_duplicates().itertuples(index=False)]
    columns = [*table[["axis", "value"]].drop_duplicates().itertuples(index=False)]
    share = table.set_index(["bricks", "method", "mortar", "axis", "value"])
    share = 100 * share["fall"] / share["steps"]
    grid = np.array([[share[(*row, *column)] for column in columns] for row in rows])
    panel = figure.subplots()
    panel.imshow(grid, cmap=ListedColormap(["white", *SHADES]), vmin=0, vmax=60, aspect="auto")
    for (i, j), value in np.ndenumerate(grid):
        panel.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize=SMALL)
    bond = {"dry": "dry", "bond=2e4": "20 kPa"}
    panel.set_yticks(range(len(rows)), [f"{n} bricks, {m}, {bond[h]}" for n, m, h in rows])
    names = {"friction": "friction {:.2g}", "tilt": "tilt {:g}°"}
    panel.set_xticks(range(len(columns)), [names[a].format(v) for a, v in columns], rotation=90)
    panel.tick_params(length=0)
    panel.set_title("(d) of 100 steps fall")


@styled
def chart(number: pd.DataFrame, step: pd.DataFrame) -> Figure:
    figure = new_figure(13.0)
    engines, costs, rest = figure.subfigures(3, 1, height_ratios=[3.6, 2.4, 6.0])
    number_panels(engines, number, "engines", 4)
    engines.suptitle("(a) engines against sixty digits", x=0.01, ha="left")
    number_panels(costs, number, "formulations", 3)
    costs.suptitle("(b) formulations against enumeration: sizes and scales", x=0.01, ha="left")
    left, right = rest.subfigures(1, 2, width_ratios=[1.1, 1.0])
    named(left, number)
    falls(right, step)
    key = [Patch(color=c, label=text) for c, text in zip(SHADES, ERRORS, strict=True)]
    key += [Patch(color=c, label=text) for c, text in ENDS.items()]
    key += [Patch(color="none", label="r, f, i, m: some are refused, failed,")]
    key += [Patch(color="none", label="infeasible, mechanisms")]
    figure.legend(handles=key, loc="outside lower center", ncols=3)
    return figure


def experiment(options: Options) -> Finding:
    number = cells(numbers(quick=options.quick))
    step = steps(quick=options.quick)
    shown = number.groupby(["half", "method"]).agg(
        dict.fromkeys(["answered", "refused", "mechanism", "infeasible", "failed", "wrong"], "sum")
        | {"error": "max", "off": "max", "kernels": "max"}
    )
    print(shown.to_string(float_format="%.2g"))
    print(step.to_string(index=False))
    note = f": {number['answered'].sum():,} answers"
    tables = {"where_numbers_fail": number, "where_steps_fall": step}
    return Finding(holds(number, step), note, tables)


CLAIM = Claim(
    experiment,
    digits=4,
    quick="few cells, one kernel",
    pictures={"where_methods_fail.png": drawn(chart, "where_numbers_fail", "where_steps_fall")},
)

if __name__ == "__main__":
    print(json.dumps(one_kernel(*sys.argv[1:]), default=str))
