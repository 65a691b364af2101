"""Work shared out to processes: what each gets, and in which order answers come."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seqopt.responses._choices import _PREPARED, _in_places, _Portion, _take_turns


class Stub:
    """A block of known work."""

    def __init__(self, work):
        self.work = work


def portions_of(works):
    return [_Portion((Stub(work),)) for work in works]


@given(works=st.lists(st.floats(0.0, 1e9), max_size=40), lanes=st.integers(1, 5))
def test_every_portion_is_taken_once_and_its_answer_comes_in_its_place(works, lanes):
    portions = portions_of(works)
    places, turns = _take_turns(portions, lanes)
    places, turns = [*places], [*turns]
    assert sorted(places) == [*range(len(works))]
    assert all(
        portions[place].blocks == turn.blocks for place, turn in zip(places, turns, strict=True)
    )
    lane_of = [lane for _, lane in sorted((p, t.lane) for p, t in zip(places, turns, strict=True))]
    assert lane_of == sorted(lane_of)  # each gets neighbors
    assert all(0 <= lane < lanes for lane in lane_of)
    for lane in range(lanes):
        mine = [place for place, turn in zip(places, turns, strict=True) if turn.lane == lane]
        assert mine == sorted(mine)
    assert [*_in_places(places, places)] == [*range(len(works))]


@pytest.mark.parametrize("lanes", [2, 3, 4])
def test_lanes_end_together_where_each_prepares_what_comes_before_it(lanes):
    _, turns = _take_turns(portions_of([1.0] * 2000), lanes)
    own = np.bincount([turn.lane for turn in turns]) / 2000
    takes = own + _PREPARED * np.cumsum(own)
    assert takes == pytest.approx(takes[0], rel=0.01)
    assert own[0] > own[-1] > 0


def test_an_answer_waits_for_those_before_it():
    asked = []

    def results():
        for place in (0, 2, 1, 3):
            asked.append(place)
            yield f"answer {place}"

    answers = _in_places((0, 2, 1, 3), results())
    assert [next(answers), asked] == ["answer 0", [0]]
    assert [next(answers), asked] == ["answer 1", [0, 2, 1]]
    assert [next(answers), asked] == ["answer 2", [0, 2, 1]]
    assert [*answers] == ["answer 3"]
