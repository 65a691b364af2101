"""Plans over their robots' payloads are named; sweeps over scenes and options."""

import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

import seqopt
from experiments.harness.layers import LayeredCosts
from seqopt import Search
from seqopt._cli.main import main
from seqopt.errors import InfeasibleError, ProblemError, SolverError
from seqopt.graph.formulation import find_formulation
from seqopt.graph.states import build_states
from seqopt.plan._infeasible import payload_advice
from seqopt.plan.solve import graph_of, solve
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import overloads, payload_limits
from seqopt.report.charts import draw_sweep
from seqopt.report.sweep import spread, sweep
from seqopt.workflow import Robust
from tests.builders import Counting, small_arch, with_part
from tests.layered import Costs


def weak(scene, payload):
    return replace(scene, robots=tuple(replace(r, payload=payload) for r in scene.robots))


def test_a_limit_that_a_fixed_step_exceeds_is_infeasible(arch25):
    """The first two steps of the loop have no open grip: nothing can be chosen there."""
    said = r"step 2 of 90, in which no grip is open, has F_largest=38.* instead of 20"
    with pytest.raises(InfeasibleError, match=said):
        seqopt.optimize(arch25, limits=[seqopt.Limit("F_largest", 20.0)])
    with pytest.raises(InfeasibleError, match="step 94 of 95, in which no grip is open"):
        seqopt.optimize(
            arch25, "modified-sequential", formulation="cascade",
            search=seqopt.Search(proof=False),
            limits=payload_limits(weak(arch25, 150.0)),
        )  # fmt: skip


@pytest.mark.slow
def test_payloads_hold_on_every_step_or_are_named(arch25):
    kept = seqopt.optimize(arch25, limits=payload_limits(arch25))
    assert kept.overloads == ()
    assert kept.summary()["payload_exceeded"] == []
    over = seqopt.optimize(weak(arch25, 350.0))
    assert [excess.limit.response for excess in over.overloads] == ["F_rob1"]
    assert over.overloads[0].largest == over.responses()["F_rob1_N"].abs().max()
    (said,) = over.summary()["payload_exceeded"]
    assert said == str(over.overloads[0])
    assert "rob1 holds up to 375.4 N, more than its payload of 350 N (step" in said


@pytest.mark.parametrize(("share", "exceeds"), [(1 - 1e-12, False), (1 - 1e-6, True)])
def test_the_last_bit_decides_nothing(share, exceeds):
    limit = seqopt.Limit("T_max", share * 0.3)
    assert limit.exceeded(np.array([0.1 + 0.2, np.nan])).tolist() == [exceeds, False]


def problem():
    costs = LayeredCosts((np.array([2.0, 1.0]),), (np.zeros((1, 2)),))
    return Costs(costs).compiled().instance


def test_costs_that_change_while_they_are_judged_are_seen(monkeypatch):
    monkeypatch.setattr("seqopt.instances._judge.proven", lambda *_: 99.0)
    with pytest.raises(SolverError, match="the bound 99 is above the path's 1"):
        seqopt.solve(problem(), "overlap_dp")


ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))


def settled(fall=-0.005, payload=None, bricks=7):
    """An arch whose second end sinks, m; by default robots carry what they are given."""
    scene = small_arch(bricks)
    scene = with_part(scene, "grounds", 1, movement=(0.0, 0.0, fall))
    strong = (replace(robot, payload=payload or robot.payload) for robot in scene.robots)
    return scene.with_robots(*strong)


def advice(scene):
    """What is said of the sequential method, and how much the largest grip would hold, N."""
    engine = seqopt.make_engine("compliance", scene)
    over = overloads(scene, seqopt.analyze(engine, seqopt.sequential(engine.network)))
    return payload_advice(engine.network, over), max(each.largest for each in over)


def weight(scene):
    return np.linalg.norm(seqopt.build_network(scene).weight, axis=1).sum()


@pytest.mark.parametrize(("fall", "stiff"), [(-0.005, True), (0.0, False)])
def test_a_payload_beyond_all_weights_comes_with_the_grips_that_need_less(fall, stiff):
    scene = settled(fall, payload=5.0)
    said, least = advice(scene)
    assert (least > weight(scene)) == stiff == ("softer grips (--grips)" in said)
    (newton,) = re.findall(r"^payload of (\S+) N is enough for this plan: --payload \1", said)
    assert least <= float(newton) < 1.1 * least
    if stiff:
        soft = seqopt.make_engine("compliance", scene.with_grips(1e3))
        table = seqopt.analyze(soft, seqopt.sequential(soft.network))
        assert max(each.largest for each in overloads(scene, table)) < weight(scene)


def test_a_free_schedule_says_so_too():
    engine = seqopt.make_engine("compliance", settled(bricks=4))
    problem = build_states(engine, seqopt.FreeRules(), ONES, "steps")
    with pytest.raises(InfeasibleError, match=r"a payload of .* softer grips") as found:
        seqopt.solve(problem, "schedule_search")
    assert str(found.value).count("softer grips") == 1


# one way to solve: what is computed when, what a plan says of itself, what a watch is told
WORST = seqopt.CRITERIA["worst-ratio-published"]


