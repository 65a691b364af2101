"""Figures of a comparison and of what was found at which time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from seqopt.placement.budgets import travel
from seqopt.placement.solving import solve
from seqopt.report.charts import trace_figure


def test_a_trace_is_drawn_as_it_is(problem25):
    capped = replace(problem25, budgets=(travel(problem25, 18.0),))
    plans = [solve(capped, name) for name in ("labels", "lagrangian")]
    axes = trace_figure(plans).axes[0]
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["labels", "lagrangian"]
    lines = axes.get_lines()
    assert len(lines) == 4
    for plan, values, bounds in zip(plans, lines[::2], lines[1::2], strict=True):
        trace = plan.selection.trace
        known = [found.objective for found in trace if np.isfinite(found.objective)]
        assert values.get_ydata().tolist() == known
        assert bounds.get_ydata()[-1] == trace[-1].bound
