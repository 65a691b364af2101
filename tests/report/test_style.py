"""The style: series that can be told apart, numbers as people write them, PNG and SVG alike."""

from __future__ import annotations

import pandas as pd
import pytest

from seqopt.report._style import look, looks, new_figure, picture_files, plain
from seqopt.report.charts import COLUMNS, responses_figure


def test_seventy_series_differ_and_ten_do_without_color():
    every = [look(number) for number in range(70)]
    assert len({(one.color, one.marker) for one in every}) == 70
    assert len({one.marker for one in every[:10]}) == 10
    assert len({one.color for one in every[:7]}) == 7
    assert list(looks(["a", "b", "a"])) == ["a", "b"]


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


def test_equal_tables_are_one_line():
    rows = {"step": [1, 2, 3], "bricks": [1, 1, 2], **{name: [1.0, 3.0, 2.0] for name in COLUMNS}}
    table = pd.DataFrame(rows | {"phase": list("abc")})
    other = table.assign(M_sup_Nm=[1.0, 3.0, 2.5])
    figure = responses_figure({"a": table, "b": other, "c": table.copy()})
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert words == ["the same plan: a, c", "b"]
