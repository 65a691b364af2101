"""What commands note on standard error beside their answer."""

from __future__ import annotations

from collections.abc import Iterable

from seqopt.cli.terminal import complain
from seqopt.engines.auto import AutoEngine
from seqopt.engines.interface import Engine
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import AnyStep, idle_robots


def say_levels(engine: Engine) -> None:
    """Say which levels an engine that picks them took, and why.

    Parameters
    ----------
    engine : Engine
        Any other one says nothing.
    """
    if not isinstance(engine, AutoEngine):
        return
    for choice, sets in engine.tally.items():
        complain(f"engine: {choice.level.value} for {sets} grip sets: {choice.reason}")
    if engine.unchecked:
        complain(f"engine: {engine.unchecked}")


def say_idle(scene: Scene, steps: Iterable[AnyStep]) -> None:
    """Name the robots that never grip.

    Parameters
    ----------
    scene : Scene
    steps : iterable of AnyStep
        Of a sequence or plan.
    """
    if idle := idle_robots(scene, steps):
        complain(f"robots: {', '.join(idle)} never grip{'s' * (len(idle) == 1)}")
