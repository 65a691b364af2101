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

Inputs: generated chains, the shipped scene. Command: ``python -m experiments where_methods_fail
[--quick]``.
"""

import os
import pickle
from pathlib import Path
from tempfile import TemporaryDirectory

import pandas as pd

from experiments.failing.parts import engine_cells, step_cells
from experiments.failing.parts.heat_maps import chart
from experiments.harness.claim import Claim, Finding, Options
from experiments.harness.results import apart, drawn
from experiments.harness.scenes import scene_named
from seqopt import build_network, cantilever, sequential
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
            found = apart(f"{__package__}.parts.one_kernel", *words, env=os.environ | own)
            tables.append(pd.DataFrame(found).assign(kernel=kernel))
            print(f"{kernel}: {len(found)} answers and refusals", flush=True)
    return pd.concat(tables, ignore_index=True)


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
        builds = {"sequential": sequential(net), "cantilever": cantilever(net)}
        axes = {axis: values[1:3] for axis, values in AXES.items()} if quick else AXES
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
