"""Why a problem is infeasible: budgets in conflict, or where builds stop, and what would help.

Every filter says how it is loosened. Each relaxation with which there is a plan is a remedy, and is
named with the least value that is enough, where there is one.
"""

from __future__ import annotations

import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from seqopt.arrays import Ints
from seqopt.errors import InfeasibleError, NothingFoundError, SeqoptError, SolverError
from seqopt.graph._budgets import within_budgets
from seqopt.graph._spaces import (
    FEWEST,
    WORST,
    StandingLook,
    TooManySetsError,
    barred,
    bisected,
    explore,
    with_margin,
)
from seqopt.graph.graph import distances, least_peak, tied
from seqopt.graph.space import Explorer
from seqopt.graph.states import States
from seqopt.judge._proof import Proof, TooManyPartsError
from seqopt.network.network import Network
from seqopt.problem.amounts import BUILT_IN, LARGEST, STATE_RESPONSES, worst
from seqopt.problem.requirements import IGNORED, STANDING, Excess, Limit
from seqopt.responses._tolerance import is_tolerance, value_text
from seqopt.responses.quantities import PROP_EXCESS, _payload_text, _rounded_up, length_text
from seqopt.scene.scene import _hang_free, loads
from seqopt.sequence.rules import FREE, _RuleBook
from seqopt.sequence.rules import _unbearable as too_heavy_steps
from seqopt.sequence.schedule import islands
from seqopt.stability.standing import Standing

PROVEN = 1 - 1e-6  # of a choice that costs nothing and is said to cost this much: there is none


def claimed(name: str, why: str, *, exact: bool) -> InfeasibleError | NothingFoundError:
    """Return an unproven infeasibility error; ``exact``: the formulation searches all plans."""
    if exact:
        return InfeasibleError(f"claimed by {name}, and not proven: {why}")
    return NothingFoundError(f"{name} found none, and there may be one: {why}")


ALLOWED = "says that no plan is allowed, and some are"


def confirmed(
    problem: States, name: str, seconds: float = np.inf, *, exact: bool = True, explain: bool = True
) -> SeqoptError:
    """Return the error that explains why a problem is infeasible, after proving that it is.

    ``name``, ``exact``: as of `claimed`; ``seconds``: of proof and search for remedies, after which
    the error is called claimed; ``explain``: whether remedies are sought. A `SolverError` if a plan
    is feasible, a `NothingFoundError` if the stability of some states is undecided.
    """
    look, capped = Look(time.perf_counter() + seconds), problem.goals[len(problem.aims) :]
    own = (goal for goal in problem.aims if goal.of_criterion)  # whose values may be infinite
    steps = replace(_with_any_margin(problem), goals=(*FEWEST, *own, *capped))
    try:
        hint = None
        if barred(steps) is None:
            found = look(steps)
            if found.whole and problem.paths:
                kept = ", ".join(map(str, problem.paths))
                return claimed(name, f"no plan keeps {kept}; leave it out", exact=exact)
            if found.whole and capped:
                return _over_budget(steps, found, name, exact=exact)
            if found.whole:
                return SolverError(f"formulation {name} {ALLOWED}")
            hint = {level: rows for level, _, rows in found.graph().states}
        proven = Proof(steps, hint).is_impossible()
    except (LateError, TooManySetsError, TooManyPartsError):
        proven = False
    why = "no plan is allowed"
    if explain:
        why = _why_impossible(replace(problem, goals=problem.aims, budgets=(), orders=None), look)
    if problem.orders is not None:
        why = f"no order of the bricks has a plan; in the scene's own, {why}"
    if proven:
        return InfeasibleError(why)
    undecided = sum(each.stability.undecided for each in steps.each or (steps,) if each.demands)
    if undecided:
        return NothingFoundError(f"{undecided} grip sets neither stand nor fall for sure: {why}")
    return claimed(name, why, exact=exact)


