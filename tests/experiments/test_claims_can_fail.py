"""Every claim's check passes on the rows that are stored, and fails on rows that are spoiled."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
import pytest

from experiments import figures
from experiments.__main__ import STORE
from experiments.calibration import calibration
from experiments.calibration.parts import arch_scores, calibration_spread
from experiments.discrete import contact_steps, discrete_arches
from experiments.engines import (
    engine_growth,
    engine_speed,
    fidelity_ladder,
    frame_contrast,
    parallel,
)
from experiments.exchange import outside_assemblies
from experiments.harness.catalog import claims
from experiments.harness.plotting import RESULTS
from experiments.peers import peers
from experiments.placement import (
    budget_proofs,
    decision_sensitivity,
    degenerate_placement,
    formulation_cost,
    free_growth,
    heuristic_gaps,
    program_shapes,
    robust_placement,
    speed_accuracy,
    staged_construction,
)
from experiments.stability import dry_grips, dry_map, failing_steps, witnesses
from experiments.study import criteria_variants, paper_counterparts
from experiments.study.parts.paper_items import ITEMS
from seqopt.study.tables import printed

Check = Callable[..., bool]
Tables = tuple[pd.DataFrame, ...]
WORDS = ("ours", "rbe", "no_tension", "cra", "lmgc90")


def rows(name):
    return pd.read_csv(RESULTS / f"{name}.csv")


def spoiled(table, column, value, **where):
    """Return the rows with a column set where others have given values, which occur."""
    chosen = pd.Series(data=True, index=table.index)
    for name, wanted in where.items():
        chosen &= table[name] == wanted
    assert chosen.any(), where
    kind = object if isinstance(value, str) else float
    return table.assign(**{column: table[column].astype(kind).where(~chosen, value)})


def checks() -> dict[str, tuple[Check, Tables, Callable[..., Iterator[tuple[Any, ...]]]]]:
    """Return the check of every claim, what is stored, and ways to spoil it.

    A way yields all tables of a check, at least one of them changed.
    """
    numbered = [item for item in ITEMS if item.has_numbers]
    study = printed("de_validation").set_index("bricks")["error_percent"]
    said = dict.fromkeys(WORDS, "")
    costs, tools = rows("formulation_cost"), rows("peers")
    parts = [tools[tools["part"] == part] for part in ("models", "placement")]
    return {
        "budget_proofs": (budget_proofs.holds, (rows("budget_proofs"),), spoil_proofs),
        "calibration": (
            calibration.holds,
            (rows("calibration_fits"), rows("calibration_comparison")),
            spoil_calibration,
        ),
        "contact_steps": (contact_steps.holds, (rows("contact_steps"),), spoil_contact),
        "criteria_variants": (
            lambda table: criteria_variants.holds(table, 22),
            (rows("criteria_variants"),),
            spoil_criteria,
        ),
        "decision_sensitivity": (
            decision_sensitivity.holds,
            (rows("decision_sensitivity"),),
            spoil_sensitivity,
        ),
        "degenerate_placement": (
            lambda table: not degenerate_placement.faults(table),
            (rows("degenerate_placement"),),
            spoil_degenerate,
        ),
        "discrete_arches": (
            lambda table: discrete_arches.holds(table, study),
            (rows("discrete_arches"),),
            spoil_discrete,
        ),
        "dry_grips": (dry_grips.holds, (rows("dry_grips"), rows("dry_grips_build")), spoil_dry),
        "dry_map": (dry_map.holds, (rows("dry_map"),), spoil_map),
        "engine_growth": (engine_growth.holds, (rows("engine_growth_runs"),), spoil_growth),
        "engine_speed": (
            lambda table: engine_speed.holds(table.iloc[:, -1]),
            (pd.read_csv(RESULTS / "engine_speed.csv", index_col=0),),
            spoil_speed,
        ),
        "failing_steps": (
            lambda *tables: all(failing_steps.holds(*tables).values()),
            (rows("failing_steps"), rows("failing_scale")),
            spoil_failing,
        ),
        "fidelity_ladder": (
            lambda table: fidelity_ladder.judge(table) and fidelity_ladder.cheaper(table),
            (rows("fidelity_ladder"),),
            spoil_ladder,
        ),
        "formulation_cost": (
            lambda chains, arch: formulation_cost.holds(chains, arch.iloc[0]),
            (costs.iloc[:-1], costs.iloc[[-1]]),
            spoil_cost,
        ),
        "frame_contrast": (
            lambda table: frame_contrast.holds(table, 1e-11),
            (rows("frame_contrast"),),
            spoil_contrast,
        ),
        "free_growth": (free_growth.holds, (rows("free_growth"),), spoil_free_growth),
        "heuristic_gaps": (heuristic_gaps.holds, (rows("heuristic_gaps"),), spoil_gaps),
        "identify_arch25": (
            lambda table: arch_scores.holds(table, quick=False),
            (rows("identify_arch25_refit"),),
            spoil_identified,
        ),
        "outside_assemblies": (
            outside_assemblies.holds,
            (rows("outside_assemblies"),),
            spoil_outside,
        ),
        "paper_counterparts": (
            lambda table: not paper_counterparts.faults(numbered, table),
            (rows("paper_counterparts"),),
            spoil_counterparts,
        ),
        "parallel": (parallel.holds, (rows("parallel"),), spoil_parallel),
        "peers": (peers.judge, tuple(parts), spoil_peers),
        "program_shapes": (program_shapes.holds, (rows("program_shapes"),), spoil_shapes),
        "robust_placement": (
            robust_placement.holds,
            (rows("robust_placement"), rows("robust_programs")),
            spoil_robust,
        ),
        "speed_accuracy": (
            lambda table, ratios: all(
                (speed_accuracy.holds(table) | speed_accuracy.free_pays(ratios)).values()
            ),
            (rows("runs"), rows("worst_ratios")),
            spoil_runs,
        ),
        "staged_construction": (
            lambda *tables: all(staged_construction.holds(*tables).values()),
            (rows("staged_construction"), rows("staged_choice")),
            spoil_staged,
        ),
        "witnesses": (
            lambda table: not witnesses.faults(table, ["rbe", "lmgc90"], largest(table)),
            (rows("witnesses").fillna(said),),
            spoil_witnesses,
        ),
    }


def spoil_proofs(table):
    own = {"formulation": "labels", "bricks": 49, "case": "all three"}
    yield (spoiled(table, "proven_gap", 2e-3, **own),)
    yield (spoiled(table, "verify", 3.0, **own),)
    yield (spoiled(table, "memory_MB", 1100.0, **own),)
    yield (spoiled(table, "solve", 1.0, formulation="labels", bricks=25, case="travel 0.8"),)
    yield (spoiled(table, "end", "stopped", formulation="overlap_mip", bricks=49),)
    yield (spoiled(table, "objective", 100.0, formulation="overlap_mip", bricks=25),)
    yield (spoiled(table, "bound", 1e5, formulation="lagrangian", case="force 0.7"),)


def spoil_calibration(fits, beside):
    yield fits, spoiled(beside, "paper_percent", 10.0, what=calibration_spread.IN_SAMPLE)
    yield fits, spoiled(beside, "bed_percent", -1.0, what=calibration_spread.GAIN_HIGH)
    yield fits, spoiled(beside, "bed_percent", 18.0, what=calibration_spread.ANEW)
    yield spoiled(fits, "mean_absolute_percent", 15.0, law="b t"), beside


def spoil_contact(table):
    yield (spoiled(table, "certificate", "undecided", discrete="rests"),)
    yield (spoiled(table, "discrete", "neither", discrete="goes"),)  # not followed: no evidence


def spoil_criteria(table):
    yield (spoiled(table, "first", 22, after_from_brick=14),)
    yield (table.assign(first=10),)


def spoil_sensitivity(table):
    yield (spoiled(table, "changed", 0.1, kind="nominal"),)
    yield (spoiled(table, "relative_regret", 0.01, kind="weight, each brick", size=0.1),)
    yield (spoiled(table, "changed", 0.3, kind="position, each", size=0.002),)
    yield (spoiled(table, "relative_regret", 0.01, kind="stiffness, each joint", size=3.0),)
    yield (spoiled(table, "average_regret", 0.2, kind="stiffness, each joint", size=3.0),)


def spoil_degenerate(table):
    yield (spoiled(table, "status", "wrong", case=table["case"].iloc[40], seed=3),)
    for status in ("infeasible", "refused", "rejected"):
        yield (spoiled(table, "message", "", status=status),)


def spoil_parallel(table):
    yield (spoiled(table, "times_as_fast_by_cpu", 1.5, way="two processes"),)
    yield (table.assign(same=table["way"] != "two processes"),)
    yield (table[table["way"] != "two processes"],)


def spoil_discrete(table):
    nearly = printed("de_validation").set_index("bricks")["error_percent"] + 9
    one = (table["pads"] == "stated") & (table["grip"] == "node") & (table["joint"] == "as printed")
    yield (table.assign(error_pct=table["error_pct"].where(~one, table["bricks"].map(nearly))),)
    yield (spoiled(table, "tension_MPa", 3.5, bricks=24),)
    yield (spoiled(table, "shear_used", 1.2, bricks=17),)


def spoil_dry(table, built):
    yield spoiled(table, "open", 1, bricks=24, case="dry"), built
    yield spoiled(table, "contradicted", 1, bricks=17, case="bond 3 kPa"), built
    yield spoiled(table, "solved", 2000, bricks=25, case="dry"), built
    yield table, spoiled(built, "placed", 25, robots=2)
    yield table, spoiled(built, "placed", 24, robots=3)


def spoil_map(table):
    cell = {"bricks": 13, "thickness_m": 0.053, "friction": 0.466}
    yield (spoiled(table, "least_payload", 2.0, **cell, robots=3),)
    yield (spoiled(table, "least_payload", np.inf, **cell, robots=4),)
    yield (spoiled(table, "least_payload", 0.1, **(cell | {"friction": 0.3}), robots=3),)
    yield (table.assign(least_payload=0.5),)


def spoil_staged(table, chosen):
    published = {"method": staged_construction.PUBLISHED, "analysis": "fitted"}
    yield spoiled(table, "F_largest_N", 270.0, **published), chosen
    yield spoiled(table, "F_largest_N", 650.0, method="cantilever", analysis="fitted"), chosen
    yield spoiled(table, "T_max_N", 120.0, method="sequential", analysis="fitted"), chosen
    yield spoiled(table, "imbalance_N", 1e-3, step=40), chosen
    yield table, chosen.assign(fitted=chosen["scratch"])
    yield table, chosen.assign(scratch_worst_fitted=1.0)


def spoil_growth(table):
    for column in ("seconds", "memory_MB"):  # as the cube, and a run without an end
        cube = 1e-4 * table["bricks"] ** 3 + table["memory_MB"].min()
        yield (table.assign(**{column: table[column].where(table["version"] != "this", cube)}),)
    yield (spoiled(table, "seconds", np.nan, version="this", scene="vault338"),)
    yield (spoiled(table, "error", 2e-9, version="this", scene="chain338"),)
    yield (spoiled(table, "screen_error", 2e-6, version="this", scene="chain338"),)


def spoil_speed(table):
    for name, value in (
        ("ratio_median", 900),
        ("ratio_lowest", 90),
        ("fast_s_per_set", 1e-5),
        ("prepare_all_counts_s", 0.06),
    ):
        yield (table.where(table.index.to_numpy()[:, None] != name, value),)


def spoil_failing(steps, scale):
    yield spoiled(steps, "epoxy", "does not stand", step=47), scale
    yield spoiled(steps, "dry", "stands", method="sequential", step=35), scale
    yield spoiled(steps, "bond_needed_Pa", 1.0, method="cantilever"), scale
    yield spoiled(steps, "bond_needed_Pa", 2e5, method="three-robot, published"), scale
    yield steps, spoiled(scale, "bond_needed_Pa", 1.0, times=scale["times"].max())


def spoil_ladder(table):
    yield (spoiled(table, "error", 1e-7, level="rigid", case="arch25, epoxy"),)
    yield (spoiled(table, "error", 0.01, condition="not met"),)
    yield (spoiled(table, "ratio", 0.97, level="planar", condition="met"),)  # not for less
    yield (spoiled(table, "ratio", 0.8, level="auto"),)


def spoil_cost(chains, arch):
    yield spoiled(chains, "overlap_lp", 5e-4, bricks=6), arch
    yield chains, arch.assign(overlap_mip=50 * arch["overlap_dp"])
    yield spoiled(chains, "gap_overlap_dp", 1e-3, bricks=18), arch
    yield chains, arch.assign(pose=0.6)


def spoil_contrast(table):
    yield (spoiled(table, "displacement", 1e-5, contrast=1e7),)
    yield (spoiled(table, "edge_force", 1e-8, contrast=1e11).pipe(
        lambda t: t.assign(grip_force=1e-8, refused=0)
    ),)  # fmt: skip
    flat = table.assign(**dict.fromkeys(frame_contrast.FIELDS, 1e-07), refused=0)
    yield (flat,)  # no contrast is better than another


def spoil_shapes(table):
    yield (spoiled(table, "relaxed", 650.0, formulation="assignment_tight"),)
    yield (spoiled(table, "relaxed", 640.0, formulation="assignment_loose"),)
    yield (spoiled(table, "relaxed", 0.9, formulation="minimax_arc"),)
    yield (spoiled(table, "relaxed", 0.2, formulation="minimax_big_m"),)
    yield (spoiled(table, "nodes", 1000.0, formulation="overlap_mip"),)
    yield (table.assign(proven=True),)
    yield (spoiled(table, "value", 1.2, formulation="minimax_layer"),)


def spoil_robust(table, programs):
    yield spoiled(table, "gap", 1e-3, aim="cvar=0.9", scenarios=100), programs
    yield spoiled(table, "unseen_robust", 2.0, aim="worst-peak", scenarios=30), programs
    yield spoiled(table, "unseen_robust", 150.0, aim="worst-total", scenarios=100), programs
    yield spoiled(table, "unseen_robust", 1.0, aim="worst-peak", scenarios=10), programs
    yield spoiled(table, "nominal_robust", 1.6, aim="worst-peak", scenarios=100), programs
    yield table[table["scenarios"] < 30], programs
    yield table, spoiled(programs, "program", 180.0, aim="worst-total")
    yield table, spoiled(programs, "solve_s", 5.0, aim="cvar=0.9")


def spoil_gaps(table):
    yield (spoiled(table, "gap", 0.02, formulation="cascade"),)
    yield (spoiled(table, "gap", 0.02, formulation="beam", draw=table["draw"].iloc[0]),)


def spoil_identified(table):
    yield (spoiled(table, "shipped", 5.0, what="p95_pct"),)
    yield (spoiled(table, "shipped", 5.0, what="Table B.1, p95_pct"),)
    yield (spoiled(table, "difference", 0.1, what="median_pct"),)


def spoil_counterparts(table):
    yield (spoiled(table, "error_pct", 50.0, id="table:experimental_data3"),)
    yield (spoiled(table, "error_pct", 0.0, id="table:model_results"),)
    yield (table[table["id"] != "table:2robot_forces"],)


def spoil_peers(models, ways):
    yield spoiled(models, "ratio_lowest", 50.0, tool="OpenSeesPy"), ways
    yield spoiled(models, "ratio_lowest", 15.0, tool="SciPy bars, banded"), ways
    yield spoiled(models, "ratio", 0.2, tool="dense products", setting="criterion"), ways
    yield spoiled(models, "difference", 1e-3, tool="PyNite"), ways
    yield models, spoiled(ways, "gap", 1e-3, tool="networkx, Dijkstra")


def spoil_free_growth(table):
    yield (spoiled(table, "status", "feasible", bricks=49, robots=4),)
    yield (spoiled(table, "seconds", 5000.0, bricks=145),)
    yield (spoiled(table, "memory_MB", 2100.0, bricks=19),)
    yield (spoiled(table, "bound", 0.1, status="feasible"),)


def spoil_runs(table, ratios):
    own = {"engine": "rigid bricks", "formulation": "overlap_dp"}
    yield (spoiled(table, "gap", 1e-3, **own), ratios)
    yield (spoiled(table, "total", 9.0, **own), ratios)
    yield (spoiled(table, "total", 1e-3, engine="auto", formulation="overlap_dp"), ratios)
    frame = {"engine": "frame 1e7", "formulation": "overlap_dp"}
    yield (spoiled(table, "total", 0.05, scene="chain7", **frame), ratios)
    yield (spoiled(table, "total", 2.0, scene="arch25", **frame), ratios)
    proven = {"formulation": "rank_search, no proof", "scene": "arch25"}
    yield (spoiled(table, "total", 1e-3, engine="rigid bricks", **proven), ratios)
    yield (spoiled(table, "total", 99.0, engine="frame 1e7", **proven), ratios)
    yield (table, spoiled(ratios, "seconds", 60.0, way="free, 3 robots"))
    yield (table, spoiled(ratios, "worst_ratio", 1.0, way="free, 3 robots"))


def largest(table):
    """Return how much sooner we are on the largest assembly, by the stored rows."""
    row = table.set_index("case").loc[witnesses.LARGEST]
    return float(row["rbe_seconds"] / row["seconds"])


def spoil_witnesses(table):
    yield (spoiled(table, "ours", "undecided", case="bridge"),)
    yield (spoiled(table, "lmgc90", "stands", case="A"),)  # a known difference that is gone
    yield (spoiled(table, "rbe", "does not stand", case="bridge"),)
    yield (spoiled(table, "ours", "does not stand", case="25 at 1"),)
    yield (spoiled(table, "rbe_seconds", 1.0, case=witnesses.LARGEST),)


def spoil_outside(table):
    yield (spoiled(table, "outcome", "half", file="bridge.json"),)
    yield (spoiled(table, "said", "feasible", file="bridge.json"),)
    yield (spoiled(table, "said", "two\nlines", file="armadillo.json"),)
    yield (spoiled(table, "falls", 1, file="bridge.json"),)
    yield (spoiled(table, "open", 1, file="bridge.json"),)
    yield (table[table["file"].isin(["bridge.json", "armadillo.json"])],)


CHECKS = checks()


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_passes_on_the_stored_rows(name):
    check, tables, _ = CHECKS[name]
    assert check(*tables)


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_fails_on_spoiled_rows(name):
    check, tables, spoil = CHECKS[name]
    ways = list(spoil(*tables))
    assert len(ways) >= 2
    assert [check(*way) for way in ways] == [False] * len(ways)


def test_pictures_of_another_scene_are_seen():
    """The one claim without rows: a picture is held against the stored one."""
    image = np.ones((64, 80, 3))
    image[20:44, 10:60] = 0.2
    assert figures.unlike(image, image) == 0
    assert figures.unlike(np.roll(image, 16, axis=1), image) > figures.ALIKE
    assert figures.unlike(np.ones_like(image), image) == pytest.approx(1)
    assert figures.unlike(image[:32], image) == np.inf


def test_every_claim_is_checked_here():
    assert set(CHECKS) | {"figures"} == set(claims())


def test_stored_verdicts_quote_the_claims():
    table = pd.read_csv(STORE, index_col=0)
    assert table["claim"].to_dict() == {name: claim.text for name, claim in claims().items()}
