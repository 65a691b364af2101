"""Outside witnesses: what they are shown is what we judge, and a wrong verdict would be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

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
from seqopt.stability.assessment import Verdict


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
