"""Figures of the documentation: drawn from stored results, and readable where they are shown."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments.figures import PICTURES
from experiments.harness.claim import claims
from experiments.harness.results import FIGURES
from seqopt.report._style import DPI, WIDTH, dress, looks, new_figure, styled
from tests.pictures import flaws, texts

DRAWN = {name: draw for claim in claims().values() for name, draw in claim.pictures.items()}
LONG = {"calibration.png", "outside_assemblies.png", "dry_map.png", "decision_sensitivity.png"}
DAILY = ("soft_grips.png", "four_arms.png")
ELSEWHERE = {"report.png", "half_built.png"}  # of a browser
TOUCHING = 1.5  # pixels that texts may share


def params():
    """Return a few charts, and as slow ones those that are looked at nowhere else."""
    return [*DAILY, *(pytest.param(name, marks=pytest.mark.slow) for name in sorted(LONG))]


@pytest.mark.parametrize("name", params())
def test_a_chart_is_readable_at_the_width_of_the_site(name):
    if name == "outside_assemblies.png":
        pytest.importorskip("compas_cra")
    figure = DRAWN[name]()
    assert figure.get_figwidth() == WIDTH
    assert flaws(figure) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in PICTURES if name != "free_front.png"])
def test_a_picture_is_readable_at_the_width_of_the_site(name, engine25):
    figure = PICTURES[name](engine25)
    assert figure.get_figwidth() == WIDTH
    assert flaws(figure) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in DRAWN if name not in LONG])
def test_no_text_covers_another_or_leaves_the_figure(name):
    figure = DRAWN[name]()
    assert figure.get_figwidth() == WIDTH
    assert flaws(figure) == []
    assert covered(figure) == []


def covered(figure: Figure) -> list[str]:
    """Return the texts that share room in the figure, or lie outside of it."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    wide, high = canvas.get_width_height()
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts(figure)]
    out = [
        f"{text!r} leaves the figure"
        for text, box in boxes
        if min(box.x0, box.y0, wide - box.x1, high - box.y1) < -TOUCHING
    ]
    low, high = np.split(np.array([box.extents for _, box in boxes]).reshape(-1, 4), 2, axis=1)
    shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
    meet = (shared > TOUCHING).all(axis=2)
    pairs = combinations(enumerate(text for text, _ in boxes), 2)
    return out + [f"{text!r} covers {other!r}" for (i, text), (k, other) in pairs if meet[i, k]]


def test_stored_figures_are_of_this_style():
    stored = {path.name: path for path in FIGURES.glob("*.png")}
    assert set(stored) == {*DRAWN, *PICTURES, *ELSEWHERE}
    for name in {*DRAWN, *PICTURES}:
        header = stored[name].read_bytes()[:20]
        assert int.from_bytes(header[16:20]) == round(WIDTH * DPI), name


@pytest.mark.slow
def test_redraw_writes_figures_and_runs_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("experiments.harness.results.FIGURES", tmp_path)
    claim = claims()["soft_grips"]
    claim.main(["--redraw"])
    assert [path.name for path in tmp_path.iterdir()] == [*claim.pictures]
    assert capsys.readouterr().out == "drawn: soft_grips.png\n"  # and no verdict


@styled
def two_lines() -> Figure:
    """Return a chart without a flaw."""
    figure = new_figure(2.0)
    axes = figure.subplots()
    for name, look in looks(["one", "two"]).items():
        axes.plot([1, 2], [1, 2], label=name, **look.line())
    dress(axes)
    axes.legend()
    return figure


def shrink(figure: Figure) -> None:
    figure.axes[0].set_xlabel("too small", fontsize=7.5)


def widen(figure: Figure) -> None:
    figure.set_figwidth(10.0)


def repeat(figure: Figure) -> None:
    one, two = figure.axes[0].get_lines()
    two.set(marker=one.get_marker(), linestyle=one.get_linestyle())


def forget(figure: Figure) -> None:
    figure.axes[0].get_legend().remove()


def code(figure: Figure) -> None:
    figure.axes[0].set_ylabel("time of overlap_dp")


def column(figure: Figure) -> None:
    figure.axes[0].set_ylabel("D_max_1e-3mm")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (shrink, "shown at 7.5 points"),
        (widen, "points"),
        (repeat, "differ in color at most"),
        (forget, "is in no legend"),
        (code, "is a name of the code"),
        (column, "is a name of the code"),
    ],
)
def test_what_makes_a_chart_hard_to_read_is_seen(spoil, words):
    figure = two_lines()
    assert flaws(figure) == []
    spoil(figure)
    found = flaws(figure)
    assert found
    assert all(words in flaw for flaw in found)


def test_texts_on_top_of_each_other_are_seen():
    figure = two_lines()
    assert covered(figure) == []
    figure.text(0.5, 0.5, "under")
    figure.text(0.5, 0.5, "over")
    figure.text(0.95, 0.2, "far to the right of everything")
    found = covered(figure)
    assert "'under' covers 'over'" in found
    assert "'far to the right of everything' leaves the figure" in found
