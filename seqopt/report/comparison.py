"""Every method and formulation on one scene, side by side, beside what was published."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError, StepError
from seqopt.placement.certificate import least_sum
from seqopt.placement.costs import TINY
from seqopt.placement.formulation import formulations
from seqopt.placement.plan import Plan
from seqopt.placement.problem import Problem, pose
from seqopt.placement.promises import overloads
from seqopt.placement.ranking import rank_choice
from seqopt.placement.requirements import Criterion
from seqopt.placement.solving import solve
from seqopt.responses.quantities import RESPONSES, robot_response
from seqopt.responses.table import analyze, force_column
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import AnyStep, idle_robots
from seqopt.sequence.stretches import degeneration
from seqopt.sequence.three_robots import modified_sequential, three_robot_loop
from seqopt.sequence.two_robots import METHODS
from seqopt.study.published import (
    IRREGULARITIES,
    PUBLISHED,
    is_reference_arch,
    paper_models,
    printed_maxima,
    published_choice,
    published_plan,
)

LARGEST = {"F_rob": "N", "M_sup": "N m", "T_max": "N", "D_max": "1e-3 mm"}
COLUMNS = [
    "problem",
    "objective",
    "gap",
    *LARGEST,
    "overloaded",
    "models",
    "seconds",
    "solve_seconds",
]
CLOSED = "no choice"  # the problem of a sequence without open grips


@dataclass(frozen=True, eq=False)
class Comparison:
    """Methods and formulations side by side.

    Attributes
    ----------
    maxima : pandas.DataFrame
        A row per quantity (with its unit), a column per method without a choice, and the published
        plan: the largest value of any step.
    printed : pandas.DataFrame or None
        The same as the paper prints it, for its own arch only.
    table : pandas.DataFrame
        A row per method or formulation: the ``problem`` it solves (rows of different problems do
        not compete), ``objective`` and ``gap`` to the exact optimum of its aim, the largest
        ``F_rob`` [N], ``M_sup`` [N m], ``T_max`` [N] and ``D_max`` [1e-3 mm] of any step, whether a
        robot is ``overloaded``, the distinct ``models`` it looks at, and the ``seconds`` that it
        took on its own, ``solve_seconds`` of them to choose.
    tables : mapping of str to pandas.DataFrame
        Responses of every step, by row of ``table``.
    ranks : pandas.DataFrame or None
        Where the published plan's nodes rank, move by move; see `rank_choice`.
    paper_models : tuple of int or None
        Models that Bruun et al. count: cascading, full overlap.
    notes : tuple of str
        Methods that degenerate, robots that never grip, payloads exceeded, and inconsistencies in
        the paper's own numbers.
    refusal : str
        Why the scene has no three-robot loop; empty if it has.
    shared_seconds : mapping of str to float
        What all formulations of the loop share: computing responses, and ranking them.
    """

    maxima: pd.DataFrame
    printed: pd.DataFrame | None
    table: pd.DataFrame
    tables: Mapping[str, pd.DataFrame]
    ranks: pd.DataFrame | None
    paper_models: tuple[int, int] | None
    notes: tuple[str, ...]
    refusal: str
    shared_seconds: Mapping[str, float]


def compare(
    engine: Engine, criterion: Criterion, progress: Callable[[str], None] = lambda _: None
) -> Comparison:
    """Analyze every method on an engine's scene and solve its loop by every formulation.

    Parameters
    ----------
    engine : Engine
        What computes responses; it has the scene.
    criterion : Criterion
        What a step costs.
    progress : callable, optional
        Told in a few words what is done next.

    Returns
    -------
    Comparison

    Raises
    ------
    StepError
        If no method can build the scene.
    """
    scene = engine.network.scene
    tables, notes = method_tables(engine)
    maxima = pd.DataFrame({name: _quantities(scene, table) for name, table in tables.items()})
    printed = printed_maxima().set_axis(maxima.index) if PUBLISHED in tables else None
    rows: dict[str, dict[str, object]] = {name: {"problem": CLOSED} for name in tables}
    ranks, counted, refusal, shared = None, None, "", {}
    try:
        plans, problem = _plans(engine, criterion, progress)
    except (StepError, ProblemError) as error:
        refusal = str(error)
    else:
        for name, plan in plans.items():
            tables[name] = plan.responses()
            rows[name] = _row(plan)
        counted = paper_models(problem.schedule)
        notes += _idle(scene, "three-robot loop", problem.schedule.steps)
        shared = {stage: plan.seconds[stage] for stage in ("respond", "rank")}
        if PUBLISHED in tables:
            ranks = rank_choice(problem, published_choice(problem))
            rows[PUBLISHED] |= _worth(problem, published_choice(problem))
    for name, steps in tables.items():
        over = overloads(scene, steps)
        rows[name] |= largest(scene, steps) | {"overloaded": bool(over)}
        notes += [f"{name}: {excess}" for excess in over]
    notes += [f"In the paper: {text}" for text in IRREGULARITIES if printed is not None]
    table = pd.DataFrame.from_dict(rows, orient="index").reindex(columns=COLUMNS)
    return Comparison(maxima, printed, table, tables, ranks, counted, tuple(notes), refusal, shared)


def method_tables(engine: Engine) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Return the responses of every method without open grips, and of the published plan.

    Parameters
    ----------
    engine : Engine
        What computes responses; it has the scene.

    Returns
    -------
    tables : dict of str to pandas.DataFrame
        By method, as `seqopt.analyze` makes them; the published plan for its own arch only.
    notes : list of str
        Why other methods cannot build the scene or are not what they are called, and which robots
        never grip.

    Raises
    ------
    StepError
        If no method can build it.
    """
    scene = engine.network.scene
    tables: dict[str, pd.DataFrame] = {}
    refused: dict[str, StepError] = {}
    notes: list[str] = []
    for name, method in METHODS.items():
        try:
            steps = method(engine.network)
        except StepError as error:
            refused[name] = error
            continue
        tables[name] = analyze(engine, steps)
        why = degeneration(engine.network, name)
        notes += [f"{name}: {why}"] if why else []
        notes += _idle(scene, name, steps)
    if not tables:
        raise next(iter(refused.values()))
    if is_reference_arch(scene):
        tables[PUBLISHED] = analyze(engine, published_plan(scene))
    refusals = [f"{name}: not possible here; {error}" for name, error in refused.items()]
    return tables, refusals + notes


