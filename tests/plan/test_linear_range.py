"""The linear range as a limit of plans; one way from a problem."""

import json
import math
from dataclasses import dataclass, replace

import pytest

import seqopt
from seqopt.contact.mortar import bond_mortar
from seqopt.engines.interface import Want, linear_limit
from seqopt.engines.registry import AutoEngine
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, NothingFoundError, ProblemError, SolverError, TimeUpError
from seqopt.judge._schedules import check_shape, judge_schedule
from seqopt.plan.front import find_front
from seqopt.plan.plan import Status
from seqopt.plan.solve import INTERRUPTED, NONE_KEEPS, UNKNOWN, best_within, graph_of
from seqopt.problem.criteria import WeightedSum, WorstRatio
from seqopt.problem.requirements import LINEAR_RANGE, Limit, _step_limits, parse_limits
from seqopt.responses._grip_sets import Moved, most_moved
from seqopt.responses.table import OUTSIDE
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.methods import three_robot_loop
from tests.builders import scaled, small_arch

FORCES = WeightedSum("forces", (("F_largest", 1.0, 100.0), ("D_max", 1e-6, 1e-3)))  # no ties
MOTION = WorstRatio("motion", (("D_max", 1e-5),))
HARD, LIFTED = Limit(LINEAR_RANGE, 1.0), Limit(LINEAR_RANGE, math.inf)


def posed(scene, criterion=FORCES, *, loop=False, **words):
    engine = seqopt.make_engine("compliance", scene)
    free = seqopt.FreeRules(least_grips=1, ending=words.pop("ending", "released"))
    moves = seqopt.three_robot_loop(engine.network) if loop else free
    if "scenarios" in words:
        words["scenarios"] = seqopt.scenarios(scene, count=2, seed=1)
    return seqopt.pose(engine, moves, criterion, words.pop("goals", ()), **words)


HELD = {"goals": "minmax", "ending": "held"}  # without the end that all builds share
KINDS = {
    "free": (HELD, None),
    "budget": (HELD | {"budgets": "regrips=1"}, None),
    "orders": (HELD | {"orders": "tied"}, None),
    "scenarios": (HELD | {"scenarios": 2}, None),
    "loop": ({"loop": True}, None),
    "loop, no proof": ({"loop": True}, "cascade"),
    "loop, as states": ({"loop": True, "goals": "minmax"}, None),
    "loop, scenarios": ({"loop": True, "scenarios": 2}, None),
}


def moved(problem, formulation=None):
    """The best plan of all, and how far it moves over the limit."""
    plan = seqopt.solve(problem.but(limits=[LIFTED]), formulation)
    return plan, plan.moved.share


def between(words, formulation):
    """A scene so soft that each of the best plans leaves the range, and another one keeps it.

    Displacements over the limit grow with softness; forces, and so what is best, stay.
    """
    scene = small_arch(5 if "loop" in words else 3 if "orders" in words else 4)
    rest = {name: word for name, word in words.items() if name not in ("goals", "budgets")}
    aims = {"goals": f"{words['goals']},D_max"} if "goals" in words else {}
    best = moved(posed(scene, **rest, **aims), formulation)[1]
    goals = {"goals": "D_max"} if aims else {}
    worst = "minimax" if "loop" in words and not aims and "over" not in words else formulation
    least = moved(posed(scene, MOTION, **rest, **goals), worst)[1]
    assert least < best * (1 - 1e-3), "the scene does not tell the two apart"
    return scaled(scene, stiffness=math.sqrt(least * best))


DAILY = ("free", "loop")


@pytest.mark.parametrize(
    ("words", "formulation"),
    [
        pytest.param(*kind, id=name, marks=[pytest.mark.slow] * (name not in DAILY))
        for name, kind in KINDS.items()
    ],
)
def test_the_best_plan_keeps_the_range_wherever_one_does(words, formulation):
    problem = posed(between(words, formulation), **words)
    free, far = moved(problem, formulation)
    assert far > 1
    before, plan = problem.engine.answered, seqopt.solve(problem, formulation)
    both, hard = problem.engine.answered - before, problem.but(limits=[HARD])
    assert plan.moved.share <= 1 + 1e-9
    assert not plan.is_far
    assert not plan.beyond
    assert plan.status == seqopt.solve(hard, formulation).status
    seqopt.solve(problem.but(limits=[LIFTED]), formulation)
    apart = problem.engine.answered - before - both  # zero where scenes of their own are solved
    assert both < apart or not apart, "the second search began anew"
    limit = Limit("D_max", linear_limit(problem.scene))
    same = seqopt.solve(problem.but(limits=[limit]), formulation)
    assert plan.certificate.values == pytest.approx(same.certificate.values)
    assert plan.certificate.values >= tuple(v * (1 - 1e-9) for v in free.certificate.values)
    assert plan.problem is problem
    assert plan.summary()["limits"] == {}


