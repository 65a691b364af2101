"""The component of the Grasshopper page, without Rhino: blocks, a plan, and its steps."""

import runpy
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import compas
import numpy as np
import pytest
from compas.datastructures import Mesh
from compas.geometry import Box, Frame

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[2] / "docs/examples"
SCRIPT = EXAMPLES / "grasshopper/seqopt_component.py"
COMMAND = shutil.which("seqopt", path=str(Path(sys.executable).parent))
LOWEST = {0: 0, 1: 300, 2: 300, 3: 600}  # of the blocks, mm


@pytest.fixture(scope="module")
def component():
    return SimpleNamespace(**runpy.run_path(str(SCRIPT)))


@pytest.fixture(scope="module")
def blocks():
    """A pier, two stones on it that reach out, and a cap, mm."""
    rows = [((0, 0), 1200), ((-350, 0), 700), ((350, 0), 700), ((0, 0), 900)]
    return [
        Mesh.from_shape(Box(length, 400, 300, Frame([x, y, LOWEST[i] + 150], [1, 0, 0], [0, 1, 0])))
        for i, ((x, y), length) in enumerate(rows)
    ]


@pytest.fixture(scope="module")
def planned(component, blocks, tmp_path_factory):
    folder = tmp_path_factory.mktemp("gh")
    assert component.read_plan(folder) is None
    words = "--schedule free --aim minmax"
    said = component.make_plan(blocks, folder, COMMAND, "--density 2400", words, 1000.0)
    return folder, said


def shown_steps(component, plan, places, per_meter):
    """Check every step of a plan, and return how many blocks stand at most."""
    standing = 0
    for step in range(1, component.last_step(plan) + 1):
        shown = component.show_step(plan, step, per_meter)
        meshes = [*shown["built"], *shown["placed"], *shown["held"]]
        standing = max(standing, len(meshes))
        assert {tuple(np.round(mesh.centroid(), 3)) for mesh in meshes} <= places
        near = np.array([mesh.vertices_attributes("xyz") for mesh in meshes]).reshape(-1, 3)
        for tool in shown["tools"]:  # where a robot holds is within what stands
            assert (near.min(axis=0) <= tool.point).all()
            assert (tool.point <= near.max(axis=0)).all()
        assert len(shown["tools"]) >= len(shown["held"])
        assert f"step {step} of {component.last_step(plan)}" in shown["says"]
    return standing


def test_a_plan_of_the_gallery_is_shown_where_it_is(component):
    plan = compas.json_load(EXAMPLES / "four_arms/wall/tasks.json")
    places = {tuple(np.round(1e3 * np.array(b["shape"].centroid()), 3)) for b in plan["blocks"]}
    assert shown_steps(component, plan, places, 1000.0) == len(plan["blocks"])
    last = component.show_step(plan, 10**6)["says"]
    assert last == component.show_step(plan, component.last_step(plan))["says"]
    with pytest.raises(AssertionError):
        shown_steps(component, plan, places, 1.0)


def test_blocks_of_the_plan_are_those_that_were_given(component, planned, blocks):
    plan = component.read_plan(planned[0])
    places = {tuple(np.round(block.centroid(), 3)) for block in blocks}
    assert plan["unit"] == "m"
    assert shown_steps(component, plan, places, 1000.0) == len(blocks)


def test_what_seqopt_refuses_is_said(component, blocks, tmp_path):
    with pytest.raises(RuntimeError, match="block 1 has no density; give one in kg/m³"):
        component.make_plan(blocks, tmp_path, COMMAND, "")
