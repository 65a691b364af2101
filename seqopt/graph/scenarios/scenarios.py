"""The problem of a plan that is to be good in many scenarios at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import overload

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import InfeasibleError, ProblemError
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.interface import Aim
from seqopt.graph.layers.layers import Layers
from seqopt.graph.scenarios.aims import WORST_PEAK, RobustAim, parse_robust
from seqopt.graph.scenarios.costs import ScenarioCosts, scenario_costs, tasks_of
from seqopt.graph.scenarios.engines import require_alike
from seqopt.graph.states.states import States, over_scenarios
from seqopt.scene.checks import short
from seqopt.scene.scenarios import Scenarios
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step
from seqopt.showing import Shown


@dataclass(frozen=True, repr=False)
class ScenarioLayers(Shown):
    """Support placement over a whole build, in many scenarios at once.

    Nothing is computed before it is asked for. Limits hold in every scenario.

    ``nominal``: of the scene as it is drawn; its criterion, with its numbers, holds in every
    scenario; ``scenes``: the scenarios; ``aim``: what to minimize over them.
    """

    nominal: Layers
    scenes: tuple[Scene, ...]
    aim: RobustAim

    def __repr__(self) -> str:
        schedule = self.nominal.schedule
        what = f"{schedule.scene.name!r}, {schedule.method!r}, {len(self.scenes)} scenarios"
        return f"ScenarioLayers({what}, criterion {self.nominal.criterion.name!r}, {self.aim})"

    @property
    def costs(self) -> tuple[ScenarioCosts, ...]:
        """What choices cost, scenario by scenario."""
        return self._found[0]

    @cached_property
    def _found(self) -> tuple[tuple[ScenarioCosts, ...], float]:
        resources = self.nominal.evaluation.resources
        return scenario_costs(tasks_of(self.nominal, self.scenes), resources)

    @property
    def from_cache(self) -> Iterator[Layers]:
        """The problems of the scenarios, if their responses may come from files."""
        if self.nominal.evaluation.resources.cache is None:
            return iter(())
        return (task.problem() for task in tasks_of(self.nominal, self.scenes))

    @property
    def seconds(self) -> Mapping[str, float]:
        """What the costs of all scenarios took: ``respond``, s."""
        return {"respond": self._found[1]}

    def under(self, aim: RobustAim) -> ScenarioLayers:
        """Return the same problem with another aim; costs that are known stay known."""
        return self._kept(replace(self, aim=aim))

    def first(self, count: int) -> ScenarioLayers:
        """Return the problem of the first scenarios alone; costs that are known stay known.

        ``count``: how many, from 1.
        """
        return self._kept(replace(self, scenes=self.scenes[: max(count, 1)]))

    def _kept(self, other: ScenarioLayers) -> ScenarioLayers:
        known: tuple[tuple[ScenarioCosts, ...], float] | None = vars(self).get("_found")
        if known is not None:
            vars(other)["_found"] = known[0][: len(other.scenes)], known[1]
        return other

    def values(self, choice: Sequence[int], aim: Aim) -> Floats:
        """Return the value of a choice in every scenario.

        ``choice``: a candidate for every move; ``aim``: its total, or its largest cost. Result
        (S,): infinite where it exceeds a limit.
        """
        return np.array([aim.worth(costs, choice) for costs in self.layered(aim)])

    def layered(self, aim: Aim) -> tuple[LayeredCosts, ...]:
        """Return the costs that an aim is about, scenario by scenario.

        ``aim``: sums or peaks.
        """
        return tuple(c.sums if aim is Aim.SUM else c.peaks for c in self.costs)

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps of the build; see `Layers.steps`.

        ``choice``: a candidate for every move.
        """
        return self.nominal.steps(choice)


@overload
def robust(
    problem: Layers, scenes: Scenarios | Sequence[Scene], aim: RobustAim | str
) -> ScenarioLayers: ...


@overload
def robust(
    problem: States, scenes: Scenarios | Sequence[Scene], aim: RobustAim | str
) -> States: ...


