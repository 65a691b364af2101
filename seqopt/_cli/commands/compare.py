"""The command ``compare``: all ways to build a scene, side by side, in at most 80 columns."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from seqopt._cli.answer import Answer
from seqopt._cli.asked import (
    asked_engine,
    asked_prover,
    asked_scene,
    exceeded,
    level_notes,
    refused,
    scene_facts,
    strictly,
)
from seqopt._cli.options import Cost, Judged, Postures, Strict, Team, word
from seqopt._cli.outputs import (
    comparison_files,
    figure_notes,
    require_out,
    softness_files,
    speed_files,
    write_outputs,
)
from seqopt._cli.terminal import wrapped
from seqopt._cli.values import _parse_grip_range, asked_criterion, parse_robots, speed_seconds
from seqopt._showing import PAGE
from seqopt.arms.reach import find_postures
from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance, simplest
from seqopt.graph.formulation import FormulationKind, formulations
from seqopt.network.build import build_network
from seqopt.problem.criteria import RankSum
from seqopt.problem.requirements import Criterion
from seqopt.report._pages import comparison_page
from seqopt.report.comparison import CLOSED, Comparison, compare
from seqopt.report.softness import _softness_lines, held_softly, turning_points
from seqopt.report.text import format_details
from seqopt.responses.table import builds_in_words
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE
from seqopt.stability._builds import BuildProver, BuildVerdicts
from seqopt.stability.assessment import Verdict
from seqopt.study.published import PUBLISHED
from seqopt.workflow import DEFAULTS

ABOUT_STANDING = (
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
SOFTLY = "The same builds, by the stiffness of grips in N/m"
SPEED = "Speed against accuracy"
TURNS = "What turns as grips become softer"
NO_TURN = "nothing does in this range"
HOW_SOFT = (
    "grips: how much this depends on how stiff they are: --grips 1e5..1e9; results for one "
    "stiffness: --grips 1e6"
)
OF_PAPER = "In the paper: "  # with which notes about it begin
MODIFIED = "modified-sequential"


@dataclass(frozen=True, kw_only=True)
class Compare(Strict, Postures, Judged, Cost, Team):
    """Build a scene in every way that seqopt knows, on paper, and show all side by side.

    These are the fixed sequences, a loop of robots whose grips each formulation chooses, and the
    free schedule. Show the largest forces, moments and displacements; for the arch of Bruun et al.
    beside the figures that they print, with a list of the inconsistencies in print.

    Usage
    [SCENE] [--out DIR] [--details] [other options]

    What is built, and by whom?
    out : DIR
        write tables, figures and a page with all builds
    details :
        also show the largest force of each robot, every formulation under both objectives of ranks,
        and where the grips of the published plan rank
    speed : SECONDS
        also chart speed against accuracy: the loop by every engine and formulation, each within so
        many seconds (10); errors are those beside the engine that --engine names

    Examples
    --------
    seqopt compare
    seqopt compare wall:columns=6,courses=4 --out wall
    seqopt compare arch25 --criteria worst-ratio --json
    seqopt compare arch25 --grips 1e5..1e9
    seqopt compare arch25 --speed 20 --out speed
    """

    details: bool = False
    speed: str | None = word(None, const="10")


def run(asked: Compare) -> Answer:
    """Compare all ways to build a scene."""
    return answered(asked, find(asked))


class Found(NamedTuple):
    """A comparison, and what it is compared by."""

    engine: Engine
    criterion: Criterion
    prover: BuildProver
    result: Comparison


def find(asked: Compare) -> Found:
    """Compare all ways to build a scene; with what it is compared by."""
    _parse_grip_range(asked.grips)  # said before anything is computed
    seconds = speed_seconds(asked.speed)
    scene = asked_scene(asked, ranged=True)
    find_postures(scene, asked.cache, asked.tell)
    engine = asked_engine(asked, build_network(scene))
    usual = DEFAULTS["any other"].criterion
    criterion = asked_criterion(asked, usual) or usual
    require_out(asked)
    prover = asked_prover(asked, engine.network)
    robots = parse_robots(asked.robots)
    result = compare(engine, criterion, asked.tell, robots, prover, seconds)
    return Found(engine, criterion, prover, result)


def answered(asked: Compare, found: Found) -> Answer:
    """Write a comparison, and return what is in it."""
    engine, criterion, prover, result = found
    scene, grips = engine.network.scene, _parse_grip_range(asked.grips)
    criteria = {k: {"criterion": c.name, **c.settings} for k, c in result.criteria.items()}
    about = {"scene": scene.name, "criteria": criteria, **provenance(engine)}
    text, headings = _tell(result, scene, criterion)
    blocks = [text, format_details(result, scene)] if asked.details else [text]
    if result.speed is not None:
        blocks.append("\n".join([SPEED, *result.speed.told(wrapped)]))
    softly = held_softly(engine, _shown_tables(result), grips, asked.tell)
    turns = turning_points(softly, _fixed(result)) if grips else ()
    if grips:
        blocks += _softly(softly, turns)
    written: tuple[Path, ...] = ()
    if asked.out is not None:
        asked.tell("drawing figures")
        files = comparison_files(result) | {"summary.json": json.dumps(about, indent=2) + "\n"}
        page = {PAGE: comparison_page(engine, result)}
        files |= softness_files(softly) | speed_files(result.speed)
        written = write_outputs(asked, lambda: files | page)
        blocks.append(_where(asked.out, speed=result.speed is not None))
    else:
        more = "" if asked.details else "; --details shows more here"
        blocks.append(wrapped(f"--out DIR writes tables, figures and a step viewer{more}."))
    answer = Answer(
        facts=about
        | {"scene": scene_facts(scene), "criterion": criterion.name, **_facts(result)}
        | ({"grips": {"rows": softly, "turns": list(turns)}} if grips else {})
        | ({} if result.speed is None else {"speed": result.speed.facts()}),
        text="\n\n".join(blocks),
        headings=(*headings, SPEED, SOFTLY, TURNS),
        written=written,
        notes=(
            *level_notes(asked, simplest(engine)),
            *result.enough.lines,
            *refused(prover),
            *(() if grips else (HOW_SOFT,)),
            *(figure_notes() if written else ()),
        ),
    )
    over = exceeded(scene, *result.tables.values())
    left = builds_in_words(result.departures)
    return strictly(answer, asked, over, left, result.verdicts)


def _softly(table: pd.DataFrame, turns: Sequence[str]) -> list[str]:
    """Return what the builds come to as grips become softer, and where conclusions turn."""
    lines = [wrapped(line, first="- ") for line in turns or [NO_TURN]]
    shown = _softness_lines(table, [*dict.fromkeys(table["build"])])
    return ["\n".join([SOFTLY, *shown]), "\n".join([TURNS, *lines])]


def _shown_tables(result: Comparison) -> dict[str, pd.DataFrame]:
    """Return the responses of the builds that differ in their largest ones, by name."""
    figures = result.table[[*RESPONSES]].round(3).apply(tuple, axis=1)
    ranked = figures[sorted(figures.index, key=_plainness)]
    shown = {*ranked.index[~ranked.duplicated()]}
    return {name: table for name, table in result.tables.items() if name in shown}


def _fixed(result: Comparison) -> list[str]:
    """Return the methods that leave nothing to choose."""
    fixed = result.table.index[result.table["problem"] == CLOSED]
    return [name for name in map(str, fixed) if name in _shown_tables(result)]


def _where(folder: Path, *, speed: bool) -> str:
    timed = "\n  speed.csv: a row per engine and formulation" * speed
    return (
        f"written to {folder}\n"
        f"  {PAGE}: every build step by step; open it in a browser\n"
        "  comparison.csv: a row per way to build; steps_NAME.csv: a row per step of each\n"
        "  summary.json: the criteria with their numbers, the engine, and versions of packages"
        f"{timed}"
    ) + ("" if figure_notes() else "\n  *.png, *.svg: the figures")


def _facts(result: Comparison) -> dict[str, object]:
    """Return rows, notes and what the paper prints, for scripts."""
    table = result.table.assign(
        steps=[len(result.tables[name]) for name in result.table.index],
        paper=pd.Series({name: _printed_largest(result, name) for name in result.table.index}),
    )
    loop, printed = result.loop, result.printed
    paper = None if printed is None else printed.set_axis(result.maxima.columns, axis=1)
    return {
        "rows": table.rename_axis("name").reset_index(),
        "largest_by_robot": result.maxima.to_dict(),
        "paper_by_robot": None if paper is None else paper.to_dict(),
        "loop": None
        if loop is None
        else {
            "method": loop.method,
            "seconds": dict(loop.seconds),
            "models_paper_count": loop.paper_models,
            "published_ranks": loop.ranks,
        },
        "why_no_loop": result.refusal or None,
        "enough": result.enough.facts(),
        "findings": list(result.notes),
    }


def _tell(
    comparison: Comparison, scene: Scene, criterion: Criterion
) -> tuple[str, tuple[str, ...]]:
    """Return what a comparison found, its columns explained and its notes in order; headings."""
    blocks = [
        [f"{scene.name}: {len(scene.bricks)} bricks, {len(scene.robots)} robots"],
        ["Largest response of any step", *_responses(comparison), "", _about(comparison)],
    ]
    if comparison.loop is None:
        blocks.append([wrapped(f"Loop of robots: not possible here; {comparison.refusal}")])
    if comparison.verdicts:
        blocks.append(["Steps that fall", *_stands(comparison), "", wrapped(ABOUT_STANDING)])
    if comparison.table["objective"].notna().any():
        about = _about_choices(comparison, criterion)
        blocks.append(["How the grips were chosen", *_choices(comparison), "", about])
    blocks += _notes(comparison)
    return "\n\n".join("\n".join(block) for block in blocks), tuple(b[0] for b in blocks)


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
    paper = _printed_largest(comparison, name)
    for response, (_, _, width) in RESPONSES.items():
        value = float(row[response])
        said = f"{value:.1f}" if abs(value) < 1e4 else f"{value:,.0f}"
        said += f" ({paper[response]:.1f})" if response in paper else ""
        if response == "F_rob":
            said += "!" if row["overloaded"] else " "
        yield f"{said + ('?' if response == 'D_max' and row['outside'] else ''):>{width}}"


def _printed_largest(comparison: Comparison, name: str) -> dict[str, float]:
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
    return wrapped(said + ".")


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
            lines = [wrapped(text.removeprefix(OF_PAPER), first="- ") for text in found]
            yield [heading, *lines]


def _title_of(problem: str) -> str:
    """Return what a problem is called above its rows."""
    titles = {
        CLOSED: "fixed sequences, nothing to choose",
        MODIFIED: "modified sequential method, some grips chosen",
        FREE: "free schedule: any robot may place, hold or release next",
    }
    return titles.get(problem, f"{problem} loop, grips chosen by a formulation")
