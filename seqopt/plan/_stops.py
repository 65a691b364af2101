"""Where infeasible builds stop: by rules of a free schedule, or by the steps of a schedule."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf

from seqopt.graph.states.states import States
from seqopt.scene.scene import Scene
from seqopt.sequence._carrying import loads
from seqopt.sequence._rule_check import RuleBook, unbearable
from seqopt.sequence.rules import FreeRules, Payload
from seqopt.sequence.schedule import Schedule


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