@pytest.fixture
def counted(engine25):
    engine = Counting(engine25)
    return engine, seqopt.pose(engine, seqopt.three_robot_loop(engine.network), WORST)


def test_posing_computes_nothing(counted):
    engine, problem = counted
    assert engine.sets == 0
    plan = seqopt.solve(graph_of(problem), "overlap_dp", proof=False)
    assert plan.models == engine.sets > 0


@pytest.mark.slow
def test_a_search_without_proof_computes_only_what_it_meets(counted):
    engine, problem = counted
    plan = seqopt.solve(graph_of(problem), "cascade", proof=False)
    few = plan.models
    assert (few, plan.certificate) == (engine.sets, None)
    assert np.isnan(plan.selection.objective).all()
    proven = seqopt.solve(problem, "cascade")
    assert (plan.nodes, plan.steps) == (proven.nodes, proven.steps)
    assert few < 0.3 * proven.models < 0.3 * engine.sets
    assert [plan.summary()[name] for name in ("status", "gap")] == ["unproven", None]
    assert "not compared" in repr(plan)


@pytest.mark.slow
def test_a_plan_shows_its_steps_and_choices(engine25):
    plan = seqopt.optimize(engine25.network.scene, engine="compliance")
    assert next(iter(plan.seconds)) == "assemble"
    assert {*plan.nodes} <= {*plan.table()["node"]}
    table = plan.responses()
    assert len(table) == len(plan.steps) == 90
    assert (table["optimized_robot"] != "").sum() > 22


def test_a_plan_of_costs_alone_has_a_path_and_no_steps():
    plan = seqopt.solve(problem(), "overlap_dp")
    assert (plan.nodes, plan.steps) == ((2,), ())  # nodes of the graph, whose start is 0
    assert plan.certificate.gap == 0.0
    assert plan.summary()["objective"] == {"least sum": 1.0}
    for ask in (plan.table, plan.responses):
        with pytest.raises(ProblemError, match="costs alone"):
            ask()


@pytest.mark.slow
def test_every_plan_has_one_summary():
    """Its keys do not depend on what was chosen from, but for the criterion's and the order's."""
    scene, ones = small_arch(5), seqopt.CRITERIA["worst-ratio"]
    plans = [
        seqopt.optimize(scene, criterion=ones),
        seqopt.optimize(scene, criterion=ones, formulation="cascade", search=Search(proof=False)),
        seqopt.optimize(scene, criterion=ones, formulation="overlap_dp"),
        seqopt.optimize(scene, "free"),
        seqopt.optimize(scene, criterion=ones, robust=Robust(count=2)),
        seqopt.optimize(scene, "free", order="search"),
    ]
    own = {"criterion", *(name for plan in plans for name in plan.problem.criterion.settings)}
    keys = [{k for k in p.summary() if k not in own and not k.startswith("order")} for p in plans]
    assert keys == [keys[0]] * len(plans)
    assert [type(plan.summary()["objective"]) for plan in plans] == [dict] * len(plans)
    assert {"order", "orders", "order_evaluated"} <= set(plans[-1].summary())
    for plan in plans:
        assert len(plan.responses()) == len(plan.steps)
        assert len(plan.table()) > 0


@pytest.mark.parametrize("limit", [-1, "1", np.nan, None])
def test_a_time_limit_is_seconds(limit):
    with pytest.raises(ProblemError, match=r"time_limit is .*; give seconds from 0"):
        solve(problem(), "overlap_dp", time_limit=limit)


def test_what_takes_no_watch_takes_no_time_limit():
    exact = find_formulation("overlap_dp")

    def unwatched(problem):
        return exact.solve(problem)

    bare = replace(exact, name="bare", solve=unwatched)
    assert not bare.watched
    assert solve(problem(), bare).certificate.objective == 1.0
    assert solve(problem(), bare).selection.trace[-1].objective == 1.0
    with pytest.raises(ProblemError, match="bare takes no time limit; leave it out"):
        solve(problem(), bare, time_limit=1.0)
    assert "watch" not in exact.options


# many problems side by side: rows as they come, what is left after an end, what has no plan
WORDS = [f"wall:columns=2,courses={count}" for count in (1, 2)]
free = partial(seqopt.optimize, schedule="free", aim="F_largest,steps")


def test_every_row_is_what_one_problem_has(tmp_path):
    found = sweep(WORDS, free, mortars="dry", out=tmp_path / "rows.csv")
    assert [*found["problem"]] == WORDS
    for row in found.to_dict("records"):
        plan = free(row["problem"])
        assert row["F_largest"] == pytest.approx(plan.objective["F_largest"], rel=1e-8)
        assert row["F_largest_bound"] == pytest.approx(row["F_largest"], rel=1e-8)
        assert (row["steps"], row["status"]) == (len(plan.steps), "optimal")
        falls = sum(verdict.value == "does not stand" for verdict in plan.verdicts("dry"))
        assert row["falls_dry"] == falls
    stored = pd.read_csv(tmp_path / "rows.csv")
    pd.testing.assert_frame_equal(stored, found, check_dtype=False, rtol=1e-8)


