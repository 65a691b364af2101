"""Plans in formats of others say who is absent, placed or held, and can be read again."""

from __future__ import annotations

import csv
import io
import json

import pytest

from seqopt._files import write_text
from seqopt.errors import FileError, SceneError, StepError
from seqopt.exchange._content import Given
from seqopt.exchange.exports import export_plan, read_folder
from seqopt.exchange.imports import import_scene
from seqopt.network.build import build_network
from seqopt.scene.scene_file import save_scene
from seqopt.sequence.methods import METHODS
from seqopt.sequence.schedule_file import parse_plan
from seqopt.sequence.steps import Step, StepKind
from tests.builders import six_bricks
from tests.documents import DOCUMENTS

SCENE = six_bricks()
STEPS = METHODS["cantilever"](build_network(SCENE), ())


def test_json_says_all_of_the_steps():
    document = json.loads(export_plan(SCENE, STEPS, "json"))
    assert (document["format"], document["version"]) == ("seqopt-plan", 1)
    assert document["blocks"] == [brick.name for brick in SCENE.placed]
    names, count, steps = document["robots"], 0, []
    for row in document["steps"]:
        count += len(row["placed"])
        grips = tuple(row["holds"].get(name, {}).get("node") for name in names)
        steps.append(Step(row["step"], StepKind(row["type"]), count, grips))
    assert tuple(steps) == STEPS


def test_the_table_comes_back_as_the_same_steps():
    text = export_plan(SCENE, STEPS, "csv")
    assert parse_plan(SCENE, text, "table") == STEPS
    rows = [*csv.DictReader(io.StringIO(text))]
    assert [row["block_1"] for row in rows[:2]] == ["held", "held"]
    assert rows[0]["block_6"] == "absent"
    assert rows[0]["placed"] == "1"


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
    assert [row["step"] for row in graph["attributes"]["plan"]] == list(range(1, len(steps) + 1))


def test_a_folder_is_read_whole(tmp_path):
    save_scene(SCENE, tmp_path / "scene.json")
    with pytest.raises(FileError, match=r"it has no plan\.csv; give a folder of"):
        read_folder(tmp_path)
    (tmp_path / "pick").mkdir()
    (tmp_path / "pick" / "plan.csv").touch()
    with pytest.raises(FileError, match=r"it has no plan\.csv; give .*pick$"):
        read_folder(tmp_path)
    write_text(tmp_path / "plan.csv", export_plan(SCENE, STEPS, "csv"))
    assert read_folder(tmp_path) == (SCENE, STEPS)


def test_what_does_not_fit_is_refused(sources, tmp_path):
    path, _ = sources("assembly")
    with pytest.raises(StepError, match="format is 'xml'; give one of csv"):
        export_plan(SCENE, STEPS, "xml")
    with pytest.raises(StepError, match=r"give the assembly that was imported \(--source\)"):
        export_plan(SCENE, STEPS, "compas_assembly")
    with pytest.raises(StepError, match="takes no source"):
        export_plan(SCENE, STEPS, "csv", path)
    with pytest.raises(StepError, match="the source has no block 1"):
        export_plan(SCENE, STEPS, "compas_assembly", path)
    meshes, _ = sources("meshes")
    with pytest.raises(SceneError, match="an object is expected"):
        export_plan(SCENE, STEPS, "compas_assembly", meshes)