def _idle(scene: Scene, name: str, steps: Iterable[AnyStep]) -> list[str]:
    """Return a note that names the robots which never grip, if there are any."""
    idle = idle_robots(scene, steps)
    return (
        [f"{name}: {', '.join(idle)} never {'grips' if len(idle) == 1 else 'grip'}"] if idle else []
    )


def _plans(
    engine: Engine, criterion: Criterion, progress: Callable[[str], None]
) -> tuple[dict[str, Plan], Problem]:
    """Return the plan of the modified sequential method and of every formulation on the loop."""
    loop = three_robot_loop(engine.network)  # whose refusal says most
    progress("modified sequential method")
    modified = pose(engine, modified_sequential(engine.network), criterion)
    plans = {"modified-sequential": solve(modified, "rank_search")}
    problem = pose(engine, loop, criterion)
    for name, formulation in formulations().items():
        progress(f"three-robot loop by {name}")
        plans[name] = solve(problem, formulation)
    return plans, problem


def largest(scene: Scene, table: pd.DataFrame) -> dict[str, float]:
    """Return the largest responses of any step of a table.

    Parameters
    ----------
    scene : Scene
        Whose robots the table is about.
    table : pandas.DataFrame
        From `seqopt.analyze`.

    Returns
    -------
    dict of str to float
        By the names of `LARGEST`, in its units; ``F_rob`` is the largest force of any grip.
    """
    forces = table[[force_column(robot) for robot in scene.robots]].abs()
    out = {"F_rob": float(np.nanmax(forces.to_numpy(float)))}
    for name in ("M_sup", "T_max", "D_max"):
        out[name] = float(table[RESPONSES[name].column].max())
    return out


def _quantities(scene: Scene, table: pd.DataFrame) -> pd.Series[float]:
    """Return the largest responses of any step, the force of every robot for itself."""
    values = {
        f"{robot_response(r.name)} [N]": table[force_column(r)].abs().max() for r in scene.robots
    }
    rest = largest(scene, table)
    return pd.Series(
        values | {f"{name} [{LARGEST[name]}]": rest[name] for name in rest if name != "F_rob"}
    )


def _row(plan: Plan) -> dict[str, object]:
    """Return what a plan is worth, and the seconds that it alone took."""
    assert plan.certificate is not None  # asked for
    return {
        "problem": plan.summary()["schedule"],
        "objective": plan.certificate.objective,
        "gap": plan.certificate.gap,
        "models": plan.models_needed,
        "seconds": sum(plan.seconds[stage] for stage in ("compile", "solve", "verify")),
        "solve_seconds": plan.seconds["solve"],
    }


def _worth(problem: Problem, choice: tuple[int, ...]) -> dict[str, object]:
    """Return the value of a choice, and how far it lies above the optimum."""
    value = problem.sums.cost(choice)
    gap = (value - least_sum(problem.sums)) / max(abs(value), TINY)
    return {"problem": problem.schedule.method, "objective": value, "gap": gap}
