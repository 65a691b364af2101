"""The search that solves only the models it meets, against the one that is given all costs."""

from functools import cache
from itertools import cycle, pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import seqopt
from seqopt.contact.assembly import step_assembly
from seqopt.contact.mortar import find_mortar
from seqopt.errors import InfeasibleError, SolverError, StepError, TimeUpError
from seqopt.exchange.schedules import parse_schedule
from seqopt.graph.formulation import FormulationKind, Watch, find_formulation
from seqopt.graph.states import build_states
from seqopt.plan._answers import walk
from seqopt.plan.solve import graph_of, pose, solve
from seqopt.problem.criteria import RankSum
from seqopt.problem.requirements import LIMIT_TOLERANCE, Limit
from seqopt.scene.scene import with_robots
from seqopt.sequence.methods import SCHEDULES, modified_sequential, three_robot_loop
from seqopt.sequence.rules import FreeRules
from seqopt.sequence.schedule import OpenGrip, thin
from seqopt.sequence.steps import StepKind
from seqopt.stability.assessment import verdict
from seqopt.stability.verdict import Verdict
from seqopt.study import CRITERIA, EQUATIONS
from tests.brute_force import FOUR, ONES, allowed, distance, whole_graph
from tests.builders import Counting, small_arch

pytestmark = pytest.mark.slow


class Ticking(Watch):
    """A second goes by whenever it is looked at."""

    ticks = 0

    @property
    def seconds(self):
        self.ticks += 1
        return float(self.ticks)


FIRST, *OTHERS = CRITERIA


def windows(schedule, nodes):
    """How many grip sets candidates of one move after the other have, those before it chosen."""
    met = set()
    for step in (step for step in schedule.steps if step.moves):
        for node in schedule.moves[step.moves[-1]].candidates:
            chosen = {**dict(enumerate(nodes)), step.moves[-1]: node}
            held = [chosen[g.move] if isinstance(g, OpenGrip) else g for g in step.grips if g]
            met.update({(step.bricks, frozenset(held))} if len({*held}) == len(held) else ())
    return len(met)


@pytest.mark.parametrize(
    ("criterion", "method"), [(FIRST, "three-robot"), *zip(OTHERS, cycle(SCHEDULES))]
)
def test_it_chooses_as_the_cascade_does(engine25, method, criterion):
    schedule = SCHEDULES[method](engine25.network)
    counting = Counting(engine25)
    asked = graph_of(pose(counting, schedule, CRITERIA[criterion]))
    counting.sets = 0  # some criteria ask for the scene's methods when they are posed
    found = solve(asked, "cascade", proof=False)
    problem = pose(engine25, schedule, CRITERIA[criterion])
    for name, options in (("rank_search", {"horizon": 1}), ("cascade", {})):
        plan = solve(problem, name, options=options)
        assert found.nodes == plan.nodes
        assert found.steps == plan.steps
    for name, options in (("rank_search", {}), ("rank_search", {"horizon": 1})):
        assert solve(problem, name, proof=False, options=options).nodes == found.nodes
    fewest = windows(schedule, found.nodes)
    if isinstance(CRITERIA[criterion], RankSum):
        assert fewest == found.models
    else:  # what one step turns down no later one is asked; one candidate is no decision
        pairs = pairwise(len(move.candidates) for move in schedule.moves)
        forced = sum(before for before, now in pairs if now == 1)
        assert found.models <= fewest + forced
    assert found.models <= counting.sets <= found.models + len(schedule.moves)
    assert found.models < plan.models


def test_under_a_limit_that_binds_it_chooses_as_the_cascade_does(engine25):
    schedule, limits = three_robot_loop(engine25.network), [Limit("M_sup", 12)]
    bound, free = (pose(engine25, schedule, EQUATIONS, limits=some) for some in (limits, ()))
    found = solve(bound, "cascade", proof=False)
    assert found.nodes == solve(bound, "cascade").nodes
    assert found.nodes != solve(free, "cascade", proof=False).nodes


def test_a_time_limit_ends_it_and_says_what_was_chosen(engine25):
    """An hour is enough; of no time every moment is the last."""
    problem = pose(engine25, three_robot_loop(engine25.network), EQUATIONS)
    plan = solve(problem, "cascade", proof=False, time_limit=3600.0)
    assert plan.nodes == solve(problem, "cascade", proof=False).nodes
    with pytest.raises(TimeUpError, match=r"^.* s: no grip was chosen yet; give more"):
        solve(problem, "cascade", proof=False, time_limit=0.0)
    with pytest.raises(SolverError, match=r"grips of [1-9]\d? of 90 steps were chosen"):
        walk(graph_of(problem), Ticking(time_limit=8.0))


