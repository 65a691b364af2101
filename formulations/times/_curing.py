"""Mortar that cures, in formulations of time: waits of plans, and what bounds them from below.

Labels wait no longer than motions prove that they must. The plan that they find is looked at as it
is, with proven verdicts; where it has to wait longer, motions in which its states fall say why, and
labels are set again.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from seqopt.errors import ProblemError, StepError
from seqopt.graph.states._visits import steps_of
from seqopt.graph.states.states import States
from seqopt.sequence._robot_kinds import node_numbers
from seqopt.sequence._rule_space import FreeSpace
from seqopt.sequence._timing import StepTime, reassigned_steps, step_times
from seqopt.stability._aging.builds import CuringBuilds
from seqopt.stability._aging.cuts import FallCuts


class Soonest(NamedTuple):
    """Who acts in a plan so that it takes least, and when.

    ``grips``: places held by robots after every step; ``makespan``: s; ``starts``: of steps, s,
    where mortar cures.
    """

    grips: tuple[tuple[int, ...], ...]
    makespan: float
    starts: tuple[float, ...]


class Waits:
    """How long plans of a problem wait for mortar, and motions that say how long at least.

    ``cuts``: None where no mortar cures.
    """

    def __init__(self, problem: States) -> None:
        standing = problem.standing
        self._builds: CuringBuilds | None = None
        self.cuts: FallCuts | None = None
        if standing is not None and standing.curing is not None:
            network, mortar = problem.network, standing.mortar
            self._builds = CuringBuilds(network, mortar, standing.curing)
            self.cuts = FallCuts(network, mortar, self._builds.joints)

    def learn(self) -> bool:
        """Keep the motions of all states that were looked at; return whether some are new."""
        if self._builds is None or self.cuts is None:
            return False
        return sum(map(self.cuts.add, self._builds.motions)) > 0

    def soonest(self, problem: States, states: Sequence[Sequence[int]]) -> Soonest:
        """Return who of a kind acts so that a plan takes least, and when.

        Raises `StepError` if no wait is enough for a step.
        """
        space, scene = problem.space, problem.network.scene
        waits = None if self._builds is None else self._builds.waits
        steps, grips = steps_of(space, states), tuple[tuple[int, ...], ...]()
        if isinstance(space, FreeSpace):
            kind = {robot: k for k, each in enumerate(space.kinds) for robot in each.robots}
            steps = reassigned_steps(
                *(scene, steps, lambda r, hold: kind[r] == kind[hold.robot], [*kind], waits),
                begin=problem.rules.begin,
            )
            place = {node: i for i, node in enumerate(node_numbers(space.network), start=1)}
            grips = tuple(tuple(0 if n is None else place[n] for n in step.grips) for step in steps)
        times: tuple[StepTime, ...] = step_times(scene, steps, waits, problem.rules.begin)
        starts = () if waits is None else tuple(time.start for time in times)
        return Soonest(grips, times[-1].end, starts)

    def try_soonest(self, problem: States, states: Sequence[Sequence[int]]) -> Soonest | None:
        """Return the same; None where no wait is enough."""
        try:
            return self.soonest(problem, states)
        except StepError:
            if self.cuts is None:
                raise
            return None


def require_cured(problem: States, name: str, *, cures: bool) -> None:
    """Raise a `ProblemError` if mortar cures and a formulation does not know of it."""
    standing = problem.standing
    if standing is not None and standing.curing is not None and not cures:
        raise ProblemError(f"{name}: it does not know mortar that cures; take makespan_labels")
