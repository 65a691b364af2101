"""What values say at the prompt is short, and in words."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

import seqopt
from seqopt.engines.registry import ENGINES
from seqopt.graph._orders import among_orders
from seqopt.graph.decisions import travel
from seqopt.graph.states.states import build_states
from seqopt.plan.front import FrontProblem, find_front
from seqopt.plan.out_of_sample import judge_unseen
from seqopt.report.comparison import compare
from seqopt.scene.library import ArchForm, DomeShape
from seqopt.stability._steps import assess_steps

MOST = 300  # letters
OURS = ("seqopt.", "formulations.")


def engines(network):
    for name in ENGINES:
        yield seqopt.make_engine(name, network)


pytestmark = pytest.mark.xdist_group("prompt")  # what all look at is made once


@pytest.fixture(scope="module")
def met(problem25):
    """What a user may meet, of every kind."""
    network = problem25.engine.network
    plan = seqopt.solve(problem25, "overlap_dp")
    lean = seqopt.solve(problem25, "rank_search", proof=False)
    small = seqopt.load_scene("wall:columns=2,courses=2")
    free = seqopt.optimize(small, "free")
    drawn = seqopt.scenarios(small, count=2, seed=1)
    posed = seqopt.optimize(small, criterion="worst-ratio").problem
    asked = (posed.engine, posed.moves, posed.criterion)
    robust = seqopt.solve(seqopt.pose(*asked, scenarios=drawn))
    words = posed.criterion, "F_largest,M_sup"
    loop = FrontProblem(build_states(posed.engine, posed.schedule, *words))
    rules, aim = seqopt.FreeRules(), "F_largest,steps"
    aims = build_states(posed.engine, rules, posed.criterion, aim)
    values = [plan, lean, free, robust, free.report()]
    values += [judge_unseen(robust, drawn), drawn, loop, find_front(loop), FrontProblem(aims)]
    values += [
        seqopt.solve(among_orders(free.states, "tied")),
        *engines(network),
        *engines(posed.engine.network),
    ]
    values += [compare(posed.engine, posed.criterion), travel(problem25, 20.0)]
    values += assess_steps(network, plan.steps[:1], seqopt.DRY)
    values += [seqopt.DRY, seqopt.CRITERIA, seqopt.formulations(), seqopt.Limit("F_largest", 300.0)]
    values += [ArchForm(span=2.0, rise=0.8), DomeShape(courses=4, around=12)]
    values += [seqopt.StepCost("own", ("F_largest",), max)]
    values += [network, seqopt.Sphere(center=(0.0, 0.0, 0.0), radius=1.0)]
    values += [seqopt.Site.after(free.steps, 3), seqopt.Prop(node=3)]
    values += [seqopt.GivenSequence(problem25.engine, seqopt.sequential(network))]
    for each in (plan, free, robust):
        each.responses()
        each.table()
    return values


def within(values):
    """Yield every value of ours in others, however deep."""
    seen, stack = set(), list(values)
    while stack:
        thing = stack.pop()
        if id(thing) in seen:
            continue
        seen.add(id(thing))
        if isinstance(thing, dict):
            stack += [*thing.keys(), *thing.values()]
        elif isinstance(thing, list | tuple | set | frozenset):
            stack += thing
        elif type(thing).__module__.startswith(OURS):
            yield thing
            stack += [v for k, v in getattr(thing, "__dict__", {}).items() if k[0] != "_"]


def too_long(values):
    """Return what is long, holds arrays or tables, or says where in memory it is, by class."""
    out = {}
    for thing in within(values):
        text = repr(thing)
        if len(text) > MOST or text.count("\n") > 3 or re.search(r"array\(|dtype=| at 0x", text):
            out[type(thing).__name__] = text
    return out


def test_everything_a_user_meets_is_short_at_the_prompt(met):
    kinds = {type(thing).__name__ for thing in within(met)}
    assert len(kinds) > 60  # or too little was looked at
    assert too_long(met) == {}


def test_what_is_long_is_seen():
    @dataclass(frozen=True)
    class Long:
        numbers: tuple[int, ...] = tuple(range(500))

    Long.__module__ = "seqopt.anything"
    assert set(too_long([{"a": [Long()]}])) == {"Long"}
