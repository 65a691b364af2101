"""Every amount and every filter is corrupted in the search alone: the judge objects each time.

Of amounts a constant is added, or another column is taken. A filter lets a state through, or leaves
one out of the best plan. Without a corruption the same questions are answered and proven.
"""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

import seqopt
from formulations.times._labels import InTime
from seqopt.graph._spaces import OrderRules, bisected
from seqopt.graph.states import States
from seqopt.problem import Amount, Filter, requirements
from seqopt.problem.amounts import BUILT_IN, find_amount, worst
from seqopt.problem.criteria import CandidateCosts
from seqopt.responses.quantities import OFFERED
from seqopt.sequence._space import FreeSpace, ScheduleSpace
from tests.brute_force import ONES
from tests.builders import small_arch

HELD = seqopt.FreeRules(ending="held")


def few(states):
    """How many robots hold, and a penalty where the first does nothing."""
    return (states.nodes >= 0).sum(axis=1) + 0.25 * (states.bricks % 2)


OWN = Amount("held", few, twin=lambda states: few(states) * 1.0)
AMOUNTS = {
    **{name: BUILT_IN[name] for name in ("minmax", "sum", "steps", "regrips", "travel")},
    **{name: worst(name) for name in ("T_max", "C_max", "D_max", "F_largest")},
    **{name: BUILT_IN[name] for name in ("sum(M_sup)", "sum(F_largest)", "bond", "friction")},
    OWN.name: OWN,
}
OTHERS = {
    "minmax": lambda states: states.responses["T_max"],
    "sum": lambda states: states.responses["M_sup"],
    "steps": lambda moves: moves.regrips,
    "regrips": lambda moves: np.ones(len(moves.regrips)),
    "travel": lambda moves: moves.regrips,
    "held": lambda states: 0.5 * np.ones(len(states.possible)),
}  # columns that are taken in their place; of a response the next one
SPACES = {"loop": (5, None, {}), "free": (4, HELD, {}), "orders": (4, HELD, {"orders": "tied"})}


@cache
def posed(space, amount):
    bricks, rules, words = SPACES[space]
    engine = seqopt.make_engine("compliance", small_arch(bricks))
    moves = rules or seqopt.three_robot_loop(engine.network)
    found = AMOUNTS[amount]
    goals = (found,) if found.is_peak else (found, BUILT_IN["minmax"])
    return seqopt.pose(engine, moves, ONES, goals, **words)


def corrupted(amount, how):
    """An amount of the same name with another function, as a search with an error has it."""
    part = next(n for n in ("states", "moves", "margins") if getattr(amount, n))
    own, next_one = getattr(amount, part), "M_sup" if amount.name == "D_max" else "D_max"
    if how == "a constant added":
        return replace(amount, **{part: lambda *of: own(*of) + 0.5})
    other = OTHERS.get(amount.name, lambda states: 1e5 * states.responses[next_one])
    wanted = {*amount.responses, "T_max", "M_sup", next_one} if amount.states else ()
    return replace(amount, responses=tuple(sorted(wanted)), **{part: other})


def solved(problem):
    """The plan, which an exact search promises to be the best."""
    return seqopt.solve(problem, proof=True)


def is_refused(problem):
    """Whether the judge objects, or the search says that nothing is feasible without a proof."""
    try:
        solved(problem)
    except seqopt.SeqoptError as error:
        return "failed" not in str(error)
    return False


SHIFTS = {"bond": (1e3,), "friction": (-0.1, 0.1)}
MARGINS = [(space, name) for space in SPACES for name in SHIFTS][:-1]  # the last one takes long
PLAIN = [(s, a) for s in SPACES for a in AMOUNTS if s != "loop" or a not in ("steps", "regrips")]
ALIKE = ("C_max", "D_max", "F_largest", "sum(F_largest)")  # responses as T_max and M_sup
PLAIN = [(s, a) for s, a in PLAIN if a not in (*SHIFTS, *(() if s == "free" else ALIKE))]
DAILY = {("orders", "minmax")}
LOOP = ("minmax", "travel", "held")  # of the free schedule more are seen every day


def params(cases):
    """Cases, of which those that take long wait."""
    for space, amount, *more in cases:
        daily = (space, amount) in DAILY or (space == "free" and amount not in {*SHIFTS, *ALIKE})
        daily |= space == "loop" and amount in LOOP
        yield pytest.param(space, amount, *more, marks=[pytest.mark.slow] * (not daily))


