"""The identification of the reference arch: its start, its steps, its stored numbers."""

from functools import cache
from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from experiments.calibration.identify_arch25 import (
    OFFSETS,
    SHAPE,
    beside_shipped,
    fit,
    holds,
    report,
    residuals,
    scene_of,
    starting_guess,
    target,
)
from experiments.exchange import outside_assemblies
from experiments.figures import PICTURES
from experiments.harness.claim import claims
from experiments.harness.results import FIGURES, RESULTS
from seqopt.report._style import DPI, WIDTH, dress, looks, new_figure, styled
from seqopt.study import printed_steps
from tests.pictures import flaws, texts


@pytest.mark.slow
def test_a_few_iterations_improve_the_start(monkeypatch):
    monkeypatch.setattr("experiments.calibration.identify_arch25.SOFTENING", (0.1,))
    start = starting_guess()
    wanted = target([printed_steps("sequential")])
    before = np.abs(residuals(scene_of(start, SHAPE), wanted))
    numbers, _ = fit(start, SHAPE, wanted, 6)
    after = np.abs(residuals(scene_of(numbers, SHAPE), wanted))
    assert np.minimum(after, 0.1).sum() < 0.8 * np.minimum(before, 0.1).sum()


@pytest.mark.slow
def test_the_stored_numbers_describe_the_shipped_scene_and_worse_ones_fail():
    numbers = pd.read_csv(RESULTS / "identify_arch25.csv")["value"].to_numpy()
    groups = (*SHAPE, OFFSETS)
    same = beside_shipped(report(numbers, groups), scene_of(numbers, groups))
    assert same["difference"].abs().max() <= 0.01
    assert holds(same, quick=False)
    off = numbers * np.where(np.arange(len(numbers)) == 35, 1.1, 1.0)  # the gap
    worse = beside_shipped(report(off, groups), scene_of(off, groups))
    assert not holds(worse, quick=False)
    assert holds(worse, quick=True)  # a quick fit is not judged, the shipped one is


# figures of the documentation: drawn from stored results, and readable where they are shown
ELSEWHERE = {"report.png", "half_built.png"}  # of a browser
TOUCHED = ("calibration.png", "outside_assemblies.png", "dry_map.png", "decision_sensitivity.png")
TOUCHING = 1.5  # pixels that texts may share
SMALL = (*outside_assemblies.SHOWN[:3], outside_assemblies.SHOWN[0])  # 290 blocks take long


@cache
def drawn():
    """Every chart that a claim draws, by its file."""
    return {name: draw for claim in claims().values() for name, draw in claim.pictures.items()}


@pytest.mark.slow
def test_no_text_of_any_figure_covers_another_or_leaves_it(engine25, monkeypatch):
    """Of maps, whose texts may touch, the rest is looked at."""
    pytest.importorskip("compas_cra")
    monkeypatch.setattr(outside_assemblies, "SHOWN", SMALL)
    pictures = {n: lambda n=n: PICTURES[n](engine25) for n in PICTURES if n != "free_front.png"}
    found = {}
    for name, draw in (drawn() | pictures).items():
        figure = draw()
        wrong = flaws(figure) + (["width"] if figure.get_figwidth() != WIDTH else [])
        wrong += covered(figure) if name not in {*TOUCHED, *pictures} else []
        found |= {name: wrong} if wrong else {}
    assert found == {}


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


@pytest.mark.slow
def test_stored_figures_are_of_this_style():
    stored = {path.name: path for path in FIGURES.glob("*.png")}
    assert set(stored) == {*drawn(), *PICTURES, *ELSEWHERE}
    for name in {*drawn(), *PICTURES}:
        header = stored[name].read_bytes()[:20]
        assert int.from_bytes(header[16:20]) == round(WIDTH * DPI), name


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
