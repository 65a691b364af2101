"""Instances: compiled, written, read, solved and judged; checks are given wrong answers too."""

import json
import zipfile
from dataclasses import replace

import highspy
import numpy as np
import pytest

import seqopt
from formulations.solvers import _solve_file
from seqopt._cli.main import main
from seqopt.errors import FileError, ProblemError, SolverError
from seqopt.instances._files import TEXT
from seqopt.scene.scene import with_robots
from tests.builders import small_arch

TIMES = "fetch=30,place=10,approach=10,grip=5,release=5"


def posed(kind):
    """A small problem of every kind of goal."""
    scene = with_robots(small_arch(4), 3).with_durations(TIMES, "rob1:fetch=75")
    if kind in ("sum", "capped", "tail"):
        scene = seqopt.load_scene(f"chain:bricks={6 if kind == 'tail' else 8}")
    engine = seqopt.make_engine("compliance", scene)
    worst = seqopt.CRITERIA["worst-ratio"]
    free, loop = seqopt.FreeRules(), seqopt.three_robot_loop(engine.network)
    drawn = seqopt.scenarios(scene, count=3, seed=1)
    asked = {
        "sum": (loop, seqopt.CRITERIA["weighted"], (), {}),
        "capped": (loop, seqopt.CRITERIA["weighted"], (), {"budgets": "travel=0.9"}),
        "tail": (loop, worst, (), {"scenarios": drawn, "over": "cvar=0.5"}),
        "peak": (free, worst, "minmax,steps", {}),
        "within": (free, worst, "sum(T_max),steps", {"budgets": ["regrips=1"]}),
        "orders": (free, worst, "minmax,travel", {"orders": "tied"}),
        "time": (free, worst, "makespan", {}),
        "late": (free, worst, "minmax,makespan", {"budgets": ["regrips=1"]}),
        "robust": (free, worst, "minmax", {"scenarios": drawn}),
    }
    moves, criterion, goals, more = asked[kind]
    return seqopt.pose(engine, moves, criterion, goals, **more)


KINDS = ("sum", "capped", "tail", "peak", "within", "robust")
LONG = ("orders", "time", "late")
LATE = {"orders": ("overlap_mip",), "tail": ("overlap_mip", "overlap_lp")}
EVERY = [*KINDS, *(pytest.param(kind, marks=pytest.mark.slow) for kind in LONG)]


@pytest.fixture(scope="module")
def compiled():
    made = {}

    def of(kind):
        if kind not in made:
            made[kind] = seqopt.compile_instance(posed(kind), name=kind)
        return made[kind]

    return of


@pytest.mark.parametrize("kind", EVERY)
def test_it_is_read_as_it_was_written(compiled, tmp_path, kind):
    one = compiled(kind)
    for path in (tmp_path / "a.npz", tmp_path / "b.npz"):
        seqopt.save_instance(one, path)
    read = seqopt.read_instance(tmp_path / "a.npz")
    assert read == one
    assert read.timed == one.timed
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    with np.load(tmp_path / "a.npz") as archive:
        assert np.array_equal(archive["source"], one.source)
        assert json.loads(archive["instance.json"])["goals"][0]["name"] == one.goals[0].name


@pytest.mark.parametrize("kind", EVERY)
def test_the_best_of_the_scene_is_the_best_of_the_instance(compiled, kind):
    one, plan = compiled(kind), seqopt.solve(posed(kind))
    found = seqopt.solve(one)
    value = plan.certificate.objective
    assert found.certificate.objective == pytest.approx(value, rel=1e-6)
    assert found.certificate.bound <= found.certificate.objective
    summary = json.loads(json.dumps(found.summary()))
    assert summary["instance"] == kind
    assert summary["nodes_of_path"] == [*found.nodes]
    if kind not in ("tail",):
        assert found.gap <= 1e-6, found


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS + LONG)
def test_every_formulation_that_fits_agrees(compiled, kind):
    one = compiled(kind)
    best = seqopt.solve(one).certificate.objective
    for name in one.fitting:
        if name in LATE.get(kind, ("makespan_flow",)):
            continue  # they take long; tests of their own hold them to others
        try:
            plan = seqopt.solve(one, name)
        except SolverError as error:
            assert "use a formulation that keeps budgets" in str(error)  # noqa: PT017
            continue
        judged = seqopt.judge_instance(one, plan.nodes)
        assert judged.values == pytest.approx(plan.certificate.values, rel=1e-9)
        assert judged.objective >= best * (1 - 1e-6)