@cache
def control(space, amount):
    """What is not corrupted is proven."""
    return str(solved(posed(space, amount)).status) == "optimal"


@pytest.mark.parametrize("how", ["a constant added", "another column"])
@pytest.mark.parametrize(("space", "amount"), [*params(PLAIN)])
def test_a_corrupted_amount_is_seen(space, amount, how, monkeypatch):
    assert control(space, amount)
    problem = posed(space, amount)
    wrong = corrupted(problem.goals[0], how)
    if wrong.of_criterion:  # the search asks the criterion itself
        monkeypatch.setattr(States, "costs", lambda self, level, states: wrong.states(states))
    assert is_refused(replace(problem, goals=(wrong, *problem.goals[1:])))


@pytest.mark.parametrize(
    ("space", "amount", "shift"), [*params((*e, by) for e in MARGINS for by in SHIFTS[e[1]])]
)
def test_a_margin_that_the_search_gets_wrong_is_seen(space, amount, shift, monkeypatch):
    assert control(space, amount)

    def wrong(name, exists):
        return tuple(value + shift for value in bisected(name, exists))

    monkeypatch.setattr("seqopt.graph._spaces.bisected", wrong)
    assert is_refused(posed(space, amount))


ENDS_FIRST = {"lost": lambda self, placed: (1, 4) if not {1, 4} <= placed else (2, 3)}
UNTIED = {"let through": lambda self, placed: self.scene.build_order if placed else (2,)}


@pytest.mark.parametrize("wrong", [ENDS_FIRST, UNTIED], ids=lambda wrong: next(iter(wrong)))
def test_orders_that_the_search_gets_wrong_are_seen(wrong, monkeypatch):
    """All orders but those from both ends are lost, or one is let through that nothing ties."""
    assert control("orders", "D_max")
    ((_, follow),) = wrong.items()

    def next_bricks(rules, placed):
        return tuple(brick for brick in follow(rules, placed) if brick not in placed)

    monkeypatch.setattr(OrderRules, "next_bricks", next_bricks)
    assert is_refused(replace(posed("orders", "D_max")))


def test_every_amount_is_attacked():
    """Those that are left out are like others, or of time, which is judged with times."""
    left = {*BUILT_IN} - {*AMOUNTS} - {f"sum({name})" for name in BUILT_IN}
    assert left - {*OFFERED} == {"tilt", "tolerance"}
    assert find_amount("makespan").in_time


# filters: each decides a question, is then forgotten, or refuses one state of the best plan
FREE_NODE = {"loop": 3, "free": 6, "orders": 3}  # that best plans hold
TOTAL = "sum(F_largest)"  # of which there are few plans as good
STANDS = {"loop": "bond=3500", "free": "dry", "orders": "dry"}
KINDS = ("limit", "own", "stands", "payload", "rules")
SLOW = {("loop", "stands"), *(("orders", kind) for kind in KINDS)}
FILTERS = [
    pytest.param(s, k, marks=[pytest.mark.slow] * ((s, k) in SLOW))
    for s in SPACES
    for k in KINDS
    if s != "loop" or k not in ("payload", "rules")
]


def base(space, aim="F_largest"):
    """The best plan that no filter rules out."""
    return solved(scened(space).but(goals=aim))


@cache
def scened(space, payload=None):
    scene, (_, rules, words) = small_arch(6 if space == "loop" else 4), SPACES[space]
    if space == "orders":  # the mirrored order is as good in one that is symmetric
        scene = seqopt.arch_scene(seqopt.ArchShape(pitch=[1.3, 0.5, -0.3, -1.2]))
    if payload is not None:
        scene = scene.with_robots(*(replace(robot, payload=payload) for robot in scene.robots))
    engine = seqopt.make_engine("compliance", scene)
    moves = rules or seqopt.three_robot_loop(engine.network)
    return seqopt.pose(engine, moves, ONES, "F_largest", **words)


