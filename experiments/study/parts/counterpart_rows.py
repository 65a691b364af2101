"""Printed and computed values, side by side, of every figure and table of the paper.

Every function yields the rows of one item of the claim, named by its label in
`COUNTERPARTS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd

from experiments.calibration.parts.barrel_vaults import BED, chain, fit, laws, vaults
from experiments.harness.ranks import rank_choice
from experiments.harness.yardstick import ROUNDING, STEPS, VALUES, error, inner_nodes, moved
from seqopt.arrays import Floats
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import build_network
from seqopt.plan.solve import pose
from seqopt.problem.problem import Problem
from seqopt.report.comparison import Comparison, compare
from seqopt.scene.boxes import box_corners
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import METHODS, modified_sequential, three_robot_loop
from seqopt.sequence.schedule import OpenGrip, OpenStep
from seqopt.sequence.steps import Step
from seqopt.study import EQUATIONS, STUDY_BED, as_printed, printed, printed_steps, published_plan

Rows = Iterator["Row"]


@dataclass(frozen=True)
class Row:
    """One printed value beside ours; ``rounding`` is what print and reading leave open."""

    quantity: str
    at: str
    printed: float
    ours: float
    rounding: float = ROUNDING


@dataclass(frozen=True)
class Ours:
    """What several counterparts are read from."""

    engine: ComplianceEngine
    methods: Comparison
    problem: Problem

    @property
    def scene(self) -> Scene:
        """The paper's arch as it ships."""
        return self.engine.network.scene

    def steps(self, method: str) -> Any:  # a table: pandas does not say that cells are numbers
        """Return the responses of a method by step, the support's as the paper prints them."""
        return as_printed(self.scene, self.methods.tables[method]).set_index("step")


def ours() -> Ours:
    """Return the models that counterparts are read from."""
    engine = ComplianceEngine(build_network(load_scene("arch25")))
    problem = pose(engine, three_robot_loop(engine.network), EQUATIONS)
    return Ours(engine, compare(engine, EQUATIONS), problem)


def geometry(own: Ours) -> Rows:
    """Compare the size of the arch (figure 2)."""
    corners = box_corners(own.scene.bricks).reshape(-1, 3)
    first, last = (np.array(ground.position) for ground in own.scene.grounds)
    along = (last - first) * [1, 1, 0]
    span = float(np.ptp(corners @ along / np.linalg.norm(along)))
    yield Row("span [mm]", "arch", 2080, 1e3 * span, 5)
    yield Row("height [mm]", "arch", 1930, 1e3 * float(np.ptp(corners[:, 2])), 5)
    yield Row("bricks", "arch", 25, len(own.scene.bricks))
    yield Row("mass [kg]", "brick", 3.66, own.scene.bricks[0].mass, 0.005)


def vault_dimensions(_own: Ours) -> Rows:
    """Measure every vault back from the joints of its model, which lie at half the thickness."""
    for vault in vaults():
        made, at, half = chain(vault), f"test {vault.test}", vault.thickness / 2
        inward, up = half * np.sin(made.slope[0]), half * (1 - np.cos(made.slope[0]))
        wide, high = np.ptp(made.points, axis=0)
        yield Row("L [mm]", at, 1e3 * vault.span, 1e3 * float(wide - 2 * inward), 5)
        yield Row("r [mm]", at, 1e3 * vault.rise, 1e3 * float(high - up), 5)
        yield Row("bricks", at, vault.bricks, len(made.points) - 1)
        yield Row("x [mm]", at, 1e3 * vault.load_at, 1e3 * float(made.loads[0] - inward), 5)


def bed_of_springs() -> Floats:
    """Return the stiffness of every vault, kN/mm, under the best bed of springs."""
    law = laws(vaults())[BED]
    k_t, k_r = fit(law, "absolute", np.ones(len(law.tests), dtype=bool))
    return np.asarray(k_t * law.curves(np.array([k_r / k_t]))[:, 0] / 1e6)


def secant(_own: Ours) -> Rows:
    """Compare the secant of test 1 (figure 6)."""
    study = printed("arch_stiffness")
    k = float(bed_of_springs()[0])
    yield Row("analytical secant [kN/mm]", "test 1", study["k_m_kN_mm"][0], k, 0.5)