@pytest.mark.parametrize("criterion", ["equations-2-3", "weighted"])
@pytest.mark.parametrize("name", ["cascade", "rank_search", "beam"])
def test_heuristics_answer_as_on_the_scene(tmp_path, name, criterion):
    """What a search of one move alone is charged is part of the file: ranks of its candidates."""
    engine = seqopt.make_engine("compliance", seqopt.load_scene("chain:bricks=8"))
    moves = seqopt.three_robot_loop(engine.network)
    problem = seqopt.pose(engine, moves, seqopt.CRITERIA[criterion])
    one = seqopt.compile_instance(problem)
    seqopt.save_instance(one, tmp_path / "x.npz")
    read = seqopt.read_instance(tmp_path / "x.npz")
    scene, found = seqopt.solve(problem, name), seqopt.solve(read, name)
    assert found.certificate.objective == pytest.approx(scene.certificate.objective, rel=1e-12)
    assert read == one
    assert replace(read, alone=None) != one  # a control: it is compared
    bad = replace(one, alone=np.full_like(one.alone, np.inf))
    seqopt.save_instance(bad, tmp_path / "bad.npz")
    with pytest.raises(FileError, match="alone: give finite numbers"):
        seqopt.read_instance(tmp_path / "bad.npz")


def test_what_does_not_fit_says_what_does(compiled):
    with pytest.raises(ProblemError, match="use overlap_dp"):
        seqopt.solve(compiled("sum"), "minimax")
    with pytest.raises(ProblemError, match="use makespan_labels"):
        seqopt.solve(compiled("time"), "overlap_dp")


@pytest.mark.parametrize("kind", KINDS[:4])
def test_a_solver_reads_its_program_back(compiled, tmp_path, kind):
    one, path = compiled(kind), tmp_path / "x.mps"
    seqopt.save_instance(one, path)
    solver = highspy.Highs()
    solver.setOptionValue("log_to_console", False)  # noqa: FBT003
    assert solver.readModel(str(path)) == highspy.HighsStatus.kOk
    end, value, bound, found = _solve_file(str(path), 60.0)
    least = seqopt.solve(one).certificate.objective
    assert bound <= least * (1 + 1e-6)
    assert value >= least * (1 - 1e-6)
    assert end == "kOptimal"
    assert value == pytest.approx(least, rel=1e-6)
    if kind == "capped":
        arcs = np.flatnonzero(np.array(found[: one.arcs]) > 0.5)
        assert seqopt.judge_instance(one, {"arcs": arcs}).objective == pytest.approx(value)


def test_wrong_answers_are_refused(compiled):
    one = compiled("sum")
    plan = seqopt.solve(one)
    nodes, value = [*plan.nodes], plan.certificate.objective
    for wrong, said in [
        ({"nodes": [nodes[0], nodes[0]]}, "no arc leads from node"),
        ({"nodes": nodes[:-1]}, "the path stops at node"),
        ({"nodes": [*nodes[:-1], one.nodes]}, "does not exist"),
        ({"arcs": [one.arcs - 1]}, "the path is at node 0"),
        ({"nodes": nodes, "values": [value * 0.99]}, "as claimed"),
        ({"nodes": nodes, "bounds": [{"value": value * 1.1}]}, "the path takes"),
        ({"nodes": nodes, "bounds": [{"prices": {"way": 1.0}}]}, "it is no cap"),
    ]:
        with pytest.raises(SolverError, match=said):
            seqopt.judge_instance(one, wrong)


def test_a_bound_without_proof_is_claimed(compiled):
    one = compiled("tail")
    plan = seqopt.solve(one)
    value = plan.certificate.objective
    proof = seqopt.judge_instance(one, plan.nodes, [value])
    assert proof.claimed_gap == 0.0
    assert proof.gap > proof.claimed_gap


def test_a_peak_is_proven_by_a_cut_that_the_judge_finds(compiled):
    one = compiled("peak")
    plan = seqopt.solve(one)
    proof = seqopt.judge_instance(one, plan.nodes)
    assert proof.bounds == proof.values
    amounts = one.amounts.copy()
    amounts[one.source == 0, 0] = 0.0
    amounts[one.source != 0, 0] *= 0.5
    cheap = replace(one, amounts=amounts)
    assert seqopt.judge_instance(cheap, plan.nodes).bound < 0.6 * plan.certificate.objective


def test_prices_prove_a_capped_sum_and_dearer_ones_less(compiled):
    one = compiled("capped")
    plan = seqopt.solve(one, "lagrangian")
    name = one.caps[0].name
    ((price,),) = plan.selection.prices
    good = seqopt.judge_instance(one, plan.nodes, [{"prices": {name: price}}])
    assert good.bound <= good.objective
    less = replace(one, caps=(one.caps[0]._replace(most=0.5 * one.caps[0].most),))
    with pytest.raises(SolverError, match="more than the"):
        seqopt.judge_instance(less, plan.nodes)
    with pytest.raises(SolverError, match="give a number from 0"):
        seqopt.judge_instance(one, plan.nodes, [{"prices": {name: -1.0}}])