def _over_budget(problem: States, found: Explorer, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names the least value of each budget; without budgets plans exist."""
    graph, states = found.graph()
    if not problem.is_timed:
        with suppress(InfeasibleError, NothingFoundError):
            within_budgets(graph, problem.budgets)
            return SolverError(f"formulation {name} {ALLOWED}")
    lines = list[str]()
    for k, cap in enumerate(problem.budgets, start=len(problem.aims)):
        goal = problem.goals[k]
        none = goal.in_time  # a makespan has no least here
        least = -np.inf if none else distances(graph, graph.amounts[:, k])[graph.ends].min()
        alone = " by itself" if least <= tied(cap) else ""
        known = f"{goal} is at least {value_text(goal.name, least)}{alone}, and "
        known = known if np.isfinite(least) else f"--aim {goal} finds its least, and "
        lines.append(f"{known}{value_text(goal.name, cap)} is allowed")
    proven = Proof(problem, {level: rows for level, _, rows in states}).is_impossible()
    why = f"{problem.title}: no plan is within all budgets; {', '.join(lines)}"
    return InfeasibleError(why) if proven else claimed(name, why, exact=exact)


def _with_any_margin(problem: States) -> States:
    """Return the problem with every margin goal also as a constraint at its worst value."""
    for name in (goal.name for goal in problem.goals if goal.margins):
        problem = with_margin(problem, name, WORST[name])
    return problem


class LateError(Exception):
    """The time limit of a search for remedies is reached."""


@dataclass(frozen=True)
class Look:
    """Explores the reachable states of a problem, until ``end``, a time of `time.perf_counter`."""

    end: float = np.inf

    def tell(self, _: Explorer) -> None:
        """Raise a `LateError` after the time limit."""
        if time.perf_counter() > self.end:
            raise LateError

    def __call__(self, problem: States) -> Explorer:
        """Return the explored states of a problem."""
        return explore(problem, tell=self.tell)

    def exists(self, problem: States) -> bool:
        """Return whether a problem is feasible; stability is proven only of the states needed."""
        problem = replace(problem, goals=FEWEST)
        if not problem.demands:
            return self(problem).whole
        return barred(problem) is None and self.standing(problem).exists(problem)

    def standing(self, problem: States) -> StandingLook:
        """Return the states without the stability requirement, which is checked lazily."""
        return StandingLook(replace(problem, goals=FEWEST, standing=None, settled=()), self.tell)

    def least(self, problem: States, response: str) -> float:
        """Return the least peak of a response, or ``bond``, over all plans; infinite if none is."""
        goals = (BUILT_IN.get(response) or worst(response),)
        found = self(replace(problem, goals=goals))
        return least_peak(found.graph().graph, 0) if found.whole else np.inf


def _why_impossible(problem: States, look: Look) -> str:
    """Return one line: the brick at which all builds stop, and remedies found in time.

    Of an engine with a ``rigid`` one the latter is used: loads tried here may be far beyond the
    capacity of joints, where discrete elements take seconds per state.
    """
    engine = getattr(problem.engine, "rigid", problem.engine)
    problem = _with_any_margin(replace(problem, engine=engine))
    where, finished = "no plan is allowed", False
    try:
        steps = replace(problem, goals=FEWEST)
        if (state := barred(steps)) is not None:
            whole = problem.space.bricks_at(state[0]) == len(problem.network.inner)
            finished = whole and not problem.space.grips(state[1]).any()
            what = f"step {state[0]} of {problem.space.levels}, in which no grip is open,"
            what = "the finished structure, which nobody holds," if finished else what
            where = f"{what} {_fault(problem, *state)}"
        else:
            explored = look(steps)
            if explored.whole and any(goal.of_criterion for goal in problem.aims):
                return f"{problem.title}: criterion {problem.criterion.name} allows no plan"
            where = _where(problem, explored.reached)
        ways = [*_ways(problem, look, finished=finished)]
        found = [_enough(problem, look, *way) for way in ways]
        if not finished and all(name == "arms" for name, *_ in ways):
            found += [*islice(_pairs(problem, look, arms=not ways), 1)]
        helps = ", even if two rules or limits are loosened; extend a reach or add a robot"
        if " free: " in where:  # a brick hangs
            helps = "; give another order (--order)"
        if found:
            helps = f"; it becomes possible with {' or '.join(dict.fromkeys(found))}"
            if "--payload" in helps and "--grips" not in helps:
                soft = "; grips that give way (--grips 1e6) may do with a smaller payload"
                helps += soft * problem.network.scene.grip_kinds.rigid
        elif finished:  # nobody holds it
            most = "more bond or friction" if problem.demands else "stiffer joints"
            helps = f"; no robot helps: it needs {most}, less load, or other limits"
        return f"{problem.title}: {where}{helps}"
    except LateError:
        return f"{problem.title}: {where}; time was over before it was known what helps, give more"


def _fault(problem: States, level: int, state: Ints) -> str:
    """Return which limits an infeasible state exceeds, or which filter it does not pass."""
    for one in problem.each or (problem,):
        states = one.seen(level, state)
        known = [(each, states.responses.get(each.response)) for each in one.limits]
        over = [
            f"{each.label}={each.shown(float(value[0])):.6g} instead of {each.shown(each.bound):g}"
            for each, value in known
            if value is not None and each.exceeded(value).any()
        ]
        if over:
            return f"has {' and '.join(over)}"
        for each in one.every_filter:
            if each.name != "payload" and not each.proven(states).all():
                how = "does not" if each.refuted(states).any() else "is not proven to"
                text = f"pass the filter {each.name}"
                if each.name == "stands":
                    text = " ".join(["stand", *(d.said for d in problem.demands[:1])])
                return f"{how} {text}"
    return "asks more of robots than they carry"


def _where(problem: States, reached: int) -> str:
    """Name the step or the brick at which builds stop, and the load there.

    By rules it is the brick that is never placed or removed, and the next that is too heavy.
    """
    placed, space = problem.network.scene.placed, problem.space
    if problem.rules.method != FREE:
        heavy = "".join(f": in step {n} {why}" for n, why in [*_unbearable(problem).items()][:1])
        return f"step {reached + 1} of {space.levels} has no state that is allowed{heavy}"
    rules, end = problem.free_rules, space.bricks_at(space.levels)
    if reached == space.levels:
        return f"after brick {placed[end - 1].name} the build cannot end"
    down, at = rules.takes_down, space.bricks_at(reached) + (not rules.takes_down)
    left, done = (range(at, end, -1), "removed") if down else (range(at, end + 1), "placed")
    where = f"brick {placed[at - 1].name} ({at} of {len(placed)}) is never {done}"
    if hung := [part for part in islands(problem.network, at) if placed[at - 1].name in part]:
        return f"{where}: {_hang_free(hung[0])}"
    book = _RuleBook(problem.network, rules, problem.worlds)
    for bricks in left:
        near = [r for r in book.team if book.named(r) and book.newest_nodes[r, bricks]]
        if not near:
            name = placed[bricks - 1].name
            return f"{where}: of robots that may, none reaches a free node of brick {name}"
        heavy = book.too_heavy(bricks, near)
        if heavy and (bricks == left[0] or not any(book.places(r, bricks) for r in near)):
            return f"{where}: {heavy}"  # the next brick, or one that no robot can lift
    return where


def _unbearable(problem: States) -> dict[int, str]:
    """Return the steps in which a robot cannot bear its brick, and why; of rules there are none."""
    rules = problem.rules
    return too_heavy_steps((problem.network.scene, *problem.worlds), rules.steps, rules.begin)


Way = tuple[str, str, States]  # the filter that is loosened, how in words, and the problem then


def _ways(problem: States, look: Look, *, finished: bool) -> Iterator[Way]:
    """Yield every single relaxation that is enough; of each filter, and each rule, only the least.

    Payloads are not asked where no state is held within them, and every robot bears its brick.
    """
    kept, done = problem.rules.keeps_payloads(stands=False), set[tuple[str, str]]()
    idle = set() if (kept and problem.demands) or _unbearable(problem) else {"payload"}
    idle |= {"rules", "arms"} if finished else set()
    for each in problem.every_filter:
        for text, relaxed in each.ways(problem) if each.name not in idle else ():
            key = each.name, text.partition("=")[0] * (each.name == "rules")
            if key not in done and look.exists(relaxed):
                done.add(key)
                yield each.name, text, relaxed


def _pairs(problem: States, look: Look, *, arms: bool) -> Iterator[str]:
    """Yield a rule with another relaxation that are enough together; ``arms``: these too."""
    rules = next(each for each in problem.every_filter if each.name == "rules")
    for text, relaxed in rules.ways(problem):
        for name, other, both in _ways(relaxed, look, finished=False):
            if other == IGNORED:
                yield f"{text} (--rule {text}) together with a {_payload(relaxed, look, both)}"
            elif (arms or name != "arms") and not (text == IGNORED and name == "rules"):
                how = f" (--rule {text} --rule {other})" if name == "rules" else ""
                yield f"{text} together with {other}{how}"


def _enough(problem: States, look: Look, name: str, text: str, relaxed: States) -> str:
    """Return a relaxation that is enough in words, with its least value; arguments: a `Way`."""
    limits = [each for each in problem.limits if each.label == name]
    if text == IGNORED or name == "payload":
        return f"a {_payload(problem, look, None if name == 'payload' else relaxed)}"
    if name == "rules":
        return f"{text} (--rule {text})"
    if name == "stands" and not any(demand.tilt for demand in problem.demands):
        return _bond(problem, look)
    return _bound(problem, look, limits) if limits else text


NEWTONS = sorted({m * 10**k for k in range(4) for m in range(1, 1000)})  # in three digits


def _payload(problem: States, look: Look, free: States | None) -> str:
    """Return the least payload of all robots in words; ``free``: without any, if one may be."""
    if free is None:
        least: float = min(robot.payload for robot in problem.network.scene.robots)
        first, end = (bisect_left(NEWTONS, each) for each in (least, NEWTONS[-1]))

        def exists(payload: float) -> bool:
            return look.exists(problem.carrying(payload))

        least = NEWTONS[bisect_left(NEWTONS, x=True, lo=min(first, end), hi=end, key=exists)]
    else:
        rules, scene = problem.free_rules, problem.network.scene
        bricks, team = slice(*sorted(rules.span(scene))), rules.team(scene)
        every = (loads(s, s.robots[r])[bricks] for s in (scene, *problem.worlds) for r in team)
        least = max(look.least(free, LARGEST), *(float(own.max()) for own in every))
    text, far = _payload_text(least), _beyond(problem.network, least)
    return f"payload of {text} N (--payload {text}){far}"


def _beyond(network: Network, force: float) -> str:
    """Return a hint where a force is more than all weights, loads and wind; else nothing."""
    applied = network.applied(len(network.inner))[:, :3]
    whole = np.linalg.norm(np.concatenate([network.weight, applied]), axis=1).sum()
    hint = ", more than all weights and loads: softer grips (--grips) may do with less"
    return hint * bool(force > whole)


def _bond(problem: States, look: Look) -> str:
    """Return the least bond, Pa, with which a plan exists, in words; found by bisection."""
    own, bare = problem.standing or Standing(), replace(problem, settled=(), goals=FEWEST)
    states = look.standing(bare)

    def exists(bond: float) -> bool:
        asked = states.proving(replace(bare, standing=own.demanding("bond", bond)))
        return barred(asked) is None and states.exists(asked)

    try:
        return f"a bond of {_rounded_up(bisected('bond', exists)[1]):.10g} Pa"
    except InfeasibleError:
        return STANDING


def _bound(problem: States, look: Look, limits: Sequence[Limit]) -> str:
    """Return the least feasible bound of all limits with one label, in words."""
    name, label, bound = limits[0].response, limits[0].label, limits[0].bound
    if not (name in STATE_RESPONSES or is_tolerance(name)):
        bears = "props that bear any force, both ways"
        return bears if label == PROP_EXCESS else f"no limit on {label}"
    rest = tuple(each for each in problem.limits if each not in limits)
    least = look.least(replace(problem, limits=rest), name)
    if is_tolerance(label):
        return f"a tolerance of {length_text(1 / least)} instead of {length_text(bound)}"
    most = _rounded_up(limits[0].shown(least))
    return f"{label}={most:.6g} instead of {limits[0].shown(bound):g}"


def payload_advice(network: Network, over: Sequence[Excess]) -> str:
    """Return the payload that is enough for a plan that exceeds some, as of `overloads`."""
    force = max(each.largest for each in over)
    least = _payload_text(force)
    how = f"--payload {least}, or payload of its robots in the scene file"
    return f"payload of {least} N is enough for this plan: {how}{_beyond(network, force)}"
