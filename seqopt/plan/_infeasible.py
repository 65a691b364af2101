"""Why a free schedule is impossible: the brick at which it stops, and what would help."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from itertools import chain, combinations, islice
from typing import TYPE_CHECKING

import numpy as np

from seqopt.arrays import Ints
from seqopt.engines.registry import engine_for, recipe_of
from seqopt.errors import InfeasibleError, NothingFoundError, SeqoptError, SolverError
from seqopt.graph._budgets import within_budgets
from seqopt.graph._explore import Explorer
from seqopt.graph.duality import least_sum
from seqopt.graph.instance import Instance, _Cap
from seqopt.graph.paths import distances, least_peak, tied
from seqopt.graph.states._visits import barred, explore
from seqopt.graph.states.states import States
from seqopt.judge._budget_proof import case_of, is_kept, least_within
from seqopt.judge._proof import Proof
from seqopt.judge._twin import twin_of
from seqopt.plan._softer import HARD, _ground_moves, _softer, _whole_load
from seqopt.plan.search._margin_search import STEPS, WORST, StandingLook, bisected, with_margin
from seqopt.problem.problem import LARGEST, STATE_RESPONSES, Goal, Measure
from seqopt.problem.standing import Standing
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import (
    PROP_EXCESS,
    _payload_text,
    _rounded_up,
    length_text,
    robot_response,
)
from seqopt.scene.arm import Arm
from seqopt.scene.scene import Scene
from seqopt.sequence._carrying import loads
from seqopt.sequence._rule_check import RuleBook, unbearable
from seqopt.sequence.rules import FreeRules, Payload
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.two_robots import _enough_reach

if TYPE_CHECKING:
    from seqopt.graph.orders import AllOrders

PROVEN = 1 - 1e-6  # of a choice that costs nothing and is said to cost this much: there is none


def smallest_conflict(instance: Instance) -> tuple[_Cap, ...]:
    """Return the fewest caps of an instance proven to conflict: no path keeps all; or none."""
    counts, nothing = range(1, len(instance.caps) + 1), np.zeros(instance.arcs)
    for some in chain.from_iterable(combinations(instance.caps, count) for count in counts):
        case, sizes = case_of(instance.graph, nothing, _limited(some), 1.0)
        bound, _ = least_within(case, np.zeros_like(sizes), laid_down=instance.is_layered)
        if bound >= PROVEN:
            return some
    return ()


def _limited(caps: Sequence[_Cap]) -> list[tuple[int, float]]:
    return [(cap.column, cap.most) for cap in caps if cap.column is not None]


def claimed(name: str, why: str, *, exact: bool) -> InfeasibleError | NothingFoundError:
    """Return the error of a formulation, not proven; ``exact``: it looks at all plans."""
    if exact:
        return InfeasibleError(f"claimed by {name}, and not proven: {why}")
    return NothingFoundError(f"{name} found none, and there may be one: {why}")


def refusal(instance: Instance, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names the caps in conflict; a `SolverError` where a path keeps all.

    ``name``, ``exact``: of the formulation that says that none does, as of `claimed`.
    """
    found = smallest_conflict(instance)
    if not found and instance.is_layered and is_kept(instance.graph, _limited(instance.caps)):
        return SolverError(
            f"formulation {name} says that no choice is within all budgets, and some are"
        )
    if not found:
        return claimed(name, "no choice is within all budgets; raise a bound", exact=exact)
    if len(found) == 1:
        (cap,) = found
        least = least_sum(instance.graph, instance.amounts[:, cap.column or 0])
        return InfeasibleError(
            f"no choice is within all budgets: every choice uses at least {least:.6g} of "
            f"{cap.name!r}, more than {cap.most:.6g}; raise that bound"
        )
    named = [f"{cap.most:.6g} of {cap.name!r}" for cap in found]
    fewer = "each can alone" if len(found) == 2 else "any fewer of them can"
    return InfeasibleError(
        f"no choice is within all budgets: {', '.join(named[:-1])} and {named[-1]} cannot be kept "
        f"together, though {fewer}; raise one of them"
    )