@cache
def filtered(space, kind):
    """A question that the filter of a kind decides."""
    problem = scened(space)
    if kind == "limit":
        return problem.but(limits=(seqopt.Limit("T_max", 0.999 * largest(base(space), "F_max_N")),))
    if kind == "stands":
        return problem.but(stands=STANDS[space])
    if kind == "payload":
        force = base(space, TOTAL).responses().filter(regex="F_rob").abs().max(axis=None)
        return scened(space, 0.999 * force).but(goals=TOTAL)
    node = FREE_NODE[space]
    own = Filter("a node is free", partial(is_free, node), twin=partial(is_held, node))
    return replace(problem, filters=(own,)) if kind == "own" else problem


def largest(plan, column):
    return float(plan.responses()[column].max())


def is_free(node, states):
    return (states.nodes != node).all(axis=1)


def is_held(node, states):
    """The same refused, written a second time."""
    return np.count_nonzero(states.nodes == node, axis=1) > 0


def found(problem):
    plan = solved(problem)
    return plan.certificate.values[0], plan.steps


@cache
def best(space, kind):
    """The best plan that keeps a filter."""
    return found(filtered(space, kind))


def alike(step, bricks, nodes):
    """Which states with so many bricks hold the nodes of a step, whoever does."""
    if step.bricks != bricks:
        return np.zeros(len(nodes), dtype=bool)
    held = [node for node in step.grips if node is not None]
    here = np.isin(nodes, held).sum(axis=1) == len(held)
    return here & ((nodes != -1).sum(axis=1) == len(held))


def corrupt(monkeypatch, problem, kind, change):
    """Change what the search asks; ``change``: of what passes, bricks and nodes (n, r)."""

    def of_filter(part):
        own = part.proven
        return replace(part, passes=lambda s: change(own(s), s.bricks, s.nodes))

    def of_method(holder, name, bricks_at):
        own = getattr(holder, name)

        def changed(self, at, states, *more):
            numbers = np.array([-1, *self.network.scene.placed_nodes])
            robots = (getattr(self, "space", None) or self).robots
            nodes = numbers[states[:, :robots].clip(min=0)]
            return change(own(self, at, states, *more), bricks_at(self, at), nodes)

        monkeypatch.setattr(holder, name, changed)

    if kind == "own":
        return replace(problem, filters=tuple(map(of_filter, problem.filters)))
    if kind in ("limit", "payload"):
        name = f"_{kind}s_filter" if kind == "payload" else f"_{kind}_filter"
        own = getattr(requirements, name)
        monkeypatch.setattr(requirements, name, lambda *of: of_filter(own(*of)))
    elif kind == "stands":
        of_method(States, "stand", lambda self, level: self.space.bricks_at(level))
        monkeypatch.setattr(States, "recalled", lambda self, level, states: np.zeros(len(states)))
    else:
        of_method(FreeSpace, "_lawful", lambda self, bricks: bricks)
    return replace(problem)


@pytest.mark.parametrize(("space", "kind"), FILTERS)
def test_each_filter_decides_and_is_kept(space, kind):
    """A control: with it another plan is best, which the judge accepts."""
    value = best(space, kind)[0]
    free = found(filtered(space, kind).but(limits=(), stands=None))[0]
    assert value > free if kind in ("limit", "stands") else value > 0


@pytest.mark.parametrize(("space", "kind"), FILTERS)
def test_a_state_that_is_let_through_is_seen(space, kind, monkeypatch):
    problem = corrupt(monkeypatch, filtered(space, kind), kind, lambda ok, *_: np.ones_like(ok))
    assert is_refused(problem)


@pytest.mark.parametrize(("space", "kind"), FILTERS)
def test_a_state_that_is_left_out_is_missed(space, kind, monkeypatch):
    """Whatever state of the best plan: a plan as good is found, or the judge finds a better."""
    value, steps = best(space, kind)
    for step in steps[:0:-1]:
        with monkeypatch.context() as patch:
            own = corrupt(
                patch,
                filtered(space, kind),
                kind,
                lambda ok, bricks, nodes, step=step: ok & ~alike(step, bricks, nodes),
            )
            if is_refused(own):
                return
            assert found(own)[0] == pytest.approx(value, rel=1e-9)
    raise AssertionError("no state of the best plan was missed")


# candidates of open grips, whose ranks are those among all of them
RANKS = replace(seqopt.CRITERIA["equations-2-3"], name="ranks")


@cache
def ranked():
    engine = seqopt.make_engine("compliance", small_arch(5))
    return seqopt.pose(engine, seqopt.three_robot_loop(engine.network), RANKS)


@cache
def best_ranked():
    return solved(ranked())


