"""Plans go into the formats of others, and folders of plans are read again."""

from __future__ import annotations

import json

import pytest

from seqopt._files import write_text
from seqopt.errors import SceneError, SceneWarning, StepError
from seqopt.exchange._content import Given
from seqopt.exchange.exports import export_plan
from seqopt.exchange.imports import import_scene
from seqopt.network.build import build_network
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind
from tests.blocks import box
from tests.builders import six_bricks
from tests.documents import DOCUMENTS, obj

SCENE = six_bricks()
STEPS = METHODS["cantilever"](build_network(SCENE), ())


@pytest.fixture
def sources(tmp_path):
    """Write documents; return the scenes that they become."""

    def write(name):
        path = tmp_path / f"{name}.json"
        write_text(path, json.dumps(DOCUMENTS[name]))
        return path, import_scene(path, given=Given(unit="m", density=2000.0))

    return write


def test_an_assembly_keeps_all_and_gains_the_plan(sources):
    path, scene = sources("assembly")
    steps = METHODS["sequential"](build_network(scene), ())
    whole = json.loads(export_plan(scene, steps, "compas_assembly", path))
    graph = whole["data"]["graph"]["data"]
    assert [graph["node"][key].get("order") for key in ("0", "4", "7")] == [None, 0, 1]
    before = DOCUMENTS["assembly"]["data"]["graph"]["data"]["node"]["4"]
    assert graph["node"]["4"]["block"] == before["block"]
    assert graph["node"]["4"]["held"][0][0] == 1
    names, count, told = [robot.name for robot in scene.robots], 0, []
    for row in graph["attributes"]["plan"]:
        count += len(row["placed"])
        grips = tuple(row["holds"].get(name, [None])[0] for name in names)
        told.append(Step(row["step"], StepKind(row["type"]), count, grips))
    assert tuple(told) == steps


def test_what_does_not_fit_is_refused(sources, tmp_path):
    path, _ = sources("assembly")
    with pytest.raises(StepError, match="format is 'xml'; give one of tasks"):
        export_plan(SCENE, STEPS, "xml")
    with pytest.raises(StepError, match=r"give the assembly that was imported \(--source\)"):
        export_plan(SCENE, STEPS, "compas_assembly")
    with pytest.raises(StepError, match="takes no source"):
        export_plan(SCENE, STEPS, "tasks", path)
    with pytest.raises(StepError, match="the source has no block 1"):
        export_plan(SCENE, STEPS, "compas_assembly", path)
    meshes, _ = sources("meshes")
    with pytest.raises(SceneError, match="an object is expected"):
        export_plan(SCENE, STEPS, "compas_assembly", meshes)


# blocks that interpenetrate, or stand there twice, are named and never pass in silence


BRICK = (0.2, 0.1, 0.06)


def bricks(*places):
    return [box(BRICK, at=(x, 0.0, z)) for x, z in places]


HALF = bricks((0.0, 0.0), (0.1, 0.0), (0.05, 0.06))
SIDE = bricks((0.0, 0.0), (0.18, 0.0), (0.09, 0.06))
SUNK = bricks((0.0, 0.0), (0.2, 0.0), (0.1, 0.055))
GOOD = bricks((0.0, 0.0), (0.2, 0.0), (0.1, 0.06))
REFUSED = {
    "half": (HALF, "blocks block_0 and block_1 interpenetrate by 60 mm (their bounds by 100 mm"),
    "side": (SIDE, "blocks block_0 and block_1 interpenetrate by 20 mm"),
    "sunk": (SUNK, "blocks block_1 and block_2 interpenetrate by 5 mm"),
}


@pytest.fixture
def read(tmp_path):
    def import_one(shapes, **given):
        path = tmp_path / "wall.obj"
        path.write_text(obj(*shapes), encoding="utf-8")
        return import_scene(path, given=Given(unit="m", density=2000.0, **given))

    return import_one


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize("gap", [None, 0.2])
def test_blocks_that_interpenetrate_are_refused_whatever_the_gap(read, name, gap):
    """They came in as blocks beside each other, and every step stood."""
    shapes, said = REFUSED[name]
    with pytest.raises(SceneError) as caught:
        read(shapes, gap=gap)
    assert said in str(caught.value)
    assert "wider gap" not in str(caught.value)
    assert "(--accept-overlaps)" in str(caught.value)
    assert "faces tolerate 3 mm" in str(caught.value)


def test_what_only_touches_is_not_refused(read):
    assert len(read(GOOD).joints) == 3
    nearly = bricks((0.0, 0.0), (0.199, 0.0), (0.1, 0.058))
    assert len(read(nearly).joints) == 3
    with pytest.raises(SceneError, match=r"interpenetrate by 2 mm .* faces tolerate 1 mm"):
        read(nearly, gap=0.001)


def test_accepted_overlaps_are_said_first_and_warned_of(read):
    with pytest.warns(SceneWarning, match="bricks 0 and 1 interpenetrate by 60 mm"):
        scene = read(HALF, accept_overlaps=True)
    assert scene.provenance.splitlines()[1].startswith("blocks block_0 and block_1 interpenetrate")
    assert len(scene.joints) == 2
    with pytest.raises(
        SceneError, match="block_2; move block_2 out of the block that it"
    ) as caught:
        read(SUNK, accept_overlaps=True)
    assert "gap" not in str(caught.value)


def test_a_block_that_is_there_twice_is_refused(read):
    """It weighed twice as much: both were one block of twelve faces."""
    with pytest.raises(SceneError, match="blocks block_2 and block_3 interpenetrate by 60 mm"):
        read([*GOOD, GOOD[2]])
