"""Whether the steps of a build stand, and by how much: as a table too."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Sequence
from concurrent.futures import Executor

import pandas as pd

from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.errors import ProblemError, SceneWarning
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.scene.scene_file import _find_overlapping
from seqopt.sequence.steps import Step, require_steps
from seqopt.stability._step_verdicts import each_stability, find_margins, stability_row
from seqopt.stability.assessment import Stability
from seqopt.work.progress import Tell, with_progress


def assess_steps(
    network: Network | Scene,
    steps: Sequence[Step],
    mortar: Mortar | str,
    margins: Collection[str] = (),
    progress: Tell | None = None,
    workers: int | Executor = 1,
) -> tuple[Stability, ...]:
    """Return whether every step stands, and the margins that are asked for.

    Parameters
    ----------
    network : Network or Scene
    steps : sequence of Step
    mortar : Mortar or str
        The mortar of all joints, or its name.
    margins : collection of str, optional
        Of ``bond``, ``friction``, ``tilt`` and ``payload``, or ``all``; others are NaN. Each takes
        several times as long as a verdict.
    progress : callable, optional
        Called with a `seqopt.work.Stage`, step by step.
    workers : int or concurrent.futures.Executor, optional
        Processes to share the steps among, or any executor, which the caller ends.

    Returns
    -------
    tuple of Stability

    Raises
    ------
    SceneError
        If bricks that share a joint do not touch, or there is no such margin.
    ProblemError
        If there cannot be so many workers.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> steps = seqopt.sequential(network)[:2]
    >>> [stability.verdict.value for stability in seqopt.assess_steps(network, steps, seqopt.EPOXY)]
    ['stands', 'stands']
    """
    network, steps, asked = _warned(network), require_steps(steps), find_margins(margins)
    if not (hasattr(workers, "submit") or (isinstance(workers, int) and workers > 0)):
        raise ProblemError(f"workers is {workers!r}; give a whole number from 1, or an executor")
    shared = (None, workers) if isinstance(workers, int) else (workers, 1)
    found = each_stability(network, steps, find_mortar(mortar), asked, shared=shared)
    told = with_progress("assessing steps", steps, progress)
    return tuple(result for result, _ in zip(found, told, strict=True))


def _warned(scene: Network | Scene) -> Network:
    """Return the network of a scene; warn once of bricks that interpenetrate, joint or not."""
    network = network_of(scene)
    if "overlaps" not in network.derived:
        network.derived["overlaps"] = found = [*_find_overlapping(network.scene)]
        for line in found:
            warnings.warn(
                f"scene {network.scene.name}: {line}: no verdict sees it",
                SceneWarning,
                stacklevel=3,
            )
    return network


def stability_table(steps: Sequence[Step], results: Sequence[Stability]) -> pd.DataFrame:
    """Return one row per step; an empty cell is a number that is not proven, or not asked for.

    Parameters
    ----------
    steps : sequence of Step
    results : sequence of Stability
        Of the steps.

    Returns
    -------
    pandas.DataFrame
        ``step``, ``type``, ``bricks``, ``verdict``, ``proof``, ``bond_needed_Pa``,
        ``friction_needed``, ``tilt_survived_deg``, ``largest_grip_force_N``, ``first_brick``,
        ``first_joint`` and ``jammed``, as in `seqopt.stability.assessment.Stability`;
        ``almost_solved``, ``stalled`` and ``unproven`` count cases.
    """
    each = zip(steps, results, strict=True)
    return pd.DataFrame([stability_row(step, result) for step, result in each])
