"""Processes; robots' columns and responses collide with nothing."""

from __future__ import annotations

import pickle
from dataclasses import replace
from functools import cache
from itertools import groupby
from operator import itemgetter

import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import seqopt
from seqopt._cli.main import main
from seqopt.engines.interface import Want
from seqopt.engines.registry import ENGINES, make_engine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import ProblemError, SceneError
from seqopt.network.build import build_network
from seqopt.plan.solve import graph_of, pose, solve
from seqopt.problem.criteria import RankSum, equal
from seqopt.problem.requirements import CHOICE_RESPONSES, Limit
from seqopt.responses import _grip_sets as division
from seqopt.responses._grip_sets import Block, Resources, answer, packed
from seqopt.responses.quantities import RESPONSES, robot_response
from seqopt.responses.table import analyze
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import save_scene
from seqopt.sequence.methods import sequential, three_robot_loop
from seqopt.study import EQUATIONS, WORST_RATIO
from seqopt.work._workers import keep
from tests.builders import six_bricks

NAMES = ("T_max", "M_sup", "D_max", "C_max")


def evaluated(engine, schedule, **resources):
    """The graph of a schedule and the responses of all candidates of its open steps, by level."""
    limits = [Limit(name, 1e9) for name in ("C_max", "F_largest")]
    posed = pose(engine, schedule, EQUATIONS, limits=limits, resources=Resources(**resources))
    graph = graph_of(posed)
    levels = [k for k in range(1, graph.space.levels + 1) if graph.space.open_columns(k)]
    states = {level: graph.space.candidates(level).states for level in levels}
    with keep(graph.resources.executor, graph.resources.workers):
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


@pytest.fixture
def small_blocks(monkeypatch):
    """Many blocks on a small scene."""
    monkeypatch.setattr(division, "BLOCK", 50)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "workers"), [pytest.param("compliance", 2, marks=pytest.mark.long), ("auto", 3)]
)
def test_results_are_the_same_whatever_the_workers(small_blocks, loop25, name, workers):
    alone = make_engine(name, loop25.scene)
    shared = make_engine(name, loop25.scene)
    (one, expected), (other, found) = (
        evaluated(alone, loop25), evaluated(shared, loop25, workers=workers)
    )  # fmt: skip
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
        assert found[i] == expected


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
    assert answer(engine, first) != answer(Dependent(build_network(BUILT)), first)


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


def test_the_command_line_offers_them(capsys, tmp_path):
    save_scene(called("sup", "max", "each"), tmp_path / "s.json")
    words = ["optimize", str(tmp_path / "s.json"), "--formulation", "overlap_dp"]
    out = ["--out", str(tmp_path / "out")]
    assert main([*words, *out, "--limit", "F_sup=9"]) == 2
    assert "F_[each], F_[max], F_[sup]" in capsys.readouterr().err
    assert main([*words, *out, "--criterion", "F_[sup],T_max", "--limit", "F_[max]=900"]) == 0
    table = pd.read_csv(tmp_path / "out" / "plan.csv")
    assert {"F_sup_N", "F_[sup]_N", "F_max_N", "F_[max]_N"} <= set(table)