def test_what_must_stand_does_so_without_proof_as_well(engine25):
    problem = seqopt.pose(
        engine25, three_robot_loop(engine25.network), EQUATIONS, "sum", stands="dry"
    )
    with pytest.raises(InfeasibleError, match="step 25 of 90 has no state that is allowed"):
        solve(problem, "cascade", proof=False)


# schedules, aims, limits, budgets, standing, scenarios, candidates: any of them together
FOUR_OPEN = """step,type,bricks,rob1_node,rob2_node,rob3_node,rob4_node
1,place,1,?,,,
2,place,2,?,?,,
3,place,3,?,?,?,
4,release,3,?,?,,
5,reposition,3,?,?,?,
"""
SCALES = np.array([scale for _, scale in ONES.limits])
IGNORED = FreeRules(payload="ignored")
AIMS = ("minmax", "minmax,steps", "sum", "steps,minmax", "regrips,T_max", "travel", "T_max,sum")
NAMES = ("best_first", "overlap_dp", "overlap_lp", "overlap_mip", "path_beam", "path_labels")
PLANS = [find_formulation(name) for name in (*NAMES, "schedule_search")]


@cache
def scene_of(name):
    if name in ("free", "own"):
        return with_robots(small_arch(3), 2 if name == "free" else 4)
    return small_arch(5)


@cache
def engines_of(name, scenarios):
    """The engines of a scene and of some scenarios, those that count."""
    scene = scene_of(name)
    some = seqopt.scenarios(scene, count=scenarios, seed=3).scenes if scenarios else [scene]
    return [seqopt.make_engine("compliance", each) for each in some]


def rules_of(name, candidates):
    """The rules or the schedule, with candidates near the working end alone."""
    network = engines_of(name, 0)[0].network
    if name == "free":
        return FreeRules(least_grips=1, candidates=candidates)
    makers = {
        "three-robot": three_robot_loop,
        "modified-sequential": modified_sequential,
        "own": lambda network: parse_schedule(network, FOUR_OPEN, "own"),
    }
    schedule = makers[name](network)
    return thin(schedule, candidates) if candidates else schedule


@cache
def state(name, scenarios, mortar, _grips_of):
    """The worst responses of a state in all scenarios; None where it falls or is overloaded."""
    bricks, grips = _grips_of
    rules = FreeRules() if name == "free" else IGNORED
    engines = engines_of(name, scenarios)
    found = [allowed(engine, rules, bricks, grips) for engine in engines]
    if any(each is None for each in found):
        return None
    for engine in engines if mortar else ():
        if verdict(step_assembly(engine.network, bricks, grips), find_mortar(mortar)) is not (
            Verdict.STANDS
        ):
            return None
    return np.max(found, axis=0)


def taken(word, worst):
    """What a goal takes of a state."""
    if word.startswith("sum in"):
        return float(worst[int(word.split()[-1])])
    if word in ("minmax", "sum"):
        return float((worst / SCALES).max())
    return float(worst[(*FOUR, "tolerance").index(word)])


def is_peak(word):
    return word in ("minmax", "tolerance", *FOUR)


def every_path(name, candidates, allow, words):
    """What goals take of every plan that may be the best, by labels or one after the other."""
    if name == "free":
        return free_labels(rules_of(name, candidates), allow, words)
    return scheduled(name, candidates, allow, words)


@cache
def filled(name, candidates):
    """Every plan of a schedule, as its states and what moves take."""
    scene, schedule, out = scene_of(name), rules_of(name, candidates), []
    for nodes in product(*(move.candidates for move in schedule.moves)):
        try:
            steps = schedule.fill(nodes)
        except StepError:
            continue
        regrips = [step.kind is StepKind.REPOSITION for step in steps]
        held = [[s.grips[r] for s in steps if s.grips[r]] for r in range(len(scene.robots))]
        way = sum(distance(scene, *pair) for nodes in held for pair in pairwise(nodes))
        moves = {"steps": float(len(steps)), "regrips": float(sum(regrips)), "travel": way}
        out.append(([(step.bricks, step.grips) for step in steps], moves))
    return out


def scheduled(name, candidates, allow, words):
    for states, moves in filled(name, candidates):
        worst = [allow(*each) for each in states]
        if not any(each is None for each in worst):
            yield tuple(
                moves[word]
                if word in moves
                else (max if is_peak(word) else sum)(taken(word, each) for each in worst)
                for word in words
            )


