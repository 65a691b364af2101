"""A certificate says of each bound what it rests on, in Python and in the summary."""

from __future__ import annotations

import pytest

import seqopt
from seqopt._registry import ADDED
from seqopt.problem import Amount


def held(states):
    return (states.nodes >= 0).sum(axis=1)


@pytest.fixture
def registered(monkeypatch):
    monkeypatch.setitem(ADDED, (Amount, "held_alone"), Amount("held_alone", held))


def basis(plan):
    named = {n: str(b) for n, b in zip(plan.goals, plan.certificate.rests_on, strict=False)}
    assert plan.summary()["bound_rests_on"] == named
    return [*named.values()]


def test_states_are_rebuilt_and_costs_of_choices_are_given():
    scene = seqopt.load_scene("chain:bricks=7")
    assert basis(seqopt.optimize(scene, "free", aim="minmax,steps")) == ["rebuilt", "rebuilt"]
    loop = seqopt.optimize(scene)
    assert basis(loop) == ["given"]
    assert basis(seqopt.solve(seqopt.compile_instance(loop.problem))) == ["given"]


@pytest.mark.usefixtures("registered")
def test_what_has_no_twin_is_claimed():
    plan = seqopt.optimize("chain:bricks=7", "free", aim="minmax,held_alone")
    assert basis(plan) == ["rebuilt", "claimed"]


def test_without_a_proof_nothing_is_said():
    plan = seqopt.optimize("chain:bricks=7", "free", search=seqopt.Search(proof=False))
    assert plan.summary()["bound_rests_on"] == {}
