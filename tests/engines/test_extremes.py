"""Extremes of fields without the fields; grips that are not where they should be."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from seqopt.engines.diagnosis import Finding, diagnose
from seqopt.engines.interface import _NAMES, Want, grip_columns, read_compliance
from seqopt.engines.registry import ENGINES
from seqopt.engines.rigid import _growth
from seqopt.engines.rigid._operator import OperatorBuilder
from seqopt.engines.rigid._refinement import Refinement
from seqopt.engines.rigid.compliance import COMPILES, ComplianceEngine, _extremes_in
from seqopt.errors import GripError
from seqopt.network.network import build_network
from seqopt.responses._grip_sets import Block, answer
from seqopt.responses.quantities import CHOSEN_BY, EXTREMES, lengths
from seqopt.scene.scene_file import load_scene
from seqopt.work import _one_thread
from tests.builders import apart, from_both_sides, hinged, six_bricks, small_arch
from tests.direct_solve import solve_dense
from tests.limit_scenes import chain, loosened

needs_numba = pytest.mark.skipif(not COMPILES, reason="no numba")
once = pytest.mark.xdist_group("compiled loops")  # which one worker compiles
SOME = [Want.RESPONSES, Want.EDGES, Want.DISPLACEMENTS, Want.SUPPORT, Want(0)]
CLOSE = 1e-12  # of what is largest


def sets_of(network, bricks, grips, count=300):
    """Random grip sets on free nodes, each node once; two may share a brick."""
    rng, (known, index) = np.random.default_rng(0), network.index_of_grip
    free = known[index < 2 * bricks]
    return np.array([rng.choice(free, grips, replace=False) for _ in range(count)])


def gap_of(found, true):
    """The largest difference, over the largest of each, or a tenth of a newton or micron."""
    scale = (0.1, 0.1, 1e-7, 0.1, 0.1)
    pairs = zip(found, true, scale, strict=True)
    return max(np.abs(a - b).max() / max(np.abs(b).max(), least) for a, b, least in pairs)


def of_fields(engine, bricks, sets, want):
    return _extremes_in(engine.solve(bricks, sets, want), want)


@needs_numba
@once
@pytest.mark.parametrize("want", SOME)
def test_they_are_those_of_the_fields(want):
    engine = ComplianceEngine(build_network(from_both_sides(6)))
    sets = sets_of(engine.network, 6, 5)
    found = engine._extremes(6, sets, want, compiled=True)
    assert gap_of(found, of_fields(engine, 6, sets, want)) <= CLOSE


@needs_numba
@once
@pytest.mark.parametrize("alter", ["soft", "loose"])
def test_what_rows_do_not_answer_is_that_of_the_fields(alter):
    scene = {"soft": small_arch(6), "loose": loosened(chain(16), 1e-7, only_turning=True)}[alter]
    if alter == "soft":
        robots = tuple(replace(robot, stiffness=1e5) for robot in scene.robots)
        scene = replace(scene, robots=robots)
    engine = ComplianceEngine(build_network(scene))
    bricks = len(scene.bricks)
    sets = sets_of(engine.network, bricks, 2, 40)
    found = engine._extremes(bricks, sets, Want.RESPONSES, compiled=True)
    assert gap_of(found, of_fields(engine, bricks, sets, Want.RESPONSES)) <= CLOSE


@needs_numba
@pytest.mark.slow  # compiles where nothing has yet
@once
@pytest.mark.parametrize(("grips", "want"), [(1, Want.RESPONSES), (4, Want(0))])
def test_few_sets_of_a_large_structure_are_read_from_what_grows(grips, want):
    network = build_network(load_scene("dome163"))
    engine = ComplianceEngine(network)
    for bricks in (40, 41):  # joints of which one brick is there alone move with it
        sets = sets_of(network, bricks, grips, 100)
        known, index = network.index_of_grip
        pair = known[np.isin(index, [bricks, bricks + 1])]  # on one brick
        sets[0] = [*pair, *np.setdiff1d(sets[0], pair)][:grips]
        found = engine._extremes(bricks, sets, want, compiled=True)
        assert not engine._kept  # no operator was made
        answer = of_fields(ComplianceEngine(network), bricks, sets, want)
        asked = [want & Want.EDGES, want & Want.EDGES, want & Want.DISPLACEMENTS]
        asked += [want & Want.SUPPORT, True]
        pairs = zip(found, answer, asked, strict=True)
        known = [(one, other) if ask else (one, one) for one, other, ask in pairs]
        assert gap_of(*zip(*known, strict=True)) <= CLOSE


@needs_numba
@pytest.mark.slow  # compiles where nothing has yet
@once
def test_a_wrong_growth_is_seen():
    """The control of the comparison above."""
    network = build_network(load_scene("dome163"))
    engine = ComplianceEngine(network)
    sets = sets_of(network, 40, 3, 100)
    true = engine._extremes(40, sets, Want.RESPONSES, compiled=True)
    engine._builder.growth.wrench[:] *= 1 + 1e-9
    found = engine._extremes(40, sets, Want.RESPONSES, compiled=True)
    assert gap_of(found, true) > CLOSE


@needs_numba
@pytest.mark.slow  # compiles where nothing has yet
@once
def test_no_number_depends_on_how_many_threads_share_the_sets(monkeypatch):
    network = build_network(load_scene("dome163"))
    sets, found = sets_of(network, 60, 3), []
    for threads in (1, 3):
        for module in ("_extremes", "_growth"):
            name = f"seqopt.engines.rigid.{module}._cores"
            monkeypatch.setattr(name, lambda threads=threads: threads)
        monkeypatch.setattr(_growth, "_AT_ONCE", 2**12)
        engine = ComplianceEngine(network)
        found.append(engine._extremes(60, sets, Want.RESPONSES, compiled=True))
    assert all(map(np.array_equal, *found))


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=[needs_numba, once])])
def test_blocks_answer_responses_by_them(compiled):
    engine = ComplianceEngine(build_network(six_bricks()))
    sets = np.sort(sets_of(engine.network, 6, 2, 50), axis=1)
    names = tuple(sorted(EXTREMES))
    found = answer(engine, Block(6, sets, names, compiled=compiled))
    fields = engine.solve(6, sets, Want.RESPONSES)
    for name, values in zip(names, found.T, strict=False):
        true = CHOSEN_BY[name].of(engine.network, fields)
        assert np.abs(values - true).max() <= CLOSE * max(np.abs(true).max(), 1e-9)
    assert np.abs(found[:, len(names) :] - lengths(fields.grip_force)).max() <= 1e-9


@needs_numba
@pytest.mark.slow  # compiles anew
def test_where_no_folder_can_be_written_code_is_compiled_all_the_same(tmp_path):
    code = (
        "import tempfile\n"
        "def refuse(*_, **__): raise OSError('read only')\n"
        "tempfile.TemporaryFile = refuse\n"  # what numba tries folders by
        "import numpy as np\n"
        "from seqopt.engines.rigid._extremes import _add_six as add\n"
        "out = np.zeros(2)\n"
        "add(out, np.ones((6, 1, 2)), 0, np.ones(6))\n"
        "print(out[0], type(add._cache).__name__)\n"
    )
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["6.0", "NullCache"]


def test_without_numba_fields_answer(monkeypatch):
    monkeypatch.setattr("seqopt.engines.rigid.compliance.COMPILES", False)
    monkeypatch.setitem(sys.modules, "seqopt.engines.rigid._extremes", None)  # not imported
    engine = ComplianceEngine(build_network(six_bricks()))
    sets = sets_of(engine.network, 6, 2, 10)
    asked = engine._extremes(6, sets, Want.RESPONSES, compiled=True)
    plain = engine._extremes(6, sets, Want.RESPONSES)
    assert all(map(np.array_equal, asked, plain))


# bLAS keeps to one thread inside engines, and to its own number outside
def threads():
    """How many threads NumPy's and SciPy's linear algebra use; others may know but one."""
    found = [lib for lib in threadpool_info() if lib["user_api"] == "blas"]
    return {lib["num_threads"] for lib in found if "scipy" in lib["prefix"]}


@pytest.fixture
def two_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        if threads() != {2}:
            pytest.skip("NumPy's linear algebra has but one thread here")
        yield


def test_one_thread_inside_and_two_after(two_threads):
    with _one_thread():
        assert threads() == {1}
    assert threads() == {2}
    with pytest.raises(ZeroDivisionError), _one_thread():
        _ = 1 / 0
    assert threads() == {2}


@pytest.mark.parametrize(
    ("owner", "name", "loose"), [(OperatorBuilder, "operator", False), (Refinement, "solve", True)]
)
def test_engines_keep_to_one_thread(two_threads, monkeypatch, owner, name, loose):
    seen = []
    work = getattr(owner, name)

    def watched(self, *asked):
        seen.append(threads())
        return work(self, *asked)

    monkeypatch.setattr(owner, name, watched)
    scene = hinged(six_bricks(), 2) if loose else six_bricks()
    ComplianceEngine(build_network(scene)).solve(6, [[3, 8, 11]])
    assert seen == [{1}]
    assert threads() == {2}


# grips that are not where they should be
SETS = [[3, 8, 11], [4, 5, 9]]  # two hold one brick in the second


def drawn(sets, size, seed=0):
    return size * np.random.default_rng(seed).normal(size=(*np.shape(sets), 3))


@pytest.fixture(params=ENGINES)
def engine(request):
    return ENGINES[request.param](build_network(six_bricks("VLR")))


def test_held_nodes_go_along_and_answers_add_up(engine):
    """Small enough that no joint leaves its elastic limits, for engines that have any."""
    net = engine.network
    ways = [drawn(SETS, 1e-8, seed) for seed in range(2)]
    still, one, two, both = (
        engine.solve(6, SETS, Want.ALL, m) for m in (None, *ways, ways[0] + ways[1])
    )
    nodes = net.inner.ravel()[grip_columns(net, 6, SETS)[0]]
    assert one.displacement[0, nodes] == pytest.approx(ways[0][0], rel=1e-4, abs=1e-14)
    for name in _NAMES:
        a, b, c, d = (getattr(f, name) for f in (still, one, two, both))
        assert np.abs(b + c - a - d).max() <= 1e-5 * max(np.abs(each).max() for each in (a, b, c))
        assert np.abs(a - b).max() > 1e-3 * np.abs(a).max() or name == "grip_moment"
    assert apart(engine.solve(6, SETS, Want.ALL, np.zeros((2, 3, 3))), still) <= 1e-12


def test_engines_agree(engine):
    net = engine.network
    moved = drawn(SETS, 1e-8)
    columns = grip_columns(net, 6, SETS)
    direct = solve_dense(net, 6, columns, read_compliance(net, columns, SETS, moved))
    assert apart(engine.solve(6, SETS, Want.ALL, moved), direct) <= 1e-5
    assert apart(engine.solve(6, SETS, Want.ALL), direct) > 1e-3  # the measure can fail


@pytest.mark.parametrize(
    ("moved", "named"),
    [
        ([[0.1, 0.0, 0.0]], r"moved has shape \(1, 3\); give lengths in meters.*\(2, 3, 3\)"),
        (np.full((2, 3, 3), np.nan), "moved: a length is not finite"),
        ("far", "moved: give lengths in meters"),
    ],
)
def test_wrong_ways_are_refused(engine, moved, named):
    with pytest.raises(GripError, match=named):
        engine.solve(6, SETS, Want.RESPONSES, moved)


def test_a_brick_is_not_stretched(engine25):
    """Along it both of its nodes go halfway; all else is as asked."""
    net, grips = engine25.network, np.array([[22, 23, 3]])
    first, second = (net.node_position[net.node_name.index(int(n))] for n in grips[0, :2])
    axis = (second - first) / np.linalg.norm(second - first)
    moved = drawn(grips, 1e-4)
    stretched = moved + np.array([[-2e-3, 6e-3, 0.0]])[..., None] * axis
    along = moved + np.array([[2e-3, 2e-3, 0.0]])[..., None] * axis
    one, other = (engine25.solve(18, grips, Want.ALL, m) for m in (stretched, along))
    assert apart(one, other) <= 1e-12
    assert apart(engine25.solve(18, grips, Want.ALL, moved), other) > 1e-3
    edge = np.flatnonzero((net.edge_spring < 0) & (net.edge_brick == 11))
    assert not one.edge_force[0, edge].any()


def test_diagnosis_asks_where_hands_are(engine25):
    moved = drawn([3, 20, 33], 4e-4)
    found = diagnose(engine25, 18, [3, 20, 33], moved)
    assert found.finding is Finding.SOLVED_WELL
    assert diagnose(engine25.network, 18, [3, 20, 33], moved).finding is Finding.SOLVED_WELL

    class Still:
        """An engine that takes hands for still."""

        network = engine25.network

        def solve(self, bricks, grips, want=Want.RESPONSES, moved=None):
            return engine25.solve(bricks, grips, want)

    assert diagnose(Still(), 18, [3, 20, 33], moved).residuals.grips > 0.1
