"""The command ``sweep``: plan many problems side by side, a row of a table for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from typing import Annotated

from seqopt._cli.answer import Answer, Status
from seqopt._cli.signatures import Call, Option, signature_of
from seqopt._cli.words import Folder
from seqopt._files import make_folder
from seqopt.errors import ProblemError, did_you_mean
from seqopt.exchange._files import Output, csv_text, write_folder
from seqopt.plan.plan import Plan
from seqopt.report._folders import figure_notes, picture_files
from seqopt.report.sweep import MOST, spread, sweep
from seqopt.work import Tell
from seqopt.workflow import optimize

ROWS = "sweep.csv"


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
        An option of optimize that differs too: values with commas, or a range, as
        payload=250..400/4, grips=1e5..1e9/5log, criterion=worst-ratio,weighted,
        scene=a.json,b.json.
    stability : bool
        If not, it is not counted how many steps fall, dry and with epoxy.
    out : pathlib.Path
        Folder to write sweep.csv to, row by row, and a chart over one or two of what differs; rows
        that it has are kept.

    Examples
    --------
    $ seqopt sweep arch:span=2..3/5,rise=0.7..0.9/3 --schedule free --out designs
    $ seqopt sweep arch25 --over payload=250..400/4 --workers 2 --out payloads
    """
    words = {**asked.words}
    workers, scene = words.pop("workers", 1), words.pop("scene", "arch25")
    output = Output(out, str(scene))
    output.require(ROWS)
    said = ((n, [*w] if isinstance(w, tuple) else [w]) for n, w in words.items() if w is not True)
    both = "".join(f" {name}={' '.join(map(str, each))}" for name, each in said)
    problems = {name + both: own for name, own in _problems(over, str(scene)).items()}
    if output.path is not None:
        make_folder(output.path)
    path = None if output.path is None else output.path / ROWS
    mortars = ("dry", "epoxy") if stability else ()
    plan = partial(_plan, Call(optimize, words))
    table = sweep(problems, plan, mortars=mortars, out=path, workers=workers, progress=progress)
    written = () if output.path is None else (output.path,)
    differs = [name for name in next(iter(problems.values())) if table[name].nunique() > 1]
    if output.path is not None and differs and table.columns.str.endswith("_bound").any():
        drawn = picture_files("sweep", lambda charts: charts.draw_sweep(table, differs))
        write_folder(output.path, drawn)
    counts = ", ".join(f"{n} {status}" for status, n in table["status"].value_counts().items())
    text = f"{len(table)} problem{'s' * (len(table) > 1)}: {counts}"
    none = "why" in table and bool(table["why"].notna().all())
    text += f" ({table['why'][0]})" if none else ""
    found, status = {*table["status"]}, Status.DONE
    if none:  # of words that are wrong for all nothing is known
        status = Status.FAILED if "failed" in found else Status.BAD_INPUT
        status = Status.NO_ANSWER if found & {"infeasible", "mechanism"} else status
    return Answer(
        {"rows": table},
        f"{text}; written to {out}" if written else "",
        data="" if written else csv_text(table),
        written=written,
        notes=figure_notes() if written else (text,),
        status=status,
    )


def _problems(over: Sequence[str], scene: str) -> dict[str, Mapping[str, str]]:
    """Return by name the words of options that tell problems apart, the scene's first."""
    flags = _flags()
    differs: dict[str, Sequence[str]] = {"scene": spread(scene)}
    for each in over:
        name, sign, values = each.partition("=")
        if name not in flags or not sign:
            none = f"optimize has no option {name}{did_you_mean(name, flags)}"
            raise ProblemError(f"--over {each}: {none}; give NAME=VALUES")
        differs[name] = [word for part in values.split(",") for word in spread(part)]
    every = [dict(zip(differs, words, strict=True)) for words in product(*differs.values())]
    if len(every) > MOST:
        raise ProblemError(f"sweep: it has more than {MOST} problems; give fewer values")
    said = ([word, *(f"{n}={w}" for n, w in rest)] for (_, word), *rest in map(dict.items, every))
    return dict(zip(map(" ".join, said), every, strict=True))


def _plan(asked: Call, own: Mapping[str, str]) -> Plan:
    """Return the plan of a problem, of the words of all and its own."""
    options = [(_flags()[name], word) for name, word in own.items()]
    words = {each.name: [w] if isinstance(each.default, tuple) else w for each, w in options}
    plan: Plan = asked(**words)
    return plan


def _flags() -> dict[str, Option]:
    """Return the options of `optimize` that have a value by their words without dashes."""
    options = signature_of(optimize).options.values()
    return {option.flag.removeprefix("--"): option for option in options if option.value}
