"""Figures of a comparison and of what was found at which time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.engines.registry import make_engine
from seqopt.graph.layers.layers import travel
from seqopt.network.build import build_network
from seqopt.plan.solving import solve
from seqopt.report._style import WIDTH
from seqopt.report.charts import comparison_figures, trace_figure
from seqopt.report.comparison import compare
from seqopt.study.published import CRITERIA
from tests.builders import six_bricks
from tests.pictures import flaws


def test_a_trace_is_drawn_as_it_is(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 18.0),))
    plans = [solve(capped, name) for name in ("labels", "lagrangian")]
    axes = trace_figure(plans).axes[0]
    names = ["label setting (labels)", "Lagrangian bound (lagrangian)", "lower bound"]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == names
    *lines, _ = axes.get_lines()
    assert len(lines) == 4
    for plan, values, bounds in zip(plans, lines[::2], lines[1::2], strict=True):
        trace = plan.selection.trace
        known = [found.objective for found in trace if np.isfinite(found.objective)]
        assert values.get_ydata().tolist() == known
        assert bounds.get_ydata()[-1] == trace[-1].bound


def test_a_comparison_is_readable_and_every_plan_has_a_line_of_its_own():
    engine = make_engine("compliance", build_network(six_bricks()))
    result = compare(engine, CRITERIA["weighted-published"])
    figures = comparison_figures(result)
    assert list(figures) == ["maxima", "responses", "gap_against_cost"]
    for figure in figures.values():
        assert figure.get_figwidth() == WIDTH
        assert flaws(figure) == []
    axes, *_ = figures["responses"].axes
    assert len(axes.get_lines()) < len(result.tables)  # equal plans are one line
    words = " ".join(text.get_text() for text in figures["responses"].legends[0].get_texts())
    assert all(name in words.replace(" ", "_") or name in words for name in ("overlap_dp", "beam"))
