"""The printed sequences and the printed plan."""

from __future__ import annotations

import pandas as pd
import pytest

from experiments.study.parts.ranks import rank_choice
from seqopt.graph.decisions import pose_decisions
from seqopt.sequence.methods import METHODS
from seqopt.study.published import CLOSEST, printed_steps, published_choice

GRIPS = [f"rob{i}_node" for i in (1, 2, 3)]


def test_the_published_plan_under_the_printed_equations(problem25):
    """Equations (2) and (3): first in at least 10 of 22, among three in at least 15."""
    ranks = rank_choice(problem25, published_choice(problem25))["rank_in_window"]
    assert (ranks == 1).sum() >= 10
    assert (ranks <= 3).sum() >= 15


def test_the_published_plan_under_a_variant(engine25, loop25):
    """Tension and forces alone, the crown brick counted before the crown: 14 and 20 of 22."""
    problem = pose_decisions(engine25, loop25, CLOSEST)
    ranks = rank_choice(problem, published_choice(problem))["rank_in_window"]
    assert (ranks == 1).sum() >= 14
    assert (ranks <= 3).sum() >= 20


@pytest.mark.parametrize("method", METHODS)
def test_the_published_sequences(engine25, method):
    """Tables A.1 and A.2: type, brick count and grips of all 49 steps."""
    steps = METHODS[method](engine25.network)
    table = printed_steps(method)
    assert [s.kind.value for s in steps] == table["type"].tolist()
    assert [s.bricks for s in steps] == table["bricks"].tolist()
    wanted = [tuple(None if pd.isna(n) else int(n) for n in row) for row in table[GRIPS].to_numpy()]
    assert [s.grips for s in steps] == wanted
