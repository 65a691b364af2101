"""What an engine answers is finite, or an error: never a robot that does not grip."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

import seqopt
from experiments.harness.scenes import running_bond
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.engines.frame import FrameEngine
from seqopt.engines.interface import Engine, Want
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import SeqoptError, SolverError
from seqopt.graph.decisions import pose_decisions
from seqopt.network.build import build_network
from seqopt.responses._enough import what_was_enough
from seqopt.responses.table import LinearRange, analyze
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


# what is said of models that were not taken is what they answer


def arch(density=2000.0, pattern="V"):
    return seqopt.arch_scene(
        seqopt.ArchShape(pitch=np.linspace(1.3, -1.3, 6), pattern=pattern, density=density)
    )


def enough(scene, name):
    engine = seqopt.make_engine(name, scene)
    steps = seqopt.sequential(engine.network)
    table = seqopt.analyze(engine, steps)
    return what_was_enough(LinearRange(engine), {"": table}), steps, table


@pytest.mark.parametrize("name", ["compliance", "auto"])
def test_within_elastic_limits_discrete_elements_change_nothing(name):
    found, steps, table = enough(arch(), name)
    of_epoxy = "" if name == "auto" else " with epoxy"
    said = f"discrete elements{of_epoxy} would change nothing in these steps"
    assert said in found.others
    assert found.below_limit > 0
    assert f"{found.joint} in {found.step}" in found.lines[0]
    detailed = seqopt.analyze(DiscreteEngine(seqopt.build_network(arch())), steps)
    for column in ("F_max_N", "M_sup_Nm", "D_max_1e-3mm"):
        np.testing.assert_allclose(detailed[column], table[column], rtol=1e-7, atol=1e-9)


def test_beyond_elastic_limits_nothing_is_promised():
    """The negative control: so heavy that joints break, and discrete elements answer otherwise."""
    found, steps, table = enough(arch(2e6), "compliance")
    assert found.below_limit < 0
    assert "discrete elements would change is not known" in found.others
    number = int(found.step.removeprefix("step "))
    engine = DiscreteEngine(seqopt.build_network(arch(2e6)))
    try:
        moved = seqopt.analyze(engine, steps[number - 1 : number])["D_max_1e-3mm"][0]
    except SeqoptError:
        return  # it does not even come to rest
    assert moved > 1.01 * table["D_max_1e-3mm"][number - 1]


def test_what_is_left_out_is_that_of_the_run():
    found, _, _ = enough(arch(), "frame")
    assert "not known" in found.others
    assert "what earlier steps lock in" in found.left_out
    engine = seqopt.make_engine("compliance", arch())
    last = seqopt.sequential(engine.network)[-1:]
    alone = what_was_enough(LinearRange(engine), {"": seqopt.analyze(engine, last)})
    assert "what earlier steps lock in" not in alone.left_out
    assert found.facts().keys() == alone.facts().keys()