ALLOWED = "says that no plan is allowed, and some are"
IGNORED = "payload=ignored"
PAYLOADS = "robots that carry more"  # where states must stand, held by what robots carry
LARGE = 1e6  # N
RULES = {field.name for field in fields(FreeRules)}
BOTH = " together with "
STANDING = "no requirement to stand"
PROPS = "props that bear any force, both ways"
CENTERING = "a prop at every brick, if not fewer"
ARMS = "arms that reach more, or stand elsewhere"
APART = "arms that are out of each other's way (slimmer, or elsewhere)"


class _LateError(Exception):
    """Time is over."""


@dataclass(frozen=True)
class Look:
    """Explores the states that plans may pass, until a time of the clock."""

    end: float = np.inf

    def tell(self, _: Explorer) -> None:
        """Raise an error once time is over."""
        if time.perf_counter() > self.end:
            raise _LateError

    def __call__(self, problem: States) -> Explorer:
        """Return the states that plans of a problem may pass."""
        return explore(problem, tell=self.tell)

    def exists(self, problem: States) -> bool:
        """Return whether a problem has a plan; what stands is asked of few of its states."""
        problem = replace(problem, goals=STEPS)
        if not problem.demands:
            return self(problem).whole
        return barred(problem) is None and self.standing(problem).exists(problem)

    def standing(self, problem: States) -> StandingLook:
        """Return the states of a problem, whether they stand or not, of which that is asked."""
        return StandingLook(replace(problem, goals=STEPS, standing=None, settled=()), self.tell)


def confirmed(
    problem: States, name: str, seconds: float = np.inf, *, exact: bool = True, explain: bool = True
) -> SeqoptError:
    """Return the error that says why no plan is allowed, once it is proven that none is.

    ``name``, ``exact``: of the formulation that says so, as of `claimed`; ``seconds``: after which
    what is not proven is called claimed, and no more help is sought; ``explain``: whether help is
    sought at all. Result: a `SolverError` where a plan is allowed, a `NothingFoundError` where it
    is open whether some states stand.
    """
    end, capped = time.perf_counter() + seconds, problem.goals[len(problem.aims) :]
    goals = (*STEPS, *_of_criterion(problem), *capped)
    steps = replace(_with_any_margin(problem), goals=goals)
    try:
        hint = None
        if barred(steps) is None:
            found = Look(end)(steps)
            if found.whole and capped:
                return _over_budget(steps, found, name, exact=exact)
            if found.whole:
                return SolverError(f"formulation {name} {ALLOWED}")
            hint = {level: rows for level, _, rows in found.graph().states}
        proven = Proof(steps, hint).is_impossible()
    except _LateError:
        proven = False
    bare = replace(problem, goals=problem.aims, budgets=())
    why = "no plan is allowed"
    if explain:
        why = _why_impossible(bare, end - time.perf_counter())
    if proven:
        return InfeasibleError(why)
    undecided = sum(each.stability.undecided for each in steps.each or (steps,) if each.demands)
    if undecided:
        return NothingFoundError(f"{undecided} grip sets neither stand nor fall for sure: {why}")
    return claimed(name, why, exact=exact)


def without_order(problem: AllOrders, name: str, seconds: float = np.inf) -> InfeasibleError:
    """Return the error that no order has a plan, which is proven, and why the scene's has none."""
    why = confirmed(problem.planned(problem.scene.build_order), name, seconds)
    return InfeasibleError(f"no order of the bricks has a plan; in the scene's own, {why}")


