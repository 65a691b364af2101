"""A comparison as text for a terminal, and what methods are called in the words of the field."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

import numpy as np
import pandas as pd

from seqopt.problem.requirements import Criterion
from seqopt.report.comparison import LARGEST, Comparison, LoopFacts
from seqopt.scene.scene import Scene

WIDTH = 80  # columns
WORDS = {
    "sequential": "sequential",
    "cantilever": "cantilever",
    "published": "published plan",
    "modified-sequential": "modified sequential",
    "free": "free schedule",
    "three-robot": "three-robot loop",
    "overlap_dp": "dynamic programming",
    "overlap_lp": "linear program",
    "overlap_mip": "integer program",
    "minimax": "least worst step",
    "lagrangian": "Lagrangian bound",
    "labels": "label setting",
    "cascade": "cascade",
    "beam": "beam search",
    "rank_search": "rank search",
    "equations-2-3": "equations 2 and 3",
    "closest-to-plan": "rule closest to the published plan",
    "weighted-published": "weighted sum of ratios",
    "worst-ratio-published": "worst ratio",
    "assignment_tight": "assignment, tight links",
    "assignment_loose": "assignment, loose links",
    "minimax_layer": "epigraph per step",
    "minimax_arc": "epigraph per pair",
    "minimax_big_m": "large constant (big-M)",
}


def format_comparison(comparison: Comparison, scene: Scene, criterion: Criterion) -> str:
    """Return methods, notes and formulations, one after the other.

    Parameters
    ----------
    comparison : Comparison
        What to tell.
    scene : Scene
        Which was compared.
    criterion : Criterion
        With which the formulations were compared.

    Returns
    -------
    str
        Of many lines.
    """
    notes = "\n".join(["Notes", *(_wrapped(f"- {note}") for note in comparison.notes or ["none"])])
    plans = f"Loop of robots: not possible here; {comparison.refusal}"
    if comparison.loop is not None:
        plans = _formulations(comparison.table, comparison.loop, criterion)
    return "\n\n".join([_methods(comparison, scene), notes, plans, *_expert(comparison)])


def format_details(comparison: Comparison, scene: Scene) -> str:
    """Return forces of robots, plans under both objectives of ranks, and published ranks."""
    return "\n\n".join([_methods(comparison, scene), *_expert(comparison)])


def _expert(comparison: Comparison) -> Iterator[str]:
    """Yield what an expert of ranks wants to know, as far as there is something."""
    if comparison.table["conditional"].notna().any():
        yield _objectives(comparison.table)
    if comparison.loop is not None and comparison.loop.ranks is not None:
        yield _ranks(comparison.loop.ranks)


def _methods(comparison: Comparison, scene: Scene) -> str:
    """Return the largest responses of methods: under each our value and, if any, the paper's."""
    maxima, paper = comparison.maxima, comparison.printed
    width = 12 if paper is None else 21
    lines = [f"{scene.name}: {len(scene.bricks)} bricks; largest response of any step", ""]
    lines.append(f"{'':16}" + "".join(f"{name:>{width}}" for name in maxima))
    if paper is not None:
        lines.append(f"{'':16}" + f"{'seqopt':>13}{'paper':>8}" * maxima.shape[1])
    for row, quantity in enumerate(maxima.index):
        cells = [f"{_number(own):>{width}}" for own in maxima.iloc[row]]
        if paper is not None:
            pairs = zip(maxima.iloc[row], paper.iloc[row], strict=True)
            cells = [f"{_number(own):>13}{_number(beside):>8}" for own, beside in pairs]
        lines.append(f"{str(quantity).replace('1e-3 mm', 'µm'):16}{''.join(cells)}")
    return "\n".join(lines)


