"""Who works changes no answer; responses of each step are those of its table and its states."""

import io
import pickle
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby
from operator import itemgetter

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import rankdata

import seqopt
from seqopt._cli.main import main
from seqopt.engines.discrete import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import FLAGS, Engine, Want
from seqopt.engines.registry import ENGINES, make_engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import MechanismError, ProblemError, SceneError, SeqoptError, SolverError
from seqopt.exchange._files import csv_text
from seqopt.network.network import build_network
from seqopt.plan.solve import graph_of, pose, solve
from seqopt.problem.criteria import RankSum, equal
from seqopt.problem.requirements import CHOICE_RESPONSES, Limit
from seqopt.responses import _grip_sets as batches
from seqopt.responses._grip_sets import Block, Resources, answer, packed
from seqopt.responses.quantities import RESPONSES, responses_of, robot_response
from seqopt.responses.table import (
    LinearRange,
    _each_fields,
    analyze,
    force_column,
    step_fields,
    what_was_enough,
)
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import save_scene
from seqopt.sequence.methods import SCHEDULES, sequential, three_robot_loop
from seqopt.sequence.steps import Step, StepKind
from seqopt.study import EQUATIONS, WORST_RATIO
from seqopt.work import _keep
from seqopt.workflow import optimize
from tests.builders import running_bond, six_bricks

NAMES = ("T_max", "M_sup", "D_max", "C_max")


def evaluated(engine, schedule, **resources):
    """The graph of a schedule and the responses of all candidates of its open steps, by level."""
    limits = [Limit(name, 1e9) for name in ("C_max", "F_largest")]
    posed = pose(engine, schedule, EQUATIONS, limits=limits, resources=Resources(**resources))
    graph = graph_of(posed)
    levels = [k for k in range(1, graph.space.levels + 1) if graph.space.open_columns(k)]
    states = {level: graph.space.candidates(level).states for level in levels}
    with _keep(graph.resources.executor, graph.resources.workers):
        return graph, {k: graph.seen(k, rows).responses for k, rows in states.items()}


def require_alike(found, expected):
    """Sets share their work with others: the last digits may differ."""
    assert found.keys() == expected.keys()
    for level, responses in expected.items():
        for name, values in responses.items():
            most = 1e-11 * np.nanmax(np.abs(values), initial=0.0)
            assert found[level][name] == pytest.approx(values, abs=most, nan_ok=True)


def blocks_of(schedule, most):
    """Return the grip sets of open steps by brick count, in blocks of at most so many."""
    space = graph_of(pose(ComplianceEngine(schedule.scene), schedule, EQUATIONS)).space
    out = []
    for level, step in enumerate(schedule.steps, start=1):
        for held in space.held(space.candidates(level).states) if step.moves else ():
            nodes = [schedule.scene.placed_nodes[place - 1] for place in held if place]
            out.append((step.bricks, len(nodes), *sorted(nodes)))
    groups = [[*own] for _, own in groupby(sorted({*out}), key=itemgetter(0, 1))]
    return [
        Block(own[0][0], np.array([row[2:] for row in own[at : at + most]]), NAMES)
        for own in groups
        for at in range(0, len(own), most)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "workers"), [pytest.param("compliance", 2, marks=pytest.mark.long), ("auto", 3)]
)
def test_results_are_the_same_whatever_the_workers(monkeypatch, loop25, name, workers):
    """And whether all sets are one block or, on this small scene, many that are shared."""
    found = []
    for size, own in ((10**9, 1), (50, workers)):
        monkeypatch.setattr(batches, "BLOCK", size)
        found.append(evaluated(make_engine(name, loop25.scene), loop25, workers=own))
    (one, expected), (other, found) = found
    require_alike(found, expected)
    assert one.models == other.models == 8642


BUILT = arch_scene(ArchShape(pitch=np.linspace(1.3, -1.3, 7).tolist(), pattern="V"))  # in a plane
STATES = three_robot_loop(BUILT)