def stiffness(_own: Ours) -> Rows:
    """Compare the stiffness of the vault tests (table 2)."""
    study, k = printed("arch_stiffness"), bed_of_springs()
    error = 100 * (k / study["k_e_kN_mm"].to_numpy() - 1)
    for i, test in enumerate(study["test"]):
        yield Row("k_m [kN/mm]", f"test {test}", study["k_m_kN_mm"][i], k[i], 0.5)
        yield Row("e_rel [%]", f"test {test}", study["e_rel_percent"][i], error[i])
    mean = study["e_rel_percent"].abs().mean()
    yield Row("mean size of e_rel [%]", "all tests", mean, float(np.abs(error).mean()))


def arches(own: Ours) -> list[Step]:
    """Return the steps that the paper puts to discrete elements."""
    return [METHODS["sequential"](own.engine.network)[number - 1] for number in STEPS.values()]


def nodes_compared(own: Ours) -> Rows:
    """Compare how many nodes are compared (figure 8)."""
    study = printed("de_validation").set_index("bricks")["nodes"]
    for step in arches(own):
        count, at = len(inner_nodes(own.engine.network, step)), f"{step.bricks} bricks"
        yield Row("inner nodes that no robot holds", at, study[step.bricks], count)


def discrete_elements(own: Ours) -> Rows:
    """Compare mean errors against discrete elements, where a robot holds a node (table 3)."""
    study = printed("de_validation").set_index("bricks")["error_percent"]
    discrete = DiscreteEngine(own.engine.network, bed=STUDY_BED)
    for step in arches(own):
        mean = error(moved(own.engine, step), moved(discrete, step))
        yield Row("mean error [%]", f"{step.bricks} bricks", study[step.bricks], mean)


TWISTING = (9, 11, 21, 23, 33, 35, 45, 47)
CROWN = 25  # last step of the two-robot methods up to the crown brick, 13
LOOP = (59, 60, 61, 62)
RESPONSES = {
    **{f"F_rob{i}_N": f"F_rob{i} [N]" for i in (1, 2, 3)},
    "F_sup_N": "F_sup [N]",
    "M_sup_Nm": "M_sup [N m]",
    "F_min_N": "F_min [N]",
    "F_max_N": "T_max [N]",
    "F_avg_N": "F_avg [N]",
    "T_pct": "T_pct [%]",
    "D_max_1e-3mm": "D_max [1e-3 mm]",
    "D_avg_1e-3mm": "D_avg [1e-3 mm]",
    "D_std_1e-3mm": "D_std [1e-3 mm]",
}


def two_robots(own: Ours) -> Rows:
    """Compare grips of both methods around the crown (figure 9)."""
    states = {}
    for name, method in METHODS.items():
        steps = method(own.engine.network)
        states[name] = [(step.bricks, frozenset(step.held)) for step in steps]
        study = printed_steps(name).set_index("step")
        for number, i in product(range(32, 38), (1, 2)):
            node, grip = study.loc[number, f"rob{i}_node"], steps[number - 1].grips[i - 1]
            yield Row(f"node of rob{i}", f"{name}, step {number}", cell(node), cell(grip))
    shared = np.mean([state in states["sequential"] for state in states["cantilever"]])
    yield Row("steps shared [%]", "both methods", 100 / 3, 100 * float(shared))


def cell(grip: object, base: int = 0) -> float:
    """Return a grip as a number: a node, an optimized grip O3 as 1003, none as -1."""
    if isinstance(grip, OpenGrip):
        return 1000.0 + grip.move + 1 - base
    text = "" if grip is None else str(grip)
    if text in ("", "nan", "<NA>"):
        return -1.0
    return 1000.0 + float(text[1:]) if text.startswith("O") else float(text)


