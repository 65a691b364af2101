"""The judge counts ranks by six digits where these round for certain, by all where not."""

import numpy as np
import pytest

from experiments.harness.scenes import scene_named
from seqopt import CRITERIA, build_network, make_engine, three_robot_loop
from seqopt.graph.states import build_states
from seqopt.judge import _states
from seqopt.responses._grip_sets import Block, solve_sets


@pytest.fixture(scope="module")
def asked():
    """The loop of a long arch by ranks, and grip sets of it that are ill conditioned."""
    engine = make_engine("compliance", build_network(scene_named("chain73")))
    problem = build_states(
        engine, three_robot_loop(engine.network), CRITERIA["equations-2-3"], "sum"
    )
    draws, scene = np.random.default_rng(7), engine.network.scene
    nodes = np.array([node for brick in scene.placed[:60] for node in brick.nodes])
    near = draws.integers(80, 116, 400)[:, None] + np.array([0, 1, 3])  # grips close to each other
    return problem, 60, nodes[near]


def rounded(problem, rows):
    names = [name for name in problem.named if name != "F_largest"]
    units = problem.criterion.settings["resolution"]
    own = [units[name[0]] for name in names] + [units["F"]] * (rows.shape[1] - len(names))
    return np.round(rows / np.array(own))


def test_six_digits_err_by_no_more_than_they_say(asked):
    problem, bricks, grips = asked
    block = _states._block(problem, bricks, grips)
    exact = solve_sets(problem.engine, block)
    screened = Block(bricks, grips, block.names, screen=True, errors=True)
    rows, errors = np.hsplit(solve_sets(problem.engine, screened), 2)
    assert rows.shape == exact.shape == errors.shape
    assert (np.abs(rows - exact) <= errors).all()
    assert (errors > 0).all()


def test_ranks_round_as_all_digits_do(asked, monkeypatch):
    problem, bricks, grips = asked
    exact = _states._solve(problem, bricks, grips)
    again = list[int]()

    def counted(problem, bricks, grips):
        again.append(len(grips))
        return solve_sets(problem.engine, _states._block(problem, bricks, grips))

    monkeypatch.setattr(_states, "_solve", counted)
    found = _states._solve_to_round(problem, bricks, grips)
    assert 0 < again[0] < len(grips)  # some are close to where rounding changes, most are not
    np.testing.assert_array_equal(rounded(problem, found), rounded(problem, exact))


def test_what_is_wrong_in_the_last_digits_is_found_where_it_decides(asked, monkeypatch):
    """Negative control: an engine off by as much as six digits may be, always just beyond half."""
    problem, bricks, grips = asked
    exact = _states._solve(problem, bricks, grips)
    units = problem.criterion.settings["resolution"]
    unit = np.array([units[n[0]] for n in _states._block(problem, bricks, grips).names])
    off = exact.copy()
    size = off[:, : len(unit)] / unit
    off[:, : len(unit)] = unit * np.where(size % 1 < 0.5, 0.5 + 1e-9, 0.5 - 1e-9) + unit * (
        size // 1
    )
    errors = np.abs(off - exact)
    solved = iter([np.hstack([off, errors * (1 + 1e-6) + 1e-8 * unit.min()]), exact])
    monkeypatch.setattr(_states, "solve_sets", lambda *_: next(solved))
    found = _states._solve_to_round(problem, bricks, grips)
    np.testing.assert_array_equal(rounded(problem, found), rounded(problem, exact))
