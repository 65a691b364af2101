"""Laws of time: of given steps, of what robots do with it, and of who acts."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import SceneError
from seqopt.scene import Durations
from seqopt.times._step_check import step_ends
from seqopt.times._steps import step_times
from seqopt.times._tables import busy_table, reassign
from tests.commands import command as run
from tests.times.builders import WORDS

SCENE = seqopt.load_scene("arch25")
NETWORK = seqopt.build_network(SCENE)
STEPS = {"sequential": seqopt.sequential(NETWORK), "cantilever": seqopt.cantilever(NETWORK)}
SECONDS = st.floats(0.0, 100.0)
DURATIONS = st.builds(
    Durations,
    fetch=SECONDS,
    place=SECONDS,
    approach=SECONDS,
    grip=SECONDS,
    release=SECONDS,
    speed=st.none() | st.floats(0.01, 10.0),
)


def timed(durations):
    robots = [replace(r, durations=d) for r, d in zip(SCENE.robots, durations, strict=True)]
    return SCENE.with_robots(*robots)


@settings(max_examples=8, deadline=None)
@given(st.tuples(DURATIONS, DURATIONS, DURATIONS), st.sampled_from(sorted(STEPS)))
def test_times_are_those_of_the_longest_way(durations, name):
    scene, steps = timed(durations), STEPS[name]
    times = step_times(scene, steps)
    assert times[-1].end == pytest.approx(step_ends(scene, steps)[-1])
    for before, after in pairwise(times):
        assert before.end <= after.start <= after.end
    busy = busy_table(scene, steps).set_index("robot")
    work = busy[["prepares_s", "acts_s", "holds_s"]].sum(axis=1)
    assert (work <= times[-1].end * (1 + 1e-9) + 1e-9).all()  # at least the busiest robot's work


@settings(max_examples=8, deadline=None)
@given(
    st.tuples(DURATIONS, DURATIONS, DURATIONS),
    st.integers(0, 2),
    st.sampled_from(["fetch", "place", "approach", "grip", "release"]),
    st.floats(0.1, 50.0),
)
def test_longer_durations_make_no_build_shorter(durations, robot, what, more):
    longer = list(durations)
    longer[robot] = replace(durations[robot], **{what: getattr(durations[robot], what) + more})
    short, long = (step_times(timed(d), STEPS["cantilever"])[-1].end for d in (durations, longer))
    assert long >= short * (1 - 1e-12)


def test_reassigned_steps_are_the_best_of_all():
    scene = SCENE.with_durations(WORDS, "rob3:fetch=45,place=15,approach=15,grip=7.5,release=7.5")
    steps = seqopt.cantilever(NETWORK)[:9]
    engine = seqopt.make_engine("compliance", scene)
    table = seqopt.analyze(engine, steps)
    found = reassign(scene, steps, table)
    assert [{*step.held} for step in found] == [{*step.held} for step in steps]
    assert step_times(scene, found)[-1].end == pytest.approx(best_of_all(scene, steps))
    assert step_times(scene, found)[-1].end < step_times(scene, steps)[-1].end


def best_of_all(scene, steps):
    """The least makespan over every choice of robots for every grip."""
    every = seqopt.sequence.schedule.holds(scene, steps)
    best = float("inf")
    for robots in product(range(len(scene.robots)), repeat=len(every)):
        rows = [[None] * len(scene.robots) for _ in steps]
        fits = True
        for hold, robot in zip(every, robots, strict=True):
            fits &= scene.robots[robot].reach.covers(scene.node_position(hold.node))
            for row in rows[hold.first - 1 : hold.last]:
                fits &= row[robot] is None
                row[robot] = hold.node
        for before, after in pairwise(rows):
            fits &= all(
                None in pair or pair[0] == pair[1] for pair in zip(before, after, strict=True)
            )
        if fits:
            own = [replace(s, grips=tuple(row)) for s, row in zip(steps, rows, strict=True)]
            best = min(best, step_ends(scene, own)[-1])
    return best


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("fetch=30", "place, approach, grip, release not given"),
        ("rob9:fetch=30", "no robot 'rob9'"),
        ("fetsch=3", "'fetsch' is none"),
        (f"{WORDS},speed=0", "speed is 0.0; give a positive number"),
        (f"{WORDS.replace('30', '-1')}", "fetch is -1.0; give seconds"),
    ],
)
def test_wrong_words_get_a_line(words, said):
    with pytest.raises(SceneError, match=said):
        SCENE.with_durations(words)


def test_times_of_a_part_are_refused_by_their_own_reason(capsys, tmp_path):
    path = tmp_path / "rest.csv"
    table = seqopt.analyze(seqopt.make_engine("compliance", NETWORK), STEPS["sequential"])
    table[10:].to_csv(path, index=False)
    status, _, said = run(capsys, "times", "arch25", "--plan", str(path), "--durations", WORDS)
    assert (status, "error: steps from 11 on: times are of whole builds" in said) == (2, True)
