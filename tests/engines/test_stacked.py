"""Scenarios that are solved together say what each engine says alone."""

from dataclasses import replace

import numpy as np
import pytest

import seqopt
from seqopt.engines.interface import Want
from seqopt.engines.rigid._stacked import StackedEngines
from seqopt.responses._grip_sets import Block, GripSets, Resources, ScenarioSets, solve_sets

NAMES = ("T_max", "M_sup", "D_max")


def engines(words: str, count: int = 4):
    scenes = seqopt.scenarios(seqopt.load_scene(words), count=count, seed=3).scenes
    return [seqopt.make_engine("compliance", each) for each in scenes]


def grip_sets(engine, bricks: int, grips: int, count: int = 40):
    nodes, index = engine.network.index_of_grip
    nodes = nodes[index < 2 * bricks]
    rng = np.random.default_rng(0)
    return np.array([rng.choice(nodes, grips, replace=False) for _ in range(count)])


@pytest.mark.parametrize(
    ("words", "bricks", "grips"),
    [
        ("arch25", 9, 3),
        ("arch25", 25, 2),
        ("chain:bricks=13", 13, 1),
        ("wall:columns=3,courses=3", 7, 2),
    ],
)
@pytest.mark.parametrize("screen", [True, False])
def test_scenarios_together_are_as_each_alone(words, bricks, grips, screen):
    made = engines(words)
    block = Block(bricks, grip_sets(made[0], bricks, grips), NAMES, screen=screen)
    found = ScenarioSets(made).solve((0, 2, 3), block)
    assert [*found] == [0, 2, 3]
    for k, rows in found.items():
        alone = solve_sets(made[k], block)
        scale = np.abs(alone).max(axis=0)
        assert (np.abs(rows - alone) <= (2e-6 if screen else 2e-9) * scale).all()
    others = solve_sets(made[1], block)  # another scenario is told apart
    assert (np.abs(found[0] - others) > 1e-4 * np.abs(others).max(axis=0)).any()


def test_what_needs_more_digits_is_corrected_by_its_own_engine():
    made = engines("chain:bricks=60", 2)
    nodes, _ = made[0].network.index_of_grip
    stacked, grips = StackedEngines(made), np.sort(nodes)[[[2, 60], [100, 103], [108, 109]]]
    found = [*stacked.extremes((0, 1), 55, grips, Want.RESPONSES)]
    for engine, own in zip(made, found, strict=True):
        assert engine._refinement is not None  # its operator has too few digits for one of them
        for got, right in zip(own, engine._extremes(55, grips, Want.RESPONSES), strict=True):
            np.testing.assert_allclose(got, right, rtol=1e-7)


def test_what_does_not_fit_is_left_to_each_engine():
    made, scene = engines("arch25"), seqopt.load_scene("arch25")
    soft = scene.with_robots(*(replace(robot, stiffness=1e6) for robot in scene.robots))
    block = Block(5, grip_sets(made[0], 5, 2, 3), NAMES)
    others = [seqopt.make_engine("compliance", soft)] * 2
    assert ScenarioSets(others).solve((0, 1), block) == {}
    assert ScenarioSets(made, Resources(workers=2)).solve((0, 1), block) == {}
    assert ScenarioSets(made).solve((0, 1), Block(5, np.zeros((1, 0), int), NAMES)) == {}
    frames = [seqopt.make_engine("frame", each.network) for each in made]
    assert ScenarioSets(frames).solve((0, 1), block) == {}


def test_a_filled_cache_answers_without_another_solve():
    made = engines("arch25")
    sets = [GripSets(each, NAMES) for each in made]
    held = np.array([[0, 3, 7], [2, 5, 9], [0, 0, 4]])
    ScenarioSets(made).fill(range(4), sets, 6, held)
    assert [each.solved for each in sets] == [3] * 4
    for own, engine in zip(sets, made, strict=True):
        fresh = GripSets(engine, NAMES).answers(6, held)
        for got, right in zip(own.answers(6, held), fresh, strict=True):
            np.testing.assert_allclose(got, right, rtol=1e-8, atol=1e-12)
    assert [each.solved for each in sets] == [3] * 4


def test_sets_without_grips_or_responses_fill_nothing():
    made = engines("arch25")
    sets, held = [GripSets(each, ()) for each in made], np.array([[0, 0], [0, 3]])
    for _ in range(2):
        ScenarioSets(made).fill(range(4), sets, 6, held)
        for own in sets:
            assert own.answers(6, held)[0].shape == (2, 0)
