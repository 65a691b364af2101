"""Mortar that cures; laws of time."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, ProblemError, SceneError, SolverError, StepError
from seqopt.plan.plan import Status
from seqopt.sequence.rules import FreeRules
from seqopt.stability.standing import Standing
from seqopt.times import Curing, Durations
from seqopt.times._curing import CuringBuilds, JointsInTime
from seqopt.times._curing_law import find_curing
from seqopt.times._step_check import check_cured, step_ends
from seqopt.times._steps import step_times
from seqopt.times._tables import busy_table, reassign
from tests.brute_force import ONES
from tests.commands import command as run
from tests.times.builders import WORDS, engine_of, judged, least_cured_makespan

ALONE = FreeRules(least_grips=1)
LONG = (pytest.mark.slow, pytest.mark.long)
TACK = "0s=0.005,1min=0.02,5min=0.4,15min=1"


def cured(engine, words, aim="makespan", rules=ALONE, **asked):
    standing = Standing("epoxy", curing=words)
    return seqopt.solve(seqopt.pose(engine, rules, ONES, aim, stands=standing, **asked))


@pytest.fixture(scope="module")
def plan():
    return cured(engine_of(4, 2), "10h")


CASES = [
    (3, 2, (), ALONE, "0s=0.002,10min=1"),
    pytest.param(
        *(
            3,
            2,
            ("rob2:fetch=75,place=25,approach=25,grip=12.5,release=12.5",),
            ALONE,
            "0s=0.002,10min=1",
        ),
        marks=pytest.mark.slow,
    ),
    pytest.param(4, 2, (), ALONE, "5min=1", marks=LONG),
    pytest.param(4, 2, (), ALONE, "1min=0.001,10min=1", marks=LONG),
]


@pytest.mark.parametrize(("bricks", "robots", "words", "rules", "curing"), CASES)
def test_the_least_is_that_of_all_builds_and_waits(bricks, robots, words, rules, curing):
    engine = engine_of(bricks, robots, *words)
    plan = cured(engine, curing, rules=rules)
    least = least_cured_makespan(engine, rules, curing, plan.makespan + 1e-6)
    assert plan.makespan == pytest.approx(least, rel=1e-9)
    assert plan.status is Status.OPTIMAL
    assert plan.certificate.bounds == pytest.approx(plan.certificate.values)


def test_where_no_wait_is_enough_there_is_no_plan():
    engine = engine_of(3, 2)
    assert np.isinf(least_cured_makespan(engine, ALONE, "10min=1"))
    with pytest.raises(InfeasibleError, match="stand while mortar cures"):
        cured(engine, "10min=1")


@pytest.mark.slow
def test_instant_bond_takes_as_long_as_ever_and_none_as_dry():
    engine = engine_of(4, 3)
    rules = FreeRules()
    usual = seqopt.solve(seqopt.pose(engine, rules, ONES, "makespan", stands="epoxy"))
    dry = seqopt.solve(seqopt.pose(engine, rules, ONES, "makespan", stands="dry"))
    for words, same in (("0", usual), ("never", dry)):
        plan = cured(engine, words, rules=rules)
        assert plan.makespan == pytest.approx(same.makespan), words
        assert plan.status is Status.OPTIMAL


@pytest.mark.slow
@pytest.mark.parametrize("robots", [2, pytest.param(3, marks=pytest.mark.long)])
def test_slower_mortar_makes_no_build_shorter(robots):
    engine = engine_of(4 if robots == 2 else 6, robots)
    rules = FreeRules(least_grips=robots - 1)
    found = [cured(engine, words, rules=rules).makespan for words in ("0", "100h")]
    assert found == sorted(found)
    if robots == 2:
        assert found[-1] > found[0]


@pytest.mark.slow
def test_no_step_comes_before_its_proof(plan):
    times, standing, network = plan.times(), plan.standing, plan.engine.network
    starts = times["start_s"].tolist()
    check_cured(network, plan.steps, standing, starts)
    waits = np.flatnonzero(times["cures_s"] > 0)
    assert len(waits) == 2
    assert set(times["joint"].iloc[waits]) == {"1-2", "2-3"}
    for i in waits.tolist():
        early = list(starts)
        early[i] -= 0.02 * times["cures_s"].iloc[i]
        with pytest.raises(SolverError, match=f"step {i + 1} is not proven to stand with the bond"):
            check_cured(network, plan.steps, standing, early)


def test_the_judge_refuses_early_starts_and_missing_motions(plan):
    assert judged(plan).gap == 0
    starts = plan.selection.starts
    early = (*starts[:2], starts[2] - 1.0, *starts[3:])
    with pytest.raises(SolverError, match="step 3 is not proven to stand"):
        judged(plan, starts=early)
    with pytest.raises(SolverError, match="step 2 starts at"):
        judged(plan, starts=(*starts[:1], starts[1] - 1.0, *starts[2:]))
    with pytest.raises(SolverError, match="0 starts for"):
        judged(plan, starts=())
    with pytest.raises(SolverError, match="labels do not prove"):
        judged(plan, motions=plan.selection.motions[:1])
    lies = tuple(np.roll(each, 1, axis=1) for each in plan.selection.motions)
    with pytest.raises(SolverError, match="labels do not prove"):
        judged(plan, motions=lies)


@pytest.mark.slow
def test_waits_of_a_given_plan_are_the_least():
    scene = seqopt.load_scene("arch25").with_durations(
        "fetch=30,place=10,approach=10,grip=5,release=5"
    )
    network = seqopt.build_network(scene)
    steps, standing = seqopt.cantilever(network), Standing("epoxy", curing=TACK)
    engine = seqopt.make_engine("compliance", network)
    build = seqopt.GivenSequence(engine, steps, standing=standing)
    table = build.times()
    assert build.makespan > seqopt.GivenSequence(engine, steps).makespan
    row = table.loc[table["cures_s"].idxmax()]
    early = table["start_s"].to_numpy().copy()
    early[int(row["step"]) - 1] -= 0.02 * row["cures_s"]
    with pytest.raises(SolverError, match=f"step {row['step']} is not proven to stand"):
        check_cured(network, steps, standing, early.tolist())
    moved = seqopt.GivenSequence(engine, build.reassigned(), standing=standing)
    assert moved.makespan <= build.makespan
    check_cured(network, moved.steps, standing, moved.times()["start_s"].tolist())
    unbonded = seqopt.GivenSequence(engine, steps, standing=Standing("epoxy", curing="15min"))
    with pytest.raises(StepError, match="before the joints that it closes have any"):
        unbonded.times()


SHARES = st.lists(st.floats(1e-6, 0.99), min_size=1, max_size=4, unique=True).map(sorted)


@settings(max_examples=10, deadline=None)
@given(SHARES, st.integers(1, 10**4), st.lists(st.floats(0, 1e5), min_size=5, max_size=5))
def test_bonds_only_grow(shares, last, times):
    ages = [last * k for k in range(len(shares) + 1)]
    curing = Curing(tuple(zip(ages, [*shares, 1.0], strict=True)))
    joints = JointsInTime(engine_of(5, 2).network, curing)
    placed = np.sort(np.array(times))[None]
    found = [joints.at(5, np.array([now]), placed)[0] for now in np.linspace(0, 3e5, 20)]
    assert (np.diff(found, axis=0) >= 0).all()
    assert (found[-1] == 1.0).all()
    again = find_curing(str(curing))
    assert np.allclose(again.points, curing.points, rtol=1e-5)


def test_with_full_bond_verdicts_are_those_without_age():
    network = engine_of(5, 2).network
    builds = CuringBuilds(network, seqopt.EPOXY, find_curing("15min"))
    steps = [step for step in seqopt.sequential(network) if step.bricks > 1]
    for mortar, share in ((seqopt.EPOXY, 1.0), (seqopt.DRY, 0.0)):
        wanted = [r.verdict for r in seqopt.assess(network, steps, mortar)]
        shares = [np.full(builds.joints.count(step.bricks), share) for step in steps]
        pairs = zip(steps, shares, strict=True)
        assert [builds.verdict(s.bricks, s.grips, bond)[0] for s, bond in pairs] == wanted


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("15", None),
        ("soon", "'soon' is no age; give 15min"),
        ("5min=0.4", "the last share is 0.4; give 1 last"),
        ("5min=0.4,3min=1", "ages and shares must rise"),
        ("15min 30min", "give one law for all joints"),
        ("5-6:30min", "'5-6:30min' is no age"),
    ],
)
def test_words_of_curing(words, said):
    if said is None:
        assert find_curing(words).points[-1] == (15.0, 1.0)
        return
    with pytest.raises(SceneError, match=said):
        JointsInTime(engine_of(4, 2).network, find_curing(words))


def test_what_is_not_modeled_says_so():
    engine = engine_of(4, 2)
    with pytest.raises(ProblemError, match="add makespan to the aims"):
        cured(engine, "15min", "steps")
    with pytest.raises(ProblemError, match="bond beside it is not modeled"):
        cured(engine, "15min", "bond,makespan")
    with pytest.raises(ProblemError, match="tilt: it is not modeled while mortar cures"):
        Standing("epoxy", 0.1, "15min")
    problem = seqopt.pose(engine, ALONE, ONES, "makespan", stands=Standing("epoxy", curing="1h"))
    with pytest.raises(ProblemError, match="it does not know mortar that cures"):
        seqopt.solve(problem, "makespan_flow")


# laws of time: of given steps, of what robots do with it, and of who acts
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
