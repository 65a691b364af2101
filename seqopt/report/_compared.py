"""A comparison as text: columns explained, and what was found in it in order."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

import numpy as np
import pandas as pd

from seqopt.graph.formulation import FormulationKind, formulations
from seqopt.problem.criteria import RankSum
from seqopt.problem.requirements import Criterion
from seqopt.report.comparison import CLOSED, Comparison
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE
from seqopt.stability._builds import BuildVerdicts
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
    blocks += _notes(comparison)
    return ["\n".join(_wrapped(line, width) for line in block) for block in blocks]


def _wrapped(line: str, width: int) -> str:
    """Return a line in lines of some columns; those of tables stay whole."""
    if len(line) <= width or "  " in line:
        return line
    rest = "  " * line.startswith("- ")
    how = {"break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(line, width, subsequent_indent=rest, **how)  # type: ignore[arg-type]


def shown_tables(comparison: Comparison) -> dict[str, pd.DataFrame]:
    """Return the responses of the builds that differ in their largest ones, by name."""
    shown = {*_unlike(comparison.table)}
    return {name: table for name, table in comparison.tables.items() if name in shown}


def _unlike(table: pd.DataFrame) -> dict[str, int]:
    """Return rows with different figures, the plainest of each, and how many others have these."""
    figures = table[[*RESPONSES]].round(3).apply(tuple, axis=1)
    ranked = figures[sorted(figures.index, key=_plainness)]
    first = {*ranked.index[~ranked.duplicated()]}
    return {n: int((figures == figures[n]).sum()) - 1 for n in figures.index if n in first}


def _responses(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the largest responses; rows with the same figures are one."""
    for line in (0, 1):
        cells = (f"{names[line]:>{names[2]}}" for names in RESPONSES.values())
        yield f"{'':{NAME}}{''.join(cells)}".rstrip()
    for problem, rows in comparison.table.groupby("problem", sort=False):
        yield _title_of(str(problem))
        for name, more in _unlike(rows).items():
            label = f"  {name}{f' +{more}' if more else ''}"
            row = "".join(_cells(comparison, name, rows.T[name]))
            yield f"{label:{NAME}}{row}".rstrip()


def _stands(comparison: Comparison) -> Iterator[str]:
    """Yield the table of the steps that fall; rows with the same are one."""
    first, *_ = comparison.verdicts.values()
    heads = "".join(f"{each.mortar:>9}" for each in first)
    yield f"{'':{NAME}}{'steps':>5}{heads}   first, {first[0].mortar}".rstrip()
    for problem, rows in comparison.table.groupby("problem", sort=False):
        yield _title_of(str(problem))
        same: dict[object, list[str]] = {}
        for name in map(str, rows.index):
            same.setdefault(comparison.verdicts[name], []).append(name)
        for name, *more in (sorted(names, key=_plainness) for names in same.values()):
            label = f"  {name}{f' +{len(more)}' if more else ''}"
            shown, *_ = found = comparison.verdicts[name]
            counts = "".join(map(_falling, found))
            where = f"step {shown.first}: brick {shown.brick}" if shown.first else ""
            where += f", joint {shown.joint}" if shown.joint else ""
            yield f"{label:{NAME}}{len(shown.verdicts):5}{counts}   {where}".rstrip()


def _falling(found: BuildVerdicts) -> str:
    """Return how many steps fall, and how many are undecided, in nine columns."""
    undecided = found.count(Verdict.UNDECIDED)
    return f"{found.count(Verdict.FALLS)}{f' ({undecided}?)' if undecided else ''}".rjust(9)


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
        said = f"{value:.1f}" if abs(value) < 1e4 else f"{value:,.0f}"
        said += f" ({paper[response]:.1f})" if response in paper else ""
        if response == "F_rob":
            said += "!" if row["overloaded"] else " "
        yield f"{said + ('?' if response == 'D_max' and row['outside'] else ''):>{width}}"


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
        yield _title_of(str(problem))
        for name, row in rows.iterrows():
            steps = len(comparison.tables[str(name)])
            yield (
                f"{f'  {name}':{NAME}}{row['objective']:10.2f}{100 * row['gap']:7.2f} %{steps:7}"
                + _known(row["models"], 9, ",.0f")
                + _known(row["seconds"], 9, ".3f")
                + f"  {kinds.get(str(name), 'in print')}"
            )


def _known(value: float, width: int, form: str) -> str:
    return f"{format(value, form) if np.isfinite(value) else '-':>{width}}"


def _about_choices(comparison: Comparison, criterion: Criterion) -> str:
    said = (
        f"Objective: what the criterion {criterion.name} adds up to over all steps; "
        f"{_of_steps(comparison, criterion)}. Compare objectives only within a heading and an "
        "aim: others add up other steps. Gap: how far the objective is above its optimum. Models: "
        f"how many partial structures with different grips it looks at{_counted(comparison)}. "
        "Seconds: to choose and to check"
    )
    if comparison.loop is not None:
        seconds = comparison.loop.seconds
        said += (
            f"; the responses of all choices, which all rows of the loop share, took "
            f"{seconds['respond']:.2f} s more and their ranks {seconds['rank']:.2f} s"
        )
    return f"{said}."


def _of_steps(comparison: Comparison, criterion: Criterion) -> str:
    """Return what the objective is of aims that are about the worst step, in words."""
    if not isinstance(criterion, RankSum):
        return "of minimax and the free schedule its largest step"
    if comparison.maxima.empty:
        return "of the free schedule, which has no ranks, its worst response over what it may be"
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
            lines = [f"- {text.removeprefix(OF_PAPER)}" for text in found]
            yield [heading, *lines]


def _title_of(problem: str) -> str:
    """Return what a problem is called above its rows."""
    titles = {
        CLOSED: "fixed sequences, nothing to choose",
        MODIFIED: "modified sequential method, some grips chosen",
        FREE: "free schedule: any robot may place, hold or release next",
    }
    return titles.get(problem, f"{problem} loop, grips chosen by a formulation")
