"""The program of equilibrium with contact against limits by hand: a cube on the ground, or held.

Forces count in the cube's weight, strengths in that weight over its face, so that they add up.
"""

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import clarabel
import numpy as np
import pytest

import seqopt
from experiments.stability.parts.blocks import stack
from formulations.contact.limit_analysis import (
    CONE_OPTIONS,
    ENDS,
    SECONDS,
    _solve_cones,
    compile_equilibrium,
)
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import find_mortar
from seqopt.errors import InfeasibleError, SolverError
from seqopt.graph.states import build_states
from seqopt.judge._schedules import judge_schedule
from seqopt.plan._infeasible import Look
from seqopt.problem.criteria import WorstRatio
from seqopt.stability.assessment import _verdict_of, bonded
from seqopt.stability.limit_analysis import CAP, GAP, Case, Claim, Prover, Sense, limits
from seqopt.stability.standing import NARROW, Standing, StandingSets, slack
from seqopt.stability.verdict import Verdict
from tests.brute_force import ONES as FOUR_ONES
from tests.brute_force import allowed, least_peak, peaks, whole_graph
from tests.builders import held, small_arch

MIDDLE = (0.5, 0.5, 0.5)
NONE = np.zeros((0, 3))
CUBE = stack([]).assembly(2000.0)


def floating(payload, *points):
    """The cube off the ground, held at points with a payload over its weight."""
    alone = replace(
        *(CUBE,),
        contact_name=(),
        bodies=np.zeros((0, 2), int),
        normal=NONE,
        corner=NONE,
        contact=np.zeros(0, int),
    )
    return held(alone, payload * CUBE.scales[0], *points)


def hanging():
    """The cube below what it is laid on: its weight pulls at the face."""
    return replace(CUBE, weight=-CUBE.weight)


def case(sense, **numbers):
    return Case(
        sense=sense, **({"friction": 0.3, "tension": (0.0, 0.0), "cohesion": (0.0, 0.0)} | numbers)
    )


STRONG = {"cohesion": (50.0, 0.0)}
ASIDE = (1.0, 0.0, 0.0)
UP = (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("numbers", "z"),
    [
        ({"pull": ASIDE}, 0.3),  # slides
        ({"pull": (0.0, 1.0, 0.0)}, 0.3),
        ({"pull": (0.6, 0.0, 0.0)}, 0.5),
        ({"pull": (0.3, 0.4, 0.0)}, 0.6),  # friction is round
        ({"pull": (0.3, 0.0, -0.5)}, 0.3 / 0.15),  # a press adds to the friction
        ({"pull": ASIDE, "friction": 2.0}, 1.0),  # tips about its edge
        ({"pull": ASIDE, "cohesion": (0.1, 0.0)}, 0.4),
        ({"pull": ASIDE, "cohesion": (0.0, 0.5)}, 0.6),
        ({"pull": ASIDE, "tension": (0.2, 0.0)} | STRONG, 1.2),  # two corners hold its edge back
        ({"pull": UP, "tension": (0.2, 0.0)} | STRONG, 1.2),  # lifts
        ({"pull": UP, "tension": (0.0, 0.5)} | STRONG, 2.0),
        ({"pull": (0.0, 0.0, 0.0)}, CAP),
    ],
)
def test_the_largest_pull(numbers, z):
    answer = compile_equilibrium(CUBE)(case(Sense.LARGEST, **numbers))
    assert answer.claim is Claim.SOLVED
    assert answer.value == pytest.approx(z, rel=1e-5)


@pytest.mark.parametrize(
    ("numbers", "z"),
    [
        ({"tension": (0.0, 1.0)}, 1.0),
        ({"tension": (0.25, 1.0)}, 0.75),
        ({"tension": (0.0, 2.0)}, 0.5),
        ({"tension": (2.0, 1.0)}, 0.0),
    ],
)
def test_the_least_bond_that_holds_a_hanging_cube(numbers, z):
    answer = compile_equilibrium(hanging())(case(Sense.SMALLEST, **numbers, **STRONG))
    assert answer.value == pytest.approx(z, abs=1e-5)
    assert answer.contact_force[:, 0].sum() == pytest.approx(-1.0, abs=1e-5)


@pytest.mark.parametrize(
    ("own", "points", "payload", "z"),
    [
        (0.0, [MIDDLE], (1.0, 1.0), 1.0),
        (0.4, [MIDDLE], (1.0, 1.0), 0.6),
        (0.4, [MIDDLE], (2.0, 1.0), 0.2),
        (0.4, [MIDDLE], (1.0, 2.0), 0.3),
        (0.4, [(0.0, 0.5, 0.5), (1.0, 0.5, 0.5)], (1.0, 1.0), 0.1),
        (0.4, [(0.0, 0.5, 0.5), (0.6, 0.5, 0.5)], (1.0, 1.0), 5 / 6 - 0.4),  # the near one more
    ],
)
def test_the_least_force_of_robots_that_hold_a_cube(own, points, payload, z):
    assembly = floating(own, *points)
    answer = compile_equilibrium(assembly)(case(Sense.SMALLEST, payload=payload))
    assert answer.value == pytest.approx(z, abs=1e-5)
    assert answer.grip_force.shape == (len(points), 3)
    assert answer.contact_force.shape == (0, 3)
    assert answer.grip_force.sum(axis=0) == pytest.approx([0, 0, 1], abs=1e-5)


