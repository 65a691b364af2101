"""Scenes, networks and plans draw what they are, in notebooks too."""

from __future__ import annotations

import io

import pytest
from PIL import Image

from seqopt._cli.main import main
from seqopt.errors import FileError, StepError
from seqopt.plan.build import GivenSequence
from seqopt.report._pictures import Film, spread_steps
from seqopt.sequence.methods import sequential


@pytest.fixture(scope="module")
def build(engine25):
    return GivenSequence(engine25, sequential(engine25.network), "sequential")


def faces(axes):
    return sum(len(collection.get_paths()) for collection in axes.collections)


def test_a_scene_draws_as_many_bricks_as_are_asked_for(arch25):
    (whole,) = arch25.plot().axes
    assert whole.get_title(loc="left") == "arch25: 25 of 25 bricks"
    (part,) = arch25.plot(7).axes
    assert len(part.collections) == 2  # the others are pale
    for wrong in (0, 26, 2.5, "all"):
        with pytest.raises(StepError, match="scene arch25 has 1 to 25"):
            arch25.plot(wrong)


def test_a_network_draws_its_edges(engine25):
    network = engine25.network
    (axes,) = network.plot(8).axes
    assert len(axes.collections[0].get_segments()) == network.count_edges(8)
    assert len(axes.texts) == 16  # numbers of the nodes to hold


def test_every_step_that_is_asked_for_has_a_panel_with_its_grips(build):
    figure = build.plot([3, 30])
    assert [axes.get_title() for axes in figure.axes] == [
        "step 3 of 49: a robot lets go",
        "step 30 of 49: brick 16 is placed",
    ]
    for axes, number in zip(figure.axes, (3, 30), strict=True):
        named = [line.get_gid() for line in axes.lines]
        scene, step = build.engine.network.scene, build.steps[number - 1]
        pairs = zip(scene.robots, step.grips, strict=True)
        assert named == [f"{robot.name} at {node}" for robot, node in pairs if node is not None]
    assert len(build.plot().axes) == 6
    (key,) = figure.legends
    assert [text.get_text() for text in key.get_texts()] == ["rob1 holds", "rob2 holds"]
    (alone,) = build.plot(30).axes
    assert [text.get_text() for text in alone.texts] == named  # words where there is room


def test_forces_and_motion_are_drawn(build):
    (plain,), (forces,), (moved,) = (
        build.plot(30, **given).axes for given in ({}, {"forces": True}, {"magnify": 2000.0})
    )
    assert len({tuple(c) for c in forces.collections[0].get_colors()}) == 2
    assert len(moved.collections) == len(plain.collections) + 1  # where it would be, pale


@pytest.mark.parametrize("wrong", [0, 50, "all", 1.5, [], [3, 99], range(1, 30)])
def test_steps_that_are_none_get_one_line(build, wrong):
    with pytest.raises(StepError, match=r"the build has steps 1 to 49|give 1 to 24"):
        build.plot(wrong)


def test_a_notebook_shows_a_figure_once(build):
    picture = Image.open(io.BytesIO(build.plot(5)._repr_png_()))
    assert picture.format == "PNG"
    assert picture.width > 500


def test_a_film_has_a_picture_for_every_step(build, tmp_path):
    short = Film(build.engine, build.steps[:5], seconds=0.5)
    with Image.open(short.save(tmp_path / "build.gif")) as film:
        assert film.n_frames == 5
        assert film.convert("RGB").getpixel((0, 0)) == (255, 255, 255)
        assert film.info["duration"] == 500
    assert short._repr_html_().startswith('<img alt="5 steps of a build" src="data:image/gif')
    for wrong in ("build.avi", "no folder/build.gif"):
        with pytest.raises(FileError, match=r"ends in \.gif|cannot write"):
            short.save(tmp_path / wrong)
    assert isinstance(build.animate(), Film)


def test_a_command_writes_a_film(tmp_path, capsys):
    folder, film = tmp_path / "plan", tmp_path / "build.gif"
    assert main(["optimize", "chain:bricks=7", "--schedule", "free", "--out", str(folder)]) == 0
    assert main(["report", str(folder), "--film", str(film), "--quiet"]) == 0
    assert str(film) in capsys.readouterr().out
    with Image.open(film) as found:
        assert found.n_frames == len((folder / "plan.csv").read_text("utf-8").splitlines()) - 1


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("build.mp4", "give a name that ends in .gif"),
        ("no folder/build.gif", "there is no folder no folder; name another"),
    ],
)
def test_a_film_that_cannot_be_written_is_refused_before_the_page_is(
    tmp_path, monkeypatch, capsys, name, said
):
    monkeypatch.chdir(tmp_path)
    assert main(["report", "chain:bricks=7", "--film", name, "--out", "page.html"]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "page.html").exists()


def test_pictures_of_a_build_are_spread_over_it(build):
    numbers = [int(axes.get_title().split()[1]) for axes in build.plot().axes]
    assert numbers[-1] == 49
    kinds = [build.steps[number - 1].kind.value for number in numbers[:-1]]
    assert kinds == ["place"] * 5
    assert spread_steps(build.steps[-1:], 6) == (49,)