def blocks():
    """Return blocks of all brick counts, in order."""
    return blocks_of(STATES, 2048)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(ENGINES))
@settings(max_examples=5)
@given(order=st.permutations(range(len(blocks()))))
def test_an_answer_does_not_depend_on_what_was_asked_before(name, order):
    """Blocks may come in any order: what an engine keeps between them changes no bit."""
    few = [Block(b.bricks, b.grips[:3].copy(), b.names) for b in blocks()]
    engine = make_engine(name, BUILT)
    found = {i: answer(engine, few[i]) for i in order}
    for i, block in enumerate(few):
        expected = answer(make_engine(name, BUILT), block)
        assert np.array_equal(found[i], expected)


class Dependent:
    """An engine whose answers depend, in the last digits, on what it was asked before."""

    def __init__(self, network):
        self.engine, self.calls = ComplianceEngine(network), 0

    @property
    def network(self):
        return self.engine.network

    def solve(self, bricks, grips, want):
        self.calls += 1
        found = self.engine.solve(bricks, grips, want)
        return replace(found, edge_force=found.edge_force * (1 + 1e-15 * self.calls))


def test_an_engine_that_remembers_is_seen():
    """The comparison above can fail."""
    first, other = blocks()[:2]
    engine = Dependent(build_network(BUILT))
    answer(engine, other)
    answer(engine, other)
    fresh = answer(Dependent(build_network(BUILT)), first)
    assert not np.array_equal(answer(engine, first), fresh)


def test_the_scene_is_sent_and_no_operators(loop25):
    engine = make_engine("compliance", loop25.scene)
    first, *rest = blocks_of(loop25, 2048)  # operators of all brick counts
    engine.solve(first.bricks, first.grips, Want.SCREEN)
    engine.network.scene.prop_numbers(1, held=True)  # what the scene knows of its grips goes along
    before = len(packed(engine))
    for block in rest:
        engine.solve(block.bricks, block.grips, Want.SCREEN)
    assert len(packed(engine)) == before < 2 * len(pickle.dumps(loop25.scene))
    assert len(pickle.dumps(engine)) > 20 * before


def test_an_engine_that_cannot_be_sent_is_refused_in_a_line(loop25):
    engine = ComplianceEngine(loop25.scene)
    engine.lock = lambda: None
    with pytest.raises(SceneError, match="engine ComplianceEngine: it cannot be sent"):
        evaluated(engine, loop25, workers=2)


@pytest.mark.slow
def test_a_network_that_is_not_its_scenes_is_not_made_anew(loop25):
    """A recipe would make another engine than this one."""
    network = build_network(loop25.scene)
    heavier = replace(network, weight=2 * network.weight)
    engine = make_engine("compliance", heavier)
    found = evaluated(engine, loop25, workers=2)[1]
    require_alike(found, evaluated(make_engine("compliance", heavier), loop25)[1])
    with pytest.raises(AssertionError):
        require_alike(found, evaluated(make_engine("compliance", network), loop25)[1])


@pytest.mark.parametrize(
    "wrong", [{"workers": 0}, {"workers": 1.5}, {"workers": True}, {"executor": 2}]
)
def test_resources_that_cannot_be_meant_are_refused(wrong):
    with pytest.raises(ProblemError, match=next(iter(wrong))):
        Resources(**wrong)


def test_a_response_that_nobody_asks_for_is_neither_computed_nor_kept(loop25):
    wants = set()

    class Asked(Dependent):
        def solve(self, bricks, grips, want):
            wants.add(want)
            return self.engine.solve(bricks, grips, want)

    forces = pose(Asked(loop25.scene), loop25, RankSum("own", equal("F_move"), equal("F_move")))
    graph = graph_of(forces)
    assert solve(graph, "overlap_dp", proof=False).steps
    assert graph.sets.names == ()
    assert {want & ~Want.SCREEN for want in wants} == {Want(0)}  # forces come without any field


# robots' columns and responses collide with nothing, whatever the robots are called
ODD = ["each", "[sup]", "a,b"]
PAYLOAD = 40.0  # N
EVERY = replace(EQUATIONS, before=(("F_each", 1.0),), after=(("F_each", 1.0),))


