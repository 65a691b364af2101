"""Witnesses of stability, and where methods fail: their parts, and what would be a fault."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from experiments.failing.parts import engine_cells, step_cells
from experiments.failing.where_methods_fail import HOLDS
from experiments.stability import witnesses
from experiments.stability.parts.witness_cra import (
    SAMPLES,
    force_only,
    sample_scene,
    without_tension,
)
from experiments.stability.witnesses import (
    Trial,
    built_trials,
    differing,
    faults,
    ours,
    row_of,
    sample_trials,
)
from seqopt.contact.mortar import Mortar
from seqopt.engines.frame import FrameEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SolverError
from seqopt.stability.verdict import Verdict
from tests.builders import six_bricks
from tests.commands import command
from tests.quality.kernels import NAMES, every, other, running


@pytest.fixture(scope="module")
def table():
    """What a few cases look like when all agree, with an LMGC90 that says what we say."""
    shown = [t for t in built_trials() if t.group in ("incline", "stack")]
    shown += [t for t in sample_trials(["A"]) if t.name == "A"]
    table = pd.DataFrame([row_of(trial, None) for trial in shown])
    wedged = table["case"] == "A"
    table["lmgc90"] = table["ours"].where(~wedged, Verdict.FALLS.value)
    return table


def changed(table, case, **values):
    out = table.copy()
    for column, value in values.items():
        out.loc[out["case"] == case, column] = value
    return out


def test_the_largest_sample_is_read_as_published():
    scene = sample_scene("armadillo_cra")
    assert len(scene.solids) == 399
    assert len(scene.touches) == 1014
    assert scene.volume == pytest.approx(9.7364, abs=5e-5)
    first, second = np.array([touch.pair for touch in scene.touches]).T
    middle = np.array([solid.mass[1] for solid in scene.solids])
    normal = np.array([touch.normal for touch in scene.touches])
    assert (np.einsum("ci,ci->c", normal, middle[second] - middle[first]) > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bridge", "curve-3-blocks"])
def test_what_stands_and_what_does_not_is_seen_by_both(name):
    """As published; without friction; and, for the bridge, with a support set free."""
    trial = Trial("sample", name, sample_scene(name), SAMPLES[name].friction)
    assert ours(trial)[0] is force_only(trial.scene, trial.friction).verdict is Verdict.STANDS
    slippery = replace(trial, friction=0.0)
    assert ours(slippery)[0] is force_only(trial.scene, 0.0).verdict is Verdict.FALLS
    if name == "bridge":
        freed = witnesses.without_a_support(name)
        assert ours(freed)[0] is force_only(freed.scene, freed.friction).verdict is Verdict.FALLS


@pytest.mark.slow
def test_what_tension_leaves_open_is_decided_without_it():
    scene = sample_scene("curve-3-blocks")
    assert force_only(scene, 0.05).verdict is Verdict.UNDECIDED
    assert without_tension(scene, 0.05) is Verdict.FALLS
    assert without_tension(scene, 0.1) is Verdict.STANDS


@pytest.mark.slow
def test_agreement_holds_and_known_differences_are_no_fault(table):
    assert faults(table, ["rbe", "lmgc90"], 6.0) == []
    assert differing(table, "rbe") | differing(table, "lmgc90") == {
        (witnesses.TURNED, "rbe"),
        ("A", "lmgc90"),
    }


def test_wrong_verdicts_and_slowness_are_faults(table):
    both = ["rbe", "lmgc90"]
    stood, lost = "stack 0, 0", Verdict.FALLS.value
    assert faults(changed(table, stood, ours=lost), both, 6.0) == [
        f"{stood}: rbe differs",
        f"{stood}: lmgc90 differs",
    ]
    open_ = Verdict.UNDECIDED.value
    assert len(faults(changed(table, stood, ours=open_), both, 6.0)) == 2
    assert faults(changed(table, stood, rbe=open_, no_tension=lost), ["rbe"], 6.0)
    assert faults(changed(table, stood, rbe=open_, no_tension=open_), ["rbe"], 6.0) == []
    assert faults(changed(table, "A", lmgc90=Verdict.STANDS.value), both, 6.0)
    assert faults(table, both, 4.9) == ["only 4.9 times sooner"]
    assert len(faults(table[table["ours"] == lost], ["rbe"], 6.0)) == 1


# cells of the maps of failures against closed forms, and answers and verdicts gone wrong
def cell(bend, bricks=25):
    """Grips beyond a missing joint, off one line by a bend."""
    pitch = np.full(bricks, 0.3)
    pitch[17:] += bend
    shape = seqopt.ArchShape(pitch=pitch, pattern="VLR", closed=False)
    net = engine_cells.without_joint(seqopt.arch_scene(shape))
    return engine_cells.Cell("bend", bend, net, [(30, 40, 49)])


def statuses(one):
    return {row["method"]: row for row in engine_cells.rows(one, engine_cells.exact(one))}


def test_a_frame_refuses_what_rounding_has_stiffened():
    """Its corrections end early there, with an error of 100 %."""
    with pytest.raises(SolverError, match="too ill-conditioned"):
        FrameEngine(cell(1e-7).network).solve(25, [[30, 40, 49]])
    found = statuses(cell(1e-1))
    assert {row["status"] for row in found.values()} == {"answered"}
    assert found["frame"]["error"] < 1e-6


def test_what_only_last_digits_decide_is_refused_or_called_a_mechanism():
    assert {row["status"] for row in statuses(cell(1e-9)).values()} == {"refused"}
    assert engine_cells.exact(cell(1e-13))[0].digits > engine_cells.UNDECIDED
    assert engine_cells.exact(cell(1e-1))[0].digits < 1e-12


@pytest.mark.parametrize(("share", "status"), [(1e-12, "answered"), (1e-8, "wrong")])
def test_an_answer_that_is_off_by_more_than_promised_is_wrong(monkeypatch, share, status):
    one = next(engine_cells.sizes("VLR", [5]))
    solve = ComplianceEngine.solve

    def spoiled(self, *words):
        fields = solve(self, *words)
        return replace(fields, displacement=(1 + share) * fields.displacement)

    monkeypatch.setattr(ComplianceEngine, "solve", spoiled)
    assert statuses(one)["compliance"]["status"] == status


def test_a_missed_and_a_false_mechanism_are_wrong():
    one = next(engine_cells.sizes("VLR", [5]))
    exact = engine_cells.exact(one)
    missed = [each._replace(answer=None) for each in exact]
    assert {row["status"] for row in engine_cells.rows(one, missed)} == {"wrong"}
    apart = cell(1e-1)._replace(grips=[()])
    (nothing,) = engine_cells.exact(apart)
    assert nothing.answer is None
    made = engine_cells.engines(apart.network)["compliance"]
    assert engine_cells.ending("compliance", made, (), nothing)["status"] == "mechanism"
    assert engine_cells.ending("compliance", made, (), exact[0])["status"] == "wrong"


@pytest.mark.slow
def test_own_programs_agree_with_the_verdicts_and_contradict_false_ones(monkeypatch):
    scene = six_bricks()
    net = seqopt.build_network(scene)
    asked = scene, {"cantilever": seqopt.cantilever(net)}, ["dry"], {"friction": [0.4]}
    (row,) = step_cells.rows(*asked)
    assert row["steps"] == 11
    assert 0 < row["fall"] == row["own_fall"]
    assert row["contradicted"] == row["undecided"] == 0
    monkeypatch.setattr(step_cells, "find_mortar", lambda _: Mortar(friction=1, cohesion=1e6,
                        tensile_strength=1e6))  # fmt: skip
    assert next(step_cells.rows(*asked))["contradicted"] == row["fall"]


@pytest.mark.slow
@pytest.mark.skipif(not other(), reason="no OpenBLAS, or no other kernel by name")
def test_every_kernel_of_the_machine_is_known_by_what_runs():
    found = every()
    assert {n.replace("Zen", "Haswell") for n in running().values()} <= {*found}  # one kernel
    assert other() in found
    assert {*found.values()} <= {*NAMES}


BOXES = ["x,y,z,length,width,height"]
BOXES += [f"{x},0,{0.2 * k + 0.1:g},0.6,0.3,0.2" for k, x in enumerate((0, 0.15, 0.4, 0.75))]


@pytest.mark.parametrize(
    ("scene", "values"),
    [
        ("wall:columns=2,courses=2,corbel=0.08", {"tilt": (8.0,)}),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("wall:columns=3,courses=3,corbel=0.08", {"friction": (0.2,), "tilt": (8.0,)}),
                ("boxes", {"friction": (0.2,), "tilt": (0.0, 6.0)}),
                ("vault:span=1,rise=0.4,columns=2", {"friction": (0.5,)}),
            )
        ),
    ],
)
def test_own_programs_agree_where_nothing_is_an_arch(scene, values, tmp_path, capsys):
    """A wall that overhangs, a stack of a reader's own blocks, a vault; bonded ones fall less."""
    if scene == "boxes":
        (tmp_path / "boxes.csv").write_text("\n".join(BOXES), encoding="utf-8")
        scene = tmp_path / "boxes.json"
        words = ("import", tmp_path / "boxes.csv", "--unit", "m", "--density", "2000")
        assert command(capsys, *words, "--out", scene)[0] == 0
    loaded = seqopt.load_scene(scene)
    builds = {"sequential": seqopt.sequential(seqopt.build_network(loaded))}
    rows = [*step_cells.rows(loaded, builds, ["dry", "bond=2e4"], values)]
    assert sum(row["contradicted"] + row["undecided"] + row["own_open"] for row in rows) == 0
    falls = {mortar: sum(r["fall"] for r in rows if r["mortar"] == mortar) for mortar in HOLDS}
    assert falls["dry"] > falls["bond=2e4"]
    assert all(row["fall"] == row["own_fall"] for row in rows)
