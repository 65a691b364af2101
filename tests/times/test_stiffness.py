"""Joints whose stiffness grows with their age: closed forms, limits, laws, and what is refused."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.contact.mortar import _find_curing
from seqopt.engines.interface import Want
from seqopt.errors import SceneError
from seqopt.sequence.steps import Step, StepKind
from seqopt.times._steps import step_times
from seqopt.times._tables import SHARE, _softened, aged_table
from tests.builders import small_arch
from tests.commands import command as run
from tests.times.builders import WORDS

SCENE = seqopt.load_scene("arch25").with_durations(WORDS)
NETWORK = seqopt.build_network(SCENE)
STEPS = seqopt.cantilever(NETWORK)
TIMES = step_times(SCENE, STEPS)
DROP = "D_max_1e-3mm"


def aged(words, network=NETWORK, steps=STEPS, times=TIMES):
    return aged_table(network, steps, times, _find_curing(words))


def test_at_once_it_is_the_table_of_today():
    own = aged("0s=1")
    full = seqopt.analyze(seqopt.make_engine("compliance", NETWORK), STEPS)
    for column in full:
        if full[column].dtype.kind == "f":
            np.testing.assert_allclose(own[column], full[column], rtol=1e-9, err_msg=column)
        else:
            assert own[column].equals(full[column])
    assert [*own.drop(columns=["start_s", SHARE])] == [*full]
    assert (own[SHARE] == 1).all()


def test_a_brick_on_one_joint_turns_by_moment_over_stiffness():
    """F/k and M/k at its age: half of the stiffness is twice the way, and no other force."""
    scene = small_arch(3).with_durations(WORDS)
    network = seqopt.build_network(scene)
    none = (None,) * len(scene.robots)
    held = (scene.placed[0].nodes[1], *none[1:])
    steps = (Step(1, StepKind.PLACE, 1, held), Step(2, StepKind.RELEASE, 1, none))
    times = step_times(scene, steps)
    words = "0s=0.1,5s=0.25,10s=0.5,1min=1"
    table, full = (aged(each, network, steps, times) for each in (words, "0s=1"))
    age = times[1].start - times[0].end
    share = _find_curing(words).share(age)
    assert 0 < share < 1
    assert table[SHARE].tolist() == [0.1, share]
    assert table[DROP][1] == pytest.approx(full[DROP][1] / share, rel=1e-9)
    for column in ("M_sup_Nm", "F_sup_N"):  # statically determinate
        assert table[column][1] == pytest.approx(full[column][1], rel=1e-9)
    held_full = full[DROP][0]
    assert table[DROP][0] > held_full  # a robot that holds takes a part of it


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(0.01, 1.0), min_size=7, max_size=7), st.integers(0, 6), st.data())
def test_what_is_stiffer_anywhere_gives_way_less_to_its_own_weight(shares, joint, data):
    """With grips that hold still, the work of loads falls as any joint gets stiffer."""
    network = seqopt.build_network(small_arch(7))
    stiffer = [*shares]
    stiffer[joint] = data.draw(st.floats(shares[joint], 1.0))
    grips = np.array([[network.scene.placed[6].nodes[1]]])
    work = [_work(_softened(network, np.array(own)), 7, grips) for own in (shares, stiffer)]
    assert work[1] <= work[0] * (1 + 1e-9)


def _work(network, bricks, grips):
    """What weights do on the way that they go, J."""
    found = seqopt.make_engine("compliance", network).solve(bricks, grips, Want.BRICKS)
    weights = np.array([brick.mass for brick in network.scene.placed[:bricks]])
    return float(-(weights * found.brick_twist[0, :bricks, 2]).sum())


def test_older_joints_are_no_softer():
    slow, fast = (aged(f"0s=0.05,{t}min=0.4,{3 * t}min=1") for t in (10, 2))
    assert (fast[SHARE] >= slow[SHARE]).all()
    assert fast[DROP].max() < slow[DROP].max()


@pytest.mark.parametrize(
    ("words", "said"),
    [("15min", "none before 0.9 s"), ("never", "none ever"), ("0s=1 5-6:1h", "joint 5-6: it has")],
)
def test_what_would_hang_on_nothing_is_refused(words, said):
    with pytest.raises(SceneError, match=said):
        aged(words)


@pytest.mark.slow
def test_the_command_says_what_it_comes_to(capsys, tmp_path):
    words = ("arch25", "--method", "cantilever", "--durations", WORDS, "--out", str(tmp_path / "o"))
    status, said, _ = run(capsys, "times", *words, "--stiffens", "0s=0.05,15min=1")
    assert status == 0
    most = aged("0s=0.05,15min=1")[DROP].max()
    found = re.search(r"displacements up to ([\d.]+) µm in step \d+, not 15.74 µm", said)
    assert float(found[1]) == pytest.approx(most, rel=1e-3)
    table = pd.read_csv(tmp_path / "o" / "aged.csv")
    assert table[DROP].max() == pytest.approx(most, rel=1e-5)
    status, _, said = run(capsys, "times", *words[:5], "--stiffens", "15min")
    assert (status, "--stiffens: stiffness of joint ground-1" in said) == (2, True)
