"""The problem of the free schedule: which robot does what next, and where, over a whole build."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from seqopt.arrays import Bools, Floats, Ints
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.network.network import Network
from seqopt.placement.criteria import RankSum
from seqopt.placement.free_goals import LARGEST, STATE_RESPONSES, Goal, Measure, parse_goals
from seqopt.placement.requirements import LIMIT_TOLERANCE, Criterion, Limit, state_costs
from seqopt.placement.scales import SceneFacts
from seqopt.placement.standing import Standing, StandingSets
from seqopt.responses.grip_sets import GripSets
from seqopt.responses.quantities import robot_response
from seqopt.scene.checks import short
from seqopt.sequence.free_rules import FreeRules
from seqopt.sequence.free_space import FreeSpace
from seqopt.sequence.free_start import free_space
from seqopt.sequence.steps import Grips
from seqopt.showing import Shown
from seqopt.stability.assessment import Stability


@dataclass(frozen=True, repr=False)
class FreeProblem(Shown):
    """The problem of the free schedule of a scene; everything is computed when first needed.

    Attributes
    ----------
    engine : Engine
        What computes responses.
    rules : FreeRules
        Which moves are possible.
    criterion : Criterion
        What a step costs, for the goals that name no response.
    goals : tuple of Goal
        What to minimize, the most important first.
    limits : tuple of Limit
        What no step may exceed.
    standing : Standing or None
        That every state must stand, if it is demanded.
    """

    engine: Engine
    rules: FreeRules
    criterion: Criterion
    goals: tuple[Goal, ...]
    limits: tuple[Limit, ...] = ()
    standing: Standing | None = None

    def __repr__(self) -> str:
        goals = ", ".join(map(str, self.goals))
        return f"FreeProblem({self.network.scene.name!r}, {goals}, {len(self.limits)} limits)"

    @property
    def network(self) -> Network:
        """Of the scene that is built."""
        return self.engine.network

    @cached_property
    def space(self) -> FreeSpace:
        """Its states and moves."""
        parks = any(goal.measure is Measure.TRAVEL for goal in self.goals)
        return free_space(self.network, self.rules, self.caps, parks=parks)

    @cached_property
    def caps(self) -> Mapping[str, float]:
        """Limits on single robots, by name, N."""
        own = {robot_response(robot.name): robot.name for robot in self.network.scene.robots}
        out: dict[str, float] = {}
        for limit in self.limits:
            if limit.response in own:
                name = own[limit.response]
                out[name] = min(limit.bound, out.get(name, np.inf))
        return out

    @cached_property
    def named(self) -> tuple[str, ...]:
        """The responses that goals, criterion and limits name."""
        names = [goal.response for goal in self.goals if goal.response]
        if any(goal.of_states and not goal.response for goal in self.goals):
            names += self.criterion.wanted(1)
        names += [limit.response for limit in self.limits]
        return tuple(name for name in STATE_RESPONSES if name in names)

    @property
    def leading(self) -> int:
        """The first goal that is about responses, or the first of all."""
        return next((k for k, goal in enumerate(self.goals) if goal.of_states), 0)

    @cached_property
    def sets(self) -> GripSets:
        """Responses of grip sets, those of the engine that are named; the forces come with them."""
        return GripSets(self.engine, [name for name in self.named if name != LARGEST])

    def responses(self, bricks: int, states: Ints) -> tuple[Mapping[str, Floats], Bools]:
        """Return the named responses of states, and which states are within all limits.

        Parameters
        ----------
        bricks : int
        states : (n, c) int
            As in `seqopt.sequence.free_space`.

        Returns
        -------
        responses : dict of str to (n,) float
            SI units.
        within : (n,) bool
        """
        held = self.space.held(states)
        answers, forces = self.sets.answers(bricks, held)
        names = [name for name in self.named if name != LARGEST]
        found = dict(zip(names, answers.T, strict=True))
        found[LARGEST] = forces.max(axis=1, initial=0.0)
        within = np.isfinite(answers).all(axis=1) & np.isfinite(forces).all(axis=1)
        for limit in self.limits:
            if limit.response in found:
                within &= ~limit.exceeded(found[limit.response])
        return found, within & self._carried(states, forces)

    def worth(
        self, bricks: int, states: Ints, ceiling: float = np.inf
    ) -> tuple[Floats, Bools, float]:
        """Return what goals that are about states take of them.

        What stands, and by what margin, is asked only of states that nothing else rules out.

        Parameters
        ----------
        bricks : int
        states : (n, c) int
        ceiling : float, optional
            The first goal must not take more, where it is about a peak.

        Returns
        -------
        values : (n, g) float
            A column for every goal; zero for one that is about moves alone.
        within : (n,) bool
            Which states are within all limits and below the ceiling, and stand if they must.
        excluded : float
            The least that the first goal takes of a state that is left out for the ceiling.
        """
        found, within = self.responses(bricks, states)
        out = np.zeros((len(states), len(self.goals)))
        for column, goal in enumerate(self.goals):
            if goal.of_states and not goal.of_margins:
                if goal.response:
                    out[:, column] = found[goal.response]
                else:
                    out[:, column] = state_costs(self.criterion, found, bricks, within)
        out[~within] = np.inf
        within &= np.isfinite(out).all(axis=1)
        within, excluded = self._below(out, within, ceiling)
        if self.standing is not None:
            rows = np.flatnonzero(within)
            within[rows] = self.stability.stand(bricks, *self._grips(states[rows]))
        for column, goal in enumerate(self.goals):
            if goal.of_margins:
                rows = np.flatnonzero(within)
                ends = self.stability.margins(goal.response, bricks, *self._grips(states[rows]))
                out[rows, column] = ends[:, 1]
        within, more = self._below(out, within & np.isfinite(out).all(axis=1), ceiling)
        return out, within, min(excluded, more)

    def _below(self, values: Floats, within: Bools, ceiling: float) -> tuple[Bools, float]:
        """Return which states the first goal leaves, and the least value that is left out."""
        if self.goals[0].measure is not Measure.PEAK:
            return within, np.inf
        above = within & (values[:, 0] > ceiling)
        return within & ~above, float(values[above, 0].min(initial=np.inf))

    @cached_property
    def stability(self) -> StandingSets:
        """What is known of how grip sets stand."""
        return StandingSets(self.network, self.standing or Standing(), self._caps)

    @cached_property
    def certified(self) -> dict[tuple[int, Grips], Stability]:
        """What the cone program says of states, as far as it was asked."""
        return {}

    @cached_property
    def _caps(self) -> Floats:
        """The largest force of the robot of every column of a state, N."""
        kinds = self.space.kinds
        return np.concatenate([np.full(len(kind.robots), kind.cap) for kind in kinds])

    def _grips(self, states: Ints) -> tuple[Ints, Floats]:
        """Return the nodes held, ascending, and the largest force at each, (n, r)."""
        held = states[:, : len(self._caps)].clip(min=0)
        order = np.argsort(held, axis=1, kind="stable")
        return np.take_along_axis(held, order, axis=1), self._caps[order]

    def _carried(self, states: Ints, forces: Floats) -> Bools:
        """Return in which states no grip exceeds what its robot may carry."""
        most = self._grips(states)[1]
        slack = LIMIT_TOLERANCE * np.where(np.isfinite(most), most, 0.0)
        return np.asarray((forces <= most + slack).all(axis=1))


def pose_free(
    engine: Engine,
    rules: FreeRules,
    criterion: Criterion,
    goals: Sequence[Goal] | str = "minmax",
    limits: Sequence[Limit] = (),
    stands: Standing | Mortar | str | None = None,
) -> FreeProblem:
    """Return the problem of the free schedule of an engine's scene.

    Parameters
    ----------
    engine : Engine
        What computes responses.
    rules : FreeRules
        Which moves are possible.
    criterion : Criterion
        What a step costs; ranks among choices cannot be used.
    goals : sequence of Goal or str
        What to minimize; see `parse_goals`.
    limits : sequence of Limit
        What no step may exceed.
    stands : Standing, Mortar or str, optional
        Requires that every state stands, with this mortar: ``"dry"``, ``"bond=3e3"`` (Pa).

    Returns
    -------
    FreeProblem
        Nothing is computed yet, except scales that a criterion takes from the scene.

    Raises
    ------
    ProblemError
        If goals, criterion or limits use a response that a state does not have.

    Examples
    --------
    >>> import seqopt
    >>> engine = seqopt.make_engine("compliance", seqopt.load_scene("arch25"))
    >>> pose_free(engine, FreeRules(), seqopt.CRITERIA["worst-ratio"], "minmax,steps")
    FreeProblem('arch25', minmax, steps, 0 limits)
    """
    goals = parse_goals(goals) if isinstance(goals, str) else tuple(goals)
    if not goals or not all(isinstance(goal, Goal) for goal in goals):
        raise ProblemError(f"aims {short(goals)}: give goals, or their names, as 'minmax,steps'")
    limits = _checked(limits, engine.network)
    if any(goal.of_states and not goal.response for goal in goals):
        criterion = _of_states(engine, criterion)
    standing = stands if isinstance(stands, Standing | None) else Standing(find_mortar(stands))
    return _asked(FreeProblem(engine, rules, criterion, goals, limits, standing))


def _asked(problem: FreeProblem) -> FreeProblem:
    """Return a problem whose stability can be asked, where it will be."""
    if problem.standing is not None or any(goal.of_margins for goal in problem.goals):
        _ = problem.stability  # what cannot be asked is refused now
    return problem


def _checked(limits: Sequence[Limit], network: Network) -> tuple[Limit, ...]:
    """Return limits that are all on what a state has."""
    limits = (limits,) if isinstance(limits, Limit) else tuple(limits)
    robots = {robot_response(robot.name) for robot in network.scene.robots}
    for limit in limits:
        _require(limit.response, {*STATE_RESPONSES, *robots}, "limit")
    return limits


def _of_states(engine: Engine, criterion: Criterion) -> Criterion:
    """Return a criterion posed for a scene, if it is about states alone."""
    if isinstance(criterion, RankSum):
        raise ProblemError(
            f"criterion {criterion.name}: it ranks the choices of a move, and a free schedule "
            "has none; take worst-ratio, weighted or another one of responses"
        )
    for name in criterion.wanted(1):
        _require(name, {*STATE_RESPONSES}, f"criterion {criterion.name}")
    return criterion.for_scene(SceneFacts(engine))


def _require(name: str, known: set[str], where: str) -> None:
    if name not in known:
        listed = ", ".join(sorted(known))
        raise ProblemError(f"{where}: a state of a free schedule has no {name}; give {listed}")
