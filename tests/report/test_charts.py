"""Figures of a comparison."""

from __future__ import annotations

from seqopt.engines.registry import make_engine
from seqopt.network.build import build_network
from seqopt.report._style import WIDTH
from seqopt.report.charts import responses_figure
from seqopt.report.comparison import compare
from seqopt.study.published import CRITERIA
from tests.builders import six_bricks
from tests.pictures import flaws


def test_a_comparison_is_readable_and_every_plan_has_a_line_of_its_own():
    engine = make_engine("compliance", build_network(six_bricks()))
    result = compare(engine, CRITERIA["weighted-published"])
    figure = responses_figure(result.tables)
    assert figure.get_figwidth() == WIDTH
    assert flaws(figure) == []
    axes, *_ = figure.axes
    assert len(axes.get_lines()) < len(result.tables)  # equal plans are one line
    words = " ".join(text.get_text() for text in figure.legends[0].get_texts())
    assert all(name in words.replace(" ", "_") or name in words for name in ("overlap_dp", "beam"))
