"""The three-robot loop, the problem it poses, its criteria and rankings, and the published plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import rankdata

from seqopt.engines.frame import FrameEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError, StepError
from seqopt.network.build import build_network
from seqopt.placement.criteria import RankSum, equal, mean_ranks, scaled_ranks
from seqopt.placement.formulation import formulations
from seqopt.placement.plan import run
from seqopt.placement.problem import payload_limits, pose
from seqopt.placement.ranking import move_costs, rank_moves
from seqopt.report.comparison import compare_methods
from seqopt.report.contest import contest
from seqopt.responses.quantities import step_responses
from seqopt.responses.table import analyze, step_fields
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.sequence.schedule import OpenGrip, Schedule
from seqopt.sequence.steps import StepKind
from seqopt.sequence.three_robots import SCHEDULES, modified_sequential, three_robot_loop
from seqopt.sequence.two_robots import sequential
from seqopt.study.presets import CLOSEST, CRITERIA, EQUATIONS, WEIGHTED, WORST_RATIO
from seqopt.study.published import published_choice, published_plan, published_ranks
from seqopt.study.tables import printed
from tests.sequence.test_methods import far_reaching
from tests.strategies import arches


@pytest.fixture(scope="module")
def loop(engine25):
    return three_robot_loop(engine25.network)


@pytest.fixture(scope="module")
def problem(engine25, loop):
    return pose(engine25, loop, EQUATIONS)


def test_the_loop_with_the_published_nodes_is_the_published_plan(arch25, loop, problem):
    assert loop.fill(problem.nodes(published_choice(problem))) == published_plan(arch25)


def test_who_moves_when(loop):
    """Table B.1: 22 moves, at step 3 and every fourth after it, by robots 3, 2, 1 in turn."""
    assert [m.step for m in loop.moves] == list(range(3, 88, 4))
    assert [m.robot for m in loop.moves] == [f"rob{3 - k % 3}" for k in range(22)]
    printed_robots = printed("three_robot_plan").set_index("step")["optimized_robot"]
    for step in loop.steps[2:]:
        named = {f"rob{number}" for number in str(printed_robots[step.number]).split(";")}
        assert {loop.moves[m].robot for m in step.moves} == named


@given(scene=arches(max_bricks=9).map(far_reaching), data=st.data())
def test_any_chain_can_be_looped(scene, data):
    if len(scene.bricks) < 4:
        with pytest.raises(StepError, match="needs three robots and four bricks"):
            three_robot_loop(build_network(scene))
        return
    schedule = three_robot_loop(build_network(scene))
    nodes = []
    for move in schedule.moves:
        free = [n for n in move.candidates if not nodes or n != nodes[-1]]
        nodes.append(data.draw(st.sampled_from(free)))
    for step in schedule.fill(nodes)[1:]:
        assert len(step.held) >= 2
        assert set(step.held) & set(scene.placed[step.bricks - 1].nodes)


def test_the_modified_sequential_method(engine25):
    """A third support for three steps; without it the sequential method is left."""
    schedule = modified_sequential(engine25.network)
    assert len(schedule.moves) == 23
    for k in range(len(schedule.moves)):
        kinds = [s.kind for s in schedule.steps if k in s.moves]
        assert kinds == [StepKind.REPOSITION, StepKind.RELEASE, StepKind.PLACE]
    plain = [(s.bricks, s.grips[:2]) for s in sequential(engine25.network)]
    bare = [(s.bricks, s.grips[:2]) for s in schedule.steps if s.kind is not StepKind.REPOSITION]
    assert [b for i, b in enumerate(bare) if i == 0 or b != bare[i - 1]] == plain
    nodes = [m.candidates[0] for m in schedule.moves]
    assert len(schedule.fill(nodes)) == len(schedule.steps)


def test_a_third_support_ends_twisting(engine25):
    schedule = modified_sequential(engine25.network)
    problem = pose(engine25, schedule, EQUATIONS)
    selection, _ = run(problem, formulations()["rank_search"])
    plan = schedule.fill(problem.nodes(selection.choice))
    worst = max(step_responses(engine25, step_fields(engine25, s)).D_max[0] for s in plan)
    assert worst < 20e-6  # the sequential method reaches 306e-6 m


def test_schedules_are_checked(loop):
    with pytest.raises(StepError, match="3 nodes for 22 moves"):
        loop.fill((1, 2, 3))
    far = replace(loop.steps[0], grips=(OpenGrip(0), OpenGrip(5), None))
    with pytest.raises(StepError, match="at most two neighboring"):
        Schedule("x", loop.scene, (far,), loop.moves)


def test_candidates_are_free_and_within_reach(loop, arch25):
    robots = {robot.name: robot for robot in arch25.robots}
    for k, move in enumerate(loop.moves):
        fixed = {g for s in loop.steps if k in s.moves for g in s.grips if isinstance(g, int)}
        placed = {n for b in arch25.placed[: move.bricks] for n in b.nodes}
        for node in move.candidates:
            assert node in placed - fixed - set(arch25.blocked_nodes)
            assert robots[move.robot].reach.covers(arch25.node_position(node))


def test_models(problem):
    """The study counts 2,576 and 22,724; reach, occupancy and equal models leave fewer."""
    assert problem.paper_models == (2576, 22724)
    choices = sum(next(iter(s.responses.values())).size for s in problem.evaluation.states)
    assert problem.evaluation.models < choices < 22724


@pytest.mark.parametrize("method", SCHEDULES)
def test_states_hold_the_responses_of_their_steps(engine25, method):
    """Every response of a random filled schedule is found again in the problem's states."""
    schedule = SCHEDULES[method](engine25.network)
    also = ("F_largest", "F_move", "F_rob1", "F_rob2", "F_rob3", "T_max", "M_sup", "D_max")
    problem = pose(engine25, schedule, EQUATIONS, also=also)
    rng = np.random.default_rng(1)
    choice: list[int] = []
    for k, move in enumerate(schedule.moves):
        allowed = np.flatnonzero(np.isfinite(problem.sums.shared[k][choice[-1] if choice else 0]))
        choice.append(int(rng.choice(allowed)))
        assert len(move.candidates) > choice[-1]
    steps = {s.number: s for s in schedule.fill(problem.nodes(choice))}
    for state in problem.evaluation.states:
        place = tuple(choice[m] for m in state.moves)
        step = steps[state.step.number]
        want = step_responses(engine25, step_fields(engine25, step))
        assert state.responses["T_max"][place] == pytest.approx(want.F_max[0])
        assert state.responses["M_sup"][place] == pytest.approx(want.M_sup[0])
        assert state.responses["D_max"][place] == pytest.approx(want.D_max[0])
        forces = iter(np.abs(want.F_rob[0]))
        for i, node in enumerate(step.grips):
            found = state.responses[f"F_rob{i + 1}"][place]
            assert np.isnan(found) if node is None else found == pytest.approx(next(forces))


