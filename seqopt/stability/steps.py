"""The stability of every step of a build, as a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from seqopt.contact.faces import Contacts, step_assembly
from seqopt.contact.mortar import Mortar, find_mortar
from seqopt.network.build import network_of
from seqopt.network.network import Network
from seqopt.scene.scene import Scene
from seqopt.sequence.steps import Grips, Step, require_steps
from seqopt.stability.assessment import Stability, Verdict, assess, verdict
from seqopt.stability.limit_analysis import Claim
from seqopt.work.progress import Tell, told


def assess_steps(
    network: Network | Scene,
    steps: Sequence[Step],
    mortar: Mortar | str,
    progress: Tell | None = None,
) -> tuple[Stability, ...]:
    """Return verdict and margins of every step.

    Parameters
    ----------
    network : Network or Scene
    steps : sequence of Step
    mortar : Mortar or str
        The mortar of all joints, or its name.
    progress : callable, optional
        Told as a `seqopt.work.Stage` how far it is, step by step.

    Returns
    -------
    tuple of Stability

    Raises
    ------
    SceneError
        If bricks that share a joint do not touch.

    Examples
    --------
    >>> import seqopt
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> steps = seqopt.sequential(network)[:2]
    >>> [stability.verdict.value for stability in seqopt.assess_steps(network, steps, seqopt.EPOXY)]
    ['stands', 'stands']
    """
    network, mortar = network_of(network), find_mortar(mortar)
    known, up, out = Contacts(network), network.scene.up, []
    for step in told("assessing steps", require_steps(steps), progress):
        out.append(assess(step_assembly(network, step.bricks, step.grips, known), mortar, up))
    return tuple(out)


def step_verdicts(network: Network, steps: Sequence[Step], mortar: Mortar) -> tuple[Verdict, ...]:
    """Return the verdict of every step; of equal partial structures it is asked once."""
    contacts = Contacts(network)
    found: dict[tuple[int, Grips], Verdict] = {}
    for step in steps:
        if (step.bricks, step.grips) not in found:
            assembly = step_assembly(network, step.bricks, step.grips, contacts)
            found[step.bricks, step.grips] = verdict(assembly, mortar)
    return tuple(found[step.bricks, step.grips] for step in steps)


def stability_table(steps: Sequence[Step], results: Sequence[Stability]) -> pd.DataFrame:
    """Return one row per step; an empty cell is a number that is not proven.

    Parameters
    ----------
    steps : sequence of Step
    results : sequence of Stability
        Of the steps.

    Returns
    -------
    pandas.DataFrame
        ``step``, ``type``, ``bricks``, ``verdict``, ``bond_needed_Pa``, ``friction_needed``,
        ``tilt_survived_deg``, ``largest_grip_force_N``, ``first_brick``, ``first_joint`` and
        ``jammed``, as in `seqopt.stability.assessment.Stability`; ``almost_solved``, ``stalled``
        and ``unproven`` count cases.
    """
    rows = []
    for step, result in zip(steps, results, strict=True):
        rows.append(
            {
                "step": step.number,
                "type": step.kind.value,
                "bricks": step.bricks,
                "verdict": result.verdict.value,
                "bond_needed_Pa": result.bond,
                "friction_needed": result.friction,
                "tilt_survived_deg": np.degrees(result.tilt),
                "largest_grip_force_N": result.grip,
                "first_brick": result.first_block,
                "first_joint": result.first_contact,
                "jammed": result.jammed,
                "almost_solved": result.claims.get(Claim.ALMOST, 0),
                "stalled": result.claims.get(Claim.STALLED, 0),
                "unproven": result.unproven,
            }
        )
    return pd.DataFrame(rows)


def format_verdicts(results: Sequence[Stability]) -> str:
    """Return how many steps stand, do not stand and are undecided, and how the solver ended.

    Returns
    -------
    str
        One line.
    """
    words = {
        Verdict.STANDS: "stand",
        Verdict.FALLS: "do not stand",
        Verdict.UNDECIDED: "are undecided",
    }
    verdicts = ", ".join(
        f"{sum(result.verdict is verdict for result in results)} {word}"
        for verdict, word in words.items()
    )
    jammed = sum(result.jammed for result in results)
    verdicts += f" ({jammed} only jammed: do not trust these)" if jammed else ""
    claims = {
        claim: sum(result.claims.get(claim, 0) for result in results)
        for claim in (Claim.ALMOST, Claim.STALLED)
    }
    cases = sum(sum(result.claims.values()) for result in results)
    ends = ", ".join(f"{count} {claim.value}" for claim, count in claims.items())
    unproven = sum(result.unproven for result in results)
    return f"{len(results)} steps: {verdicts}; {cases} cases: {ends}, {unproven} unproven"
