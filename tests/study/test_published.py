"""The published plan: what it holds, and how its choices rank."""

import pytest

from experiments.harness.ranks import rank_choice
from seqopt.plan.solve import solve
from seqopt.study import published_plan


def test_the_loop_with_the_published_nodes_is_the_published_plan(arch25, loop25):
    plan = published_plan(arch25)
    assert loop25.fill(loop25.chosen(plan)) == plan


@pytest.mark.slow
def test_the_window_rank_is_the_studys_search(problem25):
    """The choice of the cascade is first in its own window, move by move; the optimum is not."""
    cascade, exact = (solve(problem25, name).nodes for name in ("cascade", "overlap_dp"))
    assert (rank_choice(problem25, cascade)["rank_in_window"] == 1).all()
    assert (rank_choice(problem25, exact)["rank_in_window"] > 1).any()


def test_the_published_plan(arch25):
    steps = published_plan(arch25)
    assert len(steps) == 90
    assert steps[-1].bricks == 25
    assert all(len(s.held) >= 2 for s in steps[1:])  # criterion 1 of section 5: no twisting
    newest = [arch25.placed[s.bricks - 1].nodes for s in steps]
    assert all(set(s.held) & set(nodes) for s, nodes in zip(steps, newest, strict=True))