def test_the_ground_and_a_robot_share_a_pull():
    """Friction and the payload, one after the other in the same line."""
    both = held(CUBE, 0.5 * CUBE.scales[0], MIDDLE)
    answer = compile_equilibrium(both)(case(Sense.LARGEST, pull=ASIDE))
    lift = np.sqrt(0.5**2 / (1 + 0.3**2))  # the robot pulls back and presses: best of both
    best = 0.3 * (1 + 0.3 * lift) + lift
    assert answer.value == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("pull", [ASIDE, (0.2, 0.3, -0.1)])
def test_an_answer_is_in_equilibrium_and_within_its_limits(pull):
    assembly = held(stack([0.2, 0.1]).assembly(2000.0), 3000.0, (0.9, 0.5, 2.5))
    asked = case(Sense.LARGEST, pull=pull, tension=(0.1, 0.02), cohesion=(0.2, 0.01))
    answer = compile_equilibrium(assembly)(asked)
    forces = assembly.contact_map @ answer.contact_force.ravel()
    forces = forces + assembly.grip_map @ answer.grip_force.ravel()
    load = assembly.load() + answer.value * assembly.load(pull)
    assert np.abs(forces + load).max() <= 1e-6
    tension, cohesion, payload = limits(assembly, asked, answer.value)
    normal, tangent = answer.contact_force[:, 0], answer.contact_force[:, 1:]
    assert (normal + tension).min() >= -1e-6
    assert (0.3 * normal + cohesion - np.linalg.norm(tangent, axis=1)).min() >= -1e-6
    assert (payload - np.linalg.norm(answer.grip_force, axis=1)).min() >= -1e-6
    assert answer.motion.shape == (3, 6)
    assert abs(np.vdot(answer.motion.ravel(), assembly.load(pull))) > 0.1  # it gives way


def test_a_program_is_asked_again():
    program = compile_equilibrium(CUBE)
    values = [program(case(Sense.LARGEST, pull=ASIDE, friction=m)).value for m in (0.3, 0.2, 0.3)]
    assert values == pytest.approx([0.3, 0.2, 0.3], rel=1e-5)
    other = program(case(Sense.LARGEST, pull=ASIDE), len(CONE_OPTIONS) - 1)
    assert other.value == pytest.approx(0.3, rel=1e-5)


def test_what_cannot_be_held_has_no_forces():
    answer = compile_equilibrium(floating(0.4, MIDDLE))(case(Sense.SMALLEST))
    assert answer.claim is Claim.INFEASIBLE
    assert np.isnan(answer.value)
    for part, shape in (("contact_force", (0, 3)), ("grip_force", (1, 3)), ("motion", (1, 6))):
        assert getattr(answer, part).shape == shape
        assert not getattr(answer, part).any()
    fallen = compile_equilibrium(hanging())(case(Sense.SMALLEST))
    assert fallen.contact_force.shape == (len(CUBE.corner), 3)
    assert fallen.grip_force.shape == (0, 3)


class Ended:
    """A solver that ends with a status, and keeps what it was given."""

    given: ClassVar[list[object]] = []

    def __init__(self, *given):
        self.given.append(given[-1])

    def solve(self):
        if self.status == "fails":
            raise RuntimeError("no")
        return SimpleNamespace(status=self.status, x=[0.0], z=[0.0])


@pytest.mark.parametrize("status", [*ENDS, "MaxTime", "NumericalError", "DualInfeasible", "fails"])
def test_how_a_solver_says_that_it_ended(monkeypatch, status):
    """Nothing but an optimum and infeasibility is taken from it, and it gets its options."""
    monkeypatch.setattr(Ended, "status", status, raising=False)
    monkeypatch.setattr(clarabel, "DefaultSolver", Ended)
    program = np.zeros(1), np.zeros((1, 1)), np.zeros(1), []
    for attempt, own in enumerate(CONE_OPTIONS):
        assert _solve_cones(*program, attempt)[0] is ENDS.get(status, Claim.STALLED)
        given, usual = Ended.given[-1], clarabel.DefaultSettings()
        assert (given.time_limit, given.max_threads, given.verbose) == (SECONDS, 1, False)
        assert given.equilibrate_enable is own.get("equilibrate_enable", usual.equilibrate_enable)
    assert 60 <= SECONDS <= 3600
    assert len({str(options) for options in CONE_OPTIONS}) == len(CONE_OPTIONS)


# free schedules whose every state must stand: against brute force, and what judges them


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


@slow
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
    steps = seqopt.assess(engine.network, plan.steps, "dry", "all")
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
    network, every = seqopt.build_network(small_arch(4)), (weak, strong, tilted, weak)
    assert StandingSets(network, weak, np.ones(1), every)._demands == (strong, tilted)


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
