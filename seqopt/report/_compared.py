"""A comparison as text: columns explained, and what was found in it in order."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from seqopt.graph.formulation import FormulationKind, formulations
from seqopt.problem.criteria import RankSum
from seqopt.problem.requirements import Criterion
from seqopt.report.comparison import CLOSED, Comparison
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE
from seqopt.stability.assessment import Verdict
from seqopt.study.published import PUBLISHED

_STANDING = (
    "Proven as rigid bricks whose joints may open and slide, robots within their payload. First: "
    "the step that falls first, the brick that is fastest in it, and the joint that opens fastest."
)
NAME = 21  # columns of a name
RESPONSES = {
    "F_rob": ("grip", "force, N", 15),
    "M_sup": ("support", "moment, N m", 14),
    "T_max": ("", "tension, N", 14),
    "D_max": ("displacement,", "µm", 14),
}  # above each column of responses, and how wide it is
OF_PAPER = "In the paper: "  # with which notes about it begin
MODIFIED = "modified-sequential"
TITLES = {
    CLOSED: "fixed sequences, nothing to choose",
    MODIFIED: "modified sequential method, some grips chosen",
    FREE: "free schedule: any robot may place, hold or release next",
}  # above the rows of a problem


def format_comparison(
    comparison: Comparison, scene: Scene, criterion: Criterion, width: int = 80
) -> str:
    """Return a comparison as ``seqopt compare`` prints it.

    Parameters
    ----------
    comparison : Comparison
        What to tell.
    scene : Scene
        Which was compared.
    criterion : Criterion
        With which the formulations were compared.
    width : int
        Columns that text is wrapped to.

    Returns
    -------
    str
        Of many lines.
    """
    return "\n\n".join(comparison_blocks(comparison, scene, criterion, width))


def comparison_blocks(
    comparison: Comparison, scene: Scene, criterion: Criterion, width: int
) -> list[str]:
    """Return blocks of lines, each of which begins with its heading."""
    blocks = [
        [f"{scene.name}: {len(scene.bricks)} bricks, {len(scene.robots)} robots"],
        ["Largest response of any step", *_responses(comparison), "", _about(comparison)],
    ]
    if comparison.loop is None:
        blocks.append([f"Loop of robots: not possible here; {comparison.refusal}"])
    if comparison.verdicts:
        blocks.append(["Steps that fall", *_stands(comparison), "", _STANDING])
    if comparison.table["objective"].notna().any():
        about = _about_choices(comparison, criterion)
        blocks.append(["How the grips were chosen", *_choices(comparison), "", about])
    for heading, of_paper in (("Notes", False), ("Inconsistencies in the paper", True)):
        said = [text for text in comparison.notes if text.startswith(OF_PAPER) == of_paper]
        if said:
            blocks.append([heading, *(f"- {text.removeprefix(OF_PAPER)}" for text in said)])

    def wrapped(line: str) -> str:
        if "  " in line:  # a row of a table
            return line
        rest = "  " * line.startswith("- ")
        how: Any = {"break_long_words": False, "break_on_hyphens": False}
        return textwrap.fill(line, width, subsequent_indent=rest, **how)

    return ["\n".join(map(wrapped, block)) for block in blocks]


def _unlike(table: pd.DataFrame) -> dict[str, int]:
    """Return rows with different figures, the plainest of each, and how many others have these."""
    figures = table[[*RESPONSES]].round(3).apply(tuple, axis=1)
    ranked = figures[sorted(figures.index, key=_plainness)]
    first = {*ranked.index[~ranked.duplicated()]}
    return {n: int((figures == figures[n]).sum()) - 1 for n in figures.index if n in first}


def _responses(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the largest responses; rows with the same figures are one."""
    for line in (0, 1):
        heads = (f"{names[line]:>{names[2]}}" for names in RESPONSES.values())
        yield f"{'':{NAME}}{''.join(heads)}".rstrip()
    for problem, rows in comparison.table.groupby("problem", sort=False):
        yield TITLES.get(str(problem), f"{problem} loop, grips chosen by a formulation")
        for name, more in _unlike(rows).items():
            label = f"  {name}{f' +{more}' if more else ''}"
            row, paper, cells = rows.T[name], printed_largest(comparison, name), ""
            marks = {
                "F_rob": "!" if row["overloaded"] else " ",
                "D_max": "?" * bool(row["outside"]),
            }
            for response, (_, _, width) in RESPONSES.items():
                value = float(row[response])
                said = f"{value:.1f}" if abs(value) < 1e4 else f"{value:,.0f}"
                said += f" ({paper[response]:.1f})" if response in paper else ""
                cells += f"{said + marks.get(response, ''):>{width}}"
            yield f"{label:{NAME}}{cells}".rstrip()