def called(*names):
    """The arch of six bricks with robots of other names and payloads that bind.

    They can carry a brick, of 36 N.
    """
    scene = six_bricks()
    robots = [replace(r, name=n, payload=PAYLOAD) for n, r in zip(names, scene.robots, strict=True)]
    return replace(scene, robots=tuple(robots))


def posed(scene, criterion):
    network = build_network(scene)
    return pose(ComplianceEngine(network), three_robot_loop(network), criterion)


@cache
def tabled(name):
    network = build_network(called(name, "two", "three"))
    return analyze(ComplianceEngine(network), sequential(network))


@cache
def plainly(criterion):
    """The problem and its plan where names are not odd."""
    problem = posed(called("one", "two", "three"), criterion)
    return problem, solve(problem, "overlap_dp")


@pytest.mark.parametrize("name", ODD)
def test_a_name_changes_no_number(name):
    tables = [tabled("one"), tabled(name)]
    assert len(tables[0].columns) == len(set(tables[1].columns))
    for first, second in zip(tables[0], tables[1], strict=True):
        pd.testing.assert_series_equal(tables[0][first], tables[1][second], check_names=False)
    assert {response.column for response in RESPONSES.values()} <= set(tables[1])


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("criterion", [EVERY, WORST_RATIO], ids=lambda c: c.name)
def test_a_name_changes_no_choice(name, criterion):
    plain, chosen = plainly(criterion)
    odd = posed(called("one", name, "three"), criterion)
    first, second = (seqopt.compile_instance(problem) for problem in (plain, odd))
    for arrays in ("amounts", "alone"):
        np.testing.assert_array_equal(getattr(first, arrays), getattr(second, arrays))
    other = solve(odd, "overlap_dp")
    for what in ("states", "objective", "bound"):
        assert getattr(chosen.selection, what) == getattr(other.selection, what)


@settings(max_examples=10)
@example(first=" ", second="[ ]")
@given(first=st.text("1 _F[],", max_size=4), second=st.text("1 _F[],", max_size=4))
def test_no_two_robots_share_a_name(first, second):
    taken = {*RESPONSES, *CHOICE_RESPONSES, "F_each", "F_rob", "F_max"}
    assert robot_response(first) not in taken
    assert (robot_response(first) == robot_response(second)) == (first == second)


@pytest.mark.slow
def test_the_command_line_offers_them(capsys, tmp_path):
    save_scene(called("sup", "max", "each"), tmp_path / "s.json")
    words = ["optimize", str(tmp_path / "s.json"), "--formulation", "overlap_dp"]
    out = ["--out", str(tmp_path / "out")]
    assert main([*words, *out, "--limit", "F_sup=9"]) == 2
    assert "F_[each], F_[max], F_[sup]" in capsys.readouterr().err
    assert main([*words, *out, "--criterion", "F_[sup],T_max", "--limit", "F_[max]=900"]) == 0
    table = pd.read_csv(tmp_path / "out" / "plan.csv")
    assert {"F_sup_N", "F_[sup]_N", "F_max_N", "F_[max]_N"} <= set(table)


# steps that are solved together have the fields and errors of each on its own
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
    steps = sorted(builds[0] + builds[1] + builds[0], key=lambda step: step.bricks)
    assert len([*_each_fields(engine, steps)]) == len(steps)
    states = {(step.bricks, step.grips) for step in steps}
    assert sum(count for _, count in calls) == len(states)
    assert len(calls) < len(states)


def test_an_error_names_the_step_whose_it_is(engine, builds):
    scene = engine.network.scene
    free = [replace(ground, rotational_stiffness=(0.0, 0.0, 0.0)) for ground in scene.grounds]
    hinged = seqopt.make_engine("compliance", replace(scene, grounds=tuple(free)))
    held = next(step for step in builds[0] if step.bricks == 3 and len(step.held) > 1)
    loose = Step(7, StepKind.RELEASE, 3, (None,) * len(scene.robots))
    with pytest.raises(MechanismError, match=r"^step 7: "):
        [*_each_fields(hinged, [held, loose])]


