"""A bound on all builds by counts of grips: below every build, and exact where one robot works."""

from __future__ import annotations

from dataclasses import replace

import pytest

import seqopt
from seqopt.errors import InfeasibleError
from seqopt.sequence.rules import FreeRules, with_robots
from seqopt.times._counts import least_by_counts
from tests.brute_force import ONES
from tests.builders import small_arch
from tests.times.builders import RULES, WORDS, engine_of, least_makespan

ALONE = FreeRules(least_grips=1)


@pytest.mark.parametrize("words", [("rob3:slower=2.5",), ("speed=0.01",)])
@pytest.mark.parametrize("rules", [RULES, FreeRules(ending="one-by-one"), FreeRules()])
def test_no_build_takes_less_than_counts_say(words, rules):
    engine = engine_of(3, 3, *words)
    least = least_makespan(engine, rules)
    assert 0.5 * least < least_by_counts(engine.network, rules) <= least * (1 + 1e-9)


def test_a_robot_that_does_all_alone_is_known_exactly():
    scene = with_robots(small_arch(1), 1).with_durations(WORDS)
    network = seqopt.build_network(scene)
    assert least_by_counts(network, ALONE) == pytest.approx(30 + 10 + 5)
    assert least_by_counts(network, replace(ALONE, ending="held")) == pytest.approx(30 + 10)


@pytest.mark.parametrize(
    ("share", "said"), [(0.9, r"^free.* at least .* s, and"), (1.1, "^claimed")]
)
def test_a_budget_below_what_counts_say_is_proven_to_be_too_small(share, said):
    engine = engine_of(3, 3)
    cap = share * least_by_counts(engine.network, RULES)
    assert cap < least_makespan(engine, RULES)
    problem = seqopt.pose(engine, RULES, ONES, "minmax", budgets=f"makespan={cap}s")
    with pytest.raises(InfeasibleError, match=said):
        seqopt.solve(problem)