def _formulations(table: pd.DataFrame, loop: LoopFacts, criterion: Criterion) -> str:
    """Return a line for every method and formulation, those of one problem under its name."""
    title = f"{loop.method.capitalize()} loop, criterion {criterion.name}; models"
    lines = [f"{title}: the different ones that each looks at"]
    if loop.paper_models is not None:
        cascading, overlap = loop.paper_models
        lines = [
            f"{title} counted as in the paper: {cascading:,} cascading,",
            f"{overlap:,} with the full overlap; below, the different ones that each looks at",
        ]
    names = "".join(f"{name:>8}" for name in LARGEST)
    lines += ["", f"{'':22}{'objective':>11}{'gap':>8}{names}{'models':>8}{'seconds':>9}"]
    for problem, rows in table.groupby("problem", sort=False):
        lines += [f"{problem}:", *(_line(f"  {name}", row) for name, row in rows.iterrows())]
    lines += [
        "(N, N m, N, µm; ! a payload is exceeded; gap to the exact optimum of the same aim:",
        "minimax has its own, free the worst step over what the fixed methods reach; seconds to",
        "choose and to check: all formulations of the loop share",
        f"{loop.seconds['respond']:.4f} s for the responses of all choices, "
        f"{loop.seconds['rank']:.4f} s for ranking them)",
    ]
    return "\n".join(lines)


def _line(name: str, row: pd.Series[float]) -> str:
    def cell(value: float, width: int, form: str) -> str:
        return f"{format(value, form) if np.isfinite(value) else '-':>{width}}"

    return (
        f"{name:22}{cell(row['objective'], 11, '.2f')}{cell(row['gap'], 8, '.2%')}"
        f"{_number(row['F_rob']):>7}{'!' if row['overloaded'] else ' '}"
        + "".join(f"{_number(row[column]):>8}" for column in LARGEST if column != "F_rob")
        + cell(row["models"], 8, ",.0f")
        + cell(row["seconds"], 9, ".4f")
    )


def _objectives(table: pd.DataFrame) -> str:
    """Return what every plan is worth under both objectives, and the parts of heuristics' gaps."""
    lines = [
        "Ranks over all pairs, and given the choice before; a heuristic's gap in two",
        "parts: what it loses by not looking ahead, and what the change of objective",
        "costs",
        f"{'':22}{'pairs':>11}{'given':>11}{'gap':>8}{'sight':>9}{'change':>9}",
    ]
    for problem, rows in table[table["conditional"].notna()].groupby("problem", sort=False):
        lines.append(f"{problem}:")
        for name, row in rows.iterrows():
            line = f"{f'  {name}':22}{row['pairs']:11.2f}{row['conditional']:11.2f}"
            if np.isfinite(row["short_sight"]):
                line += f"{100 * row['gap']:7.2f}%"
                parts = (100 * row[part] for part in ("short_sight", "change_of_objective"))
                line += "".join(f"{round(part, 2) + 0.0:8.2f}%" for part in parts)
            lines.append(line)
    return "\n".join(lines)


def _ranks(table: pd.DataFrame) -> str:
    """Return where the published plan's nodes rank, a line for each way to rank them."""
    ways = {"rank_in_window": "cascade", "rank_overlap": "overlap", "rank_peak": "minimax"}
    lines = ["Where the published plan's nodes rank, optimization by optimization"]
    for column, label in ways.items():
        ranks = table[column]
        said = f"first in {(ranks == 1).sum()} of {len(ranks)}, among three in {(ranks <= 3).sum()}"
        lines.append(_wrapped(f"  {label:21}{said}: {' '.join(map(str, ranks))}", 23))
    return "\n".join(lines)


def _wrapped(text: str, indent: int = 2) -> str:
    """Return a text in lines of `WIDTH` columns."""
    return textwrap.fill(text, WIDTH, subsequent_indent=" " * indent, break_on_hyphens=False)


def _number(value: object) -> str:
    number = float(str(value))
    return "-" if np.isnan(number) else f"{number:.1f}" if abs(number) < 1e4 else f"{number:,.0f}"


def in_words(name: str) -> str:
    """Return what a method or formulation is called, or its name where nobody gave it words.

    >>> in_words("overlap_dp"), in_words("my_own")
    ('dynamic programming', 'my_own')
    """
    return WORDS.get(name, name)


def typed(name: str) -> str:
    """Return words for a method or formulation, with what is typed behind where it differs.

    >>> typed("overlap_dp"), typed("cantilever")
    ('dynamic programming (overlap_dp)', 'cantilever')
    """
    words = in_words(name)
    same = words == name or name.replace("_", " ").replace("-", " ") in words
    return words if same else f"{words} ({name})"
