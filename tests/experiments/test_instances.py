"""The library of instances: made again as it is, and what is known of each is judged."""

import pytest

import seqopt
from experiments.harness.results import stored
from experiments.instances.parts.cp_sat import as_cp_sat
from experiments.instances.parts.library import HOME, LARGE, MADE, instance, known, made
from seqopt.errors import SolverError
from tests.builders import ROOT

KNOWN = known()


def test_it_is_whole():
    assert len(MADE) >= 40
    assert {path.stem for path in HOME.glob("*.npz")} == set(MADE) == set(KNOWN)
    sizes = [path.stat().st_size for path in HOME.glob("*.npz")]
    assert max(sizes) <= 1_500_000
    assert sum(sizes) < 12_000_000
    assert set(stored("instance_large")["instance"]) == set(LARGE)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (k % 6 > 0)) for k, n in enumerate(MADE)]
)
def test_what_is_known_of_it_is_judged(name):
    found = KNOWN[name]
    answer = {"nodes": found["nodes"], "values": found["values"]}
    proof = seqopt.judge_instance(instance(name), answer, found["claims"])
    for bound, said in zip(proof.bounds[:1], found["bounds"][:1], strict=True):
        assert bound >= said - 1e-6 * abs(said)


def test_a_value_that_is_not_so_is_seen():
    name = next(iter(KNOWN))
    answer = {"nodes": KNOWN[name]["nodes"], "values": [0.99 * KNOWN[name]["values"][0]]}
    with pytest.raises(SolverError, match="as claimed"):
        seqopt.judge_instance(instance(name), answer)


@pytest.mark.parametrize(
    "name",
    [
        "chain-8",
        "pair-25-peak",
        pytest.param("chain-12-way", marks=pytest.mark.slow),
        pytest.param("free-7-robust", marks=pytest.mark.slow),
        pytest.param("time-7-unequal", marks=pytest.mark.slow),
        pytest.param("order-wall-6", marks=pytest.mark.slow),
    ],
)
def test_it_is_made_again_as_it_is(name, tmp_path):
    """Values of the last digits may differ between machines; what is asked and the graph do not."""
    again, stored = made(name, tmp_path), (HOME / f"{name}.npz").read_bytes()
    if again == stored:
        return
    (tmp_path / "again.npz").write_bytes(again)
    first, second = instance(name), seqopt.read_instance(tmp_path / "again.npz")
    assert (first.goals, first.columns) == (second.goals, second.columns)
    assert (first.source == second.source).all()
    assert (first.target == second.target).all()
    assert first.amounts == pytest.approx(second.amounts, rel=1e-6, abs=1e-9)


def test_built_in_ones_are_of_the_library():
    built_in = sorted((ROOT / "seqopt" / "data" / "instances").glob("*.npz"))
    assert built_in
    for path in built_in:
        assert path.read_bytes() == (HOME / path.name).read_bytes()
        assert seqopt.read_instance(path.stem) == instance(path.stem)


@pytest.mark.parametrize("name", ["chain-8", "pair-25-peak"])
def test_cp_sat_finds_the_same_value(name):
    cp_model = pytest.importorskip("ortools.sat.python.cp_model")
    text_format = pytest.importorskip("google.protobuf.text_format")
    model, solver = cp_model.CpModel(), cp_model.CpSolver()
    text_format.Parse(as_cp_sat(instance(name)), model.Proto())
    assert not model.validate()
    assert solver.solve(model) == cp_model.OPTIMAL
    assert solver.objective_value == pytest.approx(KNOWN[name]["values"][0], rel=1e-5)
