"""Every claim's check passes on the rows that are stored, and fails on rows that are spoiled."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest

from experiments import figures
from experiments.calibration import calibration, identify_arch25, vault_loads
from experiments.engines import engine_growth, engine_speed, extremes, fidelity_ladder, soft_grips
from experiments.exchange import four_arms, outside_assemblies
from experiments.failing import where_methods_fail
from experiments.harness.claim import claims
from experiments.harness.results import stored
from experiments.instances import instance_contest
from experiments.placement import (
    decision_sensitivity,
    formulations,
    free_growth,
    heuristic_gaps,
    makespan,
    robust_placement,
    speed_accuracy,
    staged_construction,
)
from experiments.stability import classical, contact_steps, dry_map, dry_methods, witnesses
from experiments.study import criteria_variants, paper_counterparts

pytestmark = pytest.mark.slow

NUMBERED = [item for item in paper_counterparts.ITEMS if item.numbers]


class Check(NamedTuple):
    """A check, how a column of a stored table is spoiled, and the tables, if not named alike."""

    check: Callable[..., Any]  # whether a claim holds, or each part of it, or what is wrong
    column: str
    value: Any
    where: dict[str, Any]
    tables: str = ""
    spoiled: int = 0  # which of the tables


def passes(found):
    if isinstance(found, list):
        return not found
    return all(found.values()) if isinstance(found, dict) else found


def sped(table):
    return engine_speed.holds(table.set_index(table.columns[0])["value"])


def cheaper(table):
    return fidelity_ladder.judge(table) and fidelity_ladder.cheaper(table)


def witnessed(table):
    """With how much sooner we are on the largest assembly, by the stored rows."""
    row = table.set_index("case").loc[witnesses.LARGEST]
    table = table.fillna(dict.fromkeys(("no_tension", "cra", "lmgc90"), ""))
    return witnesses.faults(table, ["rbe", "lmgc90"], float(row["rbe_seconds"] / row["seconds"]))


FORMULATIONS, FAILING = formulations.holds, where_methods_fail.holds
FRAME = {"method": "frame", "axis": "bricks"}
FREE, BUDGET = ({"bricks": 13, "question": q} for q in (formulations.FREE, formulations.BUDGET))
GROWN = {"schedule": "free", "bricks": 97}
FITS, STEPS = "calibration_fits calibration_comparison", "failing_steps failing_scale"
REGRET, FAILS = "regret digits", "where_numbers_fail where_steps_fall"
CHECKS = {
    "calibration": Check(
        calibration.holds, "paper_percent", 10.0, {"what": calibration.IN_SAMPLE}, FITS, 1
    ),
    "classical": Check(classical.faults, "off", 0.01, {"source": "Milankovitch (1907)"}),
    "contact_steps": Check(contact_steps.holds, "certificate", "undecided", {"discrete": "rests"}),
    "criteria_variants": Check(
        partial(criteria_variants.holds, optimizations=22), "first", 22, {"after_from_brick": 14}
    ),
    "decision_sensitivity": Check(
        *(decision_sensitivity.holds, "relative_regret", 0.01),
        {"kind": "stiffness, each joint", "size": 3.0},
    ),
    "dry_map": Check(
        dry_map.holds, "least_payload", 2.0, {"bricks": 13, "thickness_m": 0.053, "robots": 3}
    ),
    "dry_methods": Check(
        dry_methods.holds, "dry", "stands", {"method": "sequential", "step": 35}, STEPS
    ),
    "engine_growth": Check(
        engine_growth.holds, "error", 2e-9, {"scene": "chain338"}, "engine_growth_runs"
    ),
    "engine_speed": Check(sped, "value", 900, {"Unnamed: 0": "ratio_median"}),
    "extremes": Check(extremes.holds, "times_fields", 1.4, {"bricks": 99}),
    "fidelity_ladder": Check(cheaper, "error", 1e-7, {"level": "rigid", "case": "arch25, epoxy"}),
    "formulations values": Check(FORMULATIONS, "value", 1.0, FREE | {"formulation": "overlap_lp"}),
    "formulations plans": Check(FORMULATIONS, "value", 0.1, FREE | {"formulation": "beam"}),
    "formulations bounds": Check(
        FORMULATIONS, "bound", 300.0, BUDGET | {"formulation": "overlap_lp"}
    ),
    "formulations models": Check(FORMULATIONS, "models", 1, FREE | {"formulation": "best_first"}),
    "formulations programs": Check(
        FORMULATIONS, "seconds", 1e-3, {"bricks": 25, "formulation": "overlap_mip"}
    ),
    "soft_grips": Check(
        soft_grips.holds, "D_max", 200.0, {"build": "cantilever", "stiffness": 1e6}
    ),
    "instance_contest": Check(
        *(instance_contest.holds, "value", 50.0),
        {"instance": "chain-12", "solver": "overlap_dp"},
        "instance_contest instance_library",
    ),
    "makespan": Check(makespan.holds, "makespan", 400.0, {"robots": "equal", "bricks": 15}),
    "free_growth": Check(free_growth.holds, "status", "feasible", {"bricks": 49, "robots": 4}),
    "heuristic_gaps": Check(heuristic_gaps.holds, "gap", 0.02, {"formulation": "beam"}),
    "identify_arch25": Check(
        *(partial(identify_arch25.holds, quick=False), "shipped", 5.0),
        {"what": "Table B.1, p95_pct"},
        "identify_arch25_refit",
    ),
    "outside_assemblies": Check(
        outside_assemblies.holds, "said", "feasible", {"file": "bridge.json"}
    ),
    "four_arms": Check(four_arms.faults, "status", "feasible", {"build": "vault"}),
    "paper_counterparts": Check(
        *(partial(paper_counterparts.faults, NUMBERED), "error_pct", 50.0),
        {"id": "table:experimental_data3"},
    ),
    "robust_placement": Check(
        robust_placement.holds, "unseen_robust", 2.0, {"aim": "worst-peak", "scenarios": 30}
    ),
    "speed_accuracy regret": Check(
        speed_accuracy.holds, "regret", 0.5, {"engine": "rigid grips"}, REGRET
    ),
    "speed_accuracy own": Check(speed_accuracy.holds, "own", 9, {"status": "done"}, REGRET),
    "speed_accuracy same": Check(
        speed_accuracy.holds, "same", where=GROWN, value=False, tables=REGRET, spoiled=1
    ),
    "speed_accuracy six_s": Check(speed_accuracy.holds, "six_s", 1e3, GROWN, REGRET, 1),
    "staged_construction": Check(
        staged_construction.holds,
        "imbalance_N",
        1e-3,
        {"step": 40},
        "staged_construction staged_choice",
    ),
    "vault_loads": Check(vault_loads.holds, "bare_thrust", 38.0318, {"test": 3}),
    "where_methods_fail errors": Check(FAILING, "off", 1.1, FRAME | {"value": "25"}, FAILS),
    "where_methods_fail mechanisms": Check(
        FAILING, "wrong", 1, FRAME | {"method": "compliance"}, FAILS
    ),
    "where_methods_fail refusals": Check(FAILING, "unexplained", 1, FRAME, FAILS),
    "where_methods_fail failures": Check(FAILING, "failed", 0, {"half": "formulations"}, FAILS),
    "where_methods_fail verdicts": Check(
        FAILING, "contradicted", 1, {"mortar": "dry", "value": 0.3}, FAILS, 1
    ),
    "where_methods_fail open steps": Check(FAILING, "own_open", 40, {"mortar": "dry"}, FAILS, 1),
    "witnesses": Check(witnessed, "lmgc90", "stands", {"case": "A"}),  # a known difference, gone
}


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_passes_on_the_stored_rows_and_fails_on_spoiled_ones(name):
    of = CHECKS[name]
    tables = [stored(table) for table in (of.tables or name.split()[0]).split()]
    assert passes(of.check(*tables))
    table = tables[of.spoiled]
    rows = (table[[*of.where]] == pd.Series(of.where)).all(axis=1)
    assert rows.any()
    wrong = table[of.column].astype(object).where(~rows, of.value).infer_objects()
    tables[of.spoiled] = table.assign(**{of.column: wrong})
    assert not passes(of.check(*tables))


def test_pictures_of_another_scene_are_seen():
    """The one claim without rows: a picture is held against the stored one."""
    image = np.ones((64, 80, 3))
    image[20:44, 10:60] = 0.2
    assert figures.unlike(image, image) == 0
    assert figures.unlike(np.roll(image, 16, axis=1), image) > figures.ALIKE
    assert figures.unlike(np.ones_like(image), image) == pytest.approx(1)
    assert figures.unlike(image[:32], image) == np.inf


def test_every_claim_is_checked_here():
    assert {name.split()[0] for name in CHECKS} | {"figures"} == set(claims())
