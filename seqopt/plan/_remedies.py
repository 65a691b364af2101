"""Remedies of infeasible problems: constraints to relax, and the least sufficient relaxation.

Every filter lists its relaxations: rules, standing, payloads, arms, limits and others. In addition
reaches and grips are tried. A remedy counts if it alone makes the problem feasible.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice
from math import inf

import numpy as np

from seqopt.engines.registry import recipe_of
from seqopt.errors import InfeasibleError
from seqopt.graph._explore import Explorer
from seqopt.graph.paths import least_peak
from seqopt.graph.states.explored import STEPS, StandingLook, barred, bisected, explore
from seqopt.graph.states.states import States
from seqopt.plan._softer import HARD, ground_moves, softer_grips, whole_load
from seqopt.problem.amounts import BUILT_IN, LARGEST, STATE_RESPONSES, worst
from seqopt.problem.filters import IGNORED, STANDING
from seqopt.problem.requirements import Limit
from seqopt.problem.standing import Standing
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import (
    PROP_EXCESS,
    _payload_text,
    _rounded_up,
    length_text,
    robot_response,
)
from seqopt.scene.scene import Scene
from seqopt.sequence._rule_check import RuleBook, unbearable
from seqopt.sequence._rule_space import loads
from seqopt.sequence.methods import _enough_reach
from seqopt.sequence.rules import FreeRules, Payload
from seqopt.sequence.schedule import Schedule


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


LOOK = Look()


def worst_least(problem: States, response: str, look: Look = LOOK) -> float:
    """Return the least peak of a response over all plans, SI units; infinite if infeasible.

    ``response``: one of `seqopt.problem.problem.STATE_RESPONSES`, or ``bond``.
    """
    found = look(replace(problem, goals=(BUILT_IN.get(response) or worst(response),)))
    return least_peak(found.graph().graph, 0) if found.whole else np.inf


@dataclass(frozen=True)
class Remedy:
    """A relaxation that makes the problem feasible.

    ``name``: the constraint; ``enough``: returns the least sufficient relaxation in words, empty
    if robots would carry more than all loads; ``rules``: as command-line words, if it is of rules.
    """

    name: str
    enough: Callable[[], str]
    rules: tuple[str, ...] = ()
    of_arms: bool = False

    def beside(self, rule: str) -> Remedy:
        """Return the remedy combined with a relaxed rule."""
        name, rules = f"{rule} together with {self.name}", (rule, *self.rules)
        typed = f"{name} (--rule {' --rule '.join(rules)})" if self.rules else name
        return Remedy(name, lambda: typed, rules if self.rules else ())


@dataclass(frozen=True)
class Remedies:
    """The remedies of an infeasible problem; ``look`` decides feasibility."""

    problem: States
    look: Look

    def said(self, *, finished: bool) -> str:
        """Describe the remedies, as the end of a line.

        ``finished``: whether the finished structure without grips is infeasible.
        """
        if finished:  # no robot can do anything about it
            ways = [*self._stronger(), *self._limits()]
            if not ways:
                return (
                    "; no robot helps: it needs more bond or friction, less load, or other limits"
                )
        else:
            ways = [*self._alone()]
            if all(way.of_arms for way in ways):  # of the same arms two rules may ask less
                ways += [*islice(self._in_pairs(ways), 1), *(() if ways else self._props())]
            if not ways:
                return ", whatever two rules or limits are loosened; extend a reach or add a robot"
        enough = dict.fromkeys(text for way in ways if (text := way.enough()))
        if enough:
            return f"; it becomes possible with {' or '.join(enough)}"
        return f"; robots would have to carry more than all weights and loads; {HARD}"

    def _alone(self) -> Iterator[Remedy]:
        """Yield every single relaxation that suffices; of each rule only the least."""
        done: set[str] = set()
        for _, text, problem in self._ways("rules"):
            rule, _, _ = text.partition("=")
            if rule not in done and self.look.exists(problem):
                done.add(rule)
                enough = partial(str, f"{text} (--rule {text})")
                if text == IGNORED:
                    enough = partial(self._payload_if_ignored, problem)
                yield Remedy(text, enough, (text,))
        yield from self._stronger()
        arms = (text for _, text, problem in self._ways("arms") if self.look.exists(problem))
        yield from (_as_it_is(text, of_arms=True) for text in islice(arms, 1))
        scene = self._scene
        if self._is_made and not (scene.has_arms or self.problem.scenarios):
            yield from map(_as_it_is, _enough_reach(scene, self._exists_in))
        yield from self._limits()
        moves = ground_moves(scene) and not self.problem.scenarios
        if moves and (soft := self._softer()):
            yield _as_it_is(soft)

    def _in_pairs(self, alone: list[Remedy]) -> Iterator[Remedy]:
        """Yield pairs of a relaxed rule and a remedy; other arms only if insufficient alone."""
        for _, text, problem in self._ways("rules"):
            for other in Remedies(problem, self.look)._alone():
                if not (alone and other.of_arms):
                    yield other.beside(text)

    def _ways(self, *names: str) -> Iterator[tuple[str, str, States]]:
        """Yield relaxations of a kind of filter: name, words, and the relaxed problem."""
        for each in self.problem.every_filter:
            if each.name in names:
                yield from ((each.name, *way) for way in each.ways(self.problem))

    def _payload_if_ignored(self, problem: States) -> str:
        """Return the least payload, as the peak force of a problem without payloads; in words."""
        held = worst_least(problem, LARGEST, self.look)
        if held > whole_load(problem.network):
            return self._softer()
        return _payload_said(max(held, self._stops.heaviest))

    def _stronger(self) -> Iterator[Remedy]:
        """Yield relaxations of stability and payload that suffice alone."""
        enough = {"stands": self._enough_bond}
        enough |= {"payload": self._enough_payload} if self._stops.asks_payload else {}
        for name, text, problem in self._ways(*enough):
            if self.look.exists(problem):
                yield Remedy(text, enough[name])

    def _limits(self) -> Iterator[Remedy]:
        """Yield the limits, and filters of plug-ins, whose removal alone suffices."""
        labels = {limit.label: limit for limit in self.problem.limits}
        for name, text, problem in self._ways(*labels, *map(str, self.problem.filters)):
            if self.look.exists(problem):
                raised = partial(self._enough_limit, labels[name]) if name in labels else None
                yield _as_it_is(text) if raised is None else Remedy(text, raised)

    def _props(self) -> Iterator[Remedy]:
        """Yield props as a remedy, if one at every brick suffices."""
        scene = self._scene
        if scene.props or not self._is_made or self.problem.scenarios:
            return
        props = [p for p in scene.with_centering().props if p.node not in self._stops.held_at_ends]
        if self._exists_in(scene.with_props(*props)):
            yield _as_it_is("a prop at every brick, if not fewer")

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

        low = min(robot.payload for robot in self._scene.robots)
        high = 2 * low
        while not exists(high):
            low, high = high, 2 * high
        step = 10.0 ** max(0, math.floor(math.log10(high)) - 2)
        least, most = math.floor(low / step), math.ceil(high / step)
        while most - least > 1:
            middle = (least + most) // 2
            least, most = (least, middle) if exists(middle * step) else (middle, most)
        if most * step > max(whole_load(self.problem.network), self._stops.heaviest):
            return ""
        return _payload_said(most * step)

    def _enough_limit(self, limit: Limit) -> str:
        """Return the least feasible bound of all limits with a label, in words."""
        found = [each for each in self.problem.limits if each.label == limit.label]
        name, bound = found[0].response, found[0].bound
        if not (name in STATE_RESPONSES or is_tolerance(name)):
            bears = "props that bear any force, both ways"
            return bears if limit.label == PROP_EXCESS else f"no limit on {limit.label}"
        rest = tuple(each for each in self.problem.limits if each not in found)
        least = worst_least(replace(self.problem, limits=rest), name, self.look)
        forces = (LARGEST, *(robot_response(r.name) for r in self._scene.robots))
        if name in forces and least > whole_load(self.problem.network):
            return self._softer()
        if is_tolerance(limit.label):
            return f"a tolerance of {length_text(1 / least)} instead of {length_text(bound)}"
        most = _rounded_up(found[0].shown(least))
        return f"{limit.label}={most:.6g} instead of {found[0].shown(bound):g}"

    @property
    def _scene(self) -> Scene:
        return self.problem.network.scene

    @property
    def _is_made(self) -> bool:
        """Whether the engine can be rebuilt for another scene."""
        return recipe_of(self.problem.engine) is not None

    @cached_property
    def _stops(self) -> Stops:
        return stops_of(self.problem)

    def _exists_in(self, scene: Scene) -> bool:
        return self.look.exists(self.problem.in_scene(scene))


def _as_it_is(words: str, *, of_arms: bool = False) -> Remedy:
    return Remedy(words, lambda: words, of_arms=of_arms)


def _payload_said(newton: float) -> str:
    said = _payload_text(newton)
    return f"a payload of {said} N (--payload {said})"


@dataclass(frozen=True)
class StepStops:
    """Where the steps of a schedule stop: its grips may carry more than payloads."""

    problem: States
    schedule: Schedule
    scenes: tuple[Scene, ...]
    heaviest: float = inf
    held_at_ends: frozenset[int] = frozenset()

    @property
    def asks_payload(self) -> bool:
        """Whether some robot cannot bear a brick that it places or takes away."""
        return bool(self._unbearable)

    @cached_property
    def _unbearable(self) -> dict[int, str]:
        return unbearable(self.scenes, self.schedule.steps, self.schedule.begin)

    def where(self, reached: int) -> str:
        """Name the first step without a feasible state, and a robot that cannot carry its brick."""
        heavy = "".join(f": in step {n} {why}" for n, why in [*self._unbearable.items()][:1])
        last = self.problem.space.levels
        return f"step {reached + 1} of {last} has no state that is allowed{heavy}"


@dataclass(frozen=True)
class RuleStops:
    """Where builds by rules stop."""

    problem: States
    rules: FreeRules
    scenes: tuple[Scene, ...]

    @cached_property
    def heaviest(self) -> float:
        """The heaviest brick of the build, with the tool of any robot of the team, N."""
        bricks = slice(*sorted(self.rules.span(self.scenes[0])))
        team = self.rules.team(self.scenes[0])
        pairs = ((scene, scene.robots[r]) for scene in self.scenes for r in team)
        return max(float(loads(scene, robot)[bricks].max()) for scene, robot in pairs)

    @property
    def held_at_ends(self) -> frozenset[int]:
        """Nodes that are held where builds begin or end."""
        sites = [site for site in (self.rules.begin, self.rules.finish) if site is not None]
        return frozenset(n for site in sites for n in site.holds(self.scenes[0]) if n is not None)

    @property
    def asks_payload(self) -> bool:
        """Whether states must stand, held by what robots carry."""
        return bool(self.problem.demands) and self.rules.payload is Payload.KEPT

    def where(self, reached: int) -> str:
        """Name the brick that is never placed or removed, and the next that is too heavy."""
        placed, space = self.scenes[0].placed, self.problem.space
        end, down = space.bricks_at(space.levels), self.rules.takes_down
        if reached == space.levels:
            return f"after brick {placed[end - 1].name} the build cannot end"
        at = space.bricks_at(reached) + (not down)
        left = range(at, end, -1) if down else range(at, end + 1)
        done = "removed" if down else "placed"
        where = f"brick {placed[at - 1].name} ({at} of {len(placed)}) is never {done}"
        book = RuleBook(self.problem.network, self.rules, self.problem.worlds)
        for bricks in left:
            near = [r for r in book.team if book.named(r) and book.newest_nodes[r, bricks]]
            heavy = book.too_heavy(bricks, near)
            if heavy and (bricks == left[0] or not any(book.places(r, bricks) for r in near)):
                return f"{where}: {heavy}"  # the next brick, or one that no robot can lift
        return where


Stops = StepStops | RuleStops


def stops_of(problem: States) -> Stops:
    """Return the stops of a problem, by the kind of its schedule."""
    rules, scenes = problem.rules, (problem.network.scene, *problem.worlds)
    if isinstance(rules, Schedule):
        return StepStops(problem, rules, scenes)
    return RuleStops(problem, rules, scenes)
