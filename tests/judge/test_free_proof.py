"""The proof of free schedules: its tables against rules in plain words, its bounds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError
from seqopt.graph.states.states import build_states
from seqopt.judge._proof import Proof
from seqopt.judge._rule_moves import RuleTables
from seqopt.problem.criteria import WorstRatio
from seqopt.sequence.steps import StepKind
from tests.builders import first
from tests.plain_rules import PlainBook
from tests.strategies import free_builds

ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5)))
few = settings(max_examples=3, deadline=None)


def told(book, tables, bricks, state):
    """What follows from a row by the book, as plain values."""
    robots = len(book.network.scene.robots)
    grips = [None] * robots
    for column, robot in enumerate(book.team):
        grips[robot] = int(tables.nodes[state[column]]) if state[column] else None
    counts = book.rules.regrips is not None
    taken = int(state[-1]) if counts else 0
    place = {node: i for i, node in enumerate(tables.nodes.tolist())}
    for kind, after, held, regrips in book.follow(bricks, tuple(grips), taken):
        row = [place[held[r]] if held[r] is not None else 0 for r in book.team]
        yield after, (*row, *([regrips] if counts else [])), kind is StepKind.REPOSITION


@given(build=free_builds(most_bricks=3, most_robots=3), data=st.data())
@few
def test_tables_say_what_the_book_says(build, data):
    """All states that rules lead to, robots that could change places told apart."""
    scene, rules = build
    book = PlainBook(seqopt.build_network(scene), rules)
    tables = RuleTables(book, [])
    reached = {(0, tuple(tables.start()[0].tolist()))}
    work = [*reached]
    while work:
        bricks, row = work.pop()
        expected = {*told(book, tables, bricks, row)}
        states = np.array([row], dtype=np.int32)
        found = {
            (follows.level, tuple(after), follows.regrip)
            for follows in tables.successors(bricks, states)
            for after in follows.states.tolist()
        }
        assert found == expected
        found = {move[:2] for move in found}
        assert tables.ends(bricks, states)[0] == book.ends(
            bricks, tuple(int(tables.nodes[n]) if n else None for n in row[: tables.robots])
        )
        work += found - reached
        reached |= found
    assert len(reached) > 1 or not {*told(book, tables, *reached.pop())}


@pytest.mark.parametrize("aim", ["minmax,steps", "sum(D_max),regrips", "travel"])
@given(build=free_builds(most_bricks=4, most_robots=3), told=st.booleans())
@few
def test_bounds_are_the_values_of_the_best_plan(aim, build, told):
    """Whatever states it is told of; and of a worse plan they are less than its values."""
    scene, rules = build
    problem = build_states(seqopt.make_engine("compliance", scene), rules, ONES, aim)
    try:
        best = seqopt.solve(problem, "schedule_search").selection
    except InfeasibleError:
        assert Proof(problem).is_impossible()
        return
    hint = dict(enumerate(best.visited)) if told else None
    assert Proof(problem, hint).bounds(best.objective) == pytest.approx(best.objective, rel=1e-9)
    assert not Proof(problem, hint).is_impossible()
    worse = (1.1 * best.objective[0] + 1, *best.objective[1:])
    assert Proof(problem, hint).bounds(worse)[0] == pytest.approx(best.objective[0], rel=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_the_models_of_a_proof_are_those_that_engines_solved(count):
    engines = [
        seqopt.make_engine("auto", seqopt.build_network(first(seqopt.load_scene("arch25"), 9)))
    ]
    engines += [seqopt.make_engine("auto", engines[0].network) for _ in range(1, count)]
    problem = build_states(engines[0], seqopt.FreeRules(), ONES, "minmax")
    problem = replace(problem, scenarios=tuple(engines) if count > 1 else ())
    value = seqopt.solve(problem).objective["minmax"]
    before = sum(engine.tally.total() for engine in engines)
    proof = Proof(problem)
    proof.bounds((value,))
    assert proof.models == sum(engine.tally.total() for engine in engines) - before > 0