def test_payloads_can_be_kept(engine25, loop):
    """The printed equations overload no robot once its payload is a limit."""
    problem = pose(engine25, loop, EQUATIONS, payload_limits(loop.scene))
    selection, _ = run(problem, formulations()["overlap_dp"])
    plan = analyze(engine25, loop.fill(problem.nodes(selection.choice)))
    forces = plan[["F_rob1_N", "F_rob2_N", "F_rob3_N"]].to_numpy(float)
    assert np.nanmax(np.abs(forces)) <= 392.4


def test_unknown_responses_are_refused(engine25, loop):
    with pytest.raises(ProblemError, match="response F_rob9: there is no such; give D_max"):
        pose(engine25, loop, RankSum("x", equal("F_rob9"), equal("F_rob9")))


def test_each_robot_is_a_term_whatever_its_name(arch25):
    """Equation 2 ranks the forces of all robots of a scene."""
    robots = tuple(replace(r, name=n) for r, n in zip(arch25.robots, "abc", strict=True))
    net = build_network(replace(arch25, robots=robots))
    renamed = pose(ComplianceEngine(net), three_robot_loop(net), EQUATIONS)
    first = renamed.evaluation.states[0].responses
    assert {"F_a", "F_b", "F_c", "T_max", "M_sup"} == set(first)


def test_only_what_is_asked_is_evaluated(engine25, loop):
    plain = pose(engine25, loop, RankSum("tension", equal("T_max"), equal("T_max")))
    assert {name for s in plain.evaluation.states for name in s.responses} == {"T_max"}


def test_the_frame_poses_the_same_problem():
    scene = arch_scene(ArchShape(pitch=np.linspace(1.3, -1.3, 6).tolist()))
    net = build_network(scene)
    a, b = (pose(e(net), three_robot_loop(net), WEIGHTED) for e in (ComplianceEngine, FrameEngine))
    for x, y in zip(a.sums.single, b.sums.single, strict=True):
        assert x == pytest.approx(y, rel=1e-4)


def test_ranks():
    values = np.array([3.0, 1.0, 1.0, np.nan, 2.0])
    assert scaled_ranks(values, 5) == pytest.approx([4, 1.5, 1.5, np.nan, 3], nan_ok=True)
    assert scaled_ranks(np.array([1.2, 0.9, 1.4]), 3) == pytest.approx([2, 2, 2])  # all round to 1
    assert scaled_ranks(np.full(3, np.nan), 3) == pytest.approx([2, 2, 2])