@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_sweep_that_was_interrupted_goes_on_where_it_ended(tmp_path, workers):
    """Rows that are there are kept as they are, the others are the same as without an end."""
    path = tmp_path / "rows.csv"
    whole = sweep(WORDS, free, out=path)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], lines[1].replace("optimal", "kept"), ""]))
    again = sweep(WORDS, free, out=path, workers=workers)
    assert [*again["status"]] == ["kept", "optimal"]
    assert [*again["F_largest"]] == pytest.approx([*whole["F_largest"]], rel=1e-8)
    sweep(WORDS, lambda scene: pytest.fail("it is known"), out=path)
    other = replace(seqopt.load_scene(WORDS[0]), name="other")
    assert len(sweep([other], free, out=path)) == 1
    assert len(pd.read_csv(path)) == 3  # rows of other problems stay
    path.write_text("a,b\n1,2\n")
    with pytest.raises(ProblemError, match="no table of a sweep"):
        sweep(WORDS, free, out=path)


def test_a_problem_without_a_plan_is_a_row_that_says_why():
    scene = seqopt.load_scene(WORDS[0])
    weak = replace(scene.with_robots(*(replace(r, payload=1.0) for r in scene.robots)), name="weak")
    found = sweep([scene, weak], free)
    assert [*found["status"]] == ["optimal", "infeasible"]
    assert "it becomes possible" in found["why"][1]
    with pytest.raises(ProblemError, match="two problems are called wall 2 x 1; give scenes names"):
        sweep([scene, scene.with_grips(1e6)], free)


def told(*words):
    return main(["sweep", *words, "--schedule", "free", "--aim", "F_largest,steps"])


@pytest.mark.slow
def test_a_command_sweeps_ranges_and_options(tmp_path, capsys):
    out = tmp_path / "s"
    words = ["wall:columns=2,courses=1..2/2", "--over", "payload=1,400", "--out", str(out)]
    assert told(*words) == 0
    assert "4 problems: 2 infeasible, 2 optimal" in capsys.readouterr().out
    rows = pd.read_csv(out / "sweep.csv")
    assert [*rows["payload"]] == [1, 400, 1, 400]
    assert [*rows["scene"]] == [word for word in WORDS for _ in range(2)]
    assert rows["F_largest"].notna().tolist() == [False, True, False, True]
    assert (out / "sweep.png").stat().st_size > 5000
    assert told(*words) == 0  # all rows are there
    assert pd.read_csv(out / "sweep.csv").equals(rows)
    assert told(*words, "--rule", "least_grips=1") == 0  # other problems, by other rules
    assert len(pd.read_csv(out / "sweep.csv")) == 2 * len(rows)
    assert told("wall:columns=2,courses=1", "--over", "payload=1") == 3


def test_a_chart_has_the_ranges_inside_the_words_of_scenes():
    """Over the first of them, in proportion where it goes far, a line for every other value."""
    scenes = spread("chain:bricks=1..1e4/3log,rise=0.1..0.2/2")
    table = pd.DataFrame({"scene": scenes, "payload": 300, "T_max_bound": 1.0, "T_max": range(6)})
    (axes,) = draw_sweep(table, ["scene"]).axes
    assert (axes.get_xlabel(), axes.get_xscale()) == ("bricks", "log")
    lines = {line.get_label(): line.get_xydata().tolist() for line in axes.get_lines()}
    assert lines["rise 0.2"] == [[1, 1], [100, 3], [10000, 5]]
    (axes,) = draw_sweep(table.assign(scene=["a.json", "b.json", "c.json"] * 2), ["scene"]).axes
    assert [text.get_text() for text in axes.get_xticklabels()] == ["a.json", "b.json", "c.json"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["wall:columns=2..x/2"], "range 2..x/2: could not convert"),
        (["arch:span=1..2/0"], "give from 1 to"),
        (["arch25", "--over", "payloads=2"], "no option payloads (did you mean payload?)"),
    ],
)
def test_ranges_that_are_none_are_refused(words, said, capsys):
    assert told(*words) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["chain:bricks=7", "--payload", "5..1"], 2),
        (["chian:bricks=7"], 2),
        (["chain:bricks=7", "--limit", "F_largest=0.1"], 3),
        (["chain:bricks=7", "--time-limit", "0"], 4),
        (["chain:bricks=7", "--over", "payload=0.1,x"], 3),  # one of them is infeasible
    ],
)
def test_a_sweep_without_any_plan_has_the_status_of_its_rows(words, status, capsys):
    assert told(*words, "--no-stability") == status


def test_workers_begin_with_the_largest_of_a_range():
    """Ranges go up: else the largest problem would end alone."""
    begun = []

    def refused(own):
        begun.append(own["size"])
        raise ProblemError("too large")

    given = {f"p{size}": {"size": size} for size in (1, 2, 3, 4)}
    with ThreadPoolExecutor(1) as executor:
        found = sweep(given, refused, executor=executor)
    assert begun == [4, 3, 2, 1]
    assert [*found["size"]] == [1, 2, 3, 4]  # as they were given
    sweep(given, refused)
    assert begun[4:] == [1, 2, 3, 4]
