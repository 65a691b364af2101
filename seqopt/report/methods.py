"""Responses of every method that leaves no grip open, on one scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import StepError
from seqopt.responses.table import analyze
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import AnyStep, idle_robots
from seqopt.sequence.two_robots import METHODS, degeneration
from seqopt.study.published import PUBLISHED, is_reference_arch, published_plan


def method_tables(
    engine: Engine, robots: Sequence[str] = ()
) -> tuple[dict[str, pd.DataFrame], list[str]]:
    """Return the responses of every method without open grips, and of the published plan.

    Parameters
    ----------
    engine : Engine
        What computes responses; it has the scene.
    robots : sequence of str, optional
        Names of those that take part, the first two of which are taken.

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
            steps = method(engine.network, robots[:2])
        except StepError as error:
            refused[name] = error
            continue
        tables[name] = analyze(engine, steps)
        why = degeneration(engine.network, name)
        notes += [f"{name}: {why}"] if why else []
        notes += idle_note(scene, name, steps)
    if not tables:
        raise next(iter(refused.values()))
    if is_reference_arch(scene):
        tables[PUBLISHED] = analyze(engine, published_plan(scene))
    refusals = [f"{name}: not possible here; {error}" for name, error in refused.items()]
    return tables, refusals + notes


def idle_note(scene: Scene, name: str, steps: Iterable[AnyStep]) -> list[str]:
    """Return a note that names the robots which never grip, if there are any.

    Parameters
    ----------
    scene : Scene
    name : str
        What the steps are of.
    steps : iterable of Step or OpenStep

    Returns
    -------
    list of str
        Of one note, or none.
    """
    idle = idle_robots(scene, steps)
    return (
        [f"{name}: {', '.join(idle)} never {'grips' if len(idle) == 1 else 'grip'}"] if idle else []
    )
