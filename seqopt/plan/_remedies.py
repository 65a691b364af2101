"""What can be loosened in a problem without a plan, and how little of it is enough.

Every filter says how it can be loosened: rules, standing, payloads, arms, limits and others. Beside
them reaches and grips are tried. A remedy counts where a plan exists with it alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice

import numpy as np

from seqopt.engines.registry import recipe_of
from seqopt.errors import InfeasibleError
from seqopt.graph._explore import Explorer
from seqopt.graph.paths import least_peak
from seqopt.graph.states.explored import barred, explore
from seqopt.graph.states.states import States
from seqopt.plan._softer import HARD, ground_moves, softer_grips, whole_load
from seqopt.plan._stops import Stops, stops_of
from seqopt.plan.search._margin_search import STEPS, StandingLook, bisected
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
from seqopt.sequence.two_robots import _enough_reach


class LateError(Exception):
    """Time is over."""


@dataclass(frozen=True)
class Look:
    """Explores the states that plans may pass, until a time of the clock."""

    end: float = np.inf

    def tell(self, _: Explorer) -> None:
        """Raise an error once time is over."""
        if time.perf_counter() > self.end:
            raise LateError

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


LOOK = Look()


def worst_least(problem: States, response: str, look: Look = LOOK) -> float:
    """Return the least peak of a response among plans, SI units; infinite if there is no plan.

    ``response``: one of `seqopt.problem.problem.STATE_RESPONSES`, or ``bond``.
    """
    found = look(replace(problem, goals=(BUILT_IN.get(response) or worst(response),)))
    return least_peak(found.graph().graph, 0) if found.whole else np.inf


@dataclass(frozen=True)
class Remedy:
    """What opens a way alone.

    ``name``: what it is; ``enough``: returns how little of it is enough, in words, empty where
    robots would have to carry too much; ``rules``: in words of the command line, if it is these.
    """

    name: str
    enough: Callable[[], str]
    rules: tuple[str, ...] = ()
    of_arms: bool = False

    def beside(self, rule: str) -> Remedy:
        """Return the remedy together with a rule that is loosened."""
        name, rules = f"{rule} together with {self.name}", (rule, *self.rules)
        typed = f"{name} (--rule {' --rule '.join(rules)})" if self.rules else name
        return Remedy(name, lambda: typed, rules if self.rules else ())


@dataclass(frozen=True)
class Remedies:
    """What opens a way in a problem without a plan, where ``look`` finds one."""

    problem: States
    look: Look

    def said(self, *, finished: bool) -> str:
        """Return what helps, as the end of a line.

        ``finished``: whether the finished structure, which nobody holds, is infeasible.
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
        """Yield rules, each loosened as little as is enough alone, and all else that is enough."""
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
        yield from self._arms()
        scene = self._scene
        if self._is_made and not (scene.has_arms or self.problem.scenarios):
            yield from map(_as_it_is, _enough_reach(scene, self._exists_in))
        yield from self._limits()
        moves = ground_moves(scene) and not self.problem.scenarios
        if moves and (soft := self._softer()):
            yield _as_it_is(soft)

    def _in_pairs(self, alone: list[Remedy]) -> Iterator[Remedy]:
        """Yield what opens a way together with a rule; other arms only where they do not alone."""
        for _, text, problem in self._ways("rules"):
            for other in Remedies(problem, self.look)._alone():
                if not (alone and other.of_arms):
                    yield other.beside(text)

    def _ways(self, *names: str) -> Iterator[tuple[str, str, States]]:
        """Yield how some filters can be loosened: their names, words, and the problem with that."""
        for each in self.problem.every_filter:
            if each.name in names:
                yield from ((each.name, *way) for way in each.ways(self.problem))

    def _payload_if_ignored(self, problem: States) -> str:
        """Return the payload that is enough where a problem ignores them; in words, as below."""
        held = worst_least(problem, LARGEST, self.look)
        if held > whole_load(problem.network):
            return self._softer()
        return _payload_said(max(held, self._stops.heaviest))

    def _stronger(self) -> Iterator[Remedy]:
        """Yield what alone is enough for states to stand: no need to, or robots that carry more."""
        enough = {"stands": self._enough_bond}
        enough |= {"payload": self._enough_payload} if self._stops.asks_payload else {}
        for name, text, problem in self._ways(*enough):
            if self.look.exists(problem):
                yield Remedy(text, enough[name])

    def _arms(self) -> Iterator[Remedy]:
        """Yield other arms: that keep apart by themselves, or if they alone do not do."""
        found = (text for _, text, problem in self._ways("arms") if self.look.exists(problem))
        yield from (_as_it_is(text, of_arms=True) for text in islice(found, 1))

    def _limits(self) -> Iterator[Remedy]:
        """Yield the limits, and filters of others, without which alone there is a plan."""
        labels = {limit.label: limit for limit in self.problem.limits}
        for name, text, problem in self._ways(*labels, *map(str, self.problem.filters)):
            if self.look.exists(problem):
                raised = partial(self._enough_limit, labels[name]) if name in labels else None
                yield _as_it_is(text) if raised is None else Remedy(text, raised)

    def _props(self) -> Iterator[Remedy]:
        """Yield that props help, if one at every brick does."""
        scene = self._scene
        if scene.props or not self._is_made or self.problem.scenarios:
            return
        props = [p for p in scene.with_centering().props if p.node not in self._stops.held_at_ends]
        if self._exists_in(scene.with_props(*props)):
            yield _as_it_is("a prop at every brick, if not fewer")

    def _softer(self) -> str:
        """Return with how soft grips there is a plan, in words; empty if with none."""
        return softer_grips(self.problem.engine, self._exists_in)

    def _enough_bond(self) -> str:
        """Return the least bond with which all states stand."""
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
        """Return the least payload of all robots with which a plan exists, to three digits."""

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
        """Return how far a limit has to be raised, of all with its label."""
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
        """Whether the engine can be made anew, of another scene."""
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
