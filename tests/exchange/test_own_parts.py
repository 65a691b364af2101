"""Formats of others: registered by name, offered beside those that are there."""

from __future__ import annotations

import numpy as np
import pytest

import seqopt
from seqopt._registry import ADDED
from seqopt.errors import ProblemError, SceneError, StepError
from seqopt.exchange import Content, FileBlock, Format, Given, export_plan, import_scene
from seqopt.exchange._formats import readable, writable
from seqopt.problem import Amount
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES

GIVEN = Given(density=2000.0)


@pytest.fixture(autouse=True)
def alone():
    """Forget what a test registers."""
    before = {**ADDED}
    yield
    ADDED.clear()
    ADDED.update(before)


def read(path):
    low, size = np.hsplit(np.loadtxt(path, ndmin=2)[0], 2)
    corners = low + 0.5 * (BOX_CORNERS + 1) * size
    return Content((FileBlock("1", corners, BOX_FACES),), unit="m")


@pytest.fixture
def path(tmp_path):
    found = tmp_path / "one.corners"
    found.write_text("0 0 0  .4 .2 .1\n", "utf-8")
    return found


def test_a_format_of_ones_own_is_read_and_written(path):
    with pytest.raises(SceneError, match="its format is not known"):
        import_scene(path, given=GIVEN)
    lines = Format("corners", ("corners",), read, lambda _, steps: f"{len(steps)}\n")
    seqopt.register(lines)
    assert "corners" in readable()
    assert "corners" in writable()
    with pytest.raises(SceneError, match="its lengths are known in m; give no other unit"):
        import_scene(path, given=Given(unit="mm", density=2000.0))
    scene = import_scene(path, given=GIVEN)
    assert scene.bricks[0].mass == pytest.approx(2000.0 * 0.4 * 0.2 * 0.1)
    steps = seqopt.sequential(seqopt.build_network(seqopt.load_scene("chain:bricks=7")))
    assert export_plan(scene, steps, "corners") == f"{len(steps)}\n"
    with pytest.raises(StepError, match="format corners takes no distance; leave it out"):
        export_plan(scene, steps, "corners", distance=0.1)


def test_what_a_function_of_others_returns_wrong_is_one_line(path):
    seqopt.register(Format("corners", ("corners",), lambda _: [1], lambda *_: None))
    with pytest.raises(SceneError, match=r"format corners: it reads \[1\]; return a Content"):
        import_scene(path, given=GIVEN)
    with pytest.raises(StepError, match="format corners: it writes None; return a text"):
        export_plan(seqopt.load_scene("arch25"), (), "corners")


def test_names_that_are_taken_are_refused_by_kind():
    for part in (Format("obj"), Amount("steps", len)):
        with pytest.raises(ProblemError, match="this name has a meaning already"):
            seqopt.register(part)
    seqopt.register(Format("steps"))  # kinds do not share names
