"""The command ``sweep``: plan many scenes, robots, criteria or payloads, and compare them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from math import prod
from pathlib import Path
from typing import Annotated, Any

import pandas as pd

from seqopt._cli import outputs
from seqopt._cli.answer import Answer, Status
from seqopt._cli.commands.optimize import find
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call, names_of, signature_of
from seqopt._cli.words import Folder
from seqopt._files import csv_text, make_folder, read_text, write_folder, write_text
from seqopt.errors import ProblemError, did_you_mean
from seqopt.sweep import MOST, WORDS, _plan_row, _solve_cases, _spread_values, _spread_words
from seqopt.work.progress import Tell
from seqopt.workflow import optimize

ROWS, ASKED, CHART = "sweep.csv", "sweep.json", "sweep"


def run(
    asked: Annotated[Call, ("call", optimize)],
    *,
    over: Sequence[str] = (),
    stability: bool = True,
    out: Folder = None,
    progress: Tell,
) -> Answer:
    """Plan many problems side by side: designs, robots, criteria, payloads.

    A row of a table for each: status, objectives, bounds, verdicts, time. All options of optimize
    hold for every problem; --workers are problems at a time, each solved by one. A scene in words
    may have ranges: arch:span=2..3/5,rise=0.6..0.9/3 has five spans and three rises.

    Parameters
    ----------
    over : sequence of str
        An option that differs too, of those of optimize: values with commas, or a range, as
        payload=250..400/4, grips=1e5..1e9/5log, criteria=worst-ratio,weighted, scene=a.json,b.json.
    stability : bool
        As of `optimize`.
    out : pathlib.Path
        Folder to write sweep.csv to, row by row, and a chart over one or two of what differs; a
        sweep that was interrupted goes on there.

    Examples
    --------
    $ seqopt sweep arch:span=2..3/5,rise=0.7..0.9/3 --schedule free --out designs
    $ seqopt sweep arch25 --over payload=250..400/4 --workers 2 --out payloads
    """
    output, words = Output(out, asked.words.get("scene")), {**asked.words}
    output.require(ROWS)
    workers = words.pop("workers", 1)
    cases = _cases(over, str(words.get("scene", "arch25")))
    path = None if output.path is None else _begun(words | {"over": over}, output.path, len(cases))
    solve = partial(
        _solved, Call(optimize, words), over, stability=stability
    )  # which other processes take
    table = _solve_cases(cases, solve, path, workers, None, progress)
    written = () if output.path is None else (output.path,)
    if output.path is not None and (drawn := _chart(table, [*cases[0]])):
        write_folder(output.path, drawn)
    counts = table["status"].value_counts()
    said = ", ".join(f"{count} {status}" for status, count in counts.items())
    text = f"{len(table)} problem{'s' * (len(table) > 1)}: {said}"
    none = "why" in table and bool(table["why"].notna().all())
    text += f" ({table['why'][0]})" if none else ""
    return Answer(
        {"rows": table},
        text=f"{text}; written to {out}" if written else "",
        data="" if written else csv_text(table),
        written=written,
        notes=outputs.figure_notes(written) if written else (text,),
        status=Status.NO_ANSWER if none else Status.DONE,
    )


def _cases(over: Sequence[str], scene: str) -> list[dict[str, Any]]:
    """Return every case: words of options by name, and of the scene that they distinguish."""
    flags = names_of(signature_of(optimize).options.values())
    differs = dict[str, list[str]]()
    for each in over:
        name, sign, values = each.partition("=")
        if name not in flags or not sign:
            hint = did_you_mean(name, flags)
            advice = f"optimize has no option {name}{hint}; give NAME=VALUES"
            raise ProblemError(f"--over {each}: {advice}")
        differs[name] = [v for part in values.split(",") for v in _spread_values(part)]
    scenes = _spread_words(scene) if "scene" not in differs else [({}, "")]
    if len(scenes) * prod(map(len, differs.values())) > MOST:
        raise ProblemError(f"sweep: it has more than {MOST} problems; give fewer values")
    chosen = [dict(zip(differs, values, strict=True)) for values in product(*differs.values())]
    return [{**own, **each, WORDS: words} for own, words in scenes for each in chosen]


def _solved(
    asked: Call, over: Sequence[str], case: Mapping[str, str], *, stability: bool
) -> dict[str, Any]:
    """Return the row of a case: of its plan, and how many steps fall."""
    flags = names_of(signature_of(optimize).options.values())
    names = [each.partition("=")[0] for each in over]  # a word of a scene is no option
    own = {flags[name].name: flags[name].parse(case[name]) for name in names}
    own = {"scene": case[WORDS], **own} if case[WORDS] else own
    plan, prover = find(Call(optimize, {**asked.words, **own}), None, stability=stability)
    verdicts = prover.of_builds({plan.title: plan.steps}).get(plan.title, ())
    return {**_plan_row(plan), **{f"falls_{v.mortar}": v.facts()["falls"] for v in verdicts}}


def _begun(words: Mapping[str, Any], folder: Path, count: int) -> Path:
    """Return the file of rows of a folder, which says of which sweep it is."""
    asked = {name: str(each) for name, each in words.items()}
    if (folder / ASKED).exists():
        before = json.loads(read_text(folder / ASKED))["asked"]
        other = next((n for n in asked | before if before.get(n) != asked.get(n)), None)
        if other is not None:
            raise ProblemError(
                f"{folder}: it has a sweep with another {other}, {before.get(other)}; name another "
                "folder"
            )
    make_folder(folder)
    write_text(folder / ASKED, json.dumps({"problems": count, "asked": asked}, indent=2) + "\n")
    return folder / ROWS


def _chart(table: pd.DataFrame, names: list[str]) -> dict[str, bytes]:
    """Return files of the chart over what differs; none where nothing can be drawn."""
    if outputs.figure_notes() or not table.columns.str.endswith("_bound").any():
        return {}
    return outputs.picture(
        CHART, lambda charts: charts.draw_sweep(table, [n for n in names if n in table])
    )
