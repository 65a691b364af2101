"""Amounts; what criteria make of responses."""

import pickle
from dataclasses import dataclass, field, replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

import seqopt
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.plan.solve import graph_of
from seqopt.problem import Amount, Filter
from seqopt.problem.amounts import BUILT_IN, find_amount
from seqopt.problem.criteria import (
    OVER_METHODS,
    ROUNDED,
    WORST_OVER_METHODS,
    RankSum,
    WeightedSum,
    _mean_ranks,
    equal,
)
from seqopt.problem.criteria import WorstRatio as Worst
from seqopt.problem.problem import parse_budgets
from seqopt.problem.requirements import Limit
from seqopt.responses.scales import NEVER, Units
from seqopt.sequence.rules import FreeRules
from tests.brute_force import ONES
from tests.builders import install, small_arch
from tests.refusals import one_line

pytestmark = pytest.mark.usefixtures("alone")

PACKAGE = """
import numpy as np
from seqopt.plan.solve import graph_of
from seqopt.problem import Amount, Filter

BUSY = Amount("busy", lambda states: (states.nodes >= 0).sum(axis=1))
AWAY = Filter("away", lambda states: (states.nodes != 3).all(axis=1))
"""


def busy(states):
    return (states.nodes >= 0).sum(axis=1)


def posed(goals, limits=(), schedule=None, **words):
    engine = seqopt.make_engine("compliance", small_arch(5 if schedule else 4))
    moves = schedule(engine.network) if schedule else FreeRules(ending="held")
    return seqopt.pose(engine, moves, ONES, goals, limits, **words)


def held(plan):
    return sum(len(step.held) for step in plan.steps)


@pytest.mark.parametrize("schedule", [None, seqopt.three_robot_loop])
def test_a_registered_amount_is_an_aim_and_a_budget(schedule):
    seqopt.register(Amount("busy", busy, twin=lambda states: busy(states) * 1.0))
    plan = seqopt.solve(posed("busy,minmax", schedule=schedule))
    assert plan.objective["busy"] == held(plan)
    assert str(plan.status) == "optimal"
    assert plan.certificate.bounds[0] == held(plan)
    most = seqopt.solve(posed("minmax", schedule=schedule, budgets=f"busy={held(plan)}"))
    assert held(most) == held(plan)
    assert most.objective["minmax"] == pytest.approx(plan.objective["minmax"])
    with pytest.raises(InfeasibleError, match="busy is at least"):
        seqopt.solve(posed("minmax", schedule=schedule, budgets=f"busy={held(plan) - 1}"))


def test_without_a_twin_a_plan_is_claimed():
    own = Amount("busy", busy)
    plan = seqopt.solve(posed((own,)))
    assert str(plan.status) == "claimed optimal"
    assert plan.certificate.bounds == (-np.inf,)
    assert plan.summary()["bound_rests_on"] == {"busy": "claimed"}
    proven = seqopt.solve(posed((replace(own, twin=busy),)))
    assert (str(proven.status), proven.objective) == ("optimal", plan.objective)


def test_the_largest_of_moves_counts_where_it_is_a_peak():
    """The farthest that robots go in a step, of which the sum is their travel."""
    own = Amount("far", moves=lambda moves: moves.distances, is_peak=True, needs_stays=True)
    own = replace(own, twin=lambda moves: np.array([*moves.distances]))
    plan = seqopt.solve(posed((own, BUILT_IN["travel"]), schedule=seqopt.three_robot_loop))
    assert str(plan.status) == "optimal"
    assert 0 < plan.objective["far"] < plan.objective["travel"]


@pytest.mark.parametrize("schedule", [None, seqopt.three_robot_loop])
def test_a_registered_filter_is_a_limit(schedule):
    node = 5
    seqopt.register(
        Filter(
            "away",
            lambda states: (states.nodes != node).all(axis=1),
            twin=lambda states: (states.nodes == node).any(axis=1),
        )
    )
    free = seqopt.solve(posed("F_largest", schedule=schedule))
    kept = seqopt.solve(posed("F_largest", "away", schedule=schedule))
    assert any(node in step.held for step in free.steps)
    assert not any(node in step.held for step in kept.steps)
    assert kept.objective["F_largest"] >= free.objective["F_largest"]
    assert (kept.summary()["filters"], "filters" in free.summary()) == (["away"], False)
    assert str(kept.status) == "optimal"


