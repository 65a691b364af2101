"""Files of others, read without COMPAS, against COMPAS and compas_cra themselves (extra witness).

The samples ship with compas_cra 0.8 (ETH Zurich, Block Research Group, MIT license).
"""

from functools import cache
from pathlib import Path

import pytest

from experiments.stability.parts.witness_cra import SAMPLES, force_only, sample_scene
from seqopt.contact.assembly import bare_assembly
from seqopt.contact.mortar import Mortar
from seqopt.exchange._content import Given
from seqopt.exchange.contacts import flat_face
from seqopt.exchange.exports import export
from seqopt.exchange.imports import import_scene
from seqopt.network.network import build_network
from seqopt.sequence.methods import METHODS
from seqopt.stability.assessment import assess
from seqopt.stability.verdict import Verdict

pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore:scene .* rest on the ground"),  # shelves do
    pytest.mark.filterwarnings("ignore:scene .* interpenetrate"),  # stones of samples do
    pytest.mark.xdist_group("samples of compas_cra"),  # which one worker reads
]
compas = pytest.importorskip("compas")
compas_cra = pytest.importorskip("compas_cra")
FOLDER = Path(compas_cra.SAMPLE)
LARGE = ("cube-curve-short", "cube-curve-tall")  # curve-3-blocks has the same kind of faces
SMALL = [
    pytest.param(n, marks=[pytest.mark.long] * (n in LARGE))
    for n in sorted({*SAMPLES} - {"armadillo_cra"})
]
CURVED = {"curve-3-blocks", "cube-curve-short", "cube-curve-tall"}  # files have faces of the curves


theirs_of = cache(sample_scene)


@cache
def imported(name, **more):
    supports = [str(i) for i in SAMPLES[name].supports] or None
    gap = SAMPLES[name].distance if name == "snake" else None
    given = Given(
        unit="m", density=2000.0, supports=supports, gap=gap, accept_overlaps=True, **more
    )
    return import_scene(FOLDER / f"{name}.json", given=given)


def structure(scene):
    return bare_assembly(build_network(scene), len(scene.bricks))


@pytest.mark.parametrize("name", SMALL)
def test_blocks_and_faces_are_those_of_compas_cra(name):
    """Volumes, and areas of faces that we and compas_cra find or that the file has."""
    scene, theirs = imported(name), theirs_of(name)
    assert len(scene.bricks) == len(theirs.free)
    volume = sum(brick.mass for brick in scene.bricks) / 2000.0
    assert volume == pytest.approx(theirs.volume, rel=2e-3)  # faces that are not flat
    area = sum(flat_face(touch.corner).area for touch in theirs.touches)
    near = 2e-3 if name in CURVED else 1e-6
    assert structure(scene).area.sum() == pytest.approx(area, rel=near)


@pytest.mark.parametrize("name", ["bridge", "snake"])
def test_verdicts_are_those_of_compas_cra(name):
    friction = SAMPLES[name].friction
    mine = assess(structure(imported(name)), Mortar(friction=friction))
    assert mine.verdict is force_only(theirs_of(name), friction).verdict is Verdict.STANDS


def test_too_little_friction_falls_for_both():
    """The bridge needs a coefficient of 0.073."""
    mine = assess(structure(imported("bridge")), Mortar(friction=0.05))
    assert mine.verdict is force_only(theirs_of("bridge"), 0.05).verdict is Verdict.FALLS


def test_a_plan_goes_back_into_the_assembly(tmp_path):
    """COMPAS loads it; blocks stay, and every one that is built says when."""
    scene = imported("bridge")
    steps = METHODS["sequential"](build_network(scene), ())
    path = tmp_path / "back.json"
    path.write_text(export(scene, steps, "compas_assembly", FOLDER / "bridge.json"), "utf-8")
    back = compas.json_load(path)
    graph = back.graph
    assert graph.number_of_nodes() == 16
    order = {int(node): graph.node_attribute(node, "order") for node in graph.nodes()}
    built = {name: place for name, place in order.items() if place is not None}
    assert sorted(built, key=built.get) == list(scene.build_order)
    assert len(graph.attributes["plan"]) == len(steps)
    again = import_scene(path, given=Given(unit="m", density=2000.0, supports=["0", "1"]))
    assert [brick.mass for brick in again.bricks] == [brick.mass for brick in scene.bricks]
