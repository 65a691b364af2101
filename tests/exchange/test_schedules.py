"""Schedules of one's own; take-downs."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import seqopt
from experiments.placement.parts.staged import analyze_staged
from seqopt.errors import FileError, ProblemError, SolverError, StepError
from seqopt.exchange.schedules import (
    parse_plan,
    parse_schedule,
    read_plan,
    read_schedule,
    schedule_text,
)
from seqopt.graph._spaces import among_orders
from seqopt.graph.states import build_states
from seqopt.judge._rule_moves import check_free
from seqopt.judge._schedules import judge_schedule
from seqopt.network.network import build_network
from seqopt.scene.scene import with_robots
from seqopt.sequence.methods import SCHEDULES, sequential
from seqopt.sequence.part import find_schedule
from seqopt.sequence.steps import Site, Step, StepKind, check_sequence
from tests.brute_force import ONES, allowed, best_values
from tests.builders import small_arch, turned_round
from tests.quality.fuzz_cases import plan_text
from tests.refusals import one_line

HEADER = "step,type,bricks,rob1_node,rob2_node,rob3_node\n"
FOUR = HEADER.replace("rob3_node", "rob3_node,rob{}_node") + "1,place,1,1,,,\n"
START = HEADER + "1,place,1,1,,\n2,place,2,1,2,\n"
THIRD = START + "3,place,3,1,2,?1\n"


@pytest.mark.parametrize("name", SCHEDULES)
def test_what_is_written_can_be_read(arch25, name):
    network = build_network(with_robots(arch25, 5))
    schedule = SCHEDULES[name](network)
    text = schedule_text(schedule)
    assert parse_schedule(network, text, "x.csv") == replace(schedule, method="x")
    bare = re.sub(r"\?\d+", "?", text)  # numbers may be left out
    assert parse_schedule(network, bare, "x.csv") == replace(schedule, method="x")
    assert schedule_text(parse_schedule(network, bare, "x.csv")) == text


def test_a_move_lasts_until_its_robot_lets_go(arch25):
    text = START + "3,reposition,2,1,2,?\n4,release,2,,2,?\n5,place,3,?,2,?\n6,release,3,?,2,\n"
    schedule = parse_schedule(arch25, text + "7,reposition,3,?,2,?\n", "mine.csv")
    assert schedule.method == "mine"
    assert [step.moves for step in schedule.steps] == [
        (), (), (0,), (0,), (0, 1), (1,), (1, 2)
    ]  # fmt: skip
    assert [(m.robot, m.step, m.candidates) for m in schedule.moves] == [
        ("rob3", 3, (3,)),
        ("rob1", 5, (4,)),
        ("rob3", 7, (1, 3, 4, 5)),
    ]


WRONG = {  # text of a schedule: what is said of it
    "": "column step is missing; give step, type",
    HEADER: "it has no steps; give at least one",
    FOUR.format(4): "column rob4_node: no robot of scene arch25 is called so; give rob1_node",
    FOUR.format(1): "column rob1_node occurs twice",
    HEADER + "1,put,1,1,,\n": "line 2: type is 'put'; give one of place",
    HEADER + "1,place,1,1,,,5\n": "line 2: it has more cells than there are columns",
    START + "3,place,3,1,2,!\n": r"line 4: rob3_node is '!'; give a node, \? for an open",
    START + "3,place,3,1,2,99\n": "line 4: step 3: rob3 at node 99: there is no such node",
    START + "3,place,3,1,2,1\n": ".*rob3 at node 1: rob1 holds it; hold another",
    START + "3,place,3,1,2,?2\n": r".*rob3_node is '\?2', but this is open grip \?1",
    THIRD + "4,release,3,,2,?1\n5,reposition,3,?1,2,?1\n":
    r"line 6: rob1_node is '\?1', but this is open grip \?2",
    THIRD + "4,release,3,,2,?2\n":
    r"line 5: rob3_node is '\?2', but this is open grip \?1: .* let rob3 release first",
    START + "3,place,3,1,2,?\n4,release,3,,2,4\n":
    r"line 5: step 4 .*: rob3 moves from node \?1 to 4; let it release first",
    START + "3,release,2,,2,\n4,reposition,2,?,2,?\n":
    r"line 5: step 4 .*: it takes grips \[\?1, \?2\] and drops \[\]",
    START + "3,release,2,,2,\n4,place,3,1,2,\n":
    "line 5: step 4 .*: its new grip is on node 1; hold brick 3 at one of",
    HEADER + "1,place,1,1,,\n2,reposition,1,1,?,\n":
    r"step 2 \(reposition\): no node is open to rob2",
}  # fmt: skip


@pytest.mark.parametrize("text", WRONG)
def test_schedule_files_are_checked(arch25, text):
    with one_line(StepError, f"^schedule s.csv(, |: ){WRONG[text]}"):
        parse_schedule(arch25, text, "s.csv")


def test_schedules_are_found_by_name_file_and_value(engine25, loop25, tmp_path):
    network, path = engine25.network, tmp_path / "own.csv"
    path.write_text(schedule_text(loop25), encoding="utf-8")
    own = replace(loop25, method="own")
    assert read_schedule(network.scene, path) == read_schedule(network, path) == own
    assert find_schedule(network, path) == find_schedule(network, str(path)) == own
    assert find_schedule(network, "three-robot") == find_schedule(network, loop25) == loop25
    named = find_schedule(network, "two-robot", ("rob3", "rob1"))
    assert [move.robot for move in named.moves[:2]] == ["rob3", "rob1"]


def test_what_cannot_be_found_gets_one_line(engine25, loop25, tmp_path):
    network = engine25.network
    with pytest.raises(
        StepError, match=r"schedule 'ring' does not exist; .* three-robot, .*loop.*, or a CSV file"
    ):
        find_schedule(network, "ring")
    with pytest.raises(FileError, match=r"cannot read .*none.csv"):
        find_schedule(network, tmp_path / "none.csv")
    with pytest.raises(StepError, match="schedule three-robot: it is of scene arch25, not of this"):
        find_schedule(build_network(small_arch(5)), loop25)
    with pytest.raises(StepError, match="robots rob1, rob2: only a schedule by name takes them"):
        find_schedule(network, loop25, ("rob1", "rob2"))


# plans from files
COLUMNS = "step,type,bricks,rob1_brick,rob1_node,rob2_brick,rob2_node,rob3_brick,rob3_node\n"


NO_PLANS = {
    "": "column step is missing",
    "step,type,bricks,rob1_node\n1,place,1,1\n": "column rob2_node is missing",
    COLUMNS: "no steps",
    COLUMNS + "1,put,1,1,1,,,,\n": "line 2: type is 'put'",
    COLUMNS + "1,place,1,1,a,,,,\n": "line 2: rob1_node is 'a'",
    COLUMNS + "2,place,1,1,1,,,,\n": "step 2 should be 1",
    HEADER + "1,place,1," + "1" * 131_073 + ",,\n": "not a readable CSV file: field larger",
    HEADER.replace("\n", "\r") + "1,place,1,1,,\r": "not a readable CSV file: new-line",
    HEADER + "1,place,1," + "1" * 5000 + ",,\n": "rob1_node is '1111",
    FOUR.format(1): "column rob1_node occurs twice",
}


@pytest.mark.parametrize("said", NO_PLANS.items(), ids=lambda said: said[1])
def test_plan_files_are_checked(arch25, said):
    text, named = said
    with one_line(StepError, named) as caught:
        parse_plan(arch25, text, "plan.csv")
    assert len(str(caught.value)) < 300


def test_a_plan_from_a_file(tmp_path, arch25):
    path = tmp_path / "plan.csv"
    path.write_text(COLUMNS + "1,place,1,1,1,,,,\n2,place,2,1,1,2,2,,\n", encoding="utf-8")
    assert read_plan(arch25, path) == (
        Step(1, StepKind.PLACE, 1, (1, None, None)),
        Step(2, StepKind.PLACE, 2, (1, 2, None)),
    )


def test_a_plan_that_pandas_wrote_again_is_the_same(tmp_path, arch25):
    """Columns with empty cells are floats in pandas: 48 is written as 48.0."""
    steps = sequential(build_network(arch25))
    path = tmp_path / "plan.csv"
    path.write_text(plan_text(arch25, steps), encoding="utf-8")
    pd.read_csv(path).to_csv(path, index=False)
    assert ",1.0," in path.read_text(encoding="utf-8")
    assert read_plan(arch25, path) == tuple(steps)


# take-downs: rules in plain words against an enumeration of one's own, plans, files, refusals
ARCH = seqopt.ArchShape(pitch=(1.2, 0.4, -0.4, -1.2), pattern="V")
DOWN = seqopt.FreeRules(direction="take-down")


def arch():
    return seqopt.make_engine("compliance", seqopt.arch_scene(ARCH))


def small_wall():
    scene = seqopt.load_scene("wall:columns=2,courses=2")
    return seqopt.make_engine("compliance", scene)


def posed(engine, aims, rules=DOWN):
    return seqopt.pose(engine, rules, ONES, aims)


@pytest.mark.slow
@pytest.mark.parametrize("aim", ["minmax", "sum", "steps"])
@pytest.mark.parametrize("made", [arch, small_wall])
@pytest.mark.parametrize("least", [1, 2])
def test_best_take_down_is_that_of_all(made, aim, least):
    engine, rules = made(), replace(DOWN, least_grips=least)
    plan = seqopt.solve(posed(engine, aim, rules))
    assert plan.status == "optimal"
    assert plan.selection.objective[0] == pytest.approx(
        best_values(engine, rules, aim)[0], rel=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["arch25", "wall:columns=3,courses=3", "vault:span=0.6,rise=0.2,columns=2"]
)
def test_take_downs_are_proven(name):
    engine = seqopt.make_engine("compliance", seqopt.load_scene(name))
    plan = seqopt.solve(seqopt.pose(engine, DOWN, seqopt.CRITERIA["worst-ratio"], "minmax,steps"))
    assert plan.status == "optimal"
    assert plan.certificate.bound == pytest.approx(plan.selection.objective[0], rel=1e-9)
    assert [s.bricks for s in plan.steps if s.kind is StepKind.REMOVE] == [
        *range(len(engine.network.scene.bricks))[::-1]
    ]


@pytest.mark.parametrize("made", [arch, small_wall])
def test_take_down_is_worth_what_its_build_is_in_reverse(made):
    """With one robot after the other at the finished structure, both pass the same states."""
    engine = made()
    one = seqopt.FreeRules(ending="one-by-one")
    build, down = (seqopt.solve(posed(engine, "minmax,steps", rules)) for rules in (one, DOWN))
    bare = peak_of(engine, [build.steps[-1]])  # counts in builds: it is where take-downs begin
    reverse = turned_round(engine.network.scene, build.steps)
    check_free(engine.network, DOWN, reverse)
    assert down.selection.objective[0] == pytest.approx(peak_of(engine, down.steps))
    assert max(bare, down.selection.objective[0]) == pytest.approx(build.selection.objective[0])
    assert len(down.steps) == len(build.steps) == len(reverse)


def peak_of(engine, steps):
    """The worst step, each solved alone."""
    scales = np.array([scale for _, scale in ONES.limits])
    worst = [allowed(engine, DOWN, s.bricks, s.grips) for s in steps if s.bricks]
    return float((np.array(worst) / scales).max())


def test_judge_refuses_what_is_no_take_down():
    engine = arch()
    problem = build_states(engine, DOWN, ONES, "minmax")
    plan = seqopt.solve(posed(engine, "minmax"))
    claimed = plan.selection
    judge_schedule(problem, claimed, plan.steps)
    better = replace(claimed, objective=(0.9 * claimed.objective[0],), bound=(0.0,))
    with pytest.raises(SolverError, match="as claimed"):
        judge_schedule(problem, better, plan.steps)
    short = plan.steps[:-1]
    with pytest.raises(StepError, match="does not end there"):
        check_free(engine.network, DOWN, short)
    wrong = Step(2, StepKind.RELEASE, 4, (None,) * 3)
    with pytest.raises(StepError, match="step 2"):
        check_free(engine.network, DOWN, [plan.steps[0], wrong])


@pytest.mark.parametrize(
    ("who", "match"),
    [((0, 1), r"\(remove\): .* one robot alone holds brick 4"), ((0,), "brick 4 is not placed")],
)
def test_removal_is_by_who_alone_holds(who, match):
    scene = arch().network.scene
    newest, first = scene.placed[-1].nodes, scene.placed[0].nodes
    free = [n for n in (*newest, *first) if n not in scene.blocked_nodes]
    before = Step(1, StepKind.REPOSITION, 4, (free[0], free[-1], None))
    check_sequence(scene, [Step(2, StepKind.REMOVE, 3, (None, free[-1], None))], before)
    two = Step(1, StepKind.REPOSITION, 4, (newest[0], newest[1], None))
    held = tuple(None if r in who else n for r, n in enumerate(two.grips))
    with pytest.raises(StepError, match=match):
        check_sequence(scene, [Step(2, StepKind.REMOVE, 3, held)], two)


def test_plans_are_read_back():
    scene = seqopt.load_scene("arch25")
    down = turned_round(scene, seqopt.sequential(seqopt.build_network(scene)))
    assert parse_plan(scene, plan_text(scene, down), "down") == down
    table = seqopt.analyze(seqopt.make_engine("auto", scene), down)
    assert table["bricks"].iloc[-1] == 0
    assert not table[["F_max_N", "D_max_1e-3mm"]].iloc[-1].any()


def test_what_a_take_down_has_not():
    engine = arch()
    with pytest.raises(ProblemError, match="orders of a take-down are not searched"):
        among_orders(build_states(engine, DOWN, ONES, "minmax"), "tied")
    with pytest.raises(StepError, match="cannot end with 4; give fewer"):
        replace(DOWN, finish=Site(4)).span(engine.network.scene)
    with pytest.raises(StepError, match="did you mean take-down"):
        seqopt.FreeRules(direction="takedown")
    plan = seqopt.solve(posed(engine, "steps"))
    with pytest.raises(StepError, match="what was locked in before is not known"):
        analyze_staged(engine.network, plan.steps)