# the responses of all choices: those of the steps, and no more than is asked
COMPARED = ("T_max", "M_sup", "D_max")
BEYOND = [Limit("C_max", 1e9), Limit("F_largest", 1e9)]  # so that these are responses as well


def steps_at(graph, level, states):
    """States of a level as steps."""
    step, nodes = graph.rules.steps[level - 1], (None, *graph.network.scene.placed_nodes)
    rows = [tuple(nodes[place] for place in row) for row in states.tolist()]
    return [Step(step.number, step.kind, step.bricks, row) for row in rows]


@pytest.mark.parametrize("method", ["three-robot", "modified-sequential"])
def test_states_hold_the_responses_of_their_steps(engine25, method):
    """Of a random candidate of every open step: as if that step were analyzed alone."""
    graph = graph_of(pose(engine25, SCHEDULES[method](engine25.network), EQUATIONS, limits=BEYOND))
    rng, robots = np.random.default_rng(1), engine25.network.scene.robots
    for level in filter(graph.space.open_columns, range(1, graph.space.levels + 1)):
        every = graph.space.candidates(level).states
        at = int(rng.integers(len(every)))
        found = {name: v[at] for name, v in graph.seen(level, every).responses.items()}
        (step,) = steps_at(graph, level, every[at : at + 1])
        want = responses_of(engine25.network, step_fields(engine25, step))
        for name in COMPARED:
            assert found[name] == pytest.approx(want[name][0])
        assert found["C_max"] == pytest.approx(max(0.0, -want["F_min"][0]))
        forces = np.abs(want["F_rob"][0])
        assert found["F_largest"] == pytest.approx(forces.max())
        own = iter(forces)
        by_robot = {
            robot.name: np.nan if node is None else next(own)
            for robot, node in zip(robots, step.grips, strict=True)
        }
        for name, force in by_robot.items():
            assert found[f"F_{name}"] == pytest.approx(force, nan_ok=True)
        moving = graph.space.decided_by(level).robot
        assert found["F_move"] == pytest.approx(by_robot[moving])


def borda(graph, level):
    """Mean ranks among the candidates of a level by equations (2) and (3), from a table of steps.

    Of two open moves ranks among all pairs are scaled to as many as the later one has candidates.
    """
    move = graph.space.decided_by(level)
    every = graph.space.candidates(level).states
    table = analyze(graph.engine, steps_at(graph, level, every))
    forces = {r.name: table[force_column(r)].to_numpy(float) for r in graph.network.scene.robots}
    moment = table["M_sup_Nm"].to_numpy(float)
    ranked = [table["F_max_N"].to_numpy(float).clip(min=0), moment]  # the largest tension
    if move.bricks < 13:  # the crown of the arch
        ranked += forces.values()
    else:
        ranked += [forces[move.robot], table["D_max_1e-3mm"].to_numpy(float)]
    count, total = len(move.candidates), 0.0
    for values in ranked:
        own = rankdata(np.round(np.abs(np.nan_to_num(values))))
        if len(graph.space.open_columns(level)) > 1:
            own = (own - 0.5) * count / len(own) + 0.5
        total += own if np.isfinite(values).any() else 0.5 * (count + 1)
    return every, total / len(ranked)


@pytest.mark.parametrize("level", [4, 7, 27, 50, 51])
def test_ranks_among_candidates_are_those_of_the_equations(engine25, loop25, level):
    """Before and after the crown, of one open move and of two."""
    graph = graph_of(pose(engine25, loop25, EQUATIONS))
    every, expected = borda(graph, level)
    assert graph.candidates.among(level, every) == pytest.approx(expected, rel=1e-12)
    assert len(every) == graph.space.candidates(level).possible.sum() > 1


