"""The largest over the ground ends is what tables, criteria and limits see."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.network.build import build_network
from seqopt.responses.quantities import RESPONSES, responses_of, support_forces, support_moments
from seqopt.responses.table import analyze, support_columns
from seqopt.sequence.steps import Step, StepKind
from tests.builders import from_both_sides, small_arch


@pytest.fixture(scope="module")
def arch():
    return ComplianceEngine(build_network(from_both_sides(9, "VLR")))


def test_an_arch_built_from_both_sides_reports_its_worse_support(arch25):
    """The fault: a robot relieves one end, and the other, which bears four times as much, hid."""
    inward = zip(range(1, 26), range(25, 0, -1), strict=True)
    order = tuple(itertools.chain.from_iterable(inward))[:25]
    engine = ComplianceEngine(build_network(replace(arch25, build_order=order)))
    answers = engine.solve(16, [[15], [36]])
    each, seen = support_moments(answers), responses_of(engine.network, answers)["M_sup"]
    assert (each.argmax(axis=1) == [1, 0]).all()
    assert (each.max(axis=1) > 4 * each.min(axis=1)).all()
    assert (seen == each.max(axis=1)).all()


def test_the_largest_force_keeps_its_sign():
    """Also where it points down, and the other end's is smaller or none."""
    net = build_network(from_both_sides(7))
    fields = ComplianceEngine(net).solve(5, np.zeros((1, 0), dtype=np.int64))
    for forces, wanted in (
        ([[0, 0, -3.0], [0, 0, 2.0]], -3.0),
        ([[0, 0, -3.0], [4.0, 0, 0]], 4.0),
        ([[0, 0, 0.0], [0, 3.0, -4.0]], -5.0),
        ([[0, 0, -2.0], [0, 0, 2.0]], 2.0),
        ([[0, 0, 2.0], [0, 0, -2.0]], 2.0),
        ([[0, 0, 0.0], [0, 0, 0.0]], 0.0),
    ):
        support = np.zeros((1, 2, 6))
        support[0, :, :3] = forces
        known = replace(fields, support=support)
        assert RESPONSES["F_sup"].of(net, known) == pytest.approx([wanted])
        assert np.abs(support_forces(net, known)).max() == abs(wanted)


def test_tables_have_columns_per_end(arch):
    steps = [Step(1, StepKind.PLACE, 1, (1, None, None)), Step(2, StepKind.PLACE, 8, (2, 3, None))]
    table = analyze(arch, steps)
    assert support_columns(arch.network.scene) == [
        ("F_sup_1_N", "M_sup_1_Nm"),
        ("F_sup_9_N", "M_sup_9_Nm"),
    ]
    assert list(table)[-5:] == [
        "D_std_1e-3mm",
        *itertools.chain.from_iterable(support_columns(arch.network.scene)),
    ]
    assert table.loc[0, ["F_sup_9_N", "M_sup_9_Nm"]].isna().all()  # brick 9 does not stand yet
    assert table.loc[0, "M_sup_Nm"] == table.loc[0, "M_sup_1_Nm"] > 0
    assert table.loc[1, "M_sup_Nm"] == max(table.loc[1, ["M_sup_1_Nm", "M_sup_9_Nm"]])
    assert abs(table.loc[1, "F_sup_N"]) == table.loc[1, ["F_sup_1_N", "F_sup_9_N"]].abs().max()


def test_one_end_needs_no_columns_of_its_own():
    arch = small_arch(3)
    free = replace(arch, grounds=arch.grounds[:1])
    table = analyze(
        ComplianceEngine(build_network(free)), [Step(1, StepKind.PLACE, 1, (1, None, None))]
    )
    assert list(table)[-1] == "D_std_1e-3mm"
