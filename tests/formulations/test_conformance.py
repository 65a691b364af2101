"""Conformance; what exact formulations share."""

import signal
from dataclasses import replace
from functools import cache
from importlib.metadata import entry_points
from itertools import pairwise

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from experiments.harness.layers import LayeredCosts
from formulations import rank_search
from formulations.flow import OVERLAP_MIP
from formulations.on_graph import Choice, on_graph
from formulations.solvers import minimize_by_highs
from seqopt.errors import InfeasibleError, ProblemError, SolverError, TimeUpError
from seqopt.graph.formulation import (
    GROUP,
    End,
    Finding,
    FormulationKind,
    Watch,
    exhibits,
    find_formulation,
    formulations,
)
from seqopt.graph.graph import Graph
from seqopt.problem.problem import Aim
from seqopt.study import CRITERIA, EQUATIONS
from tests.builders import Clock, small_arch
from tests.layered import Budget, Costs, answer, of_layers
from tests.strategies import budgeted, problems

SHOWN = formulations("costs")  # what comparisons have
ALL = {
    name: found
    for name, found in (formulations() | exhibits()).items()
    if found.fits("instance") and not found.fits("time")
}
EXACT_SUMS = [
    n for n, f in SHOWN.items() if f.aim is Aim.SUM and f.kind is not FormulationKind.HEURISTIC
]
AIMED = [(n, aim) for n, f in ALL.items() for aim in ([f.aim] if f.aim else Aim)]
every = pytest.mark.parametrize("name", ALL)
every_aim = pytest.mark.parametrize(("name", "aim"), AIMED)
OURS = {  # others, as those of the pages, promise no gap
    *exhibits(),
    *(e.name for e in entry_points(group=GROUP) if e.value.startswith("formulations.")),
}
timely = pytest.mark.parametrize("name", [n for n in [*SHOWN, *exhibits()] if ALL[n].watched])
takers = pytest.mark.parametrize("name", [n for n, f in ALL.items() if f.takes_budgets])


@every_aim
@given(problem=problems())
def test_answers_are_certified_or_refused_as_infeasible(name, aim, problem):
    best = problem.best(aim)
    if not np.isfinite(best):
        with pytest.raises(InfeasibleError, match="move"):
            answer(problem, name, aim=aim)
        return
    costs = problem.sums if aim is Aim.SUM else problem.peaks
    assert costs.least(aim) == pytest.approx(best)
    found = answer(problem, name, aim=aim)
    proof = found.certificate
    assert found.objective == proof.objective == problem.worth(found.choice, aim)
    assert proof.objective >= best - 1e-9
    assert proof.bound == pytest.approx(best, abs=1e-9)
    if ALL[name].kind is not FormulationKind.HEURISTIC:
        assert proof.objective == pytest.approx(best, abs=1e-6)
        assert proof.gap <= 1e-6
    assert found.bound <= best + 1e-6


SETTINGS = [
    *(("cascade", {"charge": charge}) for charge in ("later", "earlier")),
    *(("beam", {"width": width}) for width in (1, 2, 3)),
    *(("rank_search", {"horizon": horizon}) for horizon in (1, 2, 3)),
]
CHOSEN = {  # by enumeration of what the texts of these formulations display
    6: ["20021", "00001", "22001", "00101", "00101", "20021", "00021", "02001"],
    10: ["00000", "20000", "03020", "03200", "03110", "00000", "00010", "00030"],
    11: ["02030", "00031", "03231", "03220", "03220", "02030", "03031", "03001"],
}


@pytest.mark.parametrize("seed", CHOSEN)
def test_heuristics_do_what_they_display(seed):
    """Also where the shared step, once the choice before is made, is ranked otherwise."""
    rng, pairs = np.random.default_rng(seed), [(1, 3), (3, 4), (4, 3), (3, 4), (4, 2)]
    single = tuple(rng.integers(0, 9, pair[1]) + 0.0 for pair in pairs)
    shared, own = ([rng.integers(0, 9, pair) + 0.0 for pair in pairs] for _ in range(2))
    shared[2][1] = np.inf
    alone = (np.where(np.isinf(s), s, a) for s, a in zip(shared[1:], own[1:], strict=True))
    costs = Costs(
        LayeredCosts(single, tuple(shared)), alone=LayeredCosts(single, (shared[0], *alone))
    )
    found = [answer(costs, name, **options).choice for name, options in SETTINGS]
    assert ["".join(map(str, choice)) for choice in found] == CHOSEN[seed]


