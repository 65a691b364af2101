"""The search that solves only the models it meets, against the one that is given all costs."""

from __future__ import annotations

from itertools import cycle

import pytest

from seqopt.engines.interface import Want
from seqopt.errors import SolverError, TimeUpError
from seqopt.graph._decision_search import walk_windows
from seqopt.graph.decisions import pose_decisions
from seqopt.graph.formulation import Watch
from seqopt.plan.solve import solve
from seqopt.problem.requirements import Limit
from seqopt.responses._choices import window_models
from seqopt.sequence.methods import SCHEDULES, three_robot_loop
from seqopt.study.published import CRITERIA, EQUATIONS


class Ticking(Watch):
    """A second goes by whenever it is looked at."""

    ticks = 0

    @property
    def seconds(self):
        self.ticks += 1
        return float(self.ticks)


class Counting:
    """An engine that counts the grip sets it is asked for."""

    def __init__(self, engine):
        self.engine, self.sets = engine, 0

    @property
    def network(self):
        return self.engine.network

    def solve(self, bricks, grips, want=Want.RESPONSES):
        self.sets += len(grips)
        return self.engine.solve(bricks, grips, want)


FIRST, *OTHERS = CRITERIA


@pytest.mark.parametrize(
    ("criterion", "method"),
    [
        (FIRST, "three-robot"),
        *(pytest.param(*each, marks=pytest.mark.slow) for each in zip(OTHERS, cycle(SCHEDULES))),
    ],
)
def test_it_chooses_as_the_cascade_does(engine25, method, criterion):
    schedule = SCHEDULES[method](engine25.network)
    counting = Counting(engine25)
    asked = pose_decisions(counting, schedule, CRITERIA[criterion])
    counting.sets = 0  # some criteria ask for the scene's methods when they are posed
    found = solve(asked, "cascade", proof=False)
    problem = pose_decisions(engine25, schedule, CRITERIA[criterion])
    for name, options in (("rank_search", {"horizon": 1}), ("cascade", {})):
        plan = solve(problem, name, **options)
        assert found.nodes == plan.nodes
        assert found.steps == plan.steps
    fewest = window_models(schedule, found.choice)
    for name, options in (("rank_search", {}), ("rank_search", {"horizon": 1})):
        assert solve(problem, name, proof=False, **options).nodes == found.nodes
    assert fewest == found.models
    assert fewest <= counting.sets <= fewest + len(schedule.moves)
    assert found.models <= problem.evaluation.models


@pytest.mark.parametrize(("response", "bound"), [("M_sup", 12)])
def test_under_a_limit_that_binds_it_chooses_as_the_cascade_does(engine25, response, bound):
    schedule, limits = three_robot_loop(engine25.network), [Limit(response, bound)]
    problem = pose_decisions(engine25, schedule, EQUATIONS, limits)
    found = walk_windows(problem, Watch())
    assert tuple(found.choice) == solve(problem, "cascade").choice
    assert (
        found.choice != walk_windows(pose_decisions(engine25, schedule, EQUATIONS), Watch()).choice
    )


def test_a_time_limit_ends_it_and_says_what_was_chosen(engine25):
    """An hour is enough; of no time every moment is the last."""
    problem = pose_decisions(engine25, three_robot_loop(engine25.network), EQUATIONS)
    plan = solve(problem, "cascade", proof=False, time_limit=3600.0)
    assert plan.nodes == solve(problem, "cascade", proof=False).nodes
    with pytest.raises(TimeUpError, match=r"^.* s: no move was chosen yet; give more"):
        solve(problem, "cascade", proof=False, time_limit=0.0)
    with pytest.raises(SolverError, match=r"[1-9] of 22 moves were chosen, at nodes 4"):
        walk_windows(problem, Ticking(time_limit=8.0))