def test_steps_without_an_open_grip_have_no_ranks(engine25, loop25):
    graph = graph_of(pose(engine25, loop25, EQUATIONS))
    given = [*graph.space.without_choice()]
    assert len(given) == sum(not step.moves for step in loop25.steps) > 0
    assert not any(graph.candidates.among(level, state).any() for level, state in given)


def test_unknown_responses_are_refused(engine25, loop25):
    with pytest.raises(ProblemError, match=r"criterion x: .* no F_rob9; give C_max, D_max"):
        pose(engine25, loop25, RankSum("x", equal("F_rob9"), equal("F_rob9")))


# the table of grips says what the table of responses says, grip by grip
@pytest.fixture(scope="module")
def plans(problem25):
    return [solve(problem25, "overlap_dp"), optimize("wall:columns=3,courses=3", "free")]


def require_same(grips, table):
    """Require that grips are those of a table of responses, cell by cell."""
    count = 0
    for row in grips.to_dict("records"):
        own = table[(table["step"] >= row["from_step"]) & (table["step"] <= row["to_step"])]
        robot = row["robot"]
        assert (own[f"{robot}_node"] == row["node"]).all()
        assert (own[f"{robot}_brick"] == row["brick"]).all()
        forces = own.set_index("step")[f"F_{robot}_N"]
        largest = pytest.approx(row["largest_force_N"], rel=1e-5)  # the file has six digits
        assert forces.max() == forces[row["at_step"]] == largest
        assert row["places"] == (own["type"].iloc[0] == "place")
        count += len(own)
    nodes = [name for name in table if name.endswith("_node")]
    assert count == int(table[nodes].notna().to_numpy().sum())


@pytest.mark.slow
def test_grips_are_those_of_the_plans_csv(plans):
    for plan in plans:
        table = pd.read_csv(io.StringIO(csv_text(plan.responses())))
        require_same(plan.table(), table)


def test_another_force_is_seen(plans):
    grips = plans[0].table()
    grips.loc[3, "largest_force_N"] += 0.1
    with pytest.raises(AssertionError):
        require_same(grips, plans[0].responses())


def test_the_table_of_a_plan_has_the_node_that_was_chosen_for_every_move(plans):
    plan, _ = plans
    rows = plan.table().set_index(["robot", "from_step"])
    for move, node in zip(plan.problem.schedule.moves, plan.nodes, strict=True):
        assert rows.loc[(move.robot, move.step), "node"] == node


# what an engine answers is finite, or an error: never a robot that does not grip
@dataclass
class Broken:
    """An engine that loses a number of one field."""

    inner: Engine
    field: str
    value: float = np.nan

    @property
    def network(self):
        return self.inner.network

    def solve(self, bricks, grips, want=Want.RESPONSES):
        answer = self.inner.solve(bricks, grips, want)
        wrong = getattr(answer, self.field).copy()
        wrong.reshape(-1)[-1:] = self.value
        return replace(answer, **{self.field: wrong})


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(
    ("field", "named"),
    [("edge_force", "T_max|F_min"), ("grip_force", "grip force"), ("support", "M_sup|F_sup")],
)
def test_an_engine_of_ones_own_is_held_to_finite_numbers(field, value, named):
    """NaN dropped T_max from the ranks, and the choice was called optimal."""
    network = build_network(six_bricks())
    engine = Broken(ComplianceEngine(network), field, value)
    problem = pose(engine, three_robot_loop(network), EQUATIONS)
    with np.errstate(invalid="ignore"):
        with pytest.raises(SolverError, match=f"({named}) is not finite"):
            analyze(engine, sequential(network))
        with pytest.raises(SolverError, match=f"({named}) is not finite"):
            solve(problem, "overlap_dp")


def test_what_a_library_raises_is_an_error_of_ours():
    """A stiffness whose inverse is no number, past the scene's own check."""
    network = build_network(running_bond(2, 2))
    springs = network.springs
    soft = np.full_like(springs.translational_stiffness, 1e-320)
    weak = replace(network, springs=replace(springs, translational_stiffness=soft))
    with np.errstate(all="ignore"), pytest.raises(SolverError, match="beyond all bounds"):
        ComplianceEngine(weak).solve(4, np.array([[2]]))


