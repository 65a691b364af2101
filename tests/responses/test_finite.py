"""What an engine answers is finite, or an error: never a robot that does not grip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from experiments.harness.scenes import running_bond
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SeqoptError, SolverError
from seqopt.graph.decisions import pose_decisions
from seqopt.network.build import build_network
from seqopt.responses.table import analyze
from seqopt.sequence.methods import sequential, three_robot_loop
from seqopt.study.published import EQUATIONS
from tests.builders import six_bricks


@dataclass
class Broken:
    """An engine that loses a number of one field."""

    inner: Engine
    field: str
    value: float = np.nan

    @property
    def network(self):
        return self.inner.network

    def solve(self, bricks, grips, want=Want.RESPONSES):
        answer = self.inner.solve(bricks, grips, want)
        wrong = getattr(answer, self.field).copy()
        wrong.reshape(-1)[-1:] = self.value
        return replace(answer, **{self.field: wrong})


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize(
    ("field", "named"),
    [("edge_force", "T_max|F_min"), ("grip_force", "grip force"), ("support", "M_sup|F_sup")],
)
def test_an_engine_of_ones_own_is_held_to_finite_numbers(field, value, named):
    """NaN dropped T_max from the ranks, and the choice was called optimal."""
    network = build_network(six_bricks())
    engine = Broken(ComplianceEngine(network), field, value)
    problem = pose_decisions(engine, three_robot_loop(network), EQUATIONS, also=("T_max", "M_sup"))
    with np.errstate(invalid="ignore"):
        with pytest.raises(SolverError, match=f"({named}) is not finite"):
            analyze(engine, sequential(network))
        with pytest.raises(SolverError, match=f"({named}) is not finite"):
            _ = problem.sums


def test_what_a_library_raises_is_an_error_of_ours():
    """A stiffness whose inverse is no number, past the scene's own check."""
    network = build_network(running_bond(2, 2))
    springs = network.springs
    soft = np.full_like(springs.translational_stiffness, 1e-320)
    weak = replace(network, springs=replace(springs, translational_stiffness=soft))
    with np.errstate(all="ignore"), pytest.raises(SolverError, match="beyond all bounds"):
        ComplianceEngine(weak).solve(4, np.array([[2]]))


@pytest.mark.parametrize("engine", [ComplianceEngine, FrameEngine])
def test_engines_refuse_to_answer_what_is_not_finite(engine):
    """Edges of no length, as a network made by hand may have them."""
    network = build_network(six_bricks())
    position = network.node_position.copy()
    first = network.inner[0]
    joint = network.springs.node[0]
    position[joint] = position[first[0]]
    flat = replace(network, node_position=position)
    with np.errstate(all="ignore"), pytest.raises(SeqoptError, match=r"not finite|ill-cond"):
        engine(flat).solve(2, np.array([[2]]))
