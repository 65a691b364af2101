"""What is said of models that were not taken is what they answer."""

from __future__ import annotations

import numpy as np
import pytest

import seqopt
from seqopt.engines.discrete.engine import DiscreteEngine
from seqopt.errors import SeqoptError
from seqopt.responses._enough import what_was_enough
from seqopt.responses.table import LinearRange


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
