"""Steps that are solved together have the fields and errors of each on its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.engines.interface import FLAGS, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError
from seqopt.responses.table import _analyze_builds, _each_fields, analyze, step_fields
from seqopt.sequence.steps import Step, StepKind


@pytest.fixture(scope="module")
def engine():
    return seqopt.make_engine("compliance", seqopt.load_scene("chain:bricks=7"))


@pytest.fixture(scope="module")
def builds(engine):
    return [seqopt.sequential(engine.network), seqopt.cantilever(engine.network)]


def test_they_are_those_of_every_step_alone(engine, builds):
    last = Step(99, StepKind.REMOVE, 0, (None,) * len(engine.network.scene.robots))
    steps = [*builds[0], *builds[1], *builds[0][::-1], last]
    found = _each_fields(engine, steps, Want.ALL)
    for step, fields in zip(steps, found, strict=True):
        own = step_fields(engine, step, Want.ALL)
        for name in ("grip_force", *FLAGS):
            one, other = getattr(fields, name), getattr(own, name)
            scale = np.abs(other).max(initial=0.0)
            assert one == pytest.approx(other, rel=1e-9, abs=1e-9 * scale)


def test_equal_states_are_solved_once_and_others_with_as_many_grips_together(
    engine, builds, monkeypatch
):
    calls, real = [], ComplianceEngine.solve

    def noted(self, bricks, grips, *how):
        calls.append((bricks, len(grips)))
        return real(self, bricks, grips, *how)

    monkeypatch.setattr(ComplianceEngine, "solve", noted)
    tables = _analyze_builds(engine, [*builds, *builds])
    states = {(step.bricks, step.grips) for steps in builds for step in steps}
    assert sum(count for _, count in calls) == len(states)
    assert len(calls) < len(states)
    calls.clear()
    for table, steps in zip(tables, [*builds, *builds], strict=True):
        own = analyze(engine, steps)
        assert [*table] == [*own]
        for name in table.select_dtypes("number"):
            scale = own[name].abs().max()
            assert table[name].tolist() == pytest.approx(
                own[name].tolist(), rel=1e-9, abs=1e-9 * scale, nan_ok=True
            )


def test_an_error_names_the_step_whose_it_is(engine, builds):
    scene = engine.network.scene
    free = [replace(ground, rotational_stiffness=(0.0, 0.0, 0.0)) for ground in scene.grounds]
    hinged = seqopt.make_engine("compliance", replace(scene, grounds=tuple(free)))
    held = next(step for step in builds[0] if step.bricks == 3 and len(step.held) > 1)
    loose = Step(7, StepKind.RELEASE, 3, (None,) * len(scene.robots))
    with pytest.raises(MechanismError, match=r"^step 7: "):
        [*_each_fields(hinged, [held, loose])]
