"""Every command as a function of Python: the same words and defaults, and values in place of text.

A scene is given as such, by its name or words, by its file, or as a plan or the folder of one.
Where a parameter says nothing else, words of the command line stand for its value:
``criterion="worst-ratio"``, ``limits=["payload", "F_largest=300"]``, ``grips=1e6``. With ``out``
the same is written as by the command. Progress is shown in a notebook and at a terminal, or told to
``progress``. A `SeqoptError` says in one line what to change.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from inspect import Parameter, getdoc, signature
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import pandas as pd

from seqopt._cli.answer import Answer
from seqopt._cli.commands import analyze as _analyze
from seqopt._cli.commands import assess as _assess
from seqopt._cli.commands import compare as _compare
from seqopt._cli.commands import exporting as _export
from seqopt._cli.commands import instance as _instance
from seqopt._cli.commands import pareto as _pareto
from seqopt._cli.commands import reach as _reach
from seqopt._cli.commands import replan as _replan
from seqopt._cli.commands import report as _report
from seqopt._cli.commands import times as _times
from seqopt._cli.options import Asked
from seqopt._cli.signatures import given, page_of
from seqopt._cli.watcher import Watcher
from seqopt.contact.mortar import Mortar
from seqopt.graph.instance import Instance
from seqopt.instances.answers import judge_instance as judge
from seqopt.plan.build import ShownBuild
from seqopt.plan.front import Front
from seqopt.plan.plan import Plan
from seqopt.problem.requirements import Criterion, Limit
from seqopt.problem.standing import Standing
from seqopt.report.comparison import Comparison
from seqopt.scene.scene import Scene
from seqopt.sequence.rules import FREE, FreeRules
from seqopt.work.progress import Tell
from seqopt.workflow import optimize

__all__ = [
    "analyze",
    "assess",
    "compare",
    "export",
    "instance",
    "judge",
    "optimize",
    "pareto",
    "reach",
    "replan",
    "report",
    "times",
]

Built: TypeAlias = Scene | ShownBuild | Path | str
Words: TypeAlias = Sequence[str] | str
Limits: TypeAlias = Sequence[Limit | str] | Limit | str
Rules: TypeAlias = FreeRules | Sequence[str] | str
Stands: TypeAlias = Standing | Mortar | str
FLAG = re.compile(r"--([a-z][a-z-]*)")
_Asked = TypeVar("_Asked", bound=Asked)
COMMAND_LINE = {  # what a parameter is called there
    "criterion": "criteria",
    "limits": "limit",
    "budgets": "budget",
    "rules": "rule",
    "rounding": "round",
}
PYTHON = {
    "stability": "Whether it is proven which steps stand.",
    "progress": "Told how far it is; by default a notebook or a terminal shows it.",
}  # what a parameter is that the command line has in another way
RAISES = "Raises\n------\nSeqoptError\n    With one line that says what to change."
_Door = TypeVar("_Door", bound=Callable[..., object])


def _documented(kind: type[Asked]) -> Callable[[_Door], _Door]:
    """Give a function the parameters that the help of its command describes, each in brief."""
    options = page_of(kind).options

    def with_parameters(door: _Door) -> _Door:
        lines = ["Parameters", "----------"]
        for each in signature(door).parameters.values():
            help_text = options.get(COMMAND_LINE.get(each.name, each.name), ("", "", ""))[2]
            about = PYTHON.get(
                each.name, f"{help_text[:1].upper()}{help_text[1:].partition('; ')[0]}"
            )
            about = FLAG.sub(lambda flag: f"``{flag[1].replace('-', '_')}``", about)
            needed = "" if each.default is Parameter.empty else ", optional"
            lines += [f"{each.name} : {each.annotation}{needed}", f"    {about}"]
        head, returns, examples = re.split(r"(?=\nReturns\n)|(?=\nExamples\n)", f"{getdoc(door)}\n")
        door.__doc__ = "\n".join([head, *lines, returns, RAISES, examples])
        return door

    return with_parameters


@_documented(_compare.Compare)
def compare(
    scene: Built = "arch25",
    *,
    criterion: Criterion | str | None = None,
    robots: int | Words | None = None,
    order: Words | None = None,
    grips: float | str | None = None,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    speed: float | None = None,
    stability: bool = True,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> Comparison:
    """Build a scene in every way that seqopt knows, side by side, as ``seqopt compare`` does.

    Returns
    -------
    Comparison

    Examples
    --------
    >>> found = compare("wall:columns=2,courses=2", criterion="worst-ratio", stability=False)
    >>> float(found.table.loc["sequential", "F_rob"].round(1))
    37.3
    """
    with _asked(_compare.Compare, locals()) as asked:
        found = _compare.find(asked)
        if asked.out is not None:
            _compare.answered(asked, found)
        return found.result


@_documented(_pareto.Pareto)
def pareto(
    scene: Built = "arch25",
    *,
    schedule: Path | str = FREE,
    aim: Words | None = None,
    rules: Rules | None = None,
    limits: Limits = (),
    stands: Stands | None = None,
    robots: int | Words | None = None,
    order: Words | None = None,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    rounding: Mapping[str, float] | Words = (),
    seconds: float | None = None,
    stability: bool = True,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> Front:
    """Find all plans that no other one beats in every aim, as ``seqopt pareto`` does.

    Returns
    -------
    Front

    Examples
    --------
    >>> pareto("wall:columns=2,courses=2", aim="F_largest,steps")
    <Front: 1 plans, complete; F_largest, steps, regrips>
    """
    with _asked(_pareto.Pareto, locals()) as asked:
        found = _pareto.find(asked)
        if asked.out is not None:
            _pareto.answered(asked, found)
        return found.front


@_documented(_assess.Assess)
def assess(
    scene: Built = "arch25",
    *,
    method: str | None = None,
    plan: ShownBuild | Path | str | None = None,
    robots: Words | None = None,
    mortar: Mortar | str | None = None,
    margins: Words | None = None,
    steps: str | None = None,
    map: str | None = None,  # noqa: A002  # as of the command
    holds: Words | None = None,
    load_factor: bool = False,
    workers: int = 1,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Prove of every step that it stands, or that it does not, as ``seqopt assess`` does.

    Returns
    -------
    pandas.DataFrame
        A row per mortar and step: dry, then with epoxy, if no ``mortar`` is named; with ``map`` a
        row per build, mortar and value. ``attrs["notes"]`` says what verdicts leave out.

    Examples
    --------
    >>> assess("wall:columns=2,courses=2", mortar="dry")["verdict"].value_counts().to_dict()
    {'stands': 7}
    """
    with _asked(_assess.Assess, locals()) as asked:
        answer = _assess.run(asked)
        return _table(answer, "steps" if asked.map is None else "cases")