@pytest.mark.parametrize("engine", [ComplianceEngine, FrameEngine])
def test_engines_refuse_to_answer_what_is_not_finite(engine):
    """Edges of no length, as a network made by hand may have them."""
    network = build_network(six_bricks())
    position = network.node_position.copy()
    first = network.inner[0]
    joint = network.springs.node[0]
    position[joint] = position[first[0]]
    flat = replace(network, node_position=position)
    with np.errstate(all="ignore"), pytest.raises(SeqoptError, match=r"not finite|ill-cond"):
        engine(flat).solve(2, np.array([[2]]))


# what is said of models that were not taken is what they answer
def arch(density=2000.0, pattern="V"):
    return seqopt.arch_scene(
        seqopt.ArchShape(pitch=np.linspace(1.3, -1.3, 6), pattern=pattern, density=density)
    )


def enough(scene, name):
    engine = seqopt.make_engine(name, scene)
    steps = seqopt.sequential(engine.network)
    table = seqopt.analyze(engine, steps)
    return what_was_enough(LinearRange(engine), {"": table}), steps, table


@pytest.mark.parametrize("name", ["compliance", "auto"])
def test_within_elastic_limits_discrete_elements_change_nothing(name):
    found, steps, table = enough(arch(), name)
    of_epoxy = "" if name == "auto" else " with epoxy"
    said = f"discrete elements{of_epoxy} would change nothing in these steps"
    assert said in found.others
    assert found.below_limit > 0
    assert found.lines[0].startswith("enough: compliance; ")  # the level that auto took
    assert f"{found.joint} in {found.step}" in found.lines[0]
    detailed = seqopt.analyze(DiscreteEngine(seqopt.build_network(arch())), steps)
    for column in ("F_max_N", "M_sup_Nm", "D_max_1e-3mm"):
        np.testing.assert_allclose(detailed[column], table[column], rtol=1e-7, atol=1e-9)


def test_beyond_elastic_limits_nothing_is_promised():
    """The negative control: so heavy that joints break, and discrete elements answer otherwise."""
    found, steps, table = enough(arch(2e6), "compliance")
    assert found.below_limit < 0
    assert found.lines[0].startswith("taken: compliance; what discrete elements would change is")
    number = int(found.step.removeprefix("step "))
    engine = DiscreteEngine(seqopt.build_network(arch(2e6)))
    try:
        moved = seqopt.analyze(engine, steps[number - 1 : number])["D_max_1e-3mm"][0]
    except SeqoptError:
        return  # it does not even come to rest
    assert moved > 1.01 * table["D_max_1e-3mm"][number - 1]


def test_outside_the_linear_range_nothing_is_enough():
    engine = seqopt.make_engine("auto", arch())
    table = seqopt.analyze(engine, seqopt.sequential(engine.network))
    assert what_was_enough(LinearRange(engine), {"": table}).lines[0].startswith("enough: ")
    within = LinearRange(engine)
    within.far = float(table["D_max_1e-3mm"].max()) / 7.3e6
    said = "what discrete elements would change is not known outside the linear range"
    assert what_was_enough(within, {"": table}).lines[0] == f"taken: compliance; {said}"


def test_without_weight_there_is_a_reason_why_nothing_is_known():
    found, _, _ = enough(replace(arch(), gravity=(0.0, 0.0, 0.0)), "compliance")
    assert found.others.endswith("is not known: joints bear nothing that could be compared")


def test_what_is_left_out_is_that_of_the_run():
    found, _, _ = enough(arch(), "frame")
    assert "not known" in found.others
    assert "what earlier steps lock in" in found.left_out
    engine = seqopt.make_engine("compliance", arch())
    last = seqopt.sequential(engine.network)[-1:]
    alone = what_was_enough(LinearRange(engine), {"": seqopt.analyze(engine, last)})
    assert "what earlier steps lock in" not in alone.left_out
    assert found.facts().keys() == alone.facts().keys()
