"""What engine and peers are asked: every distinct model of the three-robot loop."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from seqopt.arrays import Ints
from seqopt.engines.interface import Fields, Want, grip_columns
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.network import Network
from seqopt.placement.problem import Problem, pose
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import EQUATIONS

SETTINGS = ("reactions", "criterion", "all fields")


class Case(NamedTuple):
    """The models of one brick count and number of grips: node numbers, places, what is asked."""

    bricks: int
    grips: Ints
    columns: Ints
    want: Want

    def asked(self, setting: str) -> Want:
        """Return what a setting asks of these models."""
        return {"reactions": Want.SUPPORT, "criterion": self.want, "all fields": Want.RESPONSES}[
            setting
        ]


class Recorder:
    """An engine that remembers what it was asked."""

    def __init__(self, net: Network) -> None:
        self.engine = ComplianceEngine(net)
        self.cases: list[Case] = []

    @property
    def network(self) -> Network:
        """The engine's network."""
        return self.engine.network

    def solve(self, bricks: int, grips: ArrayLike, want: Want = Want.RESPONSES) -> Fields:
        """Answer and remember."""
        columns = grip_columns(self.network, bricks, grips)
        self.cases.append(Case(bricks, np.asarray(grips), columns, want))
        return self.engine.solve(bricks, grips, want)


def workload(net: Network) -> tuple[Problem, list[Case]]:
    """Return the posed problem and all models it takes."""
    recorder = Recorder(net)
    problem = pose(recorder, three_robot_loop(net), EQUATIONS)
    assert problem.evaluation.models  # evaluated here, and so recorded
    return problem, recorder.cases