def _over_budget(problem: States, found: Explorer, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names what each budget needs at least, where plans exist without."""
    graph, states = found.graph()
    if not problem.is_timed:
        with suppress(InfeasibleError, NothingFoundError):
            spent = within_budgets(graph, problem.budgets).values[-len(problem.budgets) :]
            pairs = zip(problem.goals[-len(spent) :], spent, strict=True)
            one = ", ".join(f"{goal} {value:.6g}" for goal, value in pairs)
            return SolverError(f"formulation {name} {ALLOWED}: {one}")
    words, proven = [], False
    for k, cap in enumerate(problem.budgets, start=len(problem.aims)):
        if problem.goals[k].measure is Measure.MAKESPAN:  # what it is at best takes a search
            twin = twin_of(Measure.MAKESPAN)
            least = -np.inf if twin is None else twin.least(problem.network, problem.rules)
            if least > tied(cap):
                proven = True
                words.append(f"makespan is at least {least:.6g} s, and {cap:g} s are allowed")
                continue
            words.append(f"{cap:g} s of makespan are allowed; --aim makespan finds the least")
            continue
        least = distances(graph, graph.amounts[:, k])[graph.ends].min()
        alone = " by itself" if least <= tied(cap) else ""
        words.append(f"{problem.goals[k]} is at least {least:.6g}{alone}, and {cap:g} is allowed")
    proven = proven or Proof(problem, {level: rows for level, _, rows in states}).is_impossible()
    why = f"{problem.title}: no plan is within all budgets; {', '.join(words)}"
    return InfeasibleError(why) if proven else claimed(name, why, exact=exact)


def _with_any_margin(problem: States) -> States:
    """Return a problem in which states must have the margins that are asked for, however little."""
    for name in (goal.response for goal in problem.goals if goal.of_margins):
        problem = with_margin(problem, name, WORST[name])
    return problem


def _of_criterion(problem: States) -> tuple[Goal, ...]:
    """Return the aims that the criterion is asked for, which may forbid states."""
    return tuple(goal for goal in problem.aims if goal.of_states and not goal.response)


def _why_impossible(problem: States, seconds: float = np.inf) -> str:
    """Return the brick at which all builds stop and what would help, known by then, in a line.

    An engine that has a ``rigid`` one leaves this to it: what is tried here may be far beyond what
    joints carry, where discrete elements take seconds a state.
    """
    engine = getattr(problem.engine, "rigid", problem.engine)
    problem = _with_any_margin(replace(problem, engine=engine))
    look = Look(time.perf_counter() + seconds)
    where = "no plan is allowed"
    try:
        steps = replace(problem, goals=STEPS)
        if _of_criterion(problem) and barred(steps) is None and look(steps).whole:
            return f"{problem.title}: criterion {problem.criterion.name} allows no plan"
        where = _where(problem, look)
        return f"{problem.title}: {where}{_what_helps(problem, look)}"
    except _LateError:
        return f"{problem.title}: {where}; time was over before it was known what helps, give more"


def _where(problem: States, look: Look) -> str:
    """Return where all builds stop, and which brick there or later is too heavy to be carried."""
    placed, rules, last = problem.network.scene.placed, problem.rules, problem.space.levels
    if (state := barred(replace(problem, goals=STEPS))) is not None:
        return _barred_said(problem, *state)
    stops = look(replace(problem, goals=STEPS)).reached
    if isinstance(rules, Schedule):
        found = unbearable((problem.network.scene, *problem.worlds), rules.steps, rules.begin)
        heavy = "".join(f": in step {n} {why}" for n, why in [*found.items()][:1])
        return f"step {stops + 1} of {last} has no state that is allowed{heavy}"
    if stops == last:
        return f"after brick {placed[problem.space.bricks_at(last) - 1].name} the build cannot end"
    end = problem.space.bricks_at(last)
    at = problem.space.bricks_at(stops) + (not rules.takes_down)
    left = range(at, end, -1) if rules.takes_down else range(at, end + 1)
    done = "removed" if rules.takes_down else "placed"
    where = f"brick {placed[at - 1].name} ({at} of {len(placed)}) is never {done}"
    return f"{where}{_too_heavy(RuleBook(problem.network, rules, problem.worlds), left)}"


def _too_heavy(book: RuleBook, left: Sequence[int]) -> str:
    """Return which brick is too heavy, as the end of a line: the next, or a later no robot lifts.

    ``left``: brick counts with each brick that is to be carried.
    """
    for bricks in left:
        near = [r for r in book.team if book.named(r) and book.newest_nodes[r, bricks]]
        heavy = book.too_heavy(bricks, near)
        if heavy and (bricks == left[0] or not any(book.places(r, bricks) for r in near)):
            return f": {heavy}"
    return ""


def _heaviest(problem: States) -> float:
    """Return the most that a robot of a free schedule would have to carry, N: its tool as well."""
    rules, scenes = problem.rules, (problem.network.scene, *problem.worlds)
    assert isinstance(rules, FreeRules)
    bricks = slice(*sorted(rules.span(scenes[0])))
    team = rules.team(scenes[0])
    pairs = ((scene, scene.robots[r]) for scene in scenes for r in team)
    return max(float(loads(scene, robot)[bricks].max()) for scene, robot in pairs)


def _barred_said(problem: States, level: int, state: Ints) -> str:
    """Return which state that every plan passes is infeasible, and why, in words."""
    bricks, each = problem.space.bricks_at(level), problem.each or (problem,)
    what = f"step {level} of {problem.space.levels}, in which no grip is open,"
    if _is_bare_end(problem, level, state):
        what = "the finished structure, which nobody holds,"
    for one in each:
        if not one.values(level, state)[1].all():
            return f"{what} {_excess_said(one, level, state)}"
    held = (one.stability.may_stand(bricks, *one._grips(state, stand=True)) for one in each)
    how = "is not proven to stand" if all(map(np.all, held)) else "does not stand"
    demand = next(iter(problem.demands), None)
    return f"{what} {how}{'' if demand is None else f' {demand.said}'}"


def _is_bare_end(problem: States, level: int, state: Ints) -> bool:
    """Return whether a state is the finished structure that nobody holds."""
    whole = problem.space.bricks_at(level) == len(problem.network.inner)
    return whole and not problem.space.grips(state).any()


def _excess_said(problem: States, level: int, state: Ints) -> str:
    """Return which limits a state exceeds, in words."""
    found, _ = problem.responses(level, state)
    named = ((each, found[each.response]) for each in problem.limits if each.response in found)
    over = [
        f"{each.label}={each.shown(float(value[0])):.6g} instead of {each.shown(each.bound):g}"
        for each, value in named
        if each.exceeded(value).any()
    ]
    return f"has {' and '.join(over)}" if over else "asks more of robots than they carry"


def _what_helps(problem: States, look: Look) -> str:
    """Return what opens a way, as the end of a line."""
    state = barred(replace(problem, goals=STEPS))
    if state is not None and _is_bare_end(problem, *state):  # whatever robots do
        ways = [*_supporting(problem, look), *_limiting(problem, look)]
        if not ways:
            return "; no robot helps: it needs more bond or friction, less load, or other limits"
        return f"; it becomes possible with {' or '.join(_enough(problem, w, look) for w in ways)}"
    ways = [*_opening(problem, look)]
    if {*ways} <= {ARMS, APART}:  # of the same arms two rules may ask less
        arms = (ARMS, APART) if ways else ()
        pairs = (
            f"{text}{BOTH}{other}"
            for text, rules in _loosened(problem)
            for other in _opening(replace(problem, rules=rules), look)
            if not other.endswith(arms)
        )
        ways = [*ways, *islice(pairs, 1), *(() if ways else _propped(problem, look))]
    if not ways:
        return ", whatever two rules or limits are loosened; extend a reach or add a robot"
    enough = dict.fromkeys(text for way in ways if (text := _enough(problem, way, look)))
    if enough:
        return f"; it becomes possible with {' or '.join(enough)}"
    return f"; robots would have to carry more than all weights and loads; {HARD}"


def _opening(problem: States, look: Look) -> Iterator[str]:
    """Yield rules, each loosened as little as is enough alone, and limits that alone are enough."""
    problem = replace(problem, goals=STEPS)
    done: set[str] = set()
    for text, rules in _loosened(problem):
        rule = text.partition("=")[0]
        if rule not in done and look.exists(replace(problem, rules=rules)):
            done.add(rule)
            yield text
    yield from _supporting(problem, look)
    scene = problem.network.scene  # robots without arms hold as others with joints that are rigid
    able = scene.has_arms and not scene.grip_kinds.arms.any() and recipe_of(problem.engine)
    if able and look.exists(_with_arms(problem, lambda _: None)):
        alone = _with_arms(problem, lambda arm: arm and replace(arm, keeps_apart=False))
        yield APART if look.exists(alone) else ARMS
    if recipe_of(problem.engine) and not (scene.has_arms or problem.scenarios):
        yield from _enough_reach(scene, lambda other: look.exists(_in_scene(problem, other)))
    yield from _limiting(problem, look)
    if _ground_moves(scene) and not problem.scenarios and (soft := _soft_enough(problem, look)):
        yield soft


def _soft_enough(problem: States, look: Look) -> str:
    """Return with how soft grips there is a plan, in words; empty if with none."""
    return _softer(problem.engine, lambda scene: look.exists(_in_scene(problem, scene)))


def _limiting(problem: States, look: Look) -> Iterator[str]:
    """Yield the limits without which alone there is a plan, by their names."""
    for limit in problem.limits:
        rest = tuple(other for other in problem.limits if other is not limit)
        if look.exists(replace(problem, limits=rest)):
            yield limit.label


def _supporting(problem: States, look: Look) -> Iterator[str]:
    """Yield what alone is enough for states to stand: no need to, or robots that carry more."""
    if problem.demands and look.exists(replace(problem, standing=None, settled=())):
        yield STANDING
    rules, scenes = problem.rules, (problem.network.scene, *problem.worlds)
    if isinstance(rules, Schedule):  # of which grips may hold up more than payloads
        asked = bool(unbearable(scenes, rules.steps, rules.begin))
    else:
        asked = bool(problem.demands) and rules.payload is Payload.KEPT
    if asked and recipe_of(problem.engine) and look.exists(_carrying(problem, LARGE)):
        yield PAYLOADS


def _propped(problem: States, look: Look) -> Iterator[str]:
    """Yield that props help, if one at every brick does."""
    scene, moves = problem.network.scene, problem.rules
    if scene.props or recipe_of(problem.engine) is None or problem.scenarios:
        return
    sites = (moves.begin, moves.finish) if isinstance(moves, FreeRules) else ()
    held = {node for site in sites if site is not None for node in site.holds(scene)}
    props = (prop for prop in scene.with_centering().props if prop.node not in held)
    if look.exists(_in_scene(problem, scene.with_props(*props))):
        yield CENTERING


def _with_arms(problem: States, changed: Callable[[Arm | None], Arm | None]) -> States:
    """Return a problem of robots with other arms, or of what they reach without them."""
    scene = problem.network.scene
    other = scene.with_robots(*(replace(each, arm=changed(each.arm)) for each in scene.robots))
    return _in_scene(replace(problem, scenarios=()), other)


def _in_scene(problem: States, scene: Scene) -> States:
    engine, rules = engine_for(problem.engine, scene), problem.rules
    moves = replace(rules, scene=engine.network.scene) if isinstance(rules, Schedule) else rules
    return replace(problem, engine=engine, rules=moves)


def _loosened(problem: States) -> Iterator[tuple[str, FreeRules]]:
    """Yield the rules that can be loosened: what stands is asked of robots with payloads."""
    own, scene = problem.rules, problem.network.scene
    for text, rules in own.loosened(scene) if isinstance(own, FreeRules) else ():
        if not problem.demands or rules.payload is Payload.KEPT:
            yield text, rules


def _enough(problem: States, way: str, look: Look) -> str:
    """Return how far a limit or a payload has to be raised, where one is loosened."""
    if way == STANDING and not any(demand.tilt for demand in problem.demands):
        own, bare = problem.standing or Standing(), replace(problem, settled=(), goals=STEPS)
        states = look.standing(bare)

        def exists(bond: float) -> bool:
            asked = states.proving(replace(bare, standing=own.demanding("bond", bond)))
            return barred(asked) is None and states.exists(asked)

        try:
            enough = bisected("bond", exists)[1]
        except InfeasibleError:
            return way
        return f"a bond of {_rounded_up(enough):.10g} Pa"
    if way == PAYLOADS:
        return _enough_payload(problem, lambda payload: look.exists(_carrying(problem, payload)))
    if way == IGNORED and isinstance(problem.rules, FreeRules):
        rules = replace(problem.rules, payload=Payload.IGNORED)
        held = worst_least(replace(problem, rules=rules), LARGEST, look)
        if held > _whole_load(problem.network):
            return _soft_enough(problem, look)
        newton = _payload_text(max(held, _heaviest(problem)))
        return f"a payload of {newton} N (--payload {newton})"
    return _enough_limit(problem, way, look)


def _enough_limit(problem: States, way: str, look: Look) -> str:
    """Return how far a limit has to be raised; other ways as they are."""
    found = [limit for limit in problem.limits if limit.label == way]
    if not found:  # with the words of the command line behind it, where it is rules alone
        words = way.split(BOTH)
        known = all(rule.partition("=")[0] in RULES for rule in words)
        return f"{way} (--rule {' --rule '.join(words)})" if known else way
    name = found[0].response
    if not (name in STATE_RESPONSES or is_tolerance(name)):
        return PROPS if way == PROP_EXCESS else f"no limit on {way}"
    rest = tuple(limit for limit in problem.limits if limit not in found)
    least = worst_least(replace(problem, limits=rest), name, look)
    forces = (LARGEST, *(robot_response(r.name) for r in problem.network.scene.robots))
    if name in forces and least > _whole_load(problem.network):
        return _soft_enough(problem, look)
    if is_tolerance(way):
        return f"a tolerance of {length_text(1 / least)} instead of {length_text(found[0].bound)}"
    most, bound = _rounded_up(found[0].shown(least)), found[0].shown(found[0].bound)
    return f"{way}={most:.6g} instead of {bound:g}"


def _carrying(problem: States, payload: float) -> States:
    """Return a problem in which every robot may carry so much, N."""

    def strong(scene: Scene) -> Scene:
        return scene.with_robots(*(replace(r, payload=payload) for r in scene.robots))

    worlds = tuple(engine_for(e, strong(e.network.scene)) for e in problem.scenarios)
    return replace(_in_scene(problem, strong(problem.network.scene)), scenarios=worlds)


def _enough_payload(problem: States, exists: Callable[[float], bool]) -> str:
    """Return the least payload of all robots with which something exists, to three digits."""
    low = min(robot.payload for robot in problem.network.scene.robots)
    high = 2 * low
    while not exists(high):
        low, high = high, 2 * high
    step = 10.0 ** max(0, math.floor(math.log10(high)) - 2)
    least, most = math.floor(low / step), math.ceil(high / step)
    while most - least > 1:
        middle = (least + most) // 2
        least, most = (least, middle) if exists(middle * step) else (middle, most)
    free = isinstance(problem.rules, FreeRules)
    if free and most * step > max(_whole_load(problem.network), _heaviest(problem)):
        return ""
    newton = _payload_text(most * step)
    return f"a payload of {newton} N (--payload {newton})"


LOOK = Look()


def worst_least(problem: States, response: str, look: Look = LOOK) -> float:
    """Return the least peak of a response among plans, SI units; infinite if there is no plan.

    ``response``: one of `seqopt.problem.problem.STATE_RESPONSES`, or ``bond``.
    """
    found = look(replace(problem, goals=(Goal(Measure.PEAK, response),)))
    return least_peak(found.graph().graph, 0) if found.whole else np.inf
