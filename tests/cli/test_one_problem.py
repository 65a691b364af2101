"""Words of the command line and arguments of Python pose the same problem, in one place."""

from __future__ import annotations

import pytest

import seqopt
from seqopt._cli.signatures import Call
from seqopt.workflow import optimize, pose_build

FREE, SCENE = {"schedule": "free"}, "chain:bricks=6"
QUESTIONS = [
    {},
    {"limits": ["payload", "F_largest=300"], "budgets": ["travel=0.9"]},
    {"criterion": "T_max,M_sup=2", "robots": "rob1,rob2", "candidates": "near:12"},
    FREE,
    {**FREE, "aim": "minmax,steps", "rules": ["newest=free"], "budgets": ["regrips=3"]},
    {**FREE, "order": "search", "aim": "sum"},
]


def posed(words):
    """The problem that words of the command line pose."""
    return pose_build(Call(optimize, {"scene": SCENE, **words}).values())


@pytest.mark.parametrize("words", QUESTIONS, ids=str)
def test_both_pose_the_same_problem(words):
    asked = posed(words)
    values = {**words, "robots": words["robots"].split(",")} if "robots" in words else words
    found = seqopt.optimize(SCENE, **values).problem
    assert repr(asked) == repr(found)
    for name in ("moves", "criterion", "goals", "limits", "budgets", "stands", "over", "orders"):
        assert getattr(asked, name) == getattr(found, name), name


def test_another_question_is_another_problem():
    asked = [posed(each) for each in (FREE, {})]
    assert asked[0].criterion != asked[1].criterion
    assert asked[0].goals != asked[1].goals