def robust(
    problem: Layers | States, scenes: Scenarios | Sequence[Scene], aim: RobustAim | str
) -> ScenarioLayers | States:
    """Return the problem of a plan that is good in many scenarios at once.

    Parameters
    ----------
    problem : Layers or States
        The nominal one, of `seqopt.pose` or `seqopt.pose_free`; with an engine of
        `seqopt.make_engine`.
    scenes : Scenarios or sequence of Scene
        Of `seqopt.scenarios`, or scenes of one's own with the same bricks and nodes.
    aim : RobustAim or str
        Or in words: ``worst-peak``, ``worst-total`` or ``cvar=0.9``; of states the first alone.

    Returns
    -------
    ScenarioLayers or States
        As the nominal one, for `solve_robust` and `seqopt.solve`; nothing is computed yet.

    Raises
    ------
    ProblemError
        If there is no scenario, one has other bricks or nodes, or the problem has budgets.

    Examples
    --------
    >>> import seqopt
    >>> scene = seqopt.load_scene("arch25")
    >>> problem = seqopt.optimize(scene, criterion="worst-ratio-published").problem
    >>> robust(problem, seqopt.scenarios(scene, count=5), "worst-peak")  # doctest: +ELLIPSIS
    ScenarioLayers('arch25', 'three-robot', 5 scenarios, ... worst-peak)
    """
    aim = parse_robust(aim) if isinstance(aim, str) else aim
    if isinstance(problem, States):
        return over_scenarios(problem, _worst_of(scenes, aim))
    if not isinstance(problem, Layers) or not isinstance(aim, RobustAim):
        raise ProblemError(
            f"{short(aim if isinstance(problem, Layers) else problem)}: give a problem of "
            "seqopt.pose, scenarios, and an aim as WORST_PEAK, WORST_TOTAL or cvar(0.9)"
        )
    found = _scenes(scenes)
    if problem.budgets:
        raise ProblemError(
            f"budget {problem.budgets[0].name!r}: aims over scenarios take no budgets; leave it out"
        )
    for i, scene in enumerate(found, start=1):
        require_alike(problem.schedule.scene, scene, i)
    tasks_of(problem, found[:1])  # says if engines for other scenes cannot be made
    return ScenarioLayers(problem, found, aim)


def _scenes(scenes: Scenarios | Sequence[Scene]) -> tuple[Scene, ...]:
    found = scenes.scenes if isinstance(scenes, Scenarios) else tuple(scenes)
    if not found:
        raise ProblemError("there is no scenario; give at least one")
    return found


def _worst_of(scenes: Scenarios | Sequence[Scene], aim: object) -> tuple[Scene, ...]:
    """Return scenarios whose worst states count, as they do where states are chosen."""
    if aim != WORST_PEAK:
        said = aim if isinstance(aim, RobustAim) else short(aim)
        raise ProblemError(
            f"robust aim {said}: where states are chosen, worst steps count; give worst-peak"
        )
    return _scenes(scenes)


def largest_of(layers: Sequence[LayeredCosts]) -> LayeredCosts:
    """Return the largest of several costs, choice by choice and pair by pair.

    The largest cost that a choice meets in any of them is the largest that it meets in this one.

    ``layers``: of the same moves. Raises `InfeasibleError` if no choice is allowed in all of them.
    """
    single = tuple(map(_largest, zip(*(each.single for each in layers), strict=True)))
    shared = tuple(map(_largest, zip(*(each.shared for each in layers), strict=True)))
    out = LayeredCosts(single, shared)
    try:
        out.continuable()
    except InfeasibleError as error:
        raise InfeasibleError(f"over all {len(layers)} scenarios, {error}") from error
    return out


def _largest(costs: Sequence[Floats]) -> Floats:
    """Return the largest of costs, one after the other: all in one array would be a large one."""
    out = np.array(costs[0])
    for each in costs[1:]:
        np.maximum(out, each, out=out)
    return out
