"""Responses of a build in time with joints as stiff as they are when each of its steps begins.

A joint has a share of its full stiffness at its age, as it has of its bond. Every step is computed
as if all of its loads came when it begins, on joints as they are then: what was locked in before,
while they were softer, is left out, and so is what creeps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from seqopt.arrays import Floats
from seqopt.contact.curing import Curing
from seqopt.engines.registry import USUAL, make_engine
from seqopt.errors import SceneError
from seqopt.network.network import Network
from seqopt.responses.table import analyze
from seqopt.sequence._timing import StepTime
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability._aging.builds import JointsInTime

SHARE = "least_share"


def aged_table(
    network: Network, steps: Sequence[Step], times: Sequence[StepTime], law: Curing
) -> pd.DataFrame:
    """Return the responses of every step with joints as stiff as they are when it begins.

    ``times``: of the steps, of a whole build; ``law``: which share of its stiffness a joint has at
    an age. Result: as of `seqopt.analyze`, and before these ``start_s`` and `SHARE`, that of the
    softest joint. Raises `SceneError` if a joint has no stiffness when it is closed.
    """
    joints, placed = JointsInTime(network, law), list[float]()
    _require_some(joints, law)
    out = []
    for step, time in zip(steps, times, strict=True):
        since = np.full((1, step.bricks), np.inf)
        since[0, : len(placed)] = placed
        shares = joints.at(step.bricks, np.array([time.start]), since)[0]
        row = analyze(make_engine(USUAL, _softened(network, shares)), [step])
        row.insert(1, "start_s", time.start)
        row.insert(2, SHARE, shares.min(initial=1.0))
        out.append(row)
        placed += [time.end] * (step.kind is StepKind.PLACE)
    return pd.concat(out, ignore_index=True)


def _require_some(joints: JointsInTime, law: Curing) -> None:
    for name in joints.names:
        points = law.points_of(name)
        if not points or points[0][0] > 0:
            since = f"before {points[0][0]:g} s" if points else "ever"
            raise SceneError(
                f"stiffness of joint {name}: it has none {since}, and what is placed would hang on "
                "nothing; give a share from 0 s on, as 0s=0.05,15min=1"
            )


def _softened(network: Network, shares: Floats) -> Network:
    """Return a network whose first joints (j,) have shares of their stiffness."""
    springs = network.springs
    own = np.ones((len(springs.since), 1))
    own[springs.acting(len(network.inner))[: len(shares)], 0] = shares
    softer = {
        name: own * getattr(springs, name)
        for name in ("translational_stiffness", "rotational_stiffness")
    }
    return replace(network, springs=replace(springs, **softer))