def test_ranks_that_are_not_attacked_are_proven():
    assert str(best_ranked().status) == "optimal"


def among(monkeypatch, change):
    """Change costs among candidates in the search; ``change``: of level, states and costs."""
    own = CandidateCosts.among

    def changed(self, level, states, **how):
        return change(level, states, own(self, level, states, **how))

    monkeypatch.setattr(CandidateCosts, "among", changed)


@pytest.mark.parametrize("shift", [0.5, -0.5])
def test_a_constant_added_to_candidates_is_seen(shift, monkeypatch):
    among(monkeypatch, lambda _, __, costs: costs + shift * (costs > 0))
    assert is_refused(replace(ranked()))


def test_ranks_of_other_candidates_are_seen(monkeypatch):
    own = CandidateCosts._relative
    monkeypatch.setattr(CandidateCosts, "_relative", lambda *of, **how: own(*of, **how)[::-1])
    assert is_refused(replace(ranked()))


@pytest.mark.parametrize("level", [3, 4, 8])
def test_ranks_without_a_candidate_are_seen(level, monkeypatch):
    """One that is possible is not ranked, so that others are less far behind."""
    own = ScheduleSpace.candidates

    def fewer(self, at):
        found = own(self, at)
        if at != level:
            return found
        possible = found.possible.copy()
        possible[np.unravel_index(np.flatnonzero(possible)[0], possible.shape)] = False
        return found._replace(possible=possible, states=found.states[1:])

    monkeypatch.setattr(ScheduleSpace, "candidates", fewer)
    assert is_refused(replace(ranked()))


@pytest.mark.slow
def test_a_candidate_that_is_left_out_is_missed(monkeypatch):
    """Whichever of the best plan: a plan as good is found, or the judge finds a better."""
    value, met = best_ranked().certificate.values[0], 0
    for at, *row in best_ranked().selection.states:
        with monkeypatch.context() as patch:

            def lost(level, states, costs, at=at, row=row):
                gone = (level == at) & (states == row).all(axis=1)
                return np.where(gone, np.inf, costs)

            among(patch, lost)
            if is_refused(replace(ranked())):
                met += 1
            else:
                assert found(replace(ranked()))[0] == pytest.approx(value, rel=1e-9)
    assert met > 5


def test_a_candidate_that_is_let_through_is_seen(monkeypatch):
    """Two robots on one node, which is ranked with the others."""
    monkeypatch.setattr(ScheduleSpace, "_possible", lambda self, step, states: states[:, 0] >= 0)
    assert is_refused(replace(ranked()))


# robots' readiness, the resource of makespans: what depends on the path so far
DURATIONS = "fetch=30,place=10,approach=10,grip=5,release=5"


@cache
def in_time():
    engine = seqopt.make_engine("compliance", small_arch(4).with_durations(DURATIONS))
    return seqopt.pose(engine, HELD, ONES, "makespan")


def with_readiness(monkeypatch, change):
    """Whether the judge objects, or does not call it optimal, where readiness is changed."""
    own = InTime.extend

    def changed(self, arc, values):
        return change(self, arc, own(self, arc, values))

    monkeypatch.setattr(InTime, "extend", changed)
    try:
        plan = seqopt.solve(replace(in_time()))
    except seqopt.SeqoptError as error:
        return "failed" not in str(error)
    return str(plan.status) != "optimal"


def added(_, __, values):
    out = values.copy()
    out[:, 0] += 1.0
    return out


def let_through(_, __, values):
    """Robots that let go are ready at once."""
    out = values.copy()
    out[:, 1:] = 0.0
    return out


@pytest.mark.parametrize(
    ("change", "seen"), [(lambda _, __, v: v, False), (added, True), (let_through, True)]
)
def test_a_corrupted_readiness_is_seen(change, seen, monkeypatch):
    assert with_readiness(monkeypatch, change) is seen


def test_readiness_of_a_state_that_is_left_out_is_missed(monkeypatch):
    """Whatever state of the best plan: a plan as good is found, or the judge finds a better."""
    met = False
    for state in range(1, 40):
        with monkeypatch.context() as patch:

            def lost(self, arc, values, state=state):
                gone = (self._after[arc] == state)[:, None]
                return np.where(gone, np.inf, values)

            met = with_readiness(patch, lost)
        if met:
            break
    assert met
