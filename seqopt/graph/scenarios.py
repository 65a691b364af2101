"""Layers of candidates in many scenarios at once, and the costs of pairs in all of them."""

from __future__ import annotations

import pickle
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import cached_property, reduce

import numpy as np

from seqopt._showing import Shown
from seqopt.arrays import Floats, FrozenValue
from seqopt.engines.interface import Engine
from seqopt.engines.registry import Recipe, recipe_of
from seqopt.errors import InfeasibleError, MechanismError, ProblemError, SolverError
from seqopt.graph.layers.costs import Budget, LayeredCosts
from seqopt.graph.layers.layers import Layers
from seqopt.problem.problem import Aim, RobustAim
from seqopt.problem.requirements import Criterion, ResponsesAsked
from seqopt.responses._choices import Evaluation
from seqopt.responses.resources import Resources
from seqopt.scene._armed import hold_alike
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Step
from seqopt.work._workers import hire, map_ordered
from seqopt.work.progress import Progress


def _recipe_for(engine: Engine, scene: Scene) -> Recipe:
    """Return how to make an engine for another scene; a `ProblemError` where nobody knows.

    Arms hold in it in the postures of the engine's own scene.
    """
    recipe = recipe_of(engine)
    if recipe is None:
        raise ProblemError(
            f"engine {type(engine).__name__}: scenarios need engines of their own; take "
            "one of seqopt.make_engine"
        )
    return replace(recipe, scene=hold_alike(engine.network.scene, scene))


def engine_for(engine: Engine, scene: Scene) -> Engine:
    """Return an engine of the same kind and settings for another scene."""
    return _recipe_for(engine, scene).make()


def require_alike(nominal: Scene, scene: Scene, number: int) -> None:
    """Raise a `ProblemError` if a scenario differs in more than stiffness, density, position."""
    if not isinstance(scene, Scene):
        raise ProblemError(f"scenario {number}: {short(scene)} is not a scene")

    def meant(it: Scene) -> tuple[object, ...]:
        joints = tuple(joint.bricks for joint in it.joints)
        ends = tuple((ground.brick, ground.closes_with) for ground in it.grounds)
        nodes = tuple((brick.name, brick.nodes) for brick in it.placed)
        robots = tuple(robot.name for robot in it.robots)
        props = tuple(prop.node for prop in it.props)
        return joints, ends, nodes, robots, props, it.blocked_nodes, (*it.grip_kinds.of_robot,)

    if meant(nominal) != meant(scene):
        raise ProblemError(
            f"scenario {number}: it has other bricks, nodes, joints, robots or props, or another "
            f"build order than {nominal.name}, or other robots give way alike; vary stiffnesses, "
            "densities and positions alone"
        )


@dataclass(frozen=True, eq=False, repr=False)
class ScenarioCosts(FrozenValue):
    """What the choices of a schedule cost in one scenario.

    ``sums``, ``peaks``: as of `seqopt.graph.layers.layers.Layers`; infinite where a limit is
    exceeded; ``models``: how many different models were solved; ``seconds``: that solving them
    took, s.
    """

    sums: LayeredCosts
    peaks: LayeredCosts
    models: int
    seconds: float


@dataclass(frozen=True, eq=False, repr=False)
class _ScenarioTask:
    """One scenario, as it is sent to a worker.

    ``name``: for messages; ``recipe``: of its engine; ``schedule``: the nominal one, whose steps
    and candidates hold in every scenario; ``asked``: by a criterion with the numbers of the nominal
    scene, by limits, and beside these.
    """

    name: str
    recipe: Recipe
    schedule: Schedule
    asked: ResponsesAsked
    resources: Resources

    def problem(self) -> Layers:
        """Return the placement problem of this scenario."""
        evaluation = Evaluation(self.recipe.make(), self.schedule, self.asked, self.resources)
        return Layers(self.asked.criterion, self.asked.limits, evaluation)


def _tasks_of(problem: Layers, scenes: Sequence[Scene]) -> tuple[_ScenarioTask, ...]:
    """Return the tasks of scenarios.

    ``problem``: the nominal one. Raises `ProblemError` if the engine was not made by name, so that
    nobody knows how to make it for another scene.
    """
    also = getattr(problem.evaluation.wanted, "also", ())
    asked = ResponsesAsked(problem.criterion, problem.limits, also)
    alone = problem.evaluation.resources.alone()
    recipes = (_recipe_for(problem.engine, scene) for scene in scenes)
    return tuple(
        _ScenarioTask(f"scenario {i}", recipe, problem.schedule, asked, alone)
        for i, recipe in enumerate(recipes, start=1)
    )


def _costs(task: _ScenarioTask) -> ScenarioCosts:
    problem = task.problem()
    evaluation = problem.evaluation
    try:
        problem.require_possible()
        return ScenarioCosts(problem.sums, problem.peaks, evaluation.models, evaluation.seconds)
    except MechanismError as error:
        raise MechanismError(f"{task.name}: {error}", error.mode) from error
    except SolverError as error:
        raise SolverError(f"{task.name}: {error}") from error


