"""Problems without a choice; the search that solves only the models it meets."""

from dataclasses import replace

import numpy as np
import pytest

from experiments.harness.layers import LayeredCosts
from seqopt._cli.main import main
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import (
    InfeasibleError,
    NothingFoundError,
    PluginWarning,
    ProblemError,
    SolverError,
)
from seqopt.graph.formulation import FormulationKind, Solution, find_formulation, formulations
from seqopt.network.network import build_network
from seqopt.plan.solve import graph_of, pose, solve
from seqopt.problem.requirements import Limit
from seqopt.scene.arch import ArchShape, arch_scene
from seqopt.scene.scene_file import save_scene
from seqopt.sequence.methods import modified_sequential, three_robot_loop
from seqopt.study import EQUATIONS
from tests.builders import install, six_bricks
from tests.layered import Budget, Costs, answer


def test_a_schedule_without_an_open_move_is_no_problem(capsys, tmp_path):
    count = 2
    scene = arch_scene(ArchShape(pitch=[1.2, 0.7][:count]))
    network = build_network(scene)
    with pytest.raises(ProblemError, match=f"with {count} bricks it leaves no grip open"):
        pose(ComplianceEngine(network), modified_sequential(network), EQUATIONS)
    path = tmp_path / "scene.json"
    save_scene(scene, path)
    words = ("--schedule", "modified-sequential", "--out", str(tmp_path / "out"))
    for more in ((), ("--no-proof",)):
        formulation = ("--formulation", "cascade")
        assert main(["optimize", str(path), *formulation, *words, *more]) == 2
        assert "leaves no grip open" in capsys.readouterr().err
    assert main(["compare", str(path)]) == 0
    assert "needs three robots and four bricks" in capsys.readouterr().out


@pytest.fixture(scope="module")
def problem():
    network = build_network(six_bricks())
    return pose(ComplianceEngine(network), three_robot_loop(network), EQUATIONS)


NODES = (1,), (2,), (3,)
PATH = Solution(NODES, (1.0,), (0.0,))
NONSENSE = {
    "None": None,
    "a tuple": (NODES, 1.0),
    "an array": np.zeros(3),
    "a class": Solution,
    **{
        f"{name} {said}": replace(PATH, **{name: value})
        for name, values in {
            "states": {
                "None": None,
                "of floats": ((0.0,), (1.0,), (0.5,)),
                "of None": ((None,),) * 3,
                "nested twice": ((NODES,),) * 3,
                "below": ((-1,), (2,), (3,)),
                "of NaN": ((np.nan,),) * 3,
                "not nested": (1, 2, 3),
                "a table of floats": np.zeros((3, 2)),
                "too long": ((1,),) * 9,
                "none": (),
                "of two nodes": ((1, 0), (2, 0), (3, 0)),
                "beyond": ((10**6,), (2,), (3,)),
                "beyond all bounds": ((10**30,), (2,), (3,)),
            },
            "objective": {
                "None": None,
                "of text": ("least",),
                "NaN": (np.nan,),
                "complex": (1j,),
                "beyond all bounds": (10**400,),
                "of two goals": (1.0, 2.0),
            },
            "bound": {"None": None, "NaN": (np.nan,), "above": (2.0,)},
            "prices": {"None": None, "text": ("dear",), "a mapping": {"a": "dear"}},
            "stopped": {"a number": 3},
            "compile_seconds": {"NaN": np.nan, "below zero": -1.0},
        }.items()
        for said, value in values.items()
    },
}


@pytest.mark.parametrize("what", NONSENSE)
def test_a_formulation_that_returns_nonsense_has_failed(problem, what):
    made = replace(find_formulation("overlap_dp"), name="odd", solve=lambda _: NONSENSE[what])
    with pytest.raises(SolverError) as caught:
        solve(problem, made)
    assert "\n" not in str(caught.value)


def says_so(_):
    raise InfeasibleError("no choice is within all budgets")


HEURISTIC = FormulationKind.HEURISTIC


@pytest.mark.parametrize(
    ("bounds", "kind", "error", "said"),
    [
        ((0.5,), None, InfeasibleError, "every choice uses at least 1 of 'b0'"),
        ((0.5,), HEURISTIC, InfeasibleError, "every choice uses at least 1 of 'b0'"),
        ((1.5,), None, SolverError, "labels says that no choice is .* and some are"),
        ((3.0, 3.0), HEURISTIC, SolverError, "labels says that no choice is .* and some are"),
        ((2.4, 2.4), HEURISTIC, InfeasibleError, "2.4 of 'b0' and 2.4 of 'b1' cannot be kept"),
    ],
)
def test_that_budgets_conflict_is_proven(bounds, kind, error, said):
    """Two moves of two candidates; budgets that some choices keep, and some that none does."""
    costs = LayeredCosts((np.ones(2),) * 2, (np.zeros((1, 2)), np.zeros((2, 2))))
    labels = find_formulation("labels")
    formulation = replace(labels, solve=says_so, kind=kind or labels.kind)
    budgets = tuple(
        Budget(f"b{k}", (np.array([0.5, 2.0])[:: 1 - 2 * k],) * 2, costs.shared, bound)
        for k, bound in enumerate(bounds)
    )
    with pytest.raises(error, match=said) as caught:
        answer(Costs(costs, budgets), formulation)
    assert type(caught.value) is error