@pytest.mark.parametrize("name", SHOWN)
def test_it_is_repeatable(name, problem8):
    assert seqopt.solve(problem8, name).choice == seqopt.solve(problem8, name).choice


@every
def test_budgets_are_kept_or_refused(name):
    """Taking the cheap candidate of every move costs too much of the budget."""
    single = tuple(np.array([0.0, 1.0]) for _ in range(3))
    shared = (np.zeros((1, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    amounts = tuple(np.array([1.0, 0.0]) for _ in range(3))
    capped = Costs(LayeredCosts(single, shared), (Budget("use", amounts, shared, 1.0),))
    if ALL[name].takes_budgets:
        found = answer(capped, name)
        assert found.certificate.spent["use"] <= 1
        assert found.bound == pytest.approx(2.0, abs=1e-6)
        if name == "overlap_lp":  # three choices tie: the mixture need not be followed to one
            assert found.objective >= 2.0 - 1e-6
            assert found.prices["use"] == pytest.approx(1.0, abs=1e-3)
        else:
            assert found.objective == pytest.approx(2.0)
        impossible = replace(capped, budgets=(replace(capped.budgets[0], bound=-1.0),))
        with pytest.raises(InfeasibleError, match="budgets"):
            answer(impossible, name)
    else:
        with pytest.raises(ProblemError, match="takes no caps"):
            answer(capped, name)


@timely
@given(problem=st.one_of(problems(), budgeted()), limit=st.integers(0, 60))
def test_an_answer_stopped_early_is_allowed_and_its_bound_holds(name, problem, limit):
    """On a clock that moves on whenever it is looked at."""
    formulation = ALL[name]
    if problem.budgets and not formulation.takes_budgets:
        problem = replace(problem, budgets=())
    aim, told = formulation.aim, []
    best = problem.best(aim)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("seqopt.graph.formulation.time", Clock(1.0))
        found, wrongly_refused = None, False
        try:
            found = answer(problem, name, time_limit=float(limit), progress=told.append)
        except InfeasibleError:
            wrongly_refused = np.isfinite(best)
        except SolverError:  # no choice within the budgets was at hand
            wrongly_refused = not problem.budgets
    assert not wrongly_refused
    if found is None:
        return
    worth = problem.worth(found.choice, aim)
    assert found.objective == pytest.approx(worth)
    assert all(b.spent(found.choice) <= b.bound + 1e-6 for b in problem.budgets)
    assert found.bound <= best + 1e-6 <= worth + 2e-6
    trace = found.trace
    assert tuple(told) == trace
    assert trace[-1].objective == pytest.approx(worth, rel=1e-6, abs=1e-6)
    for before, after in pairwise(trace):
        assert before.seconds <= after.seconds
        assert before.objective >= after.objective
        assert before.bound <= after.bound <= best + 1e-6
    if not found.stopped and formulation.kind is FormulationKind.EXACT:
        assert worth == pytest.approx(best, abs=1e-6)


@cache
def compiled(problem, aim):
    return seqopt.compile_instance(problem, aim=aim)


@timely
def test_no_time_is_enough_for_an_allowed_choice(name, problem25):
    """Of costs that are known; where states are still to be visited there is no plan yet."""
    plan = seqopt.solve(compiled(problem25, ALL[name].aim), ALL[name], time_limit=0)
    assert plan.ended is End.STOPPED
    if name in OURS:
        assert plan.certificate.gap < 0.3
    assert plan.selection.bound[0] <= plan.certificate.bound + 1e-6


def once():
    """A receiver of findings that interrupts with the first one; a second would end the program."""
    came = []

    def interrupt(told):
        if isinstance(told, Finding):
            if not came:
                signal.raise_signal(signal.SIGINT)
            came.append(told)

    return interrupt, came


@timely
def test_an_interrupt_leaves_an_allowed_choice_and_a_bound_that_holds(name, problem8):
    formulation, (interrupt, came) = ALL[name], once()
    best = seqopt.solve(problem8, "overlap_dp")
    problem = problem8.but(budgets="travel=0.95") if formulation.takes_budgets else problem8
    one = seqopt.compile_instance(problem, aim=formulation.aim)
    plan = seqopt.solve(one, formulation, progress=interrupt)
    assert plan.ended is End.INTERRUPTED
    assert plan.trace == tuple(came)
    assert plan.selection.bound[0] <= plan.certificate.objective + 1e-6
    if formulation.aim is Aim.SUM:
        assert plan.certificate.objective >= best.certificate.objective - 1e-6
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("name", ["labels", "overlap_lp", "overlap_mip"])
def test_an_interrupt_is_said_though_the_search_may_have_ended(name, problem8):
    interrupt, came = once()
    plan = seqopt.solve(problem8.but(budgets="travel=0.95"), name, progress=interrupt)
    assert plan.ended is End.INTERRUPTED
    assert plan.trace == tuple(came)


@pytest.mark.slow
def test_where_no_path_is_found_yet_its_bound_is_said(problem25):
    """However it ends; labels have a choice within budgets before they can be interrupted."""

    def choose(graph, watch):
        watch.tell(bound=612.5)
        return Choice((), (612.5,), stopped=True)

    late = on_graph("late", "finds nothing in time", choose, aim=Aim.SUM, takes_budgets=True)
    capped = problem25.but(budgets=["travel=13m", "steps_over:F_largest=300:1"])
    one, told = seqopt.compile_instance(capped), r"no path was .* \(no path is below 612.5\)"
    with pytest.raises(TimeUpError, match=told):
        seqopt.solve(one, late)
    with pytest.raises(KeyboardInterrupt, match=told):
        seqopt.solve(one, late, progress=once()[0])
    plan = seqopt.solve(capped, "labels", progress=once()[0])
    assert plan.ended is End.INTERRUPTED
    assert plan.objective["travel"] <= 13
    assert plan.objective["steps_over:F_largest=300"] <= 1


def agrees(problem, name):
    """Exact ones find the optimum or that there is none; bounds lie below, choices not."""
    free, best = replace(problem, budgets=()).best(), problem.best()
    kind = ALL[name].kind
    exact = kind is FormulationKind.EXACT and name != "schedule_search"  # it has no labels
    if not np.isfinite(best) and (exact or not np.isfinite(free)):
        with pytest.raises(InfeasibleError, match="budget" if np.isfinite(free) else "relax"):
            answer(problem, name)
        return
    try:
        found = answer(problem, name)
    except InfeasibleError:
        assert not np.isfinite(best)
        return
    except SolverError:  # one that was not kept, or no choice was met that keeps all
        assert kind is FormulationKind.BOUND
        return
    proof = found.certificate
    assert all(b.spent(found.choice) <= b.bound + 1e-6 for b in problem.budgets)
    assert proof.bound <= best + 1e-6
    assert found.bound <= best + 1e-6
    if exact:
        assert proof.objective == pytest.approx(best, abs=1e-6)
        assert proof.gap <= 1e-6  # proven by the certificate alone
    else:
        assert proof.objective >= best - 1e-6


@pytest.mark.parametrize("examples", [6, pytest.param(40, marks=pytest.mark.slow)])
@takers
def test_budgets_against_brute_force(name, examples):
    @given(problem=budgeted())
    @settings(max_examples=examples)
    def hold(problem):
        agrees(problem, name)

    hold()


def valued(problem, name, **options):
    return seqopt.solve(problem, name, options=options).certificate.objective


@pytest.fixture(scope="module")
def problem8():
    engine = seqopt.make_engine("compliance", small_arch(8))
    return seqopt.pose(engine, seqopt.three_robot_loop(engine.network), EQUATIONS)


@pytest.mark.parametrize("criterion", ["equations-2-3", "weighted", "worst-ratio"])
def test_all_exact_ones_equal_brute_force_on_a_small_arch(criterion):
    engine, count = seqopt.make_engine("compliance", small_arch(5)), 5
    problem = seqopt.pose(engine, seqopt.three_robot_loop(engine.network), CRITERIA[criterion])
    best = valued(problem, "rank_search", horizon=count)
    costs = of_layers(problem)
    assert best == pytest.approx(costs.best())
    for name in EXACT_SUMS:
        assert valued(problem, name) == pytest.approx(best, rel=1e-6)
    assert valued(problem, "minimax") == pytest.approx(costs.best(Aim.PEAK))


# what exact formulations share: how programs are solved, read and bounded
PROGRAMS = {OVERLAP_MIP.name: OVERLAP_MIP, **exhibits()}
EXACT = PROGRAMS | {n: find_formulation(n) for n in ("overlap_dp", "overlap_lp", "minimax")}


def costs_of(lowest, seed=0):
    """Random costs of three moves, from the lowest on."""
    rng = np.random.default_rng(seed)
    sizes = (3, 4, 2)
    single = tuple(rng.uniform(lowest, 9.0, size) for size in sizes)
    shared = tuple(rng.uniform(lowest, 9.0, pair) for pair in pairwise(sizes))
    return LayeredCosts(single, (np.zeros((1, sizes[0])), *shared))


@pytest.mark.parametrize("lowest", [0.0, 1.0])
@pytest.mark.parametrize("name", EXACT)
def test_the_choice_and_its_bound_are_the_least(name, lowest):
    costs, aim, told = Costs(costs_of(lowest)), EXACT[name].aim, []
    least = costs.best(aim)
    found = answer(costs, name, progress=told.append)
    assert not found.stopped
    assert costs.worth(found.choice, aim) == pytest.approx(found.objective, rel=1e-12)
    assert found.objective == pytest.approx(least, rel=1e-9)
    assert least - 1e-4 * max(abs(least), 9.0) <= found.bound <= least + 1e-12 * abs(least)
    assert all(one.bound <= least + 1e-12 * abs(least) for one in told)


def test_an_assignment_needs_a_state_of_every_level():
    source, target = np.array([0, 0, 1]), np.array([1, 2, 2])
    ends = np.array([False, False, True])
    for name in ("assignment_tight", "assignment_loose", "minimax_layer", "minimax_big_m"):
        peak = PROGRAMS[name].aim is Aim.PEAK
        graph = Graph(source, target, np.ones((3, 1)), (peak,), ends)
        with pytest.raises(ProblemError, match="an assignment chooses a state of every level"):
            PROGRAMS[name].solve.choose(graph, Watch())


@pytest.mark.parametrize("found", [None, (1, 2)])
def test_what_is_no_choice_is_named(problem8, found):
    own = on_graph("own", "says nothing", lambda graph, watch: found, aim=Aim.SUM)
    kind = type(found).__name__
    for asked in (problem8, seqopt.compile_instance(problem8)):
        with pytest.raises(SolverError, match=f"formulation own returned a {kind}, not a Choice"):
            seqopt.solve(asked, own)


def test_how_much_is_enumerated_at_once(monkeypatch):
    free = tuple(np.zeros(2) for _ in range(3))
    problem = Costs(LayeredCosts(free, (np.zeros((1, 2)), np.eye(2), np.eye(2))))
    monkeypatch.setattr(rank_search, "MOST", 8)
    assert answer(problem, "rank_search", horizon=9).choice == (0, 1, 0)
    monkeypatch.setattr(rank_search, "MOST", 7)
    assert answer(problem, "rank_search", horizon=2).choice == (0, 1, 0)
    with pytest.raises(ProblemError, match=r"8 combinations of 3 moves; .*\(at most 7e\+00 are"):
        answer(problem, "rank_search", horizon=9)


def boxed_program():
    """The least is 5 - 2 + 1 - 0.5: with the offset, a bound below and one below zero."""
    x, y = cp.Variable(2, boolean=True), cp.Variable(bounds=[-0.5, 2.0])
    z = cp.Variable()
    rules = [x[0] + x[1] == 1, z >= 1.0, z <= 3.0]
    return cp.Problem(cp.Minimize(5.0 - 2.0 * x[0] - x[1] + y + z), rules)


def test_programs_keep_their_offset_bounds_and_equations(capfd):
    found = minimize_by_highs(boxed_program(), feasible=True)
    assert found.value == pytest.approx(3.5)
    assert found.bound == pytest.approx(3.5)
    assert not found.stopped
    assert 0 <= found.compile_seconds < 600
    assert capfd.readouterr().out == ""  # the solver keeps quiet


@pytest.mark.parametrize(("horizon", "path"), [(2, (1, 2, 5)), (3, (3, 4, 5))])
def test_a_search_sees_as_far_as_its_horizon(horizon, path):
    """Two moves that cost less lead to a third one that costs most."""
    source, target = np.array([[0, 0, 1, 2, 3, 4], [1, 3, 2, 5, 4, 5]], dtype=np.int32)
    cost = np.array([1.0, 2.0, 1.0, 9.0, 2.0, 1.0])[:, None]
    graph = Graph(source, target, cost, (False,), np.arange(6) == 5)
    assert rank_search.choose(graph, Watch(), horizon=horizon).path == path
