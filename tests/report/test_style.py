"""The style: series that can be told apart, numbers as people write them, PNG and SVG alike."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgb

from seqopt.report._style import COLORS, look, looks, new_figure, picture_files, plain, styled
from seqopt.report.charts import _merged, front_figure, responses_figure
from seqopt.report.draw import POINTS, _aside
from seqopt.report.text import WORDS, in_words, typed
from tests.pictures import flaws


def test_seventy_series_differ_and_ten_do_without_color():
    every = [look(number) for number in range(70)]
    assert len({(one.color, one.marker) for one in every}) == 70
    assert len({one.marker for one in every[:10]}) == 10
    assert len({one.color for one in every[:7]}) == 7
    assert list(looks(["a", "b", "a"])) == ["a", "b"]


DEFAULT = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd")  # of matplotlib
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def seen(color: str, matrix: list[list[float]]) -> np.ndarray:
    """Return the CIELAB coordinates of a color as people see it who lack a kind of cone."""
    sent = np.array(to_rgb(color))
    linear = np.where(sent <= 0.04045, sent / 12.92, ((sent + 0.055) / 1.055) ** 2.4)
    tristimulus = TO_XYZ @ np.clip(np.array(matrix) @ linear, 0, 1) / [0.9505, 1.0, 1.089]
    f = np.where(tristimulus > 0.008856, np.cbrt(tristimulus), 7.787 * tristimulus + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def nearest(colors: Sequence[str], matrix: list[list[float]]) -> float:
    """Return the smallest difference of two colors; 2.3 is one that is just noticed."""
    at = [seen(color, matrix) for color in colors]
    return min(float(np.linalg.norm(a - b)) for a, b in combinations(at, 2))


@pytest.mark.parametrize(
    "matrix",
    [
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
         [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
         [-0.011820, 0.042940, 0.968881]],
    ],
)  # fmt: skip
def test_colors_differ_for_people_without_red_or_green_cones(matrix):
    """Matrices for full protanopia and deuteranopia: Machado, Oliveira and Fernandes (2009)."""
    assert nearest(COLORS, matrix) > 15
    assert nearest(DEFAULT, matrix) < 10


def test_the_style_is_left_where_it_ends():
    before = mpl.rcParams["font.size"]
    inside = styled(lambda: mpl.rcParams["font.size"])()
    assert inside == 9.0
    assert mpl.rcParams["font.size"] == before


def test_a_figure_is_written_twice_and_always_alike():
    def files():
        figure = new_figure(1.0)
        figure.subplots().plot([1, 2])
        return picture_files("name", figure)

    once, again = files(), files()
    assert list(once) == ["name.png", "name.svg"]
    assert once == again
    assert once["name.png"].startswith(b"\x89PNG")
    assert b"<svg" in once["name.svg"]


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ((0.01, 1000), ["0.01", "0.1", "1", "10", "100", "1,000"]),
        ((3, 80), ["5", "10", "20", "50"]),
        ((1e5, 1e9), ["100,000", "$10^{6}$", "$10^{7}$", "$10^{8}$", "$10^{9}$"]),
    ],
)
def test_logarithmic_axes_have_plain_numbers(limits, words):
    axes = new_figure(1.0).subplots()
    axes.set(xscale="log", xlim=limits)
    plain(axes.xaxis)
    low, high = limits
    ticks = [tick for tick in axes.get_xticks() if low <= tick <= high]
    assert [axes.xaxis.get_major_formatter()(tick) for tick in ticks] == words
    assert len(axes.xaxis.get_minorticklocs()) == 0


def test_numbers_stand_beside_lines_and_apart():
    marks = np.array([[0.0, y] for y in np.linspace(0, 10, 12)])
    line = np.array([[0.0, 0.0], [0.0, 10.0]])
    shifts = np.array(_aside(marks, [line]))
    assert np.hypot(*shifts.T) == pytest.approx(POINTS)
    assert (np.abs(shifts[1:-1, 0]) > POINTS / 2).all()  # aside of a line that goes up


def test_words_say_what_is_typed_where_it_differs():
    assert typed("overlap_dp") == "dynamic programming (overlap_dp)"
    assert typed("rank_search") == in_words("rank_search") == "rank search"
    assert typed("my_own") == "my_own"
    assert len(set(WORDS.values())) == len(WORDS)


def test_equal_tables_are_one_line():
    table = pd.DataFrame({"bricks": [1, 1, 2], "M": [1.0, 3.0, 2.0], "phase": list("abc")})
    other = table.assign(M=[1.0, 3.0, 2.5])
    assert _merged({"a": table, "b": other, "c": table.copy()}) == {"a": ("a", "c"), "b": ("b",)}


def test_the_worst_step_of_every_number_of_bricks_is_drawn():
    shown = {"bricks": [1, 1, 2], "step": [1, 2, 3], "M_sup_Nm": [1.0, 3.0, 2.0]}
    table = pd.DataFrame(shown).assign(F_max_N=1.0, **{"D_max_1e-3mm": 1.0})
    axes, *_ = responses_figure({"sequential": table}).axes
    (line,) = axes.get_lines()
    assert line.get_ydata().tolist() == [3.0, 2.0]


def front_of(table):
    """A Pareto set of which only the table counts."""
    return SimpleNamespace(table=table)


def test_the_chart_of_a_pareto_set_marks_methods_and_names_them():
    rng = np.random.default_rng(1)
    names = ["F_largest", "M_sup", "T_max", "D_max", "steps"]
    table = pd.DataFrame(rng.uniform(1, 2, (9, 5)), columns=names)
    method = pd.DataFrame(
        {
            "rob1_node": [1],
            "F_rob1_N": [2.0],
            "M_sup_Nm": [1.0],
            "F_max_N": [1.0],
            "D_max_1e-3mm": 9.0,
        }
    )
    figure = front_figure(
        front_of(table), {"sequential": method, "cantilever": method}, {"loop": table}
    )
    assert len(figure.axes) == 4 + 1  # and the scale of colors
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "loop, its set", "sequential", "cantilever",
    ]  # fmt: skip
    assert flaws(figure) == []


def test_rounding_does_not_look_like_a_trade_off():
    table = pd.DataFrame(
        {"F_largest": [100.0, 200.0], "M_sup": [3.0, 3.0 + 1e-12], "steps": [9, 9]}
    )
    axes, *_ = front_figure(front_of(table), {}, {}).axes
    low, high = axes.get_ylim()
    assert 0.01 < high - low < 0.1
    assert axes.get_xlim()[1] - axes.get_xlim()[0] > 100