@pytest.mark.parametrize(
    ("kind", "error", "said"),
    [
        (FormulationKind.EXACT, InfeasibleError, "claimed by labels, and not proven: no choice"),
        (HEURISTIC, NothingFoundError, "labels found none, and there may be one: no choice"),
    ],
)
def test_a_heuristic_only_says_that_it_found_none(monkeypatch, kind, error, said):
    """Where the judge gives up, as here with no partial choice kept, an exact one claims it."""
    monkeypatch.setattr("seqopt.judge.arithmetic.MOST", 0)
    monkeypatch.setattr("seqopt.judge.arithmetic.MIXTURES", 0)
    costs = LayeredCosts((np.ones(2),) * 2, (np.zeros((1, 2)), np.zeros((2, 2))))
    both = [(np.array([0.5, 2.0])[::turn],) * 2 for turn in (1, -1)]
    budgets = tuple(Budget(f"b{k}", b, costs.shared, 2.5) for k, b in enumerate(both))
    formulation = replace(find_formulation("labels"), solve=says_so, kind=kind)
    with pytest.raises(error, match=said) as caught:
        answer(Costs(costs, budgets), formulation)
    assert type(caught.value) is error


@pytest.mark.slow
def test_one_that_cannot_be_used_is_left_out_of_all_others(monkeypatch, tmp_path, capsys):
    """A package of others that is wrong spoils no command that does not ask for it."""
    whole = formulations()
    own = {"oddest": "odd_formulation:X", "oddly": "odd_formulation:Y"}
    install(tmp_path, "seqopt.formulations", odd="math:pi", odder="no_such_package:X", **own)
    text = "from formulations.cascade import FORMULATION as F\n"
    text += "from dataclasses import replace\nX = replace(F, kind='exact')\n"
    text += "Y = replace(F, answers=('goals', 'walls'))\n"
    (tmp_path / "odd_formulation.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(PluginWarning) as seen:
        assert formulations() == whole
    assert [str(each.message).split("'")[1] for each in seen] == ["odd", "odder", "oddest", "oddly"]
    words = ("wall:columns=2,courses=2", "--no-stability")
    assert main(["compare", *words]) == 0
    lines = [x for x in capsys.readouterr().err.splitlines() if x.startswith("seqopt: warning")]
    assert ["math:pi is a float" in x for x in lines] == [True, False, False, False]
    assert lines[2].endswith("has str as kind; correct it; it is left out")
    assert "answers walls; give some of costs, goals, " in lines[3]
    with pytest.raises(ProblemError, match="'odder': no_such_package:X cannot be loaded: Module"):
        find_formulation("odder")
    assert main(["optimize", *words, "--formulation", "odd"]) == 2


# the search that solves only the models it meets: dead ends, what ranks depend on
@pytest.mark.slow
def test_a_dead_end_that_the_cascade_foresees(engine25, loop25):
    problem = pose(engine25, loop25, EQUATIONS, limits=[Limit("T_max", 64.0)])
    with pytest.raises(NothingFoundError, match="step 31: no grip is allowed after the choices"):
        solve(problem, "cascade", proof=False)
    assert len(solve(problem, "cascade").nodes) == len(loop25.moves)


def test_ranks_of_a_shared_step_depend_on_the_choice_before_it(engine25, loop25):
    graph = graph_of(pose(engine25, loop25, EQUATIONS))
    step = next(step for step in loop25.steps if len(step.moves) > 1)
    every = graph.space.candidates(step.number).states
    first, last = graph.space.open_columns(step.number)
    alone = graph.candidates.among(step.number, every, alone=True)
    ranks = {}
    for place in np.unique(every[:, first]):
        rows = every[:, first] == place
        own = graph.candidates.of_branches(step.number, every[rows])
        assert own == pytest.approx(alone[rows])
        ranks[place] = dict(zip(every[rows, last].tolist(), own.tolist(), strict=True))
    one, other, *_ = ranks.values()
    assert any(one[node] != other[node] for node in one.keys() & other.keys())


@pytest.mark.parametrize(
    ("name", "options"),
    [("overlap_dp", {}), ("cascade", {"charge": "earlier"}), ("rank_search", {"horizon": 2})],
)
def test_what_looks_further_leaves_the_proof_out(problem, name, options):
    plan, proven = (solve(problem, name, proof=proof, options=options) for proof in (False, True))
    assert plan.certificate is None
    assert plan.status == "unproven"
    assert plan.steps == proven.steps
    assert plan.objective == pytest.approx(proven.objective)