def test_labels_prove_a_time_and_missing_ones_do_not(compiled):
    one = compiled("time")
    plan = seqopt.solve(one, "makespan_labels")
    value = plan.certificate.objective
    (proof,) = plan.selection.proofs
    assert len(proof.labels)  # prices alone do not prove it
    _, firsts = np.unique(one.timed.kinds, return_index=True)
    shares = proof.prices[:, [0, *(1 + firsts)]]
    nodes = proof.states[:, 1]

    def judged(rows, claimed=value):
        labels = {"nodes": nodes[rows], "values": proof.labels[rows]}
        claim = {"value": claimed, "shares": shares, "labels": labels}
        return seqopt.judge_instance(one, plan.nodes, [claim])

    every = np.arange(len(nodes))
    assert judged(every).gap == 0.0
    with pytest.raises(SolverError, match="labels do not prove"):
        judged(every[1:])
    with pytest.raises(SolverError, match="do not prove"):
        judged(every, value * 1.01)
    with pytest.raises(SolverError, match="add up to 1"):
        seqopt.judge_instance(one, plan.nodes, [{"shares": [1.0] * shares.shape[1]}])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 two 3", "no number of a node"),
        ("{", "not JSON"),
        ('{"path": [1]}', "none of nodes"),
        ('{"nodes": [1.5]}', "whole numbers"),
        ('{"nodes": [1], "bounds": [{"proof": 1}]}', "none of value"),
        ('{"nodes": [1], "values": {"least": 1}}', "least is none of"),
    ],
)
def test_what_cannot_be_read_is_named(compiled, text, said):
    with pytest.raises(ProblemError, match=said):
        seqopt.judge_instance(compiled("sum"), text)


def test_files_that_are_no_instances_are_named(tmp_path, compiled):
    (tmp_path / "x.npz").write_bytes(b"no")
    with pytest.raises(FileError, match="it is no instance"):
        seqopt.read_instance(tmp_path / "x.npz")
    with pytest.raises(FileError, match="chain-12-way"):
        seqopt.read_instance("chain-12-wy")
    with pytest.raises(FileError, match="no format"):
        seqopt.save_instance(compiled("sum"), tmp_path / "x.xyz")


@pytest.mark.parametrize(
    ("part", "wrong"),
    [
        ("caps", {"most": float("nan")}),
        ("caps", {"most": -1.0}),
        ("goals", {"columns": [0, 0]}),
        ("goals", {"kind": "tail", "columns": []}),
        ("goals", {"columns": [9]}),
    ],
)
def test_a_text_that_asks_for_what_is_not_there_is_refused(compiled, tmp_path, part, wrong):
    path = tmp_path / "x.npz"
    seqopt.save_instance(compiled("capped"), path)
    with np.load(path) as archive:
        parts = {f"{name}.npy": archive.zip.read(f"{name}.npy") for name in archive if name != TEXT}
        document = json.loads(archive[TEXT])
    document[part][0] |= wrong
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in {**parts, TEXT: json.dumps(document)}.items():
            archive.writestr(name, content)
    with pytest.raises(FileError, match=r"instance.json, |column 9 is named"):
        seqopt.read_instance(path)


def test_commands_write_and_judge(tmp_path, capsys):
    out = tmp_path / "small"
    words = ["instance", "chain:bricks=8", "--budget", "travel=0.9", "--out", str(out)]
    assert main(words) == 0
    assert {p.suffix for p in out.iterdir()} == {".npz", ".mps", ".json"}
    one = seqopt.read_instance(out)
    assert one.facts["made_by"] == "seqopt instance chain:bricks=8 --budget travel=0.9"
    plan = seqopt.solve(one)
    mine = tmp_path / "mine.csv"
    mine.write_text("node\n" + "\n".join(map(str, plan.nodes)), "utf-8")
    assert main(["judge", str(out), str(mine)]) == 0
    assert "no path takes less" in capsys.readouterr().out
    mine.write_text("arcs 5 5", "utf-8")
    assert main(["judge", str(out), str(mine)]) == 1
    assert "the path is at node 0" in capsys.readouterr().err
    assert main(["instance", "chain:bricks=7", "--out", str(tmp_path / "x.mps")]) == 0
    assert "seqopt judge its .npz SOLUTION" in capsys.readouterr().out
    assert main(["instance", "arch25", "--out", str(tmp_path / "x.txt")]) == 2
    assert main(["judge", str(mine), str(mine)]) == 2
