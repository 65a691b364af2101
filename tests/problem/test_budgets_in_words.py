"""Budgets in words: one grammar, of which candidates and states know different words."""

from __future__ import annotations

import pytest

from seqopt.errors import ProblemError
from seqopt.problem.problem import parse_budgets


@pytest.mark.parametrize(
    ("text", "of_states", "read"),
    [
        ("travel=0.8", False, ("travel", "", 0.0, 0.8, True)),
        ("travel=3.5m", False, ("travel", "", 0.0, 3.5, False)),
        ("steps_over:T_max=80:0.5x", False, ("steps_over", "T_max", 80.0, 0.5, True)),
        ("robot_use:a:b=80:3", False, ("robot_use", "F_a:b", 80.0, 3.0, False)),
        ("makespan=600s", True, ("makespan", "", 0.0, 600.0, False)),
        ("sum(F_[a:b])=9", True, ("sum(F_[a:b])", "", 0.0, 9.0, False)),
    ],
)
def test_words_of_budgets(text, of_states, read):
    (found,) = parse_budgets(text, of_states=of_states)
    assert (found.name, found.response, found.level, found.bound, found.share) == read


@pytest.mark.parametrize(
    ("text", "of_states", "said"),
    [
        ("steps=40", False, "give travel=0.8, .* or with an aim travel=3.5m"),
        ("travle=3m", False, "did you mean travel"),
        ("travel=0.8", True, "of states does not exist"),
        ("steps_over:T_max=80:3", True, "of states does not exist"),
        ("regrips=few", True, "'few' is not a number from 0"),
        (5, True, "as words"),
    ],
)
def test_what_is_no_budget_is_refused(text, of_states, said):
    with pytest.raises(ProblemError, match=said):
        parse_budgets([text], of_states=of_states)
