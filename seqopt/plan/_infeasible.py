"""Why a free schedule is infeasible: the brick at which it stops, and what would help."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, combinations, islice
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Ints
from seqopt.engines.interface import Engine
from seqopt.engines.registry import engine_for, recipe_of
from seqopt.errors import InfeasibleError, NothingFoundError, SeqoptError, SolverError
from seqopt.graph._budgets import within_budgets
from seqopt.graph._explore import Explorer
from seqopt.graph._orders import TooManySetsError
from seqopt.graph.instance import Instance, _Cap
from seqopt.graph.paths import distances, least_peak, least_sum, tied
from seqopt.graph.states.explored import (
    STEPS,
    WORST,
    StandingLook,
    barred,
    bisected,
    explore,
    with_margin,
)
from seqopt.graph.states.states import States
from seqopt.judge._bounds import is_kept, least_within
from seqopt.judge._proof import Proof, TooManyPartsError
from seqopt.network.network import Network
from seqopt.problem.amounts import BUILT_IN, LARGEST, STATE_RESPONSES, worst
from seqopt.problem.filters import IGNORED, STANDING
from seqopt.problem.requirements import Excess, Limit, overloads
from seqopt.problem.standing import Standing
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import (
    PROP_EXCESS,
    _payload_text,
    _plain,
    _rounded_up,
    length_text,
    robot_response,
)
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence._rule_check import RuleBook, unbearable
from seqopt.sequence.methods import _enough_reach
from seqopt.sequence.rules import FREE
from seqopt.sequence.schedule import OpenStep, loads
from seqopt.sequence.steps import Step

PROVEN = 1 - 1e-6  # of a choice that costs nothing and is said to cost this much: there is none


def smallest_conflict(instance: Instance) -> tuple[_Cap, ...]:
    """Return the smallest set of caps proven infeasible together; empty if none is found."""
    counts, nothing = range(1, len(instance.caps) + 1), np.zeros(instance.arcs)
    for some in chain.from_iterable(combinations(instance.caps, count) for count in counts):
        own = instance.graph, nothing, _limited(some), 1.0
        if least_within(*own, laid_down=instance.is_layered)[0] >= PROVEN:
            return some
    return ()


def _limited(caps: Sequence[_Cap]) -> list[tuple[int, float]]:
    return [(cap.column, cap.most) for cap in caps if cap.column is not None]


def claimed(name: str, why: str, *, exact: bool) -> InfeasibleError | NothingFoundError:
    """Return an unproven infeasibility error; ``exact``: the formulation searches all plans."""
    if exact:
        return InfeasibleError(f"claimed by {name}, and not proven: {why}")
    return NothingFoundError(f"{name} found none, and there may be one: {why}")


def refusal(instance: Instance, name: str, *, exact: bool) -> SeqoptError:
    """Return the error that names the caps in conflict; a `SolverError` if a path is feasible.

    ``name``, ``exact``: of the formulation that claims infeasibility, as of `claimed`.
    """
    found = smallest_conflict(instance)
    limited, laid_down = _limited(instance.caps), instance.is_layered
    if not found and is_kept(instance.graph, limited, laid_down=laid_down):
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


def confirmed(
    problem: States, name: str, seconds: float = np.inf, *, exact: bool = True, explain: bool = True
) -> SeqoptError:
    """Return the error that explains why a problem is infeasible, after proving that it is.

    ``name``, ``exact``: of the formulation that claims so, as of `claimed`; ``seconds``: limit of
    proof and search for remedies, s, after which the error is called claimed; ``explain``: whether
    remedies are sought. Result: a `SolverError` if a plan is feasible, a `NothingFoundError` if
    the stability of some states is undecided.
    """
    end, capped = time.perf_counter() + seconds, problem.goals[len(problem.aims) :]
    own = (goal for goal in problem.aims if goal.of_criterion)  # whose values may be infinite
    goals = (*STEPS, *own, *capped)
    steps = replace(_with_any_margin(problem), goals=goals)
    try:
        hint = None
        if barred(steps) is None:
            found = Look(end)(steps)
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
    bare = replace(problem, goals=problem.aims, budgets=(), orders=None)
    why = "no plan is allowed"
    if explain:
        why = _why_impossible(bare, end - time.perf_counter())
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
            spent = within_budgets(graph, problem.budgets).values[-len(problem.budgets) :]
            pairs = zip(problem.goals[-len(spent) :], spent, strict=True)
            one = ", ".join(f"{goal} {value:.6g}" for goal, value in pairs)
            return SolverError(f"formulation {name} {ALLOWED}: {one}")
    said, proven = list[str](), False
    for k, cap in enumerate(problem.budgets, start=len(problem.aims)):
        goal = problem.goals[k]
        if not goal.in_time:
            least = distances(graph, graph.amounts[:, k])[graph.ends].min()
            alone = " by itself" if least <= tied(cap) else ""
            said.append(f"{goal} is at least {least:.6g}{alone}, and {cap:g} is allowed")
            continue
        least = -np.inf if goal.twin is None else goal.twin.least(problem.network, problem.rules)
        if least > tied(cap):
            said.append(f"makespan is at least {least:.6g} s, and {cap:g} s are allowed")
            proven = True
        else:  # what it is at best takes a search
            said.append(f"{cap:g} s of makespan are allowed; --aim makespan finds the least")
    proven = proven or Proof(problem, {level: rows for level, _, rows in states}).is_impossible()
    why = f"{problem.title}: no plan is within all budgets; {', '.join(said)}"
    return InfeasibleError(why) if proven else claimed(name, why, exact=exact)


def _with_any_margin(problem: States) -> States:
    """Return the problem with every margin goal also as a constraint at its worst value."""
    for name in (goal.name for goal in problem.goals if goal.margins):
        problem = with_margin(problem, name, WORST[name])
    return problem


def _why_impossible(problem: States, seconds: float = np.inf) -> str:
    """Return one line: the brick at which all builds stop, and remedies found within ``seconds``.

    Of an engine with a ``rigid`` one the latter is used: loads tried here may be far beyond the
    capacity of joints, where discrete elements take seconds per state.
    """
    engine = getattr(problem.engine, "rigid", problem.engine)
    problem = _with_any_margin(replace(problem, engine=engine))
    look, finished = Look(time.perf_counter() + seconds), False
    where = "no plan is allowed"
    try:
        steps = replace(problem, goals=STEPS)
        if (state := barred(steps)) is not None:
            whole = problem.space.bricks_at(state[0]) == len(problem.network.inner)
            finished = whole and not problem.space.grips(state[1]).any()
            where = _describe_barred(problem, *state, finished=finished)
        else:
            found = look(steps)
            if found.whole and any(goal.of_criterion for goal in problem.aims):
                return f"{problem.title}: criterion {problem.criterion.name} allows no plan"
            where = _where(problem, found.reached)
        return f"{problem.title}: {where}{Remedies(problem, look).said(finished=finished)}"
    except LateError:
        return f"{problem.title}: {where}; time was over before it was known what helps, give more"


def _describe_barred(problem: States, level: int, state: Ints, *, finished: bool) -> str:
    """Describe the infeasible state that every plan passes, and the violated constraint.

    ``finished``: whether it is the finished structure without grips.
    """
    each, falls = problem.each or (problem,), False
    what = f"step {level} of {problem.space.levels}, in which no grip is open,"
    if finished:
        what = "the finished structure, which nobody holds,"
    for one in each:
        if not one.values(level, state)[1].all():
            return f"{what} {_describe_excess(one, level, state)}"
        states, demanded = one.responses(level, state)[0], one.every_filter if one.demands else ()
        falls |= any(f.refuted(states).any() for f in demanded if f.expensive)
    how = "does not stand" if falls else "is not proven to stand"
    demand = next(iter(problem.demands), None)
    return f"{what} {how}{'' if demand is None else f' {demand.said}'}"


def _describe_excess(problem: States, level: int, state: Ints) -> str:
    """Describe the limits that a state exceeds."""
    states, _ = problem.responses(level, state)
    found = states.responses
    named = ((each, found[each.response]) for each in problem.limits if each.response in found)
    over = [
        f"{each.label}={each.shown(float(value[0])):.6g} instead of {each.shown(each.bound):g}"
        for each, value in named
        if each.exceeded(value).any()
    ]
    for each in problem.filters if not over else ():
        if not each.proven(states).all():
            falls = each.refuted(states).any()
            return f"{'does not' if falls else 'is not proven to'} pass the filter {each.name}"
    return f"has {' and '.join(over)}" if over else "asks more of robots than they carry"


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
        problem = replace(problem, goals=STEPS)
        if not problem.demands:
            return self(problem).whole
        return barred(problem) is None and self.standing(problem).exists(problem)

    def standing(self, problem: States) -> StandingLook:
        """Return the states without the stability requirement, which is checked lazily."""
        return StandingLook(replace(problem, goals=STEPS, standing=None, settled=()), self.tell)


OF_ROBOTS = ("rules", "arms")  # filters that leave the finished structure as it is


def worst_least(problem: States, response: str, look: Look | None = None) -> float:
    """Return the least peak of a response over all plans, SI units; infinite if infeasible.

    ``response``: one of `seqopt.problem.problem.STATE_RESPONSES`, or ``bond``.
    """
    asked = replace(problem, goals=(BUILT_IN.get(response) or worst(response),))
    found = (look or Look())(asked)
    return least_peak(found.graph().graph, 0) if found.whole else np.inf


class Remedy(NamedTuple):
    """A relaxation that makes the problem feasible.

    ``name``: the constraint; ``enough``: returns the least sufficient relaxation in words, empty
    if robots would carry more than all loads, by default the name; ``rules``: as command-line
    words, if it is of rules; ``of_arms``: whether it asks for other arms.
    """

    name: str
    enough: Callable[[], str] | None = None
    rules: tuple[str, ...] = ()
    of_arms: bool = False


@dataclass(frozen=True)
class Remedies:
    """The remedies of an infeasible problem; ``look`` decides feasibility."""

    problem: States
    look: Look

    def said(self, *, finished: bool) -> str:
        """Describe the remedies, as the end of a line.

        ``finished``: whether the finished structure without grips is infeasible.
        """
        ways = [*self._alone(finished=finished)]
        if not finished and all(way.of_arms for way in ways):  # of the same arms two rules ask less
            (rules,) = (each for each in self.problem.every_filter if each.name == "rules")
            pairs = (
                (f"{text} together with {other.name}", (text, *other.rules), bool(other.rules))
                for text, problem in rules.ways(self.problem)
                for other in Remedies(problem, self.look)._alone()
                if not (ways and other.of_arms)
            )
            for name, both, of_rules in islice(pairs, 1):
                ways.append(Remedy(name + f" (--rule {' --rule '.join(both)})" * of_rules))
        if not ways and finished:  # no robot can do anything about it
            return "; no robot helps: it needs more bond or friction, less load, or other limits"
        if not ways:
            return ", even if two rules or limits are loosened; extend a reach or add a robot"
        said = (way.enough() if way.enough else way.name for way in ways)
        enough = dict.fromkeys(text for text in said if text)
        if enough:
            return f"; it becomes possible with {' or '.join(enough)}"
        return f"; robots would have to carry more than all weights and loads; {HARD}"

    def _alone(self, *, finished: bool = False) -> Iterator[Remedy]:
        """Yield every single relaxation that suffices; of each rule, and of arms, only the least.

        Then reaches and softer grips with which a plan exists. ``finished``: as of `said`; rules,
        arms and reaches are then left out. Payloads are not asked where no state is held within
        them, and every robot bears its brick.
        """
        problem, scene = self.problem, self.problem.network.scene
        kept = problem.rules.keeps_payloads(stands=False) and problem.demands
        idle = () if kept or _unbearable(problem) else ("payload",)
        done = set[tuple[str, str]]()
        for each in problem.every_filter:
            if each.name in (*idle, *(OF_ROBOTS if finished else ())):
                continue
            for text, relaxed in each.ways(problem):
                key = each.name, text.partition("=")[0] * (each.name == "rules")
                if key not in done and self.look.exists(relaxed):
                    done.add(key)
                    yield self._remedy(each.name, text, relaxed)
        if finished or problem.scenarios or recipe_of(problem.engine) is None:
            return
        if not scene.has_arms:
            reaches = _enough_reach(scene, self._exists_in)
            yield from map(Remedy, reaches)
        if ground_moves(scene) and (soft := self._softer()):
            yield Remedy(soft)

    def _remedy(self, name: str, text: str, relaxed: States) -> Remedy:
        """Return the remedy of a filter, whose relaxation in words is known to suffice."""

        def payload() -> str:  # the least, as the peak force of the problem without payloads
            held = worst_least(relaxed, LARGEST, self.look)
            if held > whole_load(relaxed.network):
                return self._softer()
            said = _payload_text(max(held, _heaviest(self.problem)))
            return f"a payload of {said} N (--payload {said})"

        if name == "rules":
            said = partial(str, f"{text} (--rule {text})")
            return Remedy(text, payload if text == IGNORED else said, (text,))
        enough = dict[str, Callable[[], str]]()
        for limit in self.problem.limits:
            enough[limit.label] = partial(self._enough_limit, limit)
        enough |= {"stands": self._enough_bond, "payload": self._enough_payload}
        return Remedy(text, enough.get(name), of_arms=name == "arms")

    def _softer(self) -> str:
        """Describe the stiffest sufficient grips; empty if none suffice."""
        return softer_grips(self.problem.engine, self._exists_in)

    def _enough_bond(self) -> str:
        """Return the least bond, Pa, with which a plan exists, in words; found by bisection."""
        if any(demand.tilt for demand in self.problem.demands):
            return STANDING
        own, bare = (
            self.problem.standing or Standing(),
            replace(self.problem, settled=(), goals=STEPS),
        )
        states = self.look.standing(bare)

        def exists(bond: float) -> bool:
            asked = states.proving(replace(bare, standing=own.demanding("bond", bond)))
            return barred(asked) is None and states.exists(asked)

        try:
            return f"a bond of {_rounded_up(bisected('bond', exists)[1]):.10g} Pa"
        except InfeasibleError:
            return STANDING

    def _enough_payload(self) -> str:
        """Return the least common payload with which a plan exists, to three digits, in words."""

        def exists(payload: float) -> bool:
            return self.look.exists(self.problem.carrying(payload))

        low = min(robot.payload for robot in self.problem.network.scene.robots)
        high = 2 * low
        while not exists(high):
            low, high = high, 2 * high
        step = 10.0 ** max(0, math.floor(math.log10(high)) - 2)
        least, most = math.floor(low / step), math.ceil(high / step)
        while most - least > 1:
            middle = (least + most) // 2
            least, most = (least, middle) if exists(middle * step) else (middle, most)
        is_free, loaded = self.problem.rules.method == FREE, whole_load(self.problem.network)
        if is_free and most * step > max(loaded, _heaviest(self.problem)):
            return ""
        said = _payload_text(most * step)
        return f"a payload of {said} N (--payload {said})"

    def _enough_limit(self, limit: Limit) -> str:
        """Return the least feasible bound of all limits with a label, in words."""
        found = [each for each in self.problem.limits if each.label == limit.label]
        name, bound = found[0].response, found[0].bound
        if not (name in STATE_RESPONSES or is_tolerance(name)):
            bears = "props that bear any force, both ways"
            return bears if limit.label == PROP_EXCESS else f"no limit on {limit.label}"
        rest = tuple(each for each in self.problem.limits if each not in found)
        least = worst_least(replace(self.problem, limits=rest), name, self.look)
        robots = self.problem.network.scene.robots
        forces = (LARGEST, *(robot_response(r.name) for r in robots))
        if name in forces and least > whole_load(self.problem.network):
            return self._softer()
        if is_tolerance(limit.label):
            return f"a tolerance of {length_text(1 / least)} instead of {length_text(bound)}"
        most = _rounded_up(found[0].shown(least))
        return f"{limit.label}={most:.6g} instead of {found[0].shown(bound):g}"

    def _exists_in(self, scene: Scene) -> bool:
        return self.look.exists(self.problem.in_scene(scene))


def _unbearable(problem: States) -> dict[int, str]:
    """Return the steps in which a robot cannot bear its brick, and why; of rules there are none."""
    steps: Sequence[OpenStep] = getattr(problem.rules, "steps", ())
    return unbearable((problem.network.scene, *problem.worlds), steps, problem.rules.begin)


def _heaviest(problem: States) -> float:
    """Return the heaviest brick of a build by rules, with the tool of any robot of the team, N."""
    rules, scene = problem.free_rules, problem.network.scene
    bricks, team = slice(*sorted(rules.span(scene))), rules.team(scene)
    every = (loads(s, s.robots[r])[bricks] for s in (scene, *problem.worlds) for r in team)
    return max(float(own.max()) for own in every)


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
    book = RuleBook(problem.network, rules, problem.worlds)
    for bricks in left:
        near = [r for r in book.team if book.named(r) and book.newest_nodes[r, bricks]]
        heavy = book.too_heavy(bricks, near)
        if heavy and (bricks == left[0] or not any(book.places(r, bricks) for r in near)):
            return f"{where}: {heavy}"  # the next brick, or one that no robot can lift
    return where


STIFFNESSES = (1e8, 1e7, 1e6, 1e5, 1e4, 1e3)  # of grips, N/m, the stiffest that helps first


def whole_load(network: Network) -> float:
    """Return the sum of the sizes of all weights, loads and wind, N: the most any robot carries."""
    applied = network.applied(len(network.inner))[:, :3]
    return float(np.linalg.norm(np.concatenate([network.weight, applied]), axis=1).sum())


def payload_advice(engine: Engine, steps: Sequence[Step], over: Sequence[Excess]) -> str:
    """Describe remedies of the exceeded payloads of a plan, as of `overloads`."""
    network = engine.network
    held = max((each.largest for each in over if each.brick is None), default=0.0)
    if held <= whole_load(network):
        least = _payload_text(max(each.largest for each in over))
        how = f"--payload {least}, or payload of its robots in the scene file"
        return f"payload of {least} N is enough for this plan: {how}"

    def kept(scene: Scene) -> bool:
        found = overloads(scene, analyze(engine_for(engine, scene), steps))
        return all(each.brick is not None for each in found)  # what is carried stays as heavy

    still = " that hold nodes in place while the ground moves" * ground_moves(network.scene)
    why = f"stiff grips{still}"
    what = f"{held:,.0f} N, {_plain(held / whole_load(network), 3)} times all weights and loads,"
    helps = softer_grips(engine, kept)
    return f"no payload helps: {what} come of {why}; {f'{helps} are enough' if helps else HARD}"


HARD = "softer grips were not found to help; ground that moves less, or softer supports, may"


def ground_moves(scene: Scene) -> bool:
    """Return whether any ground end has a movement."""
    return any(any(ground.movement or ()) for ground in scene.grounds)


def softer_grips(engine: Engine, exists: Callable[[Scene], bool]) -> str:
    """Describe the stiffest sufficient grips below those of the scene; empty if there are none."""
    scene = engine.network.scene
    own = [float(np.min(robot.stiffness)) for robot in scene.robots if robot.stiffness]
    if recipe_of(engine) is None or scene.has_arms:
        return ""
    for stiffness in (each for each in STIFFNESSES if each < min(own, default=np.inf)):
        if exists(scene.with_grips(stiffness)):
            said = f"{stiffness:.0e}".replace("e+0", "e")
            return f"grips of {said} N/m (--grips {said})"
    return ""