def free_labels(rules, allow, words):
    """The same of a free schedule: of every state the vectors that none is below in everything."""
    engine = engines_of("free", 0)[0]
    graph, start = whole_graph(engine, rules, last="travel" in words, allow=allow)
    if start not in graph or "end" not in graph:
        return []
    peak = np.array([is_peak(word) for word in words])
    labels = {start: [np.zeros(len(words))]}
    work = [(start, labels[start][0])]
    while work:
        at, known = work.pop()
        if not any(known is each for each in labels[at]):
            continue
        for after in graph[at]:
            add = np.zeros(len(words))
            if after != "end":
                data, worst = graph.edges[at, after], graph.nodes[after]["worst"]
                moves = {"steps": 1.0, "regrips": data["regrip"], "travel": data["way"]}
                add = np.array([moves[w] if w in moves else taken(w, worst) for w in words])
            new = np.where(peak, np.maximum(known, add), known + add)
            old = labels.setdefault(after, [])
            if any((each <= new * (1 + 1e-12)).all() for each in old):
                continue
            labels[after] = [each for each in old if not (new <= each).all()] + [new]
            work.append((after, new))
    return labels.get("end", [])


def best_of(plans, aims, caps):
    """The best values of goals, one after the other, of plans within caps; None of none."""
    left = np.array([p for p in plans if (np.array(p[aims:]) <= np.array(caps) + 1e-12).all()])
    out = []
    for goal in range(aims if len(left) else 0):
        out.append(left[:, goal].min())
        left = left[left[:, goal] <= out[-1] * (1 + 1e-9)]
    return out or None


@given(data=st.data())
@settings(max_examples=8)
@pytest.mark.parametrize("name", ["free", "three-robot", "modified-sequential", "own"])
def test_everything_goes_with_everything(name, data):
    def pick(*some):
        return data.draw(st.sampled_from(some))

    aim, mortar, candidates = pick(*AIMS), pick("", "", "bond=2e4"), pick("", "near:0")
    words, response = tuple(aim.split(",")), pick("T_max", "D_max", "F_largest")
    scenarios = 0 if "sum" in words else pick(0, 2)
    capped = pick("", "travel", "regrips", "steps")
    asked, rules = (*words, capped) if capped else words, rules_of(name, candidates)

    def allow(bricks, grips):
        return state(name, scenarios, mortar, (bricks, grips))

    def limited(bricks, grips):
        worst = allow(bricks, grips)
        most = bound * (1 + LIMIT_TOLERANCE)
        return None if worst is None or worst[FOUR.index(response)] > most else worst

    peaks = [each[-1] for each in every_path(name, candidates, allow, (*asked, response))]
    bound = float(np.quantile(peaks, pick(0.2, 1.0))) if peaks else 1.0
    plans = list(every_path(name, candidates, limited, asked))
    spent = [each[-1] for each in plans]
    caps = [float(np.quantile(spent, pick(0.0, 0.5)))] if capped and plans else []
    best = best_of(plans, len(words), caps)
    unit = "m" if capped == "travel" else ""
    problem = seqopt.pose(
        *(engines_of(name, 0)[0], rules, ONES, aim),
        limits=[Limit(response, bound)],
        budgets=[f"{capped}={cap!r}{unit}" for cap in caps],
        stands=mortar or None,
        scenarios=seqopt.scenarios(scene_of(name), count=scenarios, seed=3) if scenarios else (),
    )
    formulation = find_formulation("schedule_search") if caps else pick(*PLANS)
    agree(problem, formulation, best, len(words))


def agree(problem, formulation, best, aims):
    """A plan is found where there is one; it is the best, or its bound is below that."""
    if best is None:
        with pytest.raises(InfeasibleError) as caught:
            seqopt.solve(problem, formulation)
        assert "\n" not in str(caught.value)
        return
    plan = seqopt.solve(problem, formulation)
    found, bound = plan.selection.objective[:aims], plan.certificate.bounds[:aims]
    if formulation.kind is FormulationKind.EXACT and not problem.budgets:
        assert found == pytest.approx(best, rel=1e-7)
        assert bound == pytest.approx(best, rel=1e-6)
    assert bound[0] <= best[0] * (1 + 1e-9)
    assert found[0] >= best[0] * (1 - 1e-9)


def test_a_plan_that_is_not_the_best_is_seen():
    """The control: another best than that of every path is refused."""
    plans = every_path("own", "", lambda *each: state("own", 0, "", each), ("minmax", "steps"))
    best = best_of(list(plans), 2, [])
    problem = build_states(engines_of("own", 0)[0], rules_of("own", ""), ONES, "minmax,steps")
    agree(problem, PLANS[0], best, 2)
    for wrong in ([0.9 * best[0], best[1]], [1.1 * best[0], best[1]], [best[0], best[1] - 1]):
        with pytest.raises(AssertionError):
            agree(problem, PLANS[0], wrong, 2)
