"""The command ``compare``: all ways to build a scene, side by side."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pandas as pd

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.compare_text import printed_largest, tell_comparison
from seqopt.cli.saying.outputs import comparison_files, figure_notes, require_out, write_outputs
from seqopt.cli.saying.terminal import wrapped
from seqopt.cli.words.asked import (
    asked_engine,
    asked_scene,
    exceeded,
    level_notes,
    scene_facts,
    strictly,
)
from seqopt.cli.words.common_arguments import (
    criterion_arguments,
    engine_arguments,
    form_arguments,
    group,
    robots_argument,
    scene_argument,
    strict_argument,
)
from seqopt.cli.words.values import asked_criterion, parse_robots
from seqopt.engines.registry import provenance
from seqopt.network.build import build_network
from seqopt.report.comparison import Comparison, compare
from seqopt.report.pages import PAGE, comparison_page
from seqopt.report.text import format_details
from seqopt.responses.table import builds_in_words

DESCRIPTION = (
    "Build a scene in every way that seqopt knows, on paper: the fixed sequences, a loop of robots "
    "whose grips each formulation chooses, and the free schedule. Show the largest forces, moments "
    "and displacements side by side; for the arch of Bruun et al. beside the figures that they "
    "print, with a list of the inconsistencies in print."
)
USAGE = ("[SCENE] [--out DIR] [--details] [other options]",)
EXAMPLES = (
    "seqopt compare",
    "seqopt compare wall:columns=6,courses=4 --out wall",
    "seqopt compare arch25 --criteria worst-ratio --json",
)


def add_arguments(command: argparse.ArgumentParser) -> None:
    """Add the arguments of ``compare``."""
    basic = group(command, "what is compared")
    scene_argument(basic)
    robots_argument(basic, "all methods, each of which takes as many as it needs")
    basic.add_argument(
        "--out", type=Path, metavar="DIR", help="write tables, figures and a page with all builds"
    )
    basic.add_argument(
        "--details",
        action="store_true",
        help="also show the largest force of each robot, every formulation under both objectives "
        "of ranks, and where the grips of the published plan rank",
    )
    criterion_arguments(group(command, "what a step costs (advanced)"))
    engine_arguments(group(command, "how responses are computed (advanced)"))
    form = group(command, "what is printed")
    strict_argument(form)
    form_arguments(form)


def run(options: argparse.Namespace) -> Answer:
    """Compare all ways to build a scene.

    ``options``: of the command.
    """
    scene = asked_scene(options)
    engine = asked_engine(options, build_network(scene))
    criterion = asked_criterion(options)
    require_out(options)
    result = compare(engine, criterion, options.tell, parse_robots(options.robots))
    about = {"scene": scene.name, "criteria": _criteria(result), **provenance(engine)}
    told = tell_comparison(result, scene, criterion)
    blocks = [told.text]
    if options.details:
        blocks.append(format_details(result, scene))
    written: tuple[Path, ...] = ()
    if options.out is not None:
        options.tell("drawing figures")
        files = comparison_files(result) | {"summary.json": json.dumps(about, indent=2) + "\n"}
        page = {PAGE: comparison_page(engine, result)}
        written = write_outputs(options, lambda: files | page)
        blocks.append(_where(options.out))
    else:
        more = "" if options.details else "; --details shows more here"
        blocks.append(wrapped(f"--out DIR writes tables, figures and a step viewer{more}."))
    answer = Answer(
        facts={**about, "scene": scene_facts(scene), "criterion": criterion.name, **_facts(result)},
        text="\n\n".join(blocks),
        headings=told.headings,
        written=written,
        notes=(*level_notes(engine), *(figure_notes() if written else ())),
    )
    over = exceeded(scene, *result.tables.values())
    return strictly(answer, options, over, builds_in_words(result.departures))


def _where(folder: Path) -> str:
    """Return which file of a folder is for what."""
    return (
        f"written to {folder}\n"
        f"  {PAGE}: every build step by step; open it in a browser\n"
        "  comparison.csv: a row per way to build; steps_NAME.csv: a row per step of each\n"
        "  summary.json: the criteria with their numbers, the engine, and versions of packages"
    ) + ("" if figure_notes() else "\n  *.png, *.svg: the figures")


def _criteria(result: Comparison) -> dict[str, object]:
    """Return the criteria of the rows that have an objective, with all of their numbers."""
    return {
        problem: {"criterion": criterion.name, **criterion.settings}
        for problem, criterion in result.criteria.items()
    }


def _facts(result: Comparison) -> dict[str, object]:
    """Return rows, notes and what the paper prints, for scripts."""
    table = result.table.assign(
        steps=[len(result.tables[name]) for name in result.table.index],
        paper=pd.Series({name: printed_largest(result, name) for name in result.table.index}),
    )
    loop = result.loop
    return {
        "rows": table.rename_axis("name").reset_index(),
        "largest_by_robot": result.maxima.to_dict(),
        "paper_by_robot": None if result.printed is None else _paper(result),
        "loop": None
        if loop is None
        else {
            "method": loop.method,
            "seconds": dict(loop.seconds),
            "models_paper_count": loop.paper_models,
            "published_ranks": loop.ranks,
        },
        "why_no_loop": result.refusal or None,
        "findings": list(result.notes),
    }


def _paper(result: Comparison) -> dict[str, object]:
    """Return the largest responses that the paper prints, by method and quantity."""
    assert result.printed is not None  # asked for
    table = result.printed.set_axis(result.maxima.columns, axis=1)
    return {str(name): column.to_dict() for name, column in table.items()}
