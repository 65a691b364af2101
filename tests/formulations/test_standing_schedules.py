"""Free schedules whose every state must stand: against brute force, and what judges them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import seqopt
from formulations.contact.limit_analysis import compile_equilibrium
from seqopt.contact.faces import step_assembly
from seqopt.contact.mortar import find_mortar
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.states.states import build_states
from seqopt.judge._schedules import judge_schedule
from seqopt.plan._infeasible import Look
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.standing import NARROW, Standing, _without_implied, slack
from seqopt.stability._prover import Prover
from seqopt.stability.assessment import Verdict, _verdict_of, bonded
from seqopt.stability.limit_analysis import GAP
from tests.brute_force import ONES as FOUR_ONES
from tests.brute_force import allowed, least_peak, peaks, whole_graph
from tests.builders import small_arch

slow, long = pytest.mark.slow, (pytest.mark.slow, pytest.mark.long)
TILTS = pytest.param("tilt,minmax", marks=long)
ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0)))


def stands(network, bricks, grips, mortar):
    """By the cone program."""
    assembly = step_assembly(network, bricks, grips)
    return _verdict_of(Prover(assembly, compile_equilibrium)(bonded(assembly, mortar)))


def brute_force(engine, rules, mortar):
    """The least peak of all plans whose states stand, by every state that can be reached."""

    def allow(bricks, grips):
        if bricks and stands(engine.network, bricks, grips, mortar) is not Verdict.STANDS:
            return None
        return allowed(engine, rules, bricks, grips)

    graph, start = whole_graph(engine, rules, allow=allow)
    found = least_peak(graph, start, peaks(graph))
    return None if found is None else found[0]


@pytest.mark.slow
def test_a_small_arch_equals_brute_force():
    engine, rules = seqopt.make_engine("compliance", small_arch(4)), seqopt.FreeRules()
    best = brute_force(engine, rules, find_mortar("dry"))
    problem = build_states(engine, rules, FOUR_ONES, "minmax", stands="dry")
    plan = seqopt.solve(problem, "schedule_search")
    assert plan.certificate.values == pytest.approx((best,))
    assert set(plan.stability()["verdict"]) == {"stands"}
    assert problem.stability.undecided == 0


@pytest.fixture(scope="module")
def dry():
    engine = seqopt.make_engine("compliance", small_arch(5))
    return build_states(engine, seqopt.FreeRules(), ONES, "minmax", stands="dry")


def test_a_plan_that_does_not_stand_is_seen(dry):
    """The negative control: the best plan of all, whose second brick is let go too soon."""
    free = replace(dry, standing=None)
    plan = seqopt.solve(free, "schedule_search")
    loose = find_mortar("dry")
    verdicts = [stands(dry.network, s.bricks, s.grips, loose) for s in plan.steps]
    assert Verdict.FALLS in verdicts
    with pytest.raises(SolverError, match=r"step \d+ is not proven to stand as demanded"):
        judge_schedule(dry, plan.selection, plan.steps)


@pytest.mark.parametrize(
    "aim",
    ["bond", pytest.param("bond,steps", marks=slow), pytest.param("friction", marks=long), TILTS],
)
def test_a_margin_is_the_best_to_its_width(dry, aim):
    """With the value that was found a plan exists; past the bound none does."""
    problem = build_states(dry.engine, dry.rules, ONES, aim)
    plan = seqopt.solve(problem, "schedule_search")
    name, (value, *_), (bound, *_) = (
        aim.split(",")[0],
        *((plan.certificate.values, plan.certificate.bounds)),
    )
    assert bound <= value
    rest = build_states(dry.engine, dry.rules, ONES, "steps")
    asked = Standing().demanding(name, value)
    assert seqopt.solve(replace(rest, standing=asked), "schedule_search").steps
    if bound < value:
        past = Standing().demanding(name, bound)
        with pytest.raises(InfeasibleError):
            seqopt.solve(replace(rest, standing=past), "schedule_search")


def leaning(scale=1.0, stands=None, aim="bond"):
    """Three bricks, the second of which tips off the first without bond; densities by a scale."""
    scene = seqopt.arch_scene(
        seqopt.ArchShape(pitch=(1.2, 0.0, -1.2), pattern="VLR", density=2000.0 * scale)
    )
    engine = seqopt.make_engine("compliance", scene)
    return build_states(engine, seqopt.FreeRules(), ONES, aim, stands=stands)


@slow
@pytest.mark.parametrize("aim", ["bond,minmax", "friction,minmax", TILTS])
def test_a_margin_is_sought_among_what_stands_as_demanded(aim):
    """The demand was forgotten for the margin: plans were found that do not meet it."""
    with pytest.raises(InfeasibleError, match=r"brick 2 \(2 of 3\) is never placed.*a bond of"):
        seqopt.solve(leaning(stands="dry", aim=aim), "schedule_search")
    plan = seqopt.solve(leaning(stands="bond=3e3", aim=aim), "schedule_search")
    assert set(plan.stability()["verdict"]) == {"stands"}


def test_a_second_margin_is_that_of_the_mortar_alone():
    """A tilt that is survived only with the bond that was found first was promised without."""
    with pytest.raises(InfeasibleError, match=r"it becomes possible with .*a bond of"):
        seqopt.solve(leaning(aim="bond,tilt"), "schedule_search")


@slow
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_a_bond_is_found_to_its_share_at_every_size(scale):
    """Fifty pascals were left open, whatever the size; the gap says what is."""
    problem = leaning(scale)
    plan = seqopt.solve(problem, "schedule_search")
    (value,), (bound,) = plan.certificate.values, plan.certificate.bounds
    true = Look().least(problem, "bond")
    assert 0.98 * value <= bound <= true <= value * (1 + 2 * GAP)
    assert plan.certificate.gap == pytest.approx((value - bound) / value)
    assert plan.summary()["gap"] == plan.certificate.gap > 1e-3
    assert f"optimal within {plan.certificate.gap:.2g}" in plan.result


@pytest.mark.parametrize(
    ("aim", "way"),
    [
        pytest.param("friction", "loop", marks=slow),
        pytest.param("bond", "free", marks=slow),
        pytest.param("friction", "free", marks=slow),
        pytest.param("tilt", "loop", marks=slow),
    ],
)
def test_a_margin_is_that_of_the_worst_step_to_two_percent(aim, way):
    """Friction and tilt were found to a step of their own, a tenth of what they were."""
    engine = seqopt.make_engine("compliance", small_arch(4))
    free = seqopt.FreeRules(robots=("rob1", "rob2"), least_grips=1)
    rules = seqopt.three_robot_loop(engine.network) if way == "loop" else free
    plan = seqopt.solve(build_states(engine, rules, ONES, aim), "schedule_search")
    found, bound = plan.objective[aim], plan.summary()["bound"][aim]
    assert plan.certificate.gap == pytest.approx(abs(found - bound) / found)
    assert plan.certificate.gap <= NARROW * (1 + 1e-9)
    steps = seqopt.assess_steps(engine.network, plan.steps, "dry", "all")
    worst = {
        "bond": max(step.bond for step in steps),
        "friction": max(step.friction for step in steps),
        "tilt": np.degrees(min(step.tilt for step in steps)),
    }[aim]
    assert worst == pytest.approx(found, rel=NARROW)
    (value,) = plan.selection.objective
    for share in (-1.5, 1.5):  # what is claimed is better than it is, or not the best
        wrong = value + share * slack(aim, value)
        claim = replace(plan.selection, objective=(wrong,), bound=(wrong,))
        with pytest.raises(SolverError, match=r"as claimed|promised as the least"):
            judge_schedule(plan.states, claim, plan.steps)


def test_demands_that_others_imply_are_not_asked():
    weak, strong = Standing("bond=3e3"), Standing("dry")
    tilted = Standing("bond=1e3", 0.1)
    assert _without_implied((weak, strong, tilted, weak)) == (strong, tilted)


@slow
def test_the_bond_that_is_named_is_enough():
    engine = seqopt.make_engine("compliance", small_arch(6))
    loop = seqopt.three_robot_loop(engine.network)
    with pytest.raises(InfeasibleError, match="a bond of") as caught:
        seqopt.solve(build_states(engine, loop, ONES, "minmax", stands="dry"), "schedule_search")
    said = float(re.search(r"a bond of ([\d.e+]+) Pa", str(caught.value))[1])
    strong, weak = (
        build_states(engine, loop, ONES, "minmax", stands=f"bond={bond}")
        for bond in (said, 0.9 * said)
    )
    assert seqopt.solve(strong, "schedule_search").status == "optimal"
    with pytest.raises(InfeasibleError):
        seqopt.solve(weak, "schedule_search")