@pytest.mark.parametrize("kind", ["free", "budget", "orders", "scenarios", "loop, scenarios"])
def test_the_judge_finds_displacements_again(kind):
    """To six digits those of another way to compute them."""
    words, formulation = KINDS[kind]
    plan = seqopt.solve(posed(small_arch(3 if kind == "orders" else 5), **words), formulation)
    engines = plan.graph.scenarios or (plan.engine,)
    far = max(most_moved(engine, plan.steps).share for engine in engines)
    assert plan.moved is plan.certificate.moved
    assert plan.moved.share == pytest.approx(far, rel=1e-5)
    (step,) = [step for step in plan.steps if step.number == plan.moved.step]
    shares = [most_moved(engine, [step]).share for engine in engines]
    assert max(shares) == pytest.approx(far, rel=1e-5)


SOFT = 1e-6


@dataclass(frozen=True)
class Result:
    """What a solve returns, as far as the linear range asks it."""

    moved: Moved
    beyond: str = ""
    stopped: str = ""


@pytest.mark.parametrize("loop", [False, True])
def test_where_no_plan_keeps_it_that_is_said_first(loop):
    problem = posed(scaled(small_arch(5), stiffness=SOFT), loop=loop)
    plan = seqopt.solve(problem)
    assert plan.is_far
    assert plan.beyond == NONE_KEEPS
    assert plan.status is Status.OUTSIDE
    assert repr(plan).startswith("Plan(outside the linear range: ")
    assert plan.result.startswith("outside the linear range: ")
    assert not repr(plan).endswith("optimal)")
    assert plan.summary()["status"] == str(Status.OUTSIDE)
    assert plan.summary()["outside_linear_range"]
    with pytest.raises(InfeasibleError):
        seqopt.solve(problem.but(limits=[HARD]))
    lifted = seqopt.solve(problem.but(limits="linear_range=any"))
    assert not lifted.beyond
    assert lifted.status is Status.OUTSIDE
    assert lifted.certificate.values == pytest.approx(plan.certificate.values)
    assert json.loads(json.dumps(lifted.summary()["limits"])) == {LINEAR_RANGE: "any"}
    share = plan.moved.share * 2
    wide = seqopt.solve(problem.but(limits=f"linear_range={share}"))
    assert wide.summary()["limits"] == {LINEAR_RANGE: pytest.approx(share)}


def test_what_would_help_is_said_in_shares():
    problem = posed(scaled(small_arch(4), stiffness=SOFT), limits=[HARD])
    with pytest.raises(InfeasibleError, match=r"linear_range=[0-9.]+ instead of 1") as found:
        seqopt.solve(problem)
    share = float(str(found.value).partition("linear_range=")[2].split()[0])
    assert seqopt.solve(problem.but(limits=[Limit(LINEAR_RANGE, share * 1.001)])).steps


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (InfeasibleError("none"), NONE_KEEPS),
        (NothingFoundError("left out"), f"{UNKNOWN} (NothingFoundError: left out)"),
        (TimeUpError("time is over"), f"{UNKNOWN} (TimeUpError: time is over)"),
        (KeyboardInterrupt(), INTERRUPTED),
    ],
)
def test_only_a_proof_says_that_no_plan_keeps_it(error, why):
    problem = posed(small_arch(4))

    def best(share, second=None):
        def measured(asked):
            if asked is not problem and second is None:
                raise error
            return Result(Moved(share, 3)) if asked is problem else second

        return best_within(problem, measured, lambda found: found.moved, lambda found: found)

    assert best(1.5) == Result(Moved(1.5, 3), beyond=why)
    assert best(1.0) == Result(Moved(1.0, 3))
    assert best(1.5, Result(Moved(0.9, 3))) == Result(Moved(0.9, 3))


def test_the_judge_finds_by_itself_that_steps_leave_the_range():
    words = KINDS["free"][0]
    problem = posed(between(words, None), **words)
    free, kept = seqopt.solve(problem.but(limits=[LIFTED])), seqopt.solve(problem)
    limits = _step_limits([HARD], problem.scene)
    check_shape(problem.engine, kept.steps, limits)
    check_shape(problem.engine, free.steps, _step_limits([LIFTED], problem.scene))
    with pytest.raises(SolverError, match="the linear range ends at"):
        check_shape(problem.engine, free.steps, limits)
    with pytest.raises(SolverError, match="the linear range ends at"):
        judge_schedule(graph_of(problem.but(limits=[HARD])), free.selection, free.steps)


@pytest.mark.slow
def test_a_pareto_set_keeps_it():
    words = KINDS["free"][0]
    problem = posed(between(words, None), goals="F_largest,T_max", ending="held")
    lifted = find_front(problem.but(limits=[LIFTED]))
    front = find_front(problem)
    assert max(lifted.moved).share > 1 >= max(front.moved).share
    assert repr(lifted).startswith("<Front: outside the linear range: ")
    hard = find_front(problem.but(limits=[HARD]))
    assert front.table.equals(hard.table)
    soft = find_front(posed(scaled(small_arch(4), stiffness=SOFT), goals="F_largest,steps"))
    assert soft.beyond == NONE_KEEPS


