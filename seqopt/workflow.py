"""The short cut: from a scene to a plan in one call."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from seqopt.engines.interface import Engine
from seqopt.engines.registry import make_engine
from seqopt.errors import ProblemError, did_you_mean
from seqopt.network.build import build_network
from seqopt.placement.plan import Plan
from seqopt.placement.problem import pose
from seqopt.placement.requirements import Criterion, Limit
from seqopt.placement.solving import solve
from seqopt.responses.resources import Resources
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import load_scene
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.schedule_file import find_schedule
from seqopt.study.presets import CRITERIA, EQUATIONS


def optimize(
    scene: Scene | str | Path,
    schedule: Schedule | Path | str = "three-robot",
    criterion: Criterion | str = EQUATIONS,
    formulation: str = "overlap_dp",
    engine: str = "auto",
    *,
    limits: Sequence[Limit] = (),
    **options: Any,
) -> Plan:
    """Choose where robots hold over a whole build.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        Or the name of a built-in scene, or a scene file.
    schedule : Schedule, pathlib.Path or str
        A key of `seqopt.sequence.three_robots.SCHEDULES`, a schedule file, or a schedule.
    criterion : Criterion or str
        What a step costs; or a name of `seqopt.CRITERIA`.
    formulation : str
        One of `seqopt.formulations`.
    engine : str
        A key of `seqopt.engines.registry.ENGINES`; ``"auto"`` models no more than is needed.
    limits : sequence of Limit
        What no open step may exceed.
    **options
        Of `seqopt.responses.Resources` (as ``workers=2``), `seqopt.solve` and the formulation.

    Returns
    -------
    Plan

    Raises
    ------
    SeqoptError
        One line that says who must act: see `seqopt.errors`.

    Examples
    --------
    >>> import seqopt
    >>> plan = seqopt.optimize("arch25", criterion="worst-ratio-published", formulation="minimax")
    >>> round(plan.certificate.objective, 3)
    1.185
    """
    start = time.perf_counter()
    parts = *_assemble(scene, schedule, engine), find_criterion(criterion), limits, ()
    assemble = time.perf_counter() - start
    plan = solve(pose(*parts, _resources(options)), formulation, **options)
    return replace(plan, seconds={"assemble": assemble, **plan.seconds})


def _resources(options: dict[str, Any]) -> Resources:
    """Take out of options what they say of resources."""
    given = {field.name for field in fields(Resources)} & options.keys()
    return Resources(**{name: options.pop(name) for name in given})


def _assemble(
    scene: Scene | str | Path, schedule: Schedule | Path | str, engine: str
) -> tuple[Engine, Schedule]:
    """Return the engine and the schedule of a scene."""
    network = build_network(load_scene(scene) if isinstance(scene, str | Path) else scene)
    return make_engine(engine, network), find_schedule(network, schedule)


def find_criterion(criterion: Criterion | str) -> Criterion:
    """Return a criterion, by name or itself.

    Parameters
    ----------
    criterion : Criterion or str
        A criterion, or a name of `seqopt.CRITERIA`.

    Returns
    -------
    Criterion

    Raises
    ------
    ProblemError
        If there is none of that name.
    """
    if not isinstance(criterion, str):
        return criterion
    if criterion not in CRITERIA:
        raise ProblemError(
            f"criterion {criterion!r}: there is no such{did_you_mean(criterion, CRITERIA)}; give "
            f"one of {', '.join(CRITERIA)}"
        )
    return CRITERIA[criterion]
