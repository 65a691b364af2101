"""Words of the command line and arguments of Python pose the same problem, in one place."""

from __future__ import annotations

import pytest

import seqopt
from seqopt._cli import posing
from seqopt._cli.commands.optimize import Optimize
from seqopt._cli.posing import pose_problem
from seqopt._cli.signatures import given

FREE, SCENE = {"schedule": "free"}, "chain:bricks=7"
QUESTIONS = [
    {},
    {"limits": ["payload", "F_largest=300"], "budgets": ["travel=0.9"]},
    {"criterion": "T_max,M_sup=2", "robots": "rob1,rob2", "candidates": "near:12"},
    {"formulation": "schedule_search"},
    {"stands": "epoxy"},
    FREE,
    {**FREE, "aim": "minmax,steps", "rules": ["newest=free"], "budgets": ["regrips=3"]},
    {**FREE, "order": "search", "aim": "sum"},
]


@pytest.mark.parametrize("words", QUESTIONS, ids=str)
def test_both_pose_the_same_problem(words):
    asked = pose_problem(given(Optimize, {"scene": SCENE, **words})).problem
    values = {**words, "robots": words["robots"].split(",")} if "robots" in words else words
    found = seqopt.optimize(SCENE, **values).problem
    assert repr(asked) == repr(found)
    for name in ("moves", "criterion", "goals", "limits", "budgets", "stands", "over", "orders"):
        assert getattr(asked, name) == getattr(found, name), name


def test_another_question_is_another_problem():
    asked = [pose_problem(given(Optimize, {"scene": SCENE, **each})) for each in (FREE, {})]
    assert asked[0].problem.criterion != asked[1].problem.criterion
    assert asked[0].problem.goals != asked[1].problem.goals


def test_the_command_line_leaves_posing_to_what_python_calls():
    """Which words ask for states, and what is usual then, is said once."""
    assert not {"pose", "Orders", "Filter", "find_formulation"} & {*vars(posing)}