def twisting(own: Ours) -> Rows:
    """Compare the twisting steps (table 4)."""
    table, study = own.steps("sequential"), printed("sequential_offcenter").set_index("step")
    calm = table.drop(list(TWISTING))
    for step in TWISTING:
        at, got = f"step {step}", table.loc[step]
        want: Any = study.loc[step]
        for column in ("F_rob1_N", "F_rob2_N", "F_sup_N", "M_sup_Nm", "D_max_1e-3mm"):
            if not np.isnan(want[column]):
                yield Row(RESPONSES[column], at, abs(want[column]), abs(got[column]))
        for name, column in (("C1", "M_sup_Nm"), ("C2", "D_max_1e-3mm")):
            yield Row(name, at, want[name], got[column] / calm[column].mean())


def lever_arm(own: Ours) -> Rows:
    """Compare the lever arm (figure 10)."""
    table, study = own.steps("sequential"), printed_steps("sequential").set_index("step")
    for column in ("M_sup_Nm", "D_max_1e-3mm"):
        want = float(study[column].loc[35])
        yield Row(RESPONSES[column], "step 35", want, float(table.loc[35, column]))
    for step in TWISTING[4:]:
        force = table.loc[step, ["F_rob1_N", "F_rob2_N"]].abs().max()
        arm = 1e3 * float(table.loc[step, "M_sup_Nm"] / force)
        yield Row("lever arm [mm]", f"step {step}", 135, arm, 15)


def cantilever_over_sequential(own: Ours) -> Rows:
    """Compare both methods; ratios are those of values rounded to print, as the paper's are."""
    sides = {"C": own.steps("cantilever"), "S": own.steps("sequential")}
    columns = {"M": "M_sup_Nm", "D": "D_max_1e-3mm", "T": "F_max_N"}
    for want in printed("table_5_cantilever_over_sequential").to_dict("records"):
        step = int(want["step"])
        for short, column in columns.items():
            got, name = {}, RESPONSES[column]
            for side, table in sides.items():
                got[side] = float(table.loc[step, column])
                yield Row(f"{name}, {side}", f"step {step}", want[f"{short}_{side}"], got[side])
            ratio = round(got["C"], 1) / round(got["S"], 1)
            rounding, name = 0.0501 if short == "T" else 0.00501, f"{name.split(' [')[0]}, C/S"
            yield Row(name, f"step {step}", want[f"{short}_ratio"], ratio, rounding)


def tension(own: Ours) -> Rows:
    """Compare tension (table 6)."""
    study = printed("table_6_tension").set_index("what")
    for method, start in (("sequential", 1), ("cantilever", 5)):
        largest = own.steps(method)["F_max_N"]
        parts = (largest.loc[start:], largest.loc[start:CROWN], largest.loc[CROWN + 1 :])
        values = *(part.mean() for part in parts), largest.max()
        for what, value in zip(study.index, values, strict=True):
            yield Row(f"{what} T_max [N]", method, study.loc[what, method], float(value))


def robot_forces(own: Ours) -> Rows:
    """Compare the largest forces of robots (table 7)."""
    study = printed("table_7_robot_forces").set_index("method")
    for method, robot in product(study.index, study.columns):
        force = own.methods.maxima.loc[f"F_{robot} [N]", method]
        yield Row(f"largest F_{robot} [N]", method, study.loc[method, robot], force, 0.5)


def improvement(own: Ours) -> Rows:
    """Compare the largest responses of three methods (table 10)."""
    study = own.methods.printed
    for quantity, method in product(own.methods.maxima.index, own.methods.maxima.columns):
        want = np.nan if study is None else study.loc[quantity, method]
        if not np.isnan(want):
            rounding = 0.5 if quantity.startswith("F_") else ROUNDING
            got = own.methods.maxima.loc[quantity, method]
            yield Row(f"largest {quantity}", method, want, got, rounding)


def scheme(study: pd.DataFrame, steps: list[OpenStep] | list[Step], base: int = 0) -> Rows:
    """Compare brick counts and grips of a printed scheme with as many steps."""
    for place, (row, step) in enumerate(zip(study.to_dict("records"), steps, strict=True), 1):
        at = f"row {place}" if pd.isna(row["step"]) else f"step {row['step']:g}"
        yield Row("bricks", at, row["bricks"], step.bricks)
        for i, grip in enumerate(step.grips, start=1):
            yield Row(f"node of rob{i}", at, cell(row[f"rob{i}"]), cell(grip, base))