def test_words_are_the_same_in_python_and_on_the_command_line():
    scene = small_arch(3)
    assert parse_limits("linear_range=any", scene) == (LIFTED,)
    assert parse_limits(["linear_range=0.5", HARD], scene) == (Limit(LINEAR_RANGE, 0.5), HARD)
    for words in ("20um", "0.02mm", "20e-6", "20µm"):
        (limit,) = parse_limits(f"D_max={words}", scene)
        assert (limit.response, limit.bound) == ("D_max", pytest.approx(20e-6, rel=1e-12))
    assert parse_limits(["F_largest=300", "tolerance=0.1mm"], scene) == (
        Limit("F_largest", 300.0),
        Limit("tolerance", 0.1 * 1e-3),
    )
    problem = posed(scene, goals="minmax", limits=["payload", "linear_range=any"])
    assert problem.lifts_range
    assert len(problem.limits) == 1 + len(scene.robots)
    for wrong in ("linear_range=none", "linear_range=0", "linear_rang=1", "payload=3"):
        with pytest.raises(ProblemError, match="limit"):
            posed(scene, goals="minmax", limits=wrong)
    with pytest.raises(ProblemError, match="give a share above zero"):
        Limit(LINEAR_RANGE, -1.0)
    assert replace(HARD, bound=2.0).label == LINEAR_RANGE


# one way from a problem, its graph or an instance to a plan; which level of engines answers
WORST = seqopt.CRITERIA["worst-ratio"]


def asked(goals):
    engine = seqopt.make_engine("compliance", small_arch(4))
    return seqopt.pose(engine, three_robot_loop(engine.network), WORST, goals)


def test_a_problem_its_graph_and_its_instance_have_one_optimum():
    problem = asked("sum")
    states, arcs = graph_of(problem), seqopt.compile_instance(problem)
    plans = [seqopt.solve(each) for each in (problem, states, arcs)]
    best = plans[0].certificate.values
    for plan in plans:
        assert plan.certificate.values == pytest.approx(best, rel=1e-9)
        assert plan.gap == pytest.approx(0, abs=1e-9)
    assert [bool(plan.steps) for plan in plans] == [True, True, False]
    assert [plan.graph for plan in plans[1:]] == [states, arcs]


@pytest.mark.slow
def test_a_formulation_takes_the_aim_that_is_asked():
    """Its own aim holds where none is asked; what it cannot make small it refuses itself."""
    for goals in ("sum", "minmax", "steps", "minmax,steps"):
        best = seqopt.solve(asked(goals)).certificate.values
        for name in ("overlap_dp", "overlap_lp"):
            plan = seqopt.solve(asked(goals), name)
            assert plan.certificate.values == pytest.approx(best), (goals, name)
    with pytest.raises(ProblemError, match="minimax: a sum comes first"):
        seqopt.solve(asked("sum"), "minimax")
    with pytest.raises(ProblemError, match="minimax_arc: it writes one largest cost down alone"):
        seqopt.solve(asked("sum"), "minimax_arc")


WALL, ARCH = load_scene("wall:columns=3,courses=2"), small_arch(5)
WEAK = bond_mortar(3e4)  # some joints of the small arch would leave its limits


@pytest.mark.parametrize(("scene", "schedule"), [(WALL, None), (ARCH, "free")])
def test_it_chooses_as_rigid_bricks_do_and_asks_no_joint(scene, schedule, monkeypatch):
    wanted, real = set(), ComplianceEngine._found

    def noted(self, bricks, columns, hands, want):
        wanted.add(want)
        return real(self, bricks, columns, hands, want)

    monkeypatch.setattr(ComplianceEngine, "_found", noted)
    monkeypatch.setattr(AutoEngine, "solve", lambda *_: pytest.fail("set by set"))
    plan = seqopt.optimize(scene, schedule)
    assert not any(want & (Want.JOINTS | Want.BRICKS) for want in wanted)
    other = seqopt.optimize(scene, schedule, engine="compliance")
    assert plan.objective == pytest.approx(other.objective, rel=1e-9)
    assert [step.grips for step in plan.steps] == [step.grips for step in other.steps]
    said = plan.summary()["engine"]
    assert (said["name"], said["reason"]) == ("auto", "the default")
    assert said["level"]["engine"] == "compliance"
    assert plan.enough.engine == "compliance"


def test_a_plan_that_leaves_elastic_limits_says_so_first_and_what_to_do():
    plan = seqopt.optimize(ARCH, engine="auto", mortar=WEAK)
    assert plan.result.startswith(f"{OUTSIDE}: ")
    (left,) = plan.departures
    assert "MPa beyond what bond=30000 holds, 0.03 MPa in tension" in left.said
    assert "the engine discrete says it" in plan.enough.others
    assert not seqopt.optimize(ARCH).departures
