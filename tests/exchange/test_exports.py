"""Plans go into the formats of others, and folders of plans are read again."""

from __future__ import annotations

import json

import pytest

from seqopt._files import write_text
from seqopt.errors import SceneError, StepError
from seqopt.exchange._content import Given
from seqopt.exchange.exports import export_plan
from seqopt.exchange.imports import import_scene
from seqopt.network.build import build_network
from seqopt.sequence.methods import METHODS
from seqopt.sequence.steps import Step, StepKind
from tests.builders import six_bricks
from tests.documents import DOCUMENTS

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