def modified(own: Ours) -> Rows:
    """Start where five bricks stand, held by two robots as in the first row of the excerpt."""
    steps = modified_sequential(own.engine.network).steps
    start = next(i for i, step in enumerate(steps) if step.grips == (8, 7, None))
    study = printed("table_8_modified_sequential")
    window = list(steps[start : start + len(study)])
    yield from scheme(study, window, base=window[1].moves[0])


def cascade(own: Ours) -> Rows:
    """Compare the scheme of the cascade (table 9)."""
    study = printed("table_9_cascade")
    steps = three_robot_loop(own.engine.network).steps
    yield from scheme(study, [steps[number - 1] for number in study["step"]])


def plan_rows(own: Ours) -> tuple[pd.DataFrame, list[Step], pd.DataFrame]:
    """Return the printed plan, the loop filled with its nodes, and where these rank."""
    study = printed("three_robot_plan")
    study = study.rename(columns={f"rob{i}_node": f"rob{i}" for i in (1, 2, 3)})
    schedule = own.problem.schedule
    nodes = schedule.chosen(published_plan(own.scene))
    return study, [*schedule.fill(nodes)], rank_choice(own.problem, nodes)


def loop(own: Ours) -> Rows:
    """Compare one loop (figure 13)."""
    study, steps, ranks = plan_rows(own)
    yield from scheme(study[study["step"].isin(LOOP)], [steps[number - 1] for number in LOOP])
    place = float(ranks.loc[ranks["step"] == LOOP[0], "rank_in_window"].iloc[0])
    yield Row("place of node O15 by the printed equations", "step 59", 1, place)


def plan(own: Ours) -> Rows:
    """Compare the published plan, its responses and its ranks (table B.1)."""
    study, steps, ranks = plan_rows(own)
    yield from scheme(study, steps)
    yield from steps_of(own, "published")
    first = int((ranks["rank_in_window"] == 1).sum())
    yield Row("chosen nodes in first place by the printed equations", "plan", len(ranks), first)


def steps_of(own: Ours, method: str) -> Rows:
    """Compare a table of all steps; forces at robots and support by size, T_pct by two edges."""
    study, table = printed_steps(method).set_index("step"), own.steps(method)
    for step, column in product(study.index, (*VALUES, "T_pct")):
        want, got = float(study.loc[step, column]), float(table.loc[step, column])
        if np.isnan(want):
            continue
        if column.startswith("F_rob") or column == "F_sup_N":
            want, got = abs(want), abs(got)
        bricks = int(table.loc[step, "bricks"])
        edges = 3 * bricks + (2 if bricks == len(own.scene.bricks) else 1)
        rounding = ROUNDING + (200 / edges if column == "T_pct" else 0)
        yield Row(RESPONSES[column], f"step {step}", want, got, rounding)


COUNTERPARTS: dict[str, Callable[[Ours], Rows]] = {
    "fig:arch_vault": geometry,
    "table:exp_data": vault_dimensions,
    "fig:secant_stiff": secant,
    "table:model_results": stiffness,
    "fig:3dec_image2": nodes_compared,
    "table:validation_results": discrete_elements,
    "fig:2rob_methods": two_robots,
    "table:sequential_twist": twisting,
    "fig:sequential_twist": lever_arm,
    "table:cantilever_compare": cantilever_over_sequential,
    "table:2robot_tension": tension,
    "table:2robot_forces": robot_forces,
    "table:optimization1": modified,
    "table:optimization2": cascade,
    "fig:3rob_sequence": loop,
    "table:optimization_results": improvement,
    "table:experimental_data1": lambda own: steps_of(own, "sequential"),
    "table:experimental_data2": lambda own: steps_of(own, "cantilever"),
    "table:experimental_data3": plan,
}


def tabulate(label: str, own: Ours) -> pd.DataFrame:
    """Return the rows of one item, with the error beyond rounding as in the yardstick."""
    table = pd.DataFrame([vars(row) for row in COUNTERPARTS[label](own)])
    table.insert(0, "id", label)
    table["difference"] = table["ours"] - table["printed"]
    excess = (table["difference"].abs() - table.pop("rounding")).clip(lower=0)
    table["error_pct"] = 100 * excess / table["printed"].abs().clip(lower=1)
    return table