def _pickled(content: object, criterion: Criterion) -> bytes:
    """Return what is sent to other processes; a `ProblemError` if the criterion cannot be."""
    try:
        return pickle.dumps(content)
    except Exception as error:  # whatever objects of others may raise
        raise ProblemError(
            f"criterion {criterion.name}: it cannot be sent to other processes ({error}); "
            "define it in a module, or let this process work alone"
        ) from error


Choice = tuple[int, ...]


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
        """The costs in every scenario, and what they took from the first to the last, s.

        A worker takes one scenario after the other. Raises `InfeasibleError` if a step without an
        open grip exceeds a limit in a scenario; `MechanismError`, `SolverError`, `WorkerError` as
        engines and workers do, the scenario named.
        """
        start, resources = time.perf_counter(), self.nominal.evaluation.resources
        tasks = _tasks_of(self.nominal, self.scenes)
        progress = Progress("scenarios", len(tasks), resources.progress)
        with hire(resources.executor, resources.workers) as crew:
            _pickled(tasks[: crew is not None], self.nominal.criterion)  # says if they cannot be
            done = map_ordered(_costs, tasks, crew, done=lambda *_: progress.add(1))
            with closing(done) as found:
                return tuple(found), time.perf_counter() - start

    @property
    def from_cache(self) -> Iterator[Layers]:
        """The problems of the scenarios, if their responses may come from files."""
        if self.nominal.evaluation.resources.cache is None:
            return iter(())
        return (task.problem() for task in _tasks_of(self.nominal, self.scenes))

    def seconds(self, aim: Aim) -> Mapping[str, float]:
        """Return the run time of evaluating all scenarios, ``respond``, s; of both aims."""
        return {"respond": self._found[1]}

    @property
    def alone_in_scene(self) -> Layers:
        """The layers of the nominal scene."""
        return self.nominal

    @property
    def models(self) -> int:
        """How many different models were solved, in all scenarios."""
        return sum(costs.models for costs in self.costs)

    def names_of(self, _: Aim | None) -> tuple[str, ...]:
        """Return what the aim is called."""
        return (str(self.aim),)

    @property
    def engine(self) -> Engine:
        """What computes the responses of the nominal scene."""
        return self.nominal.engine

    @property
    def schedule(self) -> Schedule:
        """The steps and moves."""
        return self.nominal.schedule

    @property
    def budgets(self) -> tuple[Budget, ...]:
        """None: they would be other ones in every scenario."""
        return ()

    @property
    def sums(self) -> LayeredCosts:
        """None: the worst total of scenarios is no total of costs; a `ProblemError` says so."""
        raise ProblemError(
            f"{self.aim}: totals over scenarios are no sum of one cost; take scenario_search, or "
            "minimax with worst-peak"
        )

    @cached_property
    def peaks(self) -> LayeredCosts:
        """The largest costs in any scenario: their largest over a build is that over scenarios."""
        return largest_of(self.layered(Aim.PEAK))

    def nodes(self, choice: Sequence[int]) -> tuple[int, ...]:
        """Return the nodes that a choice stands for; see `Layers.nodes`."""
        return self.nominal.nodes(choice)

    def under(self, aim: RobustAim) -> ScenarioLayers:
        """Return the same problem with another aim; costs that are known stay known."""
        return self._kept(replace(self, aim=aim))

    def first(self, count: int) -> ScenarioLayers:
        """Return the problem of the first scenarios alone; what is known of costs stays known."""
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
        return np.array([aim.value_of(costs, choice) for costs in self.layered(aim)])

    def layered(self, aim: Aim) -> tuple[LayeredCosts, ...]:
        """Return the costs whose sums or peaks an aim is about, scenario by scenario."""
        return tuple(map(aim.costs, self.costs))

    def steps(self, choice: Sequence[int]) -> tuple[Step, ...]:
        """Return the checked steps of the build; see `Layers.steps`."""
        return self.nominal.steps(choice)


def in_scenarios(nominal: Layers, scenes: Sequence[Scene], aim: RobustAim) -> ScenarioLayers:
    """Return the layers of a problem in many scenarios; nothing is computed yet.

    ``nominal``: with an engine of `seqopt.make_engine`; ``scenes``: with the same bricks and nodes.
    Raises `ProblemError` if there is no scenario, or one has other bricks or nodes.
    """
    if not scenes:
        raise ProblemError("there is no scenario; give at least one")
    for i, scene in enumerate(scenes, start=1):
        require_alike(nominal.schedule.scene, scene, i)
    _tasks_of(nominal, scenes[:1])  # says if engines for other scenes cannot be made
    return ScenarioLayers(nominal, tuple(scenes), aim)


def largest_of(layers: Sequence[LayeredCosts]) -> LayeredCosts:
    """Return the largest of several costs, choice by choice and pair by pair.

    The largest cost that a choice meets in any of them is the largest that it meets in this one.

    ``layers``: of the same moves. Raises `InfeasibleError` if no choice is allowed in all of them.
    """
    # one after the other: all in one array would be a large one
    single, shared = (
        tuple(reduce(np.maximum, each) for each in zip(*arrays, strict=True))
        for arrays in ([own.single for own in layers], [own.shared for own in layers])
    )
    out = LayeredCosts(single, shared)
    try:
        out.continuable()
    except InfeasibleError as error:
        raise InfeasibleError(f"over all {len(layers)} scenarios, {error}") from error
    return out