def test_a_filter_that_leaves_nothing_is_named():
    none = Filter(
        "none",
        lambda states: np.full(len(states.nodes), states.bricks < 3),
        twin=lambda states: np.full(len(states.nodes), states.bricks > 2),
    )
    with pytest.raises(InfeasibleError, match=r"becomes possible with the filter none left out"):
        seqopt.solve(posed("minmax", [none]))


def test_an_expensive_filter_is_asked_of_what_passes_all_others():
    asked = []

    def passes(states):
        asked.append(states.responses["F_largest"].max(initial=0.0))
        return np.ones(len(states.nodes), dtype=bool)

    dear = Filter("dear", passes, ("F_largest",), expensive=True)
    limit = seqopt.Limit("F_largest", 60.0)
    seqopt.solve(posed("minmax", [dear, limit]), proof=False)
    assert 0 < max(asked) <= 60.0
    asked.clear()
    seqopt.solve(posed("minmax", [replace(dear, expensive=False), limit]), proof=False)
    assert max(asked) > 60.0


def test_a_package_adds_both_by_entry_points(tmp_path, monkeypatch):
    (tmp_path / "page_parts.py").write_text(PACKAGE, encoding="utf-8")
    install(tmp_path, "seqopt.parts", busy="page_parts:BUSY", away="page_parts:AWAY")
    with pytest.raises(ProblemError, match="aim 'busy' does not exist"):
        find_amount("busy")
    monkeypatch.syspath_prepend(tmp_path)
    plan = seqopt.solve(posed("busy", "away"))
    assert plan.objective["busy"] == held(plan)
    assert not any(3 in step.held for step in plan.steps)


def test_states_go_to_other_processes_once_filters_were_asked():
    graph = seqopt.solve(posed("minmax,steps", "F_largest=900")).graph
    level, start = graph.space.first + 1, graph.space.start()
    values, within = graph.values(level, start)
    again = pickle.loads(pickle.dumps(graph)).values(level, start)
    assert (again[0].tolist(), again[1].tolist()) == (values.tolist(), within.tolist())


WRONG = {
    "its function failed: ZeroDivisionError": lambda states: 1 / 0,
    r"returned shape \(\); give": lambda states: 1.0,
    "a value is -1; give numbers from zero": lambda states: -1.0 * (states.nodes[:, 0] > -2),
    "its function failed: ValueError: could not convert string": lambda s: ["a"] * len(s.nodes),
    "a value is nan": lambda states: np.full(len(states.nodes), np.nan),
}


@pytest.mark.parametrize("said", WRONG)
def test_a_function_that_is_wrong_is_one_line(said):
    with pytest.raises(ProblemError, match=f"amount own: .*{said}"):
        seqopt.solve(posed((Amount("own", WRONG[said]),)))
    if "value" not in said and "string" not in said:
        with pytest.raises(ProblemError, match=f"filter own: .*{said}"):
            seqopt.solve(posed("minmax", [Filter("own", WRONG[said])]))


def test_responses_that_no_state_has_are_named():
    for part in (Amount("own", busy, responses=("F_move",)), Filter("own", busy, ("F_move",))):
        kind = type(part).__name__.lower()
        with pytest.raises(ProblemError, match=f"{kind} own: a state .* has no F_move; give C_max"):
            seqopt.solve(posed((part,)) if kind == "amount" else posed("minmax", [part]))


def test_parts_that_are_none_are_refused():
    with pytest.raises(ProblemError, match="amount own: twin is 3; give a function"):
        Amount("own", busy, twin=3)
    with pytest.raises(ProblemError, match="filter own: refuses is 3; give a function"):
        Filter("own", busy, refuses=3)
    for kind in (Amount, Filter):
        with pytest.raises(ProblemError, match=r"responses are 'T_max'; give names, as"):
            kind("own", busy, responses="T_max")