def _stands(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the steps that fall; rows with the same are one."""
    first, *_ = comparison.verdicts.values()
    heads = "".join(f"{each.mortar:>9}" for each in first)
    yield f"{'':{NAME}}{'steps':>5}{heads}   first, {first[0].mortar}".rstrip()
    for problem, rows in comparison.table.groupby("problem", sort=False):
        yield TITLES.get(str(problem), f"{problem} loop, grips chosen by a formulation")
        same: dict[object, list[str]] = {}
        for name in map(str, rows.index):
            same.setdefault(comparison.verdicts[name], []).append(name)
        for name, *more in (sorted(names, key=_plainness) for names in same.values()):
            label = f"  {name}{f' +{len(more)}' if more else ''}"
            shown, *_ = found = comparison.verdicts[name]
            open_ = (each.count(Verdict.UNDECIDED) for each in found)
            counts = "".join(
                f"{each.count(Verdict.FALLS)}{f' ({n}?)' if n else ''}".rjust(9)
                for each, n in zip(found, open_, strict=True)
            )
            where = f"step {shown.first}: brick {shown.brick}" if shown.first else ""
            where += f", joint {shown.joint}" if shown.joint else ""
            yield f"{label:{NAME}}{len(shown.verdicts):5}{counts}   {where}".rstrip()


def _plainness(name: str) -> tuple[bool, bool, str]:
    """Return what sorts names: rows with the same figures go by the first of them."""
    found = formulations().get(name)
    if found is None:
        return False, False, name
    return found.kind is not FormulationKind.EXACT, found.takes_budgets, name


def printed_largest(comparison: Comparison, name: str) -> dict[str, float]:
    """Return the largest responses of a method as the paper prints them, in its units, if any."""
    if comparison.printed is None or name not in comparison.maxima:
        return {}
    column = list(comparison.maxima).index(name)  # printed ones have names of their own
    quantity = [str(text).partition(" [")[0] for text in comparison.maxima.index]
    values = dict(zip(quantity, comparison.printed.to_numpy(float)[:, column], strict=True))
    forces = [value for key, value in values.items() if key not in RESPONSES]
    found = {key: value for key, value in values.items() if key in RESPONSES}
    return {"F_rob": float(np.nanmax(forces)), **found}


def _about(comparison: Comparison) -> str:
    said = (
        "Grip force: of any robot. Support moment: at any ground end. Tension: in any edge of "
        "the network of bricks and joints. Displacement: of any node."
    )
    if comparison.table["overloaded"].astype(bool).any():
        said += " !: a robot holds more than its payload."
    if comparison.departures:
        said += " ?: outside the linear range, not reliable."
    if comparison.printed is not None:
        said += " In brackets: what Bruun et al. print."
    if " +" in "".join(_responses(comparison)):
        said += " +1, +2 …: so many other formulations reach the same figures."
    return said


def _choices(comparison: Comparison) -> Iterator[str]:
    """Yield the table of objectives and of what choosing took."""
    kinds = {name: found.kind.value for name, found in formulations().items()}
    kinds |= {MODIFIED: kinds.get("cascade", ""), FREE: "exact"}
    yield f"{'':{NAME}}{'objective':>10}{'gap':>9}{'steps':>7}{'models':>9}{'seconds':>9}  kind"
    chosen = comparison.table[comparison.table["objective"].notna()]
    for problem, rows in chosen.groupby("problem", sort=False):
        yield TITLES.get(str(problem), f"{problem} loop, grips chosen by a formulation")
        for name, row in rows.iterrows():
            steps = len(comparison.tables[str(name)])
            models, seconds = (
                format(row[column], form) if np.isfinite(row[column]) else "-"
                for column, form in (("models", ",.0f"), ("seconds", ".3f"))
            )
            yield (
                f"{f'  {name}':{NAME}}{row['objective']:10.2f}{100 * row['gap']:7.2f} %{steps:7}"
                f"{models:>9}{seconds:>9}  {kinds.get(str(name), 'in print')}"
            )


def _about_choices(comparison: Comparison, criterion: Criterion) -> str:
    """Return what columns of the table of choices are."""
    known = "the fixed sequences" + (" and the published plan" * (PUBLISHED in comparison.tables))
    worst = (
        "of minimax its largest step, of the free schedule, which has no ranks, its worst response "
        f"over the least that {known} reach"
    )
    if not isinstance(criterion, RankSum):
        worst = "of minimax and the free schedule its largest step"
    elif comparison.maxima.empty:
        worst = "of the free schedule, which has no ranks, its worst response over what it may be"
    loop, paper, shared = comparison.loop, "", ""
    if loop is not None:
        shared = (
            "; the responses of all choices, which all rows of the loop share, took "
            f"{loop.seconds['respond']:.2f} s more and their ranks {loop.seconds['rank']:.2f} s"
        )
        if loop.paper_models is not None:
            few, many = loop.paper_models
            paper = f" (the paper counts {few:,} for its cascade and {many:,} with full overlap)"
    return (
        f"Objective: what the criterion {criterion.name} adds up to over all steps; {worst}. "
        "Compare objectives only within a heading and an aim: others add up other steps. Gap: how "
        "far the objective is above its optimum. Models: how many partial structures with "
        f"different grips it looks at{paper}. Seconds: to choose and to check{shared}."
    )
