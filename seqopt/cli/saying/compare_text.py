"""A comparison as text for a terminal: what a reader needs first, in at most 80 columns."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from seqopt.cli.saying.terminal import wrapped
from seqopt.plan.calling.formulation import FormulationKind, formulations
from seqopt.problem.criteria import RankSum
from seqopt.problem.requirements import Criterion
from seqopt.report.comparison import CLOSED, Comparison
from seqopt.scene.scene import Scene
from seqopt.sequence.free_rules import FREE
from seqopt.study.published import PUBLISHED

NAME = 21  # columns of a name
RESPONSES = {
    "F_rob": ("grip", "force, N", 15),
    "M_sup": ("support", "moment, N m", 14),
    "T_max": ("", "tension, N", 14),
    "D_max": ("displacement,", "0.001 mm", 14),
}  # above each column of responses, and how wide it is
OF_PAPER = "In the paper: "  # with which notes about it begin
MODIFIED = "modified-sequential"


@dataclass(frozen=True)
class Told:
    """A comparison in words.

    ``text``: all lines; ``headings``: those that are headings.
    """

    text: str
    headings: tuple[str, ...]


def tell_comparison(comparison: Comparison, scene: Scene, criterion: Criterion) -> Told:
    """Return what a comparison found, its columns explained and its notes in order.

    ``scene``: which was compared; ``criterion``: with which the formulations were compared.
    """
    blocks = [
        [f"{scene.name}: {len(scene.bricks)} bricks, {len(scene.robots)} robots"],
        ["Largest response of any step", *_responses(comparison), "", _about(comparison)],
    ]
    if comparison.loop is None:
        blocks.append([wrapped(f"Loop of robots: not possible here; {comparison.refusal}")])
    if comparison.table["objective"].notna().any():
        about = _about_choices(comparison, criterion)
        blocks.append(["How the grips were chosen", *_choices(comparison), "", about])
    blocks += _notes(comparison)
    return Told("\n\n".join("\n".join(block) for block in blocks), tuple(b[0] for b in blocks))


def _responses(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the largest responses; rows with the same figures are one."""
    for line in (0, 1):
        cells = (f"{names[line]:>{names[2]}}" for names in RESPONSES.values())
        yield f"{'':{NAME}}{''.join(cells)}".rstrip()
    for problem, rows in comparison.table.groupby("problem", sort=False):
        yield _title_of(str(problem))
        figures = rows[[*RESPONSES]].round(3).apply(tuple, axis=1)
        ranked = figures[sorted(figures.index, key=_plainness)]
        shown = {*ranked.index[~ranked.duplicated()]}
        for name in (name for name in figures.index if name in shown):
            more = int((figures == figures[name]).sum()) - 1
            label = f"  {name}{f' +{more}' if more else ''}"
            row = "".join(_cells(comparison, str(name), rows.loc[name]))
            yield f"{label:{NAME}}{row}".rstrip()


def _plainness(name: str) -> tuple[bool, bool, str]:
    """Return what sorts names: rows with the same figures go by the first of them."""
    found = formulations().get(name)
    if found is None:
        return False, False, name
    return found.kind is not FormulationKind.EXACT, found.takes_budgets, name


def _cells(comparison: Comparison, name: str, row: pd.Series[float]) -> Iterator[str]:
    """Yield the largest responses of a row, each with what the paper prints."""
    paper = printed_largest(comparison, name)
    for response, (_, _, width) in RESPONSES.items():
        value = float(row[response])
        said = f"{value:.1f}" if abs(value) < 1e6 else f"{value:.0e}"
        said += f" ({paper[response]:.1f})" if response in paper else ""
        if response == "F_rob":
            said += "!" if row["overloaded"] else " "
        yield f"{said + ('?' if response == 'D_max' and row['outside'] else ''):>{width}}"


