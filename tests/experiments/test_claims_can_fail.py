"""Every claim's check passes on the rows that are stored, and fails on rows that are spoiled."""

from collections.abc import Callable
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
    """A check, the tables that it passes on, and how a column of one of them is spoiled."""

    check: Callable[..., bool]
    tables: tuple[Any, ...]  # names of stored tables, or rows
    column: str
    value: Any
    where: dict[str, Any]
    spoiled: int = 0  # which of the tables


def sooner(table):
    """Return how much sooner we are on the largest assembly, by the stored rows."""
    row = table.set_index("case").loc[witnesses.LARGEST]
    return float(row["rbe_seconds"] / row["seconds"])


CHECKS = {
    "calibration": Check(
        calibration.holds,
        ("calibration_fits", "calibration_comparison"),
        *("paper_percent", 10.0, {"what": calibration.IN_SAMPLE}, 1),
    ),
    "classical": Check(
        lambda table: not classical.faults(table),
        ("classical",),
        *("off", 0.01, {"source": "Milankovitch (1907)"}),
    ),
    "contact_steps": Check(
        contact_steps.holds,
        ("contact_steps",),
        *("certificate", "undecided", {"discrete": "rests"}),
    ),
    "criteria_variants": Check(
        lambda table: criteria_variants.holds(table, 22),
        ("criteria_variants",),
        *("first", 22, {"after_from_brick": 14}),
    ),
    "decision_sensitivity": Check(
        decision_sensitivity.holds,
        ("decision_sensitivity",),
        *("relative_regret", 0.01, {"kind": "stiffness, each joint", "size": 3.0}),
    ),
    "dry_map": Check(
        dry_map.holds,
        ("dry_map",),
        *("least_payload", 2.0, {"bricks": 13, "thickness_m": 0.053, "robots": 3}),
    ),
    "dry_methods": Check(
        lambda *tables: all(dry_methods.holds(*tables).values()),
        ("failing_steps", "failing_scale"),
        *("dry", "stands", {"method": "sequential", "step": 35}),
    ),
    "engine_growth": Check(
        engine_growth.holds, ("engine_growth_runs",), *("error", 2e-9, {"scene": "chain338"})
    ),
    "engine_speed": Check(
        lambda table: engine_speed.holds(table.set_index(table.columns[0])["value"]),
        (stored("engine_speed").rename(columns={"Unnamed: 0": "name"}),),
        *("value", 900, {"name": "ratio_median"}),
    ),
    "extremes": Check(extremes.holds, ("extremes",), *("times_fields", 1.4, {"bricks": 99})),
    "fidelity_ladder": Check(
        lambda table: fidelity_ladder.judge(table) and fidelity_ladder.cheaper(table),
        ("fidelity_ladder",),
        *("error", 1e-7, {"level": "rigid", "case": "arch25, epoxy"}),
    ),
    **{
        f"formulations {part}": Check(
            lambda table, part=part: all(formulations.holds(table).values()),
            ("formulations",),
            *(column, value, {"bricks": 13, "formulation": name, "question": question}),
        )
        for part, column, value, name, question in (
            ("values", "value", 1.0, "overlap_lp", formulations.FREE),
            ("plans", "value", 0.1, "beam", formulations.FREE),
            ("bounds", "bound", 300.0, "overlap_lp", formulations.BUDGET),
            ("models", "models", 1, "best_first", formulations.FREE),
        )
    },
    "formulations programs": Check(
        lambda table: all(formulations.holds(table).values()),
        ("formulations",),
        *("seconds", 1e-3, {"bricks": 25, "formulation": "overlap_mip"}),
    ),
    "soft_grips": Check(
        lambda table: all(soft_grips.holds(table).values()),
        ("soft_grips",),
        *("D_max", 200.0, {"build": "cantilever", "stiffness": 1e6}),
    ),
    "instance_contest": Check(
        instance_contest.holds,
        ("instance_contest", "instance_library"),
        *("value", 50.0, {"instance": "chain-12", "solver": "overlap_dp"}),
    ),
    "makespan": Check(
        makespan.holds, ("makespan",), *("makespan", 400.0, {"robots": "equal", "bricks": 15})
    ),
    "free_growth": Check(
        free_growth.holds, ("free_growth",), *("status", "feasible", {"bricks": 49, "robots": 4})
    ),
    "heuristic_gaps": Check(
        heuristic_gaps.holds, ("heuristic_gaps",), *("gap", 0.02, {"formulation": "beam"})
    ),
    "identify_arch25": Check(
        lambda table: identify_arch25.holds(table, quick=False),
        ("identify_arch25_refit",),
        *("shipped", 5.0, {"what": "Table B.1, p95_pct"}),
    ),
    "outside_assemblies": Check(
        outside_assemblies.holds,
        ("outside_assemblies",),
        *("said", "feasible", {"file": "bridge.json"}),
    ),
    "four_arms": Check(
        lambda table: not four_arms.faults(table),
        ("four_arms",),
        *("status", "feasible", {"build": "vault"}),
    ),
    "paper_counterparts": Check(
        lambda table: not paper_counterparts.faults(NUMBERED, table),
        ("paper_counterparts",),
        *("error_pct", 50.0, {"id": "table:experimental_data3"}),
    ),
    "robust_placement": Check(
        robust_placement.holds,
        ("robust_placement",),
        *("unseen_robust", 2.0, {"aim": "worst-peak", "scenarios": 30}),
    ),
    **{
        f"speed_accuracy {column}": Check(
            lambda *tables: all(speed_accuracy.holds(*tables).values()),
            ("regret", "digits"),
            *(column, value, where, spoiled),
        )
        for column, value, where, spoiled in (
            ("regret", 0.5, {"engine": "rigid grips"}, 0),
            ("same", False, {"schedule": "free", "bricks": 97}, 1),
            ("six_s", 1e3, {"schedule": "free", "bricks": 97}, 1),
        )
    },
    "staged_construction": Check(
        lambda *tables: all(staged_construction.holds(*tables).values()),
        ("staged_construction", "staged_choice"),
        *("imbalance_N", 1e-3, {"step": 40}),
    ),
    "vault_loads": Check(
        lambda table: all(vault_loads.holds(table).values()),
        ("vault_loads",),
        *("bare_thrust", 38.0318, {"test": 3}),
    ),
    **{
        f"where_methods_fail {part}": Check(
            lambda *tables: all(where_methods_fail.holds(*tables).values()),
            ("where_numbers_fail", "where_steps_fall"),
            *(column, value, where, spoiled),
        )
        for part, column, value, where, spoiled in (
            ("errors", "off", 1.1, {"method": "frame", "axis": "bricks", "value": "25"}, 0),
            ("mechanisms", "wrong", 1, {"method": "compliance", "axis": "bricks"}, 0),
            ("refusals", "unexplained", 1, {"method": "frame", "axis": "bricks"}, 0),
            ("failures", "failed", 0, {"half": "formulations"}, 0),
            ("verdicts", "contradicted", 1, {"mortar": "dry", "value": 0.3}, 1),
            ("open steps", "own_open", 40, {"mortar": "dry"}, 1),
        )
    },
    "witnesses": Check(
        lambda table: not witnesses.faults(table, ["rbe", "lmgc90"], sooner(table)),
        (stored("witnesses").fillna(dict.fromkeys(("no_tension", "cra", "lmgc90"), "")),),
        *("lmgc90", "stands", {"case": "A"}),  # a known difference that is gone
    ),
}


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_passes_on_the_stored_rows_and_fails_on_spoiled_ones(name):
    of = CHECKS[name]
    tables = [stored(table) if isinstance(table, str) else table for table in of.tables]
    assert of.check(*tables)
    table = tables[of.spoiled]
    rows = (table[[*of.where]] == pd.Series(of.where)).all(axis=1)
    assert rows.any()
    wrong = table[of.column].astype(object).where(~rows, of.value).infer_objects()
    tables[of.spoiled] = table.assign(**{of.column: wrong})
    assert not of.check(*tables)


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
