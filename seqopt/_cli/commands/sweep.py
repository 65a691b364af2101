"""The command ``sweep``: plan many scenes, robots, criteria or payloads, and compare them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from functools import partial
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import pandas as pd

from seqopt._cli import options, outputs
from seqopt._cli.answer import Answer, Status
from seqopt._cli.commands import optimize
from seqopt._cli.signatures import Option, signature_of
from seqopt._files import csv_text, make_folder, read_text, write_folder, write_text
from seqopt._later import Later
from seqopt.errors import ProblemError, did_you_mean
from seqopt.sweep import MOST, WORDS, _plan_row, _solve_cases, _spread_values, _spread_words

CHARTED = Later("seqopt.report._sweep_chart")  # matplotlib is an extra
ROWS, ASKED, CHART = "sweep.csv", "sweep.json", "sweep"


class Sweep(optimize.Optimize):
    """What is built, and by whom?

    scene : SCENE
        as everywhere, also in words with ranges: arch:span=2..3/5,rise=0.6..0.9/3 has five spans
        and three rises (default: arch25)

    What is it about?
    over : NAME=VALUES
        an option that differs too, of those of optimize: values with commas, or a range, as
        payload=250..400/4, grips=1e5..1e9/5log, criteria=worst-ratio,weighted, scene=a.json,b.json

    What is written and printed?
    out : DIR
        folder to write sweep.csv to, row by row, and a chart over one or two of what differs; a
        sweep that was interrupted goes on there
    """

    over: options.Words = options.word(())


def run(asked: Sweep) -> Answer:
    """Plan many problems side by side: designs, robots, criteria, payloads.

    A row of a table for each: status, objectives, bounds, verdicts, time. All options of optimize
    hold for every problem; --workers are problems at a time, each solved by one.

    Examples
    --------
    seqopt sweep arch:span=2..3/5,rise=0.7..0.9/3 --schedule free --out designs
    seqopt sweep arch25 --over payload=250..400/4 --workers 2 --out payloads
    """
    outputs.require_out(asked, ROWS)
    cases = _cases(asked)
    path = None if asked.path is None else _begun(asked, asked.path, len(cases))
    solve = partial(_solved, replace(asked, progress=None))  # which other processes take
    table = _solve_cases(cases, solve, path, asked.workers, None, asked.tell)
    written = () if asked.path is None else (asked.path,)
    if asked.path is not None and (drawn := _chart(table, [*cases[0]])):
        write_folder(asked.path, drawn)
    counts = table["status"].value_counts()
    said = ", ".join(f"{count} {status}" for status, count in counts.items())
    text = f"{len(table)} problem{'s' * (len(table) > 1)}: {said}"
    none = "why" in table and bool(table["why"].notna().all())
    text += f" ({table['why'][0]})" if none else ""
    return Answer(
        {"rows": table},
        text=f"{text}; written to {asked.path}" if written else "",
        data="" if written else csv_text(table),
        written=written,
        notes=outputs.figure_notes(written) if written else (text,),
        status=Status.NO_ANSWER if none else Status.DONE,
        value=table,
    )


def _cases(asked: Sweep) -> list[dict[str, Any]]:
    """Return every case: words of options by name, and of the scene that they distinguish."""
    flags = _flags()
    differs = dict[str, list[str]]()
    for each in asked.over:
        name, sign, values = each.partition("=")
        if name not in flags or not sign:
            hint = did_you_mean(name, flags)
            advice = f"optimize has no option {name}{hint}; give NAME=VALUES"
            raise ProblemError(f"--over {each}: {advice}")
        differs[name] = [v for part in values.split(",") for v in _spread_values(part)]
    scenes = _spread_words(str(asked.scene)) if "scene" not in differs else [({}, "")]
    if len(scenes) * prod(map(len, differs.values())) > MOST:
        raise ProblemError(f"sweep: it has more than {MOST} problems; give fewer values")
    chosen = [dict(zip(differs, values, strict=True)) for values in product(*differs.values())]
    return [{**own, **each, WORDS: words} for own, words in scenes for each in chosen]


def _flags() -> dict[str, Option]:
    """Return the options of `optimize` that have a value, by their words without dashes."""
    known = signature_of(optimize.run).options.values()
    return {option.flag.removeprefix("--"): option for option in known if option.value}


def _solved(asked: Sweep, case: Mapping[str, str]) -> dict[str, Any]:
    """Return the row of a case: of its plan, and how many steps fall."""
    flags = _flags()
    names = [each.partition("=")[0] for each in asked.over]  # a word of a scene is no option
    own = {flags[name].name: flags[name].parse(case[name]) for name in names}
    own = {"scene": case[WORDS], **own} if case[WORDS] else own
    values = {each.name: getattr(asked, each.name) for each in fields(optimize.Optimize)}
    values |= {"out": None, "workers": 1, **own}
    found = optimize.find(optimize.Optimize(**values))
    verdicts = found.verdicts.get(found.plan.title, ())
    return {**_plan_row(found.plan), **{f"falls_{v.mortar}": v.facts()["falls"] for v in verdicts}}


def _begun(asked: Sweep, folder: Path, count: int) -> Path:
    """Return the file of rows of a folder, which says of which sweep it is."""
    shown = replace(asked, progress=None, out=None, workers=1)
    words = {each.name: str(getattr(shown, each.name)) for each in fields(shown)}
    if (folder / ASKED).exists():
        before = json.loads(read_text(folder / ASKED))["asked"]
        other = next((n for n in words if before.get(n) != words[n]), None)
        if other is not None:
            raise ProblemError(
                f"{folder}: it has a sweep with another {other}, {before.get(other)}; name another "
                "folder"
            )
    make_folder(folder)
    write_text(folder / ASKED, json.dumps({"problems": count, "asked": words}, indent=2) + "\n")
    return folder / ROWS


def _chart(table: pd.DataFrame, names: list[str]) -> dict[str, bytes]:
    """Return files of the chart over what differs; none where nothing can be drawn."""
    if outputs.figure_notes() or not table.columns.str.endswith("_bound").any():
        return {}
    return outputs.picture(
        CHART, lambda _: CHARTED.draw_sweep(table, [n for n in names if n in table])
    )
