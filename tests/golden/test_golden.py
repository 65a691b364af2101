"""Golden values: what every question gave before the redesign, it gives after, to 1e-9."""

import pytest

from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.responses import _grip_sets
from tests.golden.record import LONG, QUICK, SLOW, answer, composed, stored

SAME = 1e-9  # over the value; what rounding may move
GOLDEN = stored()
slow, long = pytest.mark.slow, pytest.mark.long
QUESTIONS = [
    *(pytest.param(command, id=name) for name, command in QUICK.items()),
    *(pytest.param(command, id=name, marks=slow) for name, command in SLOW.items()),
    *(pytest.param(command, id=name, marks=[slow, long]) for name, command in LONG.items()),
    *(
        pytest.param(
            command, id=name, marks=[slow, pytest.mark.xdist_group(name.partition(":")[0])]
        )
        for name, command in composed().items()
    ),
]


@pytest.fixture(autouse=True, scope="module")
def responses_are_computed_once():
    """Questions on one scene ask for many of the same, which engines of equal scenes know."""
    known, own = {}, _grip_sets.answer

    def kept(engine, block):
        if not isinstance(engine, ComplianceEngine):
            return own(engine, block)
        asked = block.bricks, block.names, block.screen, block.props, block.compiled, block.errors
        grips = block.grips.shape, block.grips.tobytes()
        key = engine.network.scene, engine._accuracy, asked, grips
        if key not in known:
            known[key] = own(engine, block)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_grip_sets, "answer", kept)
        yield


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
