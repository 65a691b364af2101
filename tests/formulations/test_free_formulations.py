"""Conformance; a puzzle without bricks."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings

import seqopt
from formulations._search import ThresholdSearch
from formulations.on_graph import Choice, on_graph
from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph.formulation import FormulationKind, Watch, find_formulation, formulations
from seqopt.graph.graph import _on_paths, _Target, fewest_moves, path_values
from seqopt.graph.space import Explorer, Moves, Space
from seqopt.graph.states import build_states
from seqopt.instances.model import Instance, _Cap
from seqopt.problem.problem import Aim
from seqopt.scene.scene import with_robots
from seqopt.sequence.rules import FreeRules
from seqopt.stability.verdict import Verdict
from tests.brute_force import ONES, best_values
from tests.builders import from_both_sides, small_arch
from tests.random_graphs import graphs, simple_paths, values_of
from tests.strategies import free_builds

ALL = {name: found for name, found in formulations("goals").items() if name != "minimax"}
EXACT = [name for name, found in ALL.items() if found.kind is not FormulationKind.HEURISTIC]
AIMS = ("minmax", "minmax,steps", "sum", "steps,minmax", "regrips,sum(T_max)", "travel")
slow, long = pytest.mark.slow, (pytest.mark.slow, pytest.mark.long)
LIKE_OTHERS = ("labels", "lagrangian", "beam", "cascade", "rank_search")  # of free schedules
every = pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[slow] * (n in LIKE_OTHERS)) for n in ALL]
)
CASES = [
    *(((4, 2), aim) for aim in ("minmax,steps", "regrips,sum(T_max)")),
    *(pytest.param((4, 2), aim, marks=slow) for aim in ("sum", "travel", "steps,minmax")),
    *(pytest.param((4, 3), aim, marks=slow) for aim in AIMS[::2]),
    *(pytest.param((6, 3), aim, marks=long) for aim in AIMS[1::2]),
]


@cache
def small(bricks=4, robots=2):
    """The engine and the rules of a small arch."""
    scene = with_robots(small_arch(bricks), robots)
    return seqopt.make_engine("compliance", scene), FreeRules(least_grips=1)


@cache
def known(size, aim):
    return best_values(*small(*size), aim)


def posed(aim, size=(4, 2), **words):
    return build_states(*small(*size), ONES, aim, **words)


def check(name, problem, best):
    """An exact one finds what brute force does, a heuristic nothing better; both are judged."""
    if best is None:
        with pytest.raises(InfeasibleError, match="free schedule: "):
            seqopt.solve(problem, ALL[name])
        return
    plan = seqopt.solve(problem, ALL[name])
    found, proof = plan.selection, plan.certificate
    assert proof.values == pytest.approx(found.objective)
    assert proof.bounds[0] == pytest.approx(best[0])
    if name in EXACT:
        assert found.objective == pytest.approx(best, rel=1e-7)
        assert found.bound == pytest.approx(best, rel=1e-7)
        assert (plan.status, proof.gap <= 1e-9) == ("optimal", True)
    else:
        worse = np.array(found.objective) - best
        assert (np.abs(worse) < 1e-9).all() or worse[np.abs(worse) > 1e-9][0] > 0
        assert set(found.bound) == {-np.inf}
        assert plan.status == ("optimal" if proof.gap < 1e-6 else "feasible")


@pytest.mark.xdist_group("best values of free schedules")  # which are known once they are found
@every
@pytest.mark.parametrize(("size", "aim"), CASES)
def test_it_agrees_with_brute_force(name, aim, size):
    check(name, posed(aim, size), known(size, aim))


SYMMETRIC = with_robots(from_both_sides(2, "VL"), 2)  # its peaks are equal but for rounding


@slow
@given(build=free_builds(most_bricks=4, most_robots=3))
@example(build=(SYMMETRIC, FreeRules(least_grips=0, newest="free")))
@settings(max_examples=4)
def test_they_agree_with_brute_force_under_any_rules(build):
    engine, rules = seqopt.make_engine("compliance", build[0]), build[1]
    for aim in ("minmax,steps", "regrips,sum", "steps,minmax"):
        best = best_values(engine, rules, aim)
        for name in ALL:
            check(name, build_states(engine, rules, ONES, aim), best)


@pytest.mark.parametrize(
    "name", ["overlap_dp", "path_labels", "best_first", "overlap_lp", "overlap_mip"]
)
@given(graph=graphs())
def test_it_finds_the_best_path_of_any_graph(name, graph):
    graph = graph.only(_on_paths(graph))
    found = sorted(values_of(graph, moves) for moves in simple_paths(graph))
    if found:
        choice = ALL[name].solve.choose(graph, Watch(np.inf))
        assert path_values(graph, choice.path) == pytest.approx(found[0])
        assert choice.bounds == pytest.approx(found[0])


@every
def test_limits_that_leave_no_plan_are_said(name):
    check(name, posed("minmax", limits=[seqopt.Limit("F_largest", 1.0)]), None)


@every
def test_what_does_not_fit_gets_one_line(name):
    for option, value in {"speed": 2, **dict.fromkeys(ALL[name].options, 0)}.items():
        said = "option|(width|charge|most|horizon) is 0|max_memory|no plan was found yet; give more"
        said = "option speed=2: " if option == "speed" else said
        with pytest.raises((ProblemError, TimeUpError), match=said) as caught:
            seqopt.solve(posed("minmax"), name, options={option: value})
        assert "\n" not in str(caught.value)
    with pytest.raises(ProblemError, match="name bond, friction and tilt before all others"):
        seqopt.solve(posed("minmax,bond"), name)


@every
def test_an_interrupt_leaves_a_plan_or_is_passed_on(name):
    for after in (1, 4, 6):
        told = []

        def interrupt(stage, told=told, after=after):
            told.append(stage)
            if len(told) == after:
                raise KeyboardInterrupt

        try:
            plan = seqopt.solve(posed("minmax"), name, progress=interrupt, proof=False)
        except KeyboardInterrupt:
            continue
        assert after > 4
        assert (plan.selection.stopped == "interrupt") == (plan.status == "feasible")


@cache
def standing(name, aim):
    words = {"stands": "bond=3000"} if aim != "bond,steps" else {}
    return seqopt.solve(posed(aim, **words), name)


@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=[slow] * (n not in ("schedule_search", "overlap_dp"))) for n in ALL],
)
@pytest.mark.parametrize("aim", ["minmax,steps", pytest.param("bond,steps", marks=slow)])
@pytest.mark.xdist_group("what stands")  # of which the first is held against all others
def test_states_stand_where_they_must(name, aim):
    own, first = standing(name, aim), standing("schedule_search", aim)
    if aim != "bond,steps":
        assert set(own.verdicts("bond=3000")) == {Verdict.STANDS}
    if name in EXACT:
        assert own.selection.objective == pytest.approx(first.selection.objective)
    else:
        assert own.selection.objective >= first.selection.objective


@pytest.mark.parametrize(
    ("name", "aim"),
    [("overlap_lp", "sum"), ("overlap_mip", "sum"), ("path_labels", "minmax,steps")],
)
def test_where_time_is_over_a_bound_is_left(name, aim, monkeypatch):
    """Whatever is claimed of the first goals is no more than the least."""

    class Late(Watch):
        def __init__(self, *_):
            super().__init__(0.0)

    monkeypatch.setattr("formulations.on_graph.watched", lambda *_: lambda _: None)
    monkeypatch.setattr("seqopt.plan._answers.Watch", Late)
    plan, best = seqopt.solve(posed(aim), name), known((4, 2), aim)
    assert (plan.status, plan.selection.stopped) == ("feasible", "time")
    assert plan.selection.bound[0] <= best[0] * (1 + 1e-9)
    assert plan.selection.objective >= best or plan.selection.objective == pytest.approx(best)


def test_a_heuristic_that_promises_nothing_is_shown_with_its_gap():
    modest = on_graph(
        "modest", "fewest moves", lambda g, _: Choice(fewest_moves(g)), FormulationKind.HEURISTIC
    )
    problem, best = posed("sum"), known((4, 2), "sum")[0]
    plan = seqopt.solve(problem, modest)
    value = plan.certificate.values[0]
    assert value > best * (1 + 1e-6)
    assert plan.certificate.bounds[0] == pytest.approx(best)
    assert plan.certificate.gap == pytest.approx((value - best) / value)
    assert plan.status == "feasible"
    assert f"feasible within {plan.certificate.gap:.2g}" in plan.result
    assert seqopt.solve(problem, modest, proof=False).status == "unproven"


AIM = "minmax,steps"


def solved(**means):
    search = seqopt.Search(**means)
    return seqopt.optimize(small_arch(5), "free", ONES, aim=AIM, search=search)


def test_a_plan_does_not_depend_on_who_solves_it():
    first = solved()
    with ThreadPoolExecutor(2) as executor:
        again = solved(executor=executor)
    assert (again.steps, again.objective) == (first.steps, first.objective)
    assert again.certificate.bounds == first.certificate.bounds


# a puzzle without bricks, as a graph and a space: formulations solve it, the judge proves it
JUGS, WANTED = (5, 3), 4  # liters that jugs hold, and liters to be measured
EVERY = formulations("goals", "instance")
SUMS = [name for name, f in EVERY.items() if f.aim is not Aim.PEAK]
PEAKS = [*EVERY]  # whatever their own aim is


def poured(full):
    """The states that follow from one: a jug is filled, emptied, or poured into the other."""
    for a, b in ((0, 1), (1, 0)):
        for amount in (JUGS[a], 0):
            yield tuple(amount if k == a else full[k] for k in (0, 1))
        moved = min(full[a], JUGS[b] - full[b])
        yield tuple(full[k] + moved * (1 if k == b else -1) for k in (0, 1))


def puzzle(kind, cap=np.inf):
    """Measure four liters: least water moved, of which no move counts less than half a liter."""
    states = sorted(product(*(range(size + 1) for size in JUGS)))
    arcs = sorted({(s, t) for s in states for t in poured(s) if s != t and s[0] != WANTED})
    source, target = (np.array([states.index(arc[k]) for arc in arcs], np.int32) for k in (0, 1))
    water = [max(0.5, *np.abs(np.subtract(s, t))) for s, t in arcs]
    ends = np.array([s[0] == WANTED for s in states])
    amounts = np.column_stack([water, np.ones(len(arcs))])
    caps = (_Cap("moves", 1, cap),) if np.isfinite(cap) else ()
    rows = np.column_stack([np.zeros(len(states), int), states])
    names, goal = ("water", "moves"), _Target("water", kind, (0,))
    return Instance("jugs", source, target, ends, names, amounts, (goal,), caps, rows)


def best(kind, cap=10):
    """The least water of any sequence of at most so many moves, by trying all."""
    one, join = puzzle(kind), {"sum": np.add, "peak": np.maximum}[kind]
    found, worth = np.inf, {0: 0.0}
    for _ in range(cap):
        after: dict[int, float] = {}
        for s, t, water in zip(
            one.source.tolist(), one.target.tolist(), one.amounts[:, 0], strict=True
        ):
            if s in worth:
                after[t] = min(after.get(t, np.inf), float(join(worth[s], water)))
        found = min([found, *(v for t, v in after.items() if one.ends[t])])
        worth = after
    return found


@pytest.mark.parametrize(
    ("name", "kind"), [*((n, "sum") for n in SUMS), *((n, "peak") for n in PEAKS)]
)
def test_every_formulation_solves_it_and_the_judge_proves_it(name, kind):
    plan = seqopt.solve(puzzle(kind), name)
    value = plan.objective["water"]
    assert value >= best(kind) - 1e-9
    if EVERY[name].kind.value == "exact":
        assert value == pytest.approx(best(kind))
        assert plan.certificate.gap <= 1e-9
    states = puzzle(kind).states[list(plan.nodes)]
    assert states[-1, 1] == WANTED
    assert plan.summary()["nodes_of_path"] == [*plan.nodes]


class Jugs(Space):
    """The same puzzle, explored as far as needed: the most water in both jugs, then moves."""

    first = levels = 1
    peaks = (True, False)

    def start(self):
        return "jugs", np.zeros((1, 2), dtype=int)

    def codes(self, part, states):
        return states @ [JUGS[1] + 1, 1]

    def within(self, part, states):
        moves = [(k, t) for k, s in enumerate(states.tolist()) for t in {*poured(s)} - {tuple(s)}]
        source, after = zip(*moves, strict=True)
        return Moves(np.array(source), np.array(after), np.zeros((len(moves), 0)))

    def onward(self, part, states):
        yield from ()

    def values(self, part, states, *, rough, most):
        return np.column_stack([states.sum(axis=1), 0 * states[:, 0]]) * 1.0, states[:, 0] >= 0

    def amounts(self, values, taken):
        return values + np.array([0.0, 1.0])

    def ended(self, part, states):
        return states[:, 0] == WANTED


def least_of_space(cap=12):
    """The least (most water, moves) of all sequences of at most so many moves, by trying all."""
    found, reached = [], {((0, 0), 0)}
    for moves in range(1, cap + 1):
        reached = {(t, max(most, sum(t))) for s, most in reached for t in poured(s)}
        found += [(most, moves) for s, most in reached if s[0] == WANTED]
    return min(found)


def whole(goals):
    """The whole space as an instance with goals, and the number of every state."""
    explorer = Explorer(Jugs())
    assert explorer.rise()
    graph, ((_, _, states),) = explorer.graph()
    rows = np.column_stack([np.zeros(len(states), int), states])
    arcs, names = (graph.source, graph.target, graph.ends), ("water", "moves")
    one = Instance("jugs", *arcs, names, graph.amounts, goals, states=rows)
    return one, {tuple(state): number for number, state in enumerate(states.tolist())}


WATER, MOVES = _Target("water", "peak", (0,)), _Target("moves", "sum", (1,))


def by_thresholds(numbers):
    """A formulation that searches the space itself, by thresholds, as schedules are searched."""
    found = ThresholdSearch(Jugs()).best()
    path = tuple((numbers[tuple(state)],) for _, *state in found.states)
    return replace(found, states=path, visited=())


def test_the_search_by_thresholds_solves_it_and_is_judged():
    one, numbers = whole((WATER, MOVES))
    answer = by_thresholds(numbers)
    assert answer.objective == answer.bound == least_of_space()
    known = find_formulation("schedule_search")
    plan = seqopt.solve(one, replace(known, solve=lambda *_, **__: answer))
    assert (plan.status, plan.certificate.gap) == ("optimal", 0.0)
    assert plan.objective == dict(zip(("water", "moves"), least_of_space(), strict=True))
    for lie in (
        replace(answer, objective=tuple(0.9 * v for v in answer.objective), bound=(0.0, 0.0)),
        replace(answer, states=answer.states[:-1]),
    ):
        with pytest.raises(SolverError):
            seqopt.solve(one, replace(known, solve=lambda *_, lie=lie, **__: lie))


def test_the_search_leaves_out_what_takes_more_than_the_best():
    """With less water than both jugs hold, states above the best value are not visited."""
    search = ThresholdSearch(Jugs())
    best_value = search.best().objective[0]
    visited = np.concatenate(search.wide.visited())
    assert visited.sum(axis=1).max() <= best_value < sum(JUGS)