def printed_largest(comparison: Comparison, name: str) -> dict[str, float]:
    """Return the largest responses of a method as the paper prints them.

    ``name``: of a method. Result: by ``F_rob`` [N], ``M_sup`` [N m], ``T_max`` [N] and ``D_max``
    [1e-3 mm]; empty where the paper prints none.
    """
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
    return wrapped(said)


def _choices(comparison: Comparison) -> Iterator[str]:
    """Yield the table of objectives and of what choosing took."""
    kinds = {name: found.kind.value for name, found in formulations().items()}
    kinds |= {MODIFIED: kinds.get("cascade", ""), FREE: "exact"}
    yield f"{'':{NAME}}{'objective':>10}{'gap':>9}{'steps':>7}{'models':>9}{'seconds':>9}  kind"
    chosen = comparison.table[comparison.table["objective"].notna()]
    for problem, rows in chosen.groupby("problem", sort=False):
        yield _title_of(str(problem))
        for name, row in rows.iterrows():
            steps = len(comparison.tables[str(name)])
            yield (
                f"{f'  {name}':{NAME}}{row['objective']:10.2f}{100 * row['gap']:7.2f} %{steps:7}"
                + _known(row["models"], 9, ".0f")
                + _known(row["seconds"], 9, ".3f")
                + f"  {kinds.get(str(name), 'in print')}"
            )


def _known(value: float, width: int, form: str) -> str:
    return f"{format(value, form) if np.isfinite(value) else '-':>{width}}"


def _about_choices(comparison: Comparison, criterion: Criterion) -> str:
    said = (
        f"Objective: what the criterion {criterion.name} adds up to over all steps; "
        f"{_of_steps(comparison, criterion)}. Only rows under one heading, and of one aim, "
        "compete. Gap: how far the objective is above the proven optimum of that aim. Models: "
        f"how many partial structures with different grips it looks at{_counted(comparison)}. "
        "Seconds: to choose and to check"
    )
    if comparison.loop is not None:
        seconds = comparison.loop.seconds
        said += (
            f"; the responses of all choices, which all rows of the loop share, took "
            f"{seconds['respond']:.2f} s more and their ranks {seconds['rank']:.2f} s"
        )
    return wrapped(said + ".")


def _of_steps(comparison: Comparison, criterion: Criterion) -> str:
    """Return what the objective is of aims that are about the worst step, in words."""
    if not isinstance(criterion, RankSum):
        return "of minimax and the free schedule its largest step"
    known = "the fixed sequences" + (" and the published plan" * (PUBLISHED in comparison.tables))
    return (
        "of minimax its largest step, of the free schedule, which has no ranks, its worst response "
        f"over the least that {known} reach"
    )


def _counted(comparison: Comparison) -> str:
    """Return how many models the paper counts, in words; nothing where it counts none."""
    if comparison.loop is None or comparison.loop.paper_models is None:
        return ""
    cascading, overlap = comparison.loop.paper_models
    return f" (the paper counts {cascading:,} for its cascade and {overlap:,} with full overlap)"


def _notes(comparison: Comparison) -> Iterator[list[str]]:
    """Yield notes about the builds, then about the paper, each list under a heading."""
    for heading, of_paper in (("Notes", False), ("Inconsistencies in the paper", True)):
        found = [text for text in comparison.notes if text.startswith(OF_PAPER) == of_paper]
        if found:
            lines = [wrapped(text.removeprefix(OF_PAPER), first="- ") for text in found]
            yield [heading, *lines]


def _title_of(problem: str) -> str:
    """Return what a problem is called above its rows.

    ``problem``: of a comparison's table.

    Examples
    --------
    >>> _title_of("three-robot")
    'three-robot loop, grips chosen by a formulation'
    """
    titles = {
        CLOSED: "fixed sequences, nothing to choose",
        MODIFIED: "modified sequential method, some grips chosen",
        FREE: "free schedule: any robot may place, hold or release next",
    }
    return titles.get(problem, f"{problem} loop, grips chosen by a formulation")
