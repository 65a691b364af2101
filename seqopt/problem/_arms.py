"""Steps of a build that the arms of its robots cannot be in, in words."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import TYPE_CHECKING

from seqopt.responses.quantities import _steps_in_words
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Step

if TYPE_CHECKING:
    from seqopt.sequence._postures import PlanPostures


def arm_faults(scene: Scene, steps: Sequence[Step]) -> tuple[str, ...]:
    """Return why arms cannot be in steps of a build, a line for each reason; none without arms."""
    if not scene.has_arms:
        return ()
    from seqopt.sequence._postures import plan_postures  # noqa: PLC0415  # few scenes have arms

    found = plan_postures(scene, steps)
    return () if found is None else faults_in_words(found)


def faults_in_words(found: PlanPostures) -> tuple[str, ...]:
    """Return why arms cannot be in steps, each reason with its steps."""
    steps = defaultdict[str, list[int]](list)
    for each in found.unreached:
        steps[each.why].append(each.step)
    return tuple(f"{why} ({_steps_in_words(numbers)})" for why, numbers in steps.items())