@_documented(_analyze.Analyze)
def analyze(
    scene: Built = "arch25",
    *,
    method: str | None = None,
    plan: ShownBuild | Path | str | None = None,
    robots: Words | None = None,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    staged: str | None = None,
    tolerance: str | None = None,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Compute how a structure responds in every step, as ``seqopt analyze`` does.

    Returns
    -------
    pandas.DataFrame
        A row per step, units in the names of columns. ``attrs["notes"]`` says what is worth
        knowing, ``attrs["failures"]`` which steps are mechanisms, or were not solved.

    Examples
    --------
    >>> analyze("wall:columns=2,courses=2", method="sequential").shape[0]
    7
    """
    with _asked(_analyze.Analyze, locals()) as asked:
        answer = _analyze.run(asked)
        return _table(answer, "steps", failures=[*answer.failures])


@_documented(_times.Times)
def times(
    scene: Built = "arch25",
    *,
    method: str | None = None,
    plan: ShownBuild | Path | str | None = None,
    robots: Words | None = None,
    durations: Words = (),
    stands: Stands | None = None,
    curing: Words = (),
    reassign: bool = False,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Say who does what when in a build, as ``seqopt times`` does.

    Returns
    -------
    pandas.DataFrame
        A row per step, s; ``attrs["robots"]`` is how long each robot does what.

    Examples
    --------
    >>> float(times("wall:columns=2,courses=2", method="sequential")["end_s"].iloc[-1])
    145.0
    """
    with _asked(_times.Times, locals()) as asked:
        answer = _times.run(asked)
        return _table(answer, "steps", robots=answer.facts["robots"])


@_documented(_reach.Reach)
def reach(
    scene: Built = "arch25",
    *,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> pd.DataFrame:
    """Say which robots reach which nodes, as ``seqopt reach`` does.

    Returns
    -------
    pandas.DataFrame
        A row per robot and node.

    Examples
    --------
    >>> bool(reach("wall:columns=2,courses=2")["reached"].all())
    True
    """
    with _asked(_reach.Reach, locals()) as asked:
        return _table(_reach.run(asked), "reach")


@_documented(_replan.Replan)
def replan(
    plan: Built = "arch25",
    at: int = 1,
    *,
    lost: Words = (),
    payload: float | Words = (),
    grips: float | str | None = None,
    robots: int | None = None,
    missing: Sequence[int] | int = (),
    measured: Path | str | None = None,
    to: int | str | None = None,
    rules: Rules | None = None,
    durations: Words = (),
    aim: Words | None = None,
    criterion: Criterion | str | None = None,
    limits: Limits = (),
    stands: Stands | None = None,
    engine: str | None = None,
    time_limit: float | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> Plan:
    """Plan the rest of a build after something has changed, as ``seqopt replan`` does.

    Returns
    -------
    Plan

    Examples
    --------
    >>> import seqopt
    >>> plan = seqopt.optimize("wall:columns=2,courses=2", "free")
    >>> replan(plan, at=2, lost=["rob3"], rules="least_grips=1").steps[0].number
    3
    """
    with _asked(_replan.Replan, locals()) as asked:
        found = _replan.find(asked)
        if asked.out is not None:
            _replan.answered(asked, found)
        return found.new.plan


@_documented(_instance.Instance)
def instance(
    scene: Built = "arch25",
    *,
    schedule: Path | str | None = None,
    criterion: Criterion | str | None = None,
    formulation: str | None = None,
    aim: Words | None = None,
    limits: Limits = (),
    budgets: Words = (),
    stands: Stands | None = None,
    rules: Rules | None = None,
    robots: int | Words | None = None,
    order: Words | None = None,
    candidates: str | None = None,
    durations: Words = (),
    engine: str | None = None,
    name: str | None = None,
    below: float | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> Instance:
    """Return the graph of a problem, for any solver, as ``seqopt instance`` writes it.

    Returns
    -------
    Instance

    Examples
    --------
    >>> instance("wall:columns=2,courses=2", schedule="free", aim="minmax").name
    'wall 2 x 2'
    """
    with _asked(_instance.Instance, locals()) as asked:
        found = _instance.find(asked)
        if asked.out is not None:
            _instance.write(asked, found, asked.out)
        return found


@_documented(_export.Export)
def export(
    folder: Built,
    format: str = "csv",  # noqa: A002  # as of the command
    *,
    source: Path | str | None = None,
    distance: float | None = None,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> str:
    """Return a plan in a format of others, as ``seqopt export`` writes it.

    Returns
    -------
    str

    Examples
    --------
    >>> len(export("wall:columns=2,courses=2").splitlines())
    8
    """
    with _asked(_export.Export, locals()) as asked:
        answer = _export.run(asked)
        return answer.data if asked.out is None else asked.out.read_text(encoding="utf-8")


@_documented(_report.Report)
def report(
    folder: Built,
    *,
    engine: str | None = None,
    mortar: Mortar | str | None = None,
    stability: bool = True,
    film: Path | str | None = None,
    figures: Path | str | None = None,
    cache: Path | str | None = None,
    out: Path | str | None = None,
    progress: Tell | None = None,
) -> tuple[Path, ...]:
    """Write a page that shows plans step by step, as ``seqopt report`` does.

    Returns
    -------
    tuple of pathlib.Path
        What was written.

    Examples
    --------
    >>> report("wall:columns=2,courses=2", out="wall.html")  # doctest: +SKIP
    (PosixPath('wall.html'),)
    """
    with _asked(_report.Report, locals()) as asked:
        return _report.run(asked).written


def _table(answer: Answer, name: str, **more: object) -> pd.DataFrame:
    """Return a table of an answer, with its notes."""
    found: Any = answer.facts[name]
    table = found if isinstance(found, pd.DataFrame) else pd.DataFrame(found)
    table.attrs |= {"notes": [*answer.notes], **more}
    return table


@contextmanager
def _asked(kind: type[_Asked], parameters: Mapping[str, Any]) -> Iterator[_Asked]:
    """Yield what a command is asked by the parameters of a function, while progress is shown."""
    words = {COMMAND_LINE.get(name, name): value for name, value in parameters.items()}
    progress, stability = words.pop("progress"), words.pop("stability", True)
    with Watcher(shows=progress is None) as shown:
        yield given(kind, words, no_stability=not stability, tell=progress or shown)