@given(values=st.lists(st.integers(-5, 5), min_size=1, max_size=30))
def test_ranks_are_those_of_scipy(values):
    found = mean_ranks(np.array(values, dtype=float))
    assert found.tolist() == rankdata(values, method="average").tolist()
    assert found.sum() == pytest.approx(len(values) * (len(values) + 1) / 2)


@given(st.lists(st.integers(0, 9), min_size=12, max_size=12))
def test_shared_ranks_weigh_as_much_as_single_ones(values):
    """Ranks over pairs have the mean of ranks over single candidates."""
    pairs = scaled_ranks(np.array(values, float).reshape(3, 4), 4)
    assert pairs.mean() == pytest.approx(scaled_ranks(np.arange(4.0), 4).mean())
    assert 0.5 < pairs.min() <= pairs.max() < 4.5


@pytest.mark.parametrize("criterion", CRITERIA.values(), ids=CRITERIA)
def test_better_responses_never_cost_more(criterion):
    rng = np.random.default_rng(0)
    names = criterion.wanted(20)
    scale = {"F": 400.0, "T": 100.0, "M": 40.0, "D": 3e-5}
    values = {name: scale[name[0]] * rng.random(12) for name in names}
    before = criterion.costs(values, 20, 12)
    better = {name: v.copy() for name, v in values.items()}
    for name in names:
        better[name][5] *= 0.5
    assert criterion.costs(better, 20, 12)[5] <= before[5]


def test_the_published_plan_under_the_printed_equations(problem):
    """Equations (2) and (3): first in at least 10 of 22, among three in at least 15."""
    ranks = published_ranks(problem, published_choice(problem))["rank_in_window"]
    assert (ranks == 1).sum() >= 10
    assert (ranks <= 3).sum() >= 15


def test_the_published_plan_under_a_variant(engine25, loop):
    """Tension and forces alone, the crown brick counted before the crown: 14 and 20 of 22."""
    problem = pose(engine25, loop, CLOSEST)
    ranks = published_ranks(problem, published_choice(problem))["rank_in_window"]
    assert (ranks == 1).sum() >= 14
    assert (ranks <= 3).sum() >= 20


def test_the_window_rank_is_the_studys_search(problem):
    """The choice of rank_search is first in its own window, move by move."""
    choice = formulations()["rank_search"].solve(problem).choice
    assert (published_ranks(problem, choice)["rank_in_window"] == 1).all()
    exact = formulations()["overlap_dp"].solve(problem).choice
    assert (published_ranks(problem, exact)["rank_overlap"] == 1).all()


def test_ranking_diagnostics(problem):
    choice = published_choice(problem)
    table = rank_moves(problem, choice)
    assert table["node"].tolist() == list(problem.nodes(choice))
    assert (table["rank"] == 1).sum() == (table["node"] == table["winner"]).sum()
    assert (table["tied"] >= 1).all()
    assert (table["margin"] >= 0).all()
    unstable = table[table["turned_by_candidates"] != ""]
    assert len(unstable) > 0  # a Borda count reverses when candidates drop out
    row = unstable.iloc[0]
    k, node = int(row["move"]) - 1, int(row["turned_by_candidates"].split()[0])
    gone = problem.schedule.moves[k].candidates.index(node)
    before = choice[k - 1] if k else 0
    without = move_costs(problem, k, before, without=gone)
    assert problem.schedule.moves[k].candidates[int(without.argmin())] != row["winner"]


def test_raw_values_do_not_reverse(engine25, loop):
    """A cost that does not depend on the other candidates keeps its winner when one drops out."""
    for criterion in (WEIGHTED, WORST_RATIO):
        table = rank_moves(pose(engine25, loop, criterion), (0,) * 2 + (1,) * 20)
        assert (table["turned_by_candidates"] == "").all()


def test_tables_are_labeled(problem):
    for state in (problem.evaluation.states[0], problem.evaluation.states[-4]):
        table = problem.table(state)
        moves = [problem.schedule.moves[m] for m in state.moves]
        assert list(table.index.names) == [f"{m.robot}_node" for m in moves]
        assert "cost" in table
        assert len(table) == np.prod([len(m.candidates) for m in moves])


def test_contest(engine25):
    result = contest(engine25, compare_methods(engine25), EQUATIONS)
    assert {"sequential", "cantilever", "published plan", "modified-sequential"} <= set(
        result.table.index
    )
    assert set(formulations()) <= set(result.table.index)
    assert result.table.loc["overlap_dp", "gap"] == pytest.approx(0)
    assert result.table.loc["published plan", "gap"] > 0
    assert set(result.tables) == set(result.table.index)
