"""What depends on how stiff grips are: the sweep, its lines, its picture and its words."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import seqopt
from experiments.engines.parts.softness import (
    grip_range,
    held_softly,
    softness_chart,
    turning_points,
)
from seqopt.errors import SceneError
from seqopt.report.comparison import LARGEST, largest
from tests.builders import small_arch


@pytest.fixture(scope="module")
def sweep():
    engine = seqopt.make_engine("compliance", small_arch(5))
    network = engine.network
    steps = {"sequential": seqopt.sequential(network), "cantilever": seqopt.cantilever(network)}
    tables = {name: seqopt.analyze(engine, each) for name, each in steps.items()}
    return engine, steps, held_softly(engine, tables, grip_range(1e5, 1e7))


def test_the_sweep_is_what_analyses_say(sweep):
    engine, steps, table = sweep
    scene = engine.network.scene
    assert len(table) == len(steps) * (2 * 4 + 1 + 1)
    for (name, stiffness), rows in table.groupby(["build", "stiffness"]):
        soft = scene.with_grips(None if stiffness == np.inf else stiffness)
        wanted = largest(scene, seqopt.analyze(seqopt.make_engine("compliance", soft), steps[name]))
        found = rows.iloc[0]
        assert {key: found[key] for key in LARGEST} == pytest.approx(wanted, rel=1e-9)
        payload = scene.robots[0].payload
        assert found["payload_share"] == pytest.approx(wanted["F_rob"] / payload, rel=1e-9)


def test_the_picture_has_a_panel_for_every_response(sweep):
    _, steps, table = sweep
    figure = softness_chart(table, [*steps], (2e5, 2e6))
    assert len(figure.axes) == 4


def test_where_conclusions_turn():
    """Values that follow a power of the stiffness: a crosses b at 1e6, half of it at 4e6."""
    ks = [1e5, 1e7, np.inf]
    values = {"a": [1e2, 1.0, 0.1], "b": [10.0] * 3}
    rows = [(name, k, v) for name, each in values.items() for k, v in zip(ks, each, strict=True)]
    table = pd.DataFrame(rows, columns=["build", "stiffness", "D_max"])
    share = [2.0 if name == "b" and k == 1e5 else 0.5 for name, k, _ in rows]
    table = table.assign(F_rob=1.0, M_sup=1.0, T_max=1.0, payload_share=share)
    assert turning_points(table, ["b"]) == (
        "displacement: below about 1e+06 N/m b has the least, not a",
        "displacement: below about 2e+06 N/m a has more than half of b's",
        "payload: below about 1e+06 N/m b asks more of a robot than it carries",
    )
    assert turning_points(table.assign(D_max=1.0, payload_share=0.5), ["b"]) == ()


@pytest.mark.parametrize("ends", [(1e7, 1e5), (0.0, 1e5), (1e5, np.inf)])
def test_wrong_ranges(ends):
    with pytest.raises(SceneError, match="give two stiffnesses, the softer one first"):
        grip_range(*ends)
