"""The costs of all choices of a schedule in every scenario, scenarios shared among workers."""

from __future__ import annotations

import pickle
import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass

from seqopt.arrays import FrozenValue
from seqopt.engines.registry import Recipe, make_engine
from seqopt.errors import MechanismError, ProblemError, SolverError
from seqopt.graph.layers.costs import LayeredCosts
from seqopt.graph.layers.layers import Layers
from seqopt.graph.scenarios.engines import recipe_for
from seqopt.problem.requirements import Criterion, Limit, ResponsesAsked
from seqopt.responses.choices import Evaluation
from seqopt.responses.resources import Resources
from seqopt.scene.scene import Scene
from seqopt.sequence.schedule import Schedule
from seqopt.work.progress import Progress
from seqopt.work.workers import Crew, hire, map_ordered


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


@dataclass(frozen=True)
class ScenarioTask:
    """One scenario, as it is sent to a worker.

    ``name``: for messages; ``recipe``: of its engine; ``schedule``: the nominal one, whose steps
    and candidates hold in every scenario; ``criterion``: with the numbers of the nominal scene;
    ``also``: responses that are evaluated beside those that these name.
    """

    name: str
    recipe: Recipe
    schedule: Schedule
    criterion: Criterion
    limits: tuple[Limit, ...]
    also: tuple[str, ...]
    resources: Resources

    def problem(self) -> Layers:
        """Return the placement problem of this scenario."""
        recipe = self.recipe
        engine = make_engine(recipe.engine, recipe.scene, **recipe.options)  # type: ignore[arg-type]
        asked = ResponsesAsked(self.criterion, self.limits, self.also)
        evaluation = Evaluation(engine, self.schedule, asked, self.resources)
        return Layers(self.criterion, self.limits, evaluation)


def tasks_of(problem: Layers, scenes: Sequence[Scene]) -> tuple[ScenarioTask, ...]:
    """Return the tasks of scenarios.

    ``problem``: the nominal one. Raises `ProblemError` if the engine was not made by name, so that
    nobody knows how to make it for another scene.
    """
    asked = problem.evaluation.wanted
    also = asked.also if isinstance(asked, ResponsesAsked) else ()
    alone = problem.evaluation.resources.alone()
    return tuple(
        ScenarioTask(
            f"scenario {i}",
            recipe_for(problem.engine, scene),
            problem.schedule,
            problem.criterion,
            problem.limits,
            also,
            alone,
        )
        for i, scene in enumerate(scenes, start=1)
    )


def scenario_costs(
    tasks: Sequence[ScenarioTask], resources: Resources
) -> tuple[tuple[ScenarioCosts, ...], float]:
    """Return the costs in every scenario, and what they took.

    ``resources``: a worker takes one scenario after the other. Results: ``seconds``: from the first
    to the last, s. Raises `InfeasibleError` if a step without an open grip exceeds a limit in a
    scenario; `MechanismError`, `SolverError`, `WorkerError` as engines and workers do, the scenario
    named.
    """
    start = time.perf_counter()
    progress = Progress("scenarios", len(tasks), resources.progress)
    with hire(resources.executor, resources.workers) as crew:
        _require_sendable(tasks, crew)
        with closing(map_ordered(_costs, tasks, crew, done=lambda *_: progress.add(1))) as found:
            costs = tuple(found)
    return costs, time.perf_counter() - start


def _costs(task: ScenarioTask) -> ScenarioCosts:
    problem = task.problem()
    try:
        problem.require_possible()
        sums, peaks = problem.sums, problem.peaks
    except MechanismError as error:
        raise MechanismError(f"{task.name}: {error}", error.mode) from error
    except SolverError as error:
        raise SolverError(f"{task.name}: {error}") from error
    evaluation = problem.evaluation
    return ScenarioCosts(sums, peaks, evaluation.models, evaluation.seconds)


def _require_sendable(tasks: Sequence[ScenarioTask], crew: Crew | None) -> None:
    """Raise an error if tasks are to go to other processes and cannot be sent."""
    if crew is None:
        return
    try:
        pickle.dumps(tasks[:1])
    except Exception as error:  # whatever objects of others may raise
        raise ProblemError(
            f"criterion {tasks[0].criterion.name}: it cannot be sent to other processes ({error}); "
            "define it in a module, or let this process work alone"
        ) from error
