"""Every command as a function of Python: the same words and defaults, and values in place of text.

A scene is given as such, by its name or words, by its file, or as a plan or the folder of one.
Where a parameter says nothing else, words of the command line stand for its value:
``criterion="worst-ratio"``, ``limits=["payload", "F_largest=300"]``, ``grips=1e6``. With ``out``
the files of the command are written. Progress is shown in a notebook and at a terminal, or passed
to ``progress``. A `SeqoptError` names in one line what to change.

Parameters, types and defaults are the fields of a command's options, and descriptions their help:
both are written once.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import pandas as pd

from seqopt._cli.answer import Answer, Result
from seqopt._cli.commands.analyze import Analyze
from seqopt._cli.commands.assess import Assess
from seqopt._cli.commands.compare import Compare
from seqopt._cli.commands.exporting import Export
from seqopt._cli.commands.instance import Instance as _Instance
from seqopt._cli.commands.pareto import Pareto
from seqopt._cli.commands.reach import Reach
from seqopt._cli.commands.replan import Replan
from seqopt._cli.commands.report import Report
from seqopt._cli.commands.times import Times
from seqopt._cli.options import Asked
from seqopt._cli.signatures import Signature, signature_of
from seqopt._cli.watcher import Watcher
from seqopt._registry import COMMANDS, Command
from seqopt.graph.instance import Instance
from seqopt.instances.answers import judge_instance as judge
from seqopt.plan.front import Front
from seqopt.plan.plan import Plan
from seqopt.report.comparison import Comparison
from seqopt.sweep import sweep
from seqopt.workflow import optimize

__all__ = [
    "Answer",
    "Command",
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
    "sweep",
    "times",
]

FLAG = re.compile(r"--([a-z][a-z-]*)")
OTHERWISE = {
    "stability": "Whether it is proven which steps stand.",
    "progress": "Called with the progress; by default a notebook or a terminal shows it.",
}  # what a parameter is that the command line has in another way
_P = ParamSpec("_P")
_T = TypeVar("_T")


def _function(
    asked: Callable[_P, Asked],
    returns: type[_T],
    about: str,
    example: str = "",
    beside: Sequence[str] = (),
) -> Callable[_P, _T]:
    """Return a command as a Python function; ``asked``: the class of its options.

    ``about``: description of its result; ``beside``: options that it takes, but does not show,
    beside those for which Python has values.
    """
    name = asked.__name__.lower()
    command = signature_of(COMMANDS[name].load())
    places = {each: number for number, each in enumerate([*command.options, "progress"])}
    known = [each for each in inspect.signature(asked).parameters.values() if each.name in places]
    known.sort(key=lambda each: (each.kind, places[each.name]))
    hidden = {each.name for each in command.options.values() if each.more.get("shell")} | {*beside}
    taken, shown = inspect.Signature(known), [each for each in known if each.name not in hidden]

    def function(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        values = taken.bind(*args, **kwargs).arguments
        with Watcher(shows=values.get("progress") is None) as watcher:
            result = command.call({"progress": watcher} | values)
            if isinstance(result, Result) and values.get("out") is not None:
                result.answer()
        found: Any = pd.DataFrame(result.value) if isinstance(result.value, list) else result.value
        if isinstance(found, pd.DataFrame):
            found.attrs |= {"notes": [*result.notes], "failures": [*result.failures]}
        value: _T = found
        return value

    function.__name__ = function.__qualname__ = name
    function.__signature__ = inspect.Signature(shown, return_annotation=returns)  # type: ignore[attr-defined]
    function.__doc__ = _docstring(command, shown, returns, about, example)
    return function


def _docstring(
    command: Signature, shown: Sequence[inspect.Parameter], returns: type, about: str, example: str
) -> str:
    """Return the docstring of a command as a function, of its help."""
    lines = [*command.lines[""], "", "Parameters", "----------"]
    for each in shown:
        option = command.options.get(each.name)
        help_text = "" if option is None else option.help.replace(": {choices}", "")
        told = help_text[:1].upper() + help_text[1:].partition("; ")[0]
        told = FLAG.sub(lambda flag: f"``{flag[1].replace('-', '_')}``", told)
        needed = "" if each.default is each.empty else ", optional"
        lines += [f"{each.name} : {each.annotation}{needed}"]
        lines += [f"    {OTHERWISE.get(each.name, told)}"]
    kind = f"{returns.__module__.partition('.')[0]}.{returns.__name__}"
    lines += ["", "Returns", "-------", kind.removeprefix("seqopt.").removeprefix("builtins.")]
    lines += [f"    {about}", "", "Raises", "------", "SeqoptError"]
    lines += ["    With one line that says what to change."]
    lines += ["", "Examples", "--------", inspect.cleandoc(example)] if example else []
    return "\n".join(lines)


compare = _function(
    Compare,
    Comparison,
    "All ways to build it, side by side.",
    """
    >>> found = compare("wall:columns=2,courses=2", criterion="worst-ratio", stability=False)
    >>> float(found.table.loc["sequential", "F_rob"].round(1))
    37.3
    """,
)
pareto = _function(
    Pareto,
    Front,
    "Its points and plans, and whether they are all.",
    """
    >>> pareto("wall:columns=2,courses=2", aim="F_largest,steps")
    <Front: 1 plans, complete; F_largest, steps, regrips>
    """,
)
assess = _function(
    Assess,
    pd.DataFrame,
    "A row per mortar and step: dry, then with epoxy, if no ``mortar`` is named; with ``map`` a\n"
    "    row per build, mortar and value. ``attrs['notes']`` says what verdicts leave out.",
    """
    >>> assess("wall:columns=2,courses=2", mortar="dry")["verdict"].value_counts().to_dict()
    {'stands': 7}
    """,
)
replan = _function(
    Replan,
    Plan,
    "The plan of the rest.",
    """
    >>> import seqopt
    >>> plan = seqopt.optimize("wall:columns=2,courses=2", "free")
    >>> replan(plan, at=2, lost=["rob3"], rules="least_grips=1").steps[0].number
    3
    """,
    beside=("cache", "mortar", "stability", "curing"),
)
analyze = _function(
    Analyze,
    pd.DataFrame,
    "A row per step, units in the names of columns. ``attrs['notes']`` says what is worth\n"
    "    knowing, ``attrs['failures']`` which steps are mechanisms, or were not solved.",
)
times = _function(
    Times, pd.DataFrame, "A row per step, s; ``attrs['robots']`` is how long each robot does what."
)
reach = _function(Reach, pd.DataFrame, "A row per robot and node.")
instance = _function(
    _Instance,
    Instance,
    "The graph of the problem, for any solver.",
    beside=("grips", "props", "payload", "stability", "time_limit", "curing"),
)
export = _function(Export, str, "The text of the file.")
report = _function(Report, tuple[Path, ...], "Paths of what was written.")
