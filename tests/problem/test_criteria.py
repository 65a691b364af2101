"""What criteria make of responses, by hand: ranks, weights, scales, limits."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.errors import ProblemError
from seqopt.problem.criteria import (
    OVER_METHODS,
    WORST_OVER_METHODS,
    RankSum,
    WeightedSum,
    _mean_ranks,
    equal,
)
from seqopt.problem.criteria import WorstRatio as Worst
from seqopt.problem.requirements import NEVER, ROUNDED, Units

NAN = np.nan


@dataclass
class Facts:
    """What a scene of two robots might say of itself."""

    robots: tuple[str, ...] = ("a", "b")
    crown: float = 5
    units: Units = field(default_factory=lambda: Units(2.0, 3.0, 4.0))
    reference: dict[str, float] = field(
        default_factory=lambda: {"F_largest": 7.0, "M_sup": 0.0, "T_max": 5.0, "D_max": 1e-3}
    )
    basis: str = ""


RESPONSES = {
    "T_max": np.array([30.0, 10.0, 20.0]),
    "M_sup": np.array([1.0, 2.0, 3.0]),
    "F_a": np.array([NAN, NAN, NAN]),
    "D_max": np.array([2e-3, NAN, 1e-3]),
}
EXACT = (("T", 10.0), ("M", 1.0), ("F", 1.0), ("D", 1e-3))


def ranked(before, after=(("M_sup", 1.0),), **options):
    return RankSum("own", before, after, **({"crown": 4, "resolution": EXACT} | options))


def test_ranks_are_averaged_with_their_weights():
    own = ranked((("T_max", 3.0), ("M_sup", 1.0)))
    assert own.costs(RESPONSES, 3, 3).tolist() == [2.5, 1.25, 2.25]
    third = ranked((("T_max", 3.0), ("M_sup", 1.0), ("F_a", 4.0)))
    assert third.costs(RESPONSES, 3, 3).tolist() == [18 / 8, 13 / 8, 17 / 8]  # all the same to it


def test_the_crown_parts_before_from_after():
    own = ranked((("T_max", 1.0),))
    assert own.costs(RESPONSES, 3, 3).tolist() == [3, 1, 2]
    assert own.costs(RESPONSES, 4, 3).tolist() == own.costs(RESPONSES, 5, 3).tolist() == [1, 2, 3]
    assert [own.wanted(bricks) for bricks in (3, 4)] == [("T_max",), ("M_sup",)]


def test_what_ranks_take_from_a_scene():
    open_one = RankSum("own", (("F_each", 2.0), ("T_max", 1.0)), equal("M_sup"), delay=2)
    posed = open_one.for_scene(Facts())
    assert posed.before == (("F_a", 2.0), ("F_b", 2.0), ("T_max", 1.0))
    assert (posed.crown, posed.delay) == (7, 0)
    assert dict(posed.resolution) == {
        name: share * Facts().units.of(name) for name, share in ROUNDED
    }
    assert posed.settings["crown"] == 7
    assert posed.settings["resolution"] == dict(posed.resolution)
    assert posed.for_scene(Facts(crown=99)) == posed
    given = replace(open_one, crown=3, resolution=EXACT).for_scene(Facts())
    assert (given.crown, given.resolution) == (3, EXACT)
    same = replace(open_one, after=open_one.before, crown=3).for_scene(Facts())
    assert same.crown == NEVER
    assert same.settings["crown"] is None
    assert open_one.settings["crown"] is None
    assert open_one.settings["resolution"] == {}
    prompt = RankSum("own", equal("T_max"), equal("M_sup")).for_scene(Facts())
    assert prompt.crown == 5


def test_a_weighted_sum_divides_by_its_scales():
    own = WeightedSum("own", (("T_max", 2.0, 4.0), ("M_sup", 3.0, 0.5), ("F_a", 9.0, 1.0)))
    assert own.costs(RESPONSES, 1, 3).tolist() == [21, 17, 28]
    assert own.wanted(1) == ("T_max", "M_sup", "F_a")
    weights = {"T_max": 2.0, "M_sup": 3.0, "F_a": 9.0}
    assert own.settings == {"scales": {"T_max": 4.0, "M_sup": 0.5, "F_a": 1.0}, "weights": weights}
    partly = replace(own, terms=(("D_max", 1.0, 1e-3),)).costs(RESPONSES, 1, 3)
    assert partly == pytest.approx([2, NAN, 1], nan_ok=True)


def test_the_worst_ratio_is_the_largest_over_the_limits():
    own = Worst("own", (("T_max", 20.0), ("M_sup", 2.0), ("F_a", 1.0)))
    assert own.costs(RESPONSES, 1, 3).tolist() == [1.5, 1.0, 1.5]
    pairs = {"T_max": np.array([[1.0, 8.0], [3.0, 2.0]]), "M_sup": np.array([[2.0, 2.0], [1.0, 5]])}
    own = replace(own, limits=own.limits[:2])
    assert own.costs(pairs, 1, 2).tolist() == [[1.0, 1.0], [0.5, 2.5]]
    assert own.wanted(1) == ("T_max", "M_sup")
    assert own.settings == {"scales": {"T_max": 20.0, "M_sup": 2.0}}


def test_scales_are_given_or_the_scenes():
    own = WeightedSum("own", (("F_each", 2.0, 8.0), ("M_sup", 1.0, None), ("T_max", 1.0, None)))
    assert own.for_scene(Facts()).terms == (
        *(("F_a", 2.0, 8.0), ("F_b", 2.0, 8.0)),
        ("M_sup", 1.0, 1.0),  # what every method keeps at zero
        ("T_max", 1.0, 5.0),
    )
    worst = Worst("own", (("F_each", 8.0), ("M_sup", None), ("T_max", 0.1)))
    limits = (("F_a", 8.0), ("F_b", 8.0), ("M_sup", 1.0), ("T_max", 0.1))
    assert worst.for_scene(Facts()).limits == limits
    with pytest.raises(ProblemError, match=r"T_max has the weight, scale or rounding 0\.0"):
        Worst("own", (("T_max", 0.0),)).for_scene(Facts())  # not the scene's either
    with pytest.raises(ProblemError, match="F_move has no scale"):
        Worst("own", (("F_move", None),)).for_scene(Facts())
    assert [weight for _, weight, _ in OVER_METHODS.terms] == [1.0] * 4
    names = [name for name, _ in WORST_OVER_METHODS.limits]
    assert names == [name for name, _, _ in OVER_METHODS.terms]
    assert sorted(names) == sorted(Facts().reference)


@given(values=st.lists(st.integers(-5, 5), min_size=1, max_size=30))
def test_ranks_are_those_of_pandas(values):
    found = _mean_ranks(np.array(values, dtype=float))
    assert found.tolist() == pd.Series(values).rank().tolist()
    assert found.sum() == pytest.approx(len(values) * (len(values) + 1) / 2)
