"""Peers: plain loops and general tools answer as we do, and a wrong one would be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from experiments.peers import peers
from experiments.peers.parts.models import LOOP, Loop, OpenSees, chain_of, kept, open_sees
from experiments.peers.peers import Case, difference
from seqopt.engines.interface import Want, grip_columns

STATES = [(4, (1, 5, 7)), (17, (1, 20, 33)), (17, (1, 20, 21)), (25, (4, 47)), (25, (12, 13, 46))]


def gap(engine, solve):
    """Largest difference from the engine over a few states, two grips on one brick among them."""
    answers = []
    for bricks, grips in STATES:
        sets = np.array([grips])
        columns = grip_columns(engine.network, bricks, sets)
        case = Case(bricks, sets, columns, Want.RESPONSES)
        answers.append((case, 0, solve(bricks).solve(columns[0], Want.RESPONSES)))
    return difference(engine, answers)


def test_the_loop_agrees_with_the_engine_and_with_a_wrong_stiffness_does_not(engine25):
    """The joints a hundredth stiffer; forces hardly notice, displacements must."""
    right, wrong = (
        gap(engine25, lambda bricks, f=factor: Loop(kept(engine25.network, bricks, f)))
        for factor in (1.0, 1.01)
    )
    assert right <= peers.ALIKE
    assert wrong == pytest.approx(0.01, rel=0.05)


def test_opensees_agrees_with_the_engine(engine25):
    try:
        open_sees()
    except (ImportError, OSError, RuntimeError):
        pytest.skip("openseespy is not installed")
    made = gap(engine25, lambda bricks: OpenSees(chain_of(engine25.network, bricks)))
    assert made <= peers.ALIKE


def test_what_is_not_asked_is_empty(engine25):
    columns = grip_columns(engine25.network, 9, np.array([[1, 17]]))[0]
    answer = Loop(kept(engine25.network, 9)).solve(columns, Want.SUPPORT)
    assert not answer.edge_force.size
    assert not answer.displacement.size
    assert answer.grip_force.shape == (2, 3)


def test_joints_that_differ_are_refused(engine25):
    springs = engine25.network.springs
    stiffness = springs.translational_stiffness.copy()
    stiffness[1] *= 2
    changed = replace(springs, translational_stiffness=stiffness)
    network = type(engine25.network)(
        **{
            name: getattr(engine25.network, name)
            for name in engine25.network.__dataclass_fields__
            if name != "springs"
        },
        springs=changed,
    )
    with pytest.raises(ValueError, match="differ in stiffness"):
        chain_of(network, 3)


def test_the_workload_is_every_distinct_model(engine25):
    cases = peers.workload(engine25.network)
    assert sum(len(case.grips) for case in cases) == 8642
    solved = [(case.bricks, tuple(sorted(row))) for case in cases for row in case.grips.tolist()]
    assert len({*solved}) == len(solved)


def test_without_the_package_its_stored_rows_stay(monkeypatch, capsys):
    def lacking():
        raise ImportError

    monkeypatch.setattr(peers, "open_sees", lacking)
    monkeypatch.setattr(peers, "compete", lambda *_: rows)
    names = ["round", "setting", "tool", "setup_s", "models_s", "difference"]
    times = {peers.OURS: 1.0, LOOP: 30.0}
    rows = pd.DataFrame(
        [(0, s, tool, 0.0, t, 0.0) for s in peers.TITLES for tool, t in times.items()],
        columns=names,
    )
    found = peers.experiment(peers.CLAIM.parse([]))
    assert all(found.holds.values())
    assert "stored rows stay" in found.note
    assert not found.tables
    slow = rows.assign(models_s=rows["models_s"].clip(upper=15.0))
    assert not peers.holds(peers.summarize(slow, 1))["loops take long"]
