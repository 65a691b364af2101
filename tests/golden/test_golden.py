"""Golden values: what every question gave before the redesign, it gives after, to 1e-9."""

from __future__ import annotations

import pytest

from tests.golden.record import LONG, QUICK, SLOW, answer, composed, stored

SAME = 1e-9  # over the value; what rounding may move
GOLDEN = stored()
slow, long = pytest.mark.slow, pytest.mark.long
QUESTIONS = [
    *(pytest.param(command, id=name) for name, command in QUICK.items()),
    *(pytest.param(command, id=name, marks=slow) for name, command in (SLOW | composed()).items()),
    *(pytest.param(command, id=name, marks=[slow, long]) for name, command in LONG.items()),
]


@pytest.mark.parametrize("command", QUESTIONS)
def test_the_answer_is_as_before(command, request, tmp_path):
    name = request.node.callspec.id
    found, before = answer(command, tmp_path), GOLDEN.get(name)
    assert (found is None) == (before is None), found
    for goal, value in (before or {}).items():
        assert found[goal] == pytest.approx(value, rel=SAME, abs=1e-12)


def test_every_stored_value_is_asked_for():
    assert {*GOLDEN} <= {*QUICK, *SLOW, *LONG, *composed()}


@slow
def test_another_question_has_another_answer(tmp_path):
    """A control: what is compared does tell questions apart."""
    other = answer(SLOW["loop, ranks, cascade"], tmp_path)
    assert other["sum"] != pytest.approx(GOLDEN["loop, ranks"]["sum"], rel=SAME)
