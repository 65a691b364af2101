"""Formats and pictures of others: registered by name, offered beside those that are there."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import seqopt
from seqopt._cli.main import main
from seqopt._registry import ADDED
from seqopt.errors import ProblemError, SceneError, StepError
from seqopt.exchange import Content, FileBlock, Format, Given, export_plan, import_scene
from seqopt.exchange._formats import readable, writable
from seqopt.network.build import build_network
from seqopt.problem import Amount
from seqopt.report import Picture, picture
from seqopt.scene.boxes import BOX_CORNERS, BOX_FACES
from seqopt.sequence.methods import sequential

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
    scene = import_scene(path, given=GIVEN)
    assert scene.bricks[0].mass == pytest.approx(2000.0 * 0.4 * 0.2 * 0.1)
    steps = sequential(build_network(seqopt.load_scene("chain:bricks=7")))
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
    for part in (Format("csv"), Picture("steps", lambda *_: None), Amount("steps", len)):
        with pytest.raises(ProblemError, match="this name has a meaning already"):
            seqopt.register(part)
    seqopt.register(Format("moments"), Picture("moments", lambda *_: Figure()))
    assert len(ADDED) >= 2  # kinds do not share names


def test_a_picture_of_ones_own_is_drawn_and_written(tmp_path, capsys):
    plan = seqopt.optimize("chain:bricks=7", "free")
    with pytest.raises(ProblemError, match="picture moments: there is none; give one of steps, g"):
        picture(plan, "moments")

    def moments(engine, steps, table):
        axes = (figure := Figure()).subplots()
        axes.plot(table["step"], table["M_sup_Nm"])
        return figure

    seqopt.register(Picture("moments", moments))
    (line,) = picture(plan, "moments").axes[0].get_lines()
    assert [*line.get_ydata()] == [*plan.responses()["M_sup_Nm"]]
    folder, drawn = tmp_path / "plan", tmp_path / "drawn"
    words = ["optimize", "chain:bricks=7", "--schedule", "free", "--no-stability", "--quiet"]
    assert main([*words, "--out", str(folder)]) == 0
    assert main(["report", str(folder), "--figures", str(drawn), "--quiet"]) == 0
    capsys.readouterr()
    names = {path.name for path in drawn.iterdir()}
    assert {"plan_steps.png", "plan_grips.svg", "plan_moments.png", "responses.png"} <= names