def test_what_is_neither_is_refused():
    with pytest.raises(ProblemError, match="give an Amount, a Filter or a Resource"):
        seqopt.register("busy")
    with pytest.raises(ProblemError, match=r"did you mean regrips\?"):
        find_amount("regrip")
    assert find_amount("steps") is BUILT_IN["steps"]


BUDGETS = {
    "travel=0.8": ("travel", 0.8, True),
    "travel=3.5m": ("travel", 3.5, False),
    "regrips=0.5x": ("regrips", 0.5, True),
    "steps_over:T_max=80:0.5x": ("steps_over:T_max=80", 0.5, True),
    "robot_use:a:b=80:3": ("steps_over:F_a:b=80", 3.0, False),
    "makespan=600s": ("makespan", 600.0, False),
    "sum(T_max)=9": ("sum(T_max)", 9.0, False),
}
NO_BUDGETS = {
    "bricks=40": "does not exist; give travel=3.5m, .* travel=0.8",
    "travle=3m": "did you mean travel",
    "travel=3s": "give it as travel=3m",
    "steps_over:T_max=80:3m": "name what is counted, a level and a number of steps",
    "regrips=few": "'few' is not a number from 0",
    5: "as words",
}


@pytest.mark.parametrize("text", BUDGETS)
def test_words_of_budgets(text):
    (found,) = parse_budgets(text)
    assert (found.amount.name, found.bound, found.share) == BUDGETS[text]
    assert parse_budgets(found) == (found,)


@pytest.mark.parametrize("text", NO_BUDGETS)
def test_what_is_no_budget_is_refused(text):
    with one_line(ProblemError, NO_BUDGETS[text]):
        parse_budgets([text])


# what criteria make of responses, by hand: ranks, weights, scales, limits
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


@given(
    value=st.floats(1e-3, 1e6),
    resolution=st.sampled_from([0.01, 0.1, 1.0, 7.0]),
    error=st.floats(-1.0, 1.0),
    share=st.sampled_from([1e-5, 1e-3]),
)
def test_what_is_not_close_is_rounded_alike_with_any_error_of_the_share(
    value, resolution, error, share
):
    ranks = RankSum("own", equal("T_max"), equal("T_max"), NEVER, 0, (("T", resolution),))
    found = {"T_max": np.array([value, (np.floor(value) + 0.5) * resolution, np.inf])}
    close = ranks.is_close(found, 3, share)
    moved = value * (1.0 + 0.999 * share * error)
    assert close[0] or np.round(value / resolution) == np.round(moved / resolution)
    assert close[1]  # a control: it lies where rounding turns
    assert not close[2]  # what is impossible has no rank


def test_ranks_by_six_digits_are_those_by_all_of_them():
    engine = seqopt.make_engine("compliance", small_arch(9))
    criterion = seqopt.CRITERIA["equations-2-3"]
    problem = graph_of(seqopt.pose(engine, seqopt.three_robot_loop(engine.network), criterion))
    passed = Filter("passed", lambda states: np.ones(len(states.nodes), dtype=bool))
    exact = replace(problem, filters=(passed,), answers={}, judged={})
    limited, sure = (replace(each, limits=(Limit("T_max", 40.0),)) for each in (problem, exact))
    assert problem.screened is not problem.sets
    assert exact.screened is exact.sets
    ranked = kept = 0
    for level in range(1, 1 + problem.space.levels):
        if problem.space.open_columns(level):
            states = problem.space.candidates(level).states
            own, all_digits = (each.candidates.among(level, states) for each in (problem, exact))
            assert own.tolist() == all_digits.tolist()
            within = limited.values(level, states, rough=True)[1]
            assert within.tolist() == sure.values(level, states)[1].tolist()
            ranked, kept = ranked + len(states), kept + int(within.sum())
    assert 0 < kept < ranked
    assert problem.six_digit_models > 0.5 * ranked
    assert problem.sets.solved < 0.2 * ranked
