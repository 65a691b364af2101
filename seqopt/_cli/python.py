"""The commands in Python: the same words, the same defaults, and values in place of text."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from seqopt._cli.arguments import parser
from seqopt._cli.commands import assess as _assess
from seqopt._cli.commands import compare as _compare
from seqopt._cli.commands import pareto as _pareto
from seqopt._cli.commands import replan as _replan
from seqopt._cli.values import RULES
from seqopt._cli.watcher import Watcher
from seqopt.errors import ProblemError, did_you_mean
from seqopt.plan.build import ShownBuild
from seqopt.plan.front import Front
from seqopt.plan.plan import Plan
from seqopt.report.comparison import Comparison
from seqopt.scene.scene import Scene
from seqopt.work.progress import Tell

Built = Scene | str | Path
ALIASES = {"criterion": "criteria", "limits": "limit", "budgets": "budget"}  # of `optimize`
NO_WORDS = ("help", "help_all", "json", "quiet", "strict", "pick", "under")  # of what is printed


def compare(scene: Built = "arch25", *, progress: Tell | None = None, **words: Any) -> Comparison:
    """Build a scene in every way that seqopt knows, side by side, as ``seqopt compare`` does.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        The scene, its name or words, its file, or a plan's folder.
    progress : callable, optional
        Told how far it is; by default that is shown in a notebook and at a terminal.
    **words
        Options of the command, as ``criteria="worst-ratio"``, ``robots=2``, ``speed=20`` or
        ``out="folder"``.

    Returns
    -------
    Comparison

    Raises
    ------
    SeqoptError
        With one line that says what to change.

    Examples
    --------
    >>> found = compare("wall:columns=2,courses=2", criteria="worst-ratio", no_stability=True)
    >>> float(found.table.loc["sequential", "F_rob"].round(1))
    37.3
    """
    with _Asked("compare", {"scene": scene, **words}, progress) as options:
        found = _compare.find(options)
        if options.out is not None:
            _compare.answered(options, *found)
        return found[-1]


def pareto(scene: Built = "arch25", *, progress: Tell | None = None, **words: Any) -> Front:
    """Find all plans that no other one beats in every aim, as ``seqopt pareto`` does.

    Parameters
    ----------
    scene : Scene, str or pathlib.Path
        The scene, its name or words, its file, or a plan's folder.
    progress : callable, optional
        Told how far it is; by default that is shown in a notebook and at a terminal.
    **words
        Options of the command, as ``aim="D_max,steps"``, ``limits=["payload"]``, ``seconds=60`` or
        ``out="folder"``.

    Returns
    -------
    Front

    Raises
    ------
    SeqoptError
        With one line that says what to change.

    Examples
    --------
    >>> pareto("wall:columns=2,courses=2", aim="F_largest,steps")
    <Front: 1 plans, complete; F_largest, steps, regrips>
    """
    with _Asked("pareto", {"scene": scene, **words}, progress) as options:
        problem, front = _pareto.find(options)
        if options.out is not None:
            _pareto.answered(options, problem, front)
        return front


def assess(
    scene: Built | ShownBuild = "arch25", *, progress: Tell | None = None, **words: Any
) -> pd.DataFrame:
    """Prove of every step that it stands, or that it does not, as ``seqopt assess`` does.

    Parameters
    ----------
    scene : Scene, str, pathlib.Path or Plan
        A plan or its folder; or a scene with ``method`` or ``plan``, a fixed method by default.
    progress : callable, optional
        Told how far it is; by default that is shown in a notebook and at a terminal.
    **words
        Options of the command, as ``mortar="dry"``, ``margins="bond,tilt"``, ``map="friction"``.

    Returns
    -------
    pandas.DataFrame
        A row per mortar and step: dry, then with epoxy, if no ``mortar`` is named; with ``map`` a
        row per build, mortar and value. ``attrs["notes"]`` says what verdicts leave out.

    Raises
    ------
    SeqoptError
        With one line that says what to change.

    Examples
    --------
    >>> assess("wall:columns=2,courses=2", mortar="dry")["verdict"].value_counts().to_dict()
    {'stands': 7}
    """
    with _Asked("assess", {"scene": scene, **words}, progress) as options:
        answer = _assess.run(options)
        found = answer.facts["steps" if options.map is None else "cases"]
        assert isinstance(found, pd.DataFrame | list)
        table = found if isinstance(found, pd.DataFrame) else pd.DataFrame(found)
        table.attrs["notes"] = [*answer.notes]
        return table


def replan(
    plan: Plan | Built = "arch25", at: int = 1, *, progress: Tell | None = None, **words: Any
) -> Plan:
    """Plan the rest of a build after something has changed, as ``seqopt replan`` does.

    Parameters
    ----------
    plan : Plan, Scene, str or pathlib.Path
        The plan or its folder; of a scene the best free schedule is planned first.
    at : int
        Number of the last step that was done.
    progress : callable, optional
        Told how far it is; by default that is shown in a notebook and at a terminal.
    **words
        Options of the command, as ``lost=["rob3"]``, ``payload=250``, ``missing=[9]``.

    Returns
    -------
    Plan

    Raises
    ------
    SeqoptError
        With one line that says what to change.

    Examples
    --------
    >>> import seqopt
    >>> plan = seqopt.optimize("wall:columns=2,courses=2", "free")
    >>> replan(plan, at=2, lost=["rob3"], least_grips=1).steps[0].number
    3
    """
    with _Asked("replan", {"plan": plan, "at": at, **words}, progress) as options:
        base, found = _replan.find(options)
        if options.out is not None:
            _replan.answered(options, base, found)
        return found.plan


class _Asked:
    """Options of a command from words of Python, while it is shown how far it is."""

    def __init__(self, command: str, words: Mapping[str, Any], progress: Tell | None) -> None:
        self._options = _options(command, words)
        self._progress, self._watcher = progress, Watcher(shows=progress is None)

    def __enter__(self) -> argparse.Namespace:
        shown = self._watcher.__enter__()
        self._options.tell = self._progress or shown
        return self._options

    def __exit__(self, *error: object) -> None:
        self._watcher.__exit__(*error)


def _options(command: str, words: Mapping[str, Any]) -> argparse.Namespace:
    """Return the options of a command, those that words do not name as on the command line."""
    whole = parser(command)
    options = whole.parse_args([command, *["."] * (command == "replan")])
    known = {name: kind for name, kind in _actions(whole, command).items() if name not in NO_WORDS}
    rules = []
    for word, value in words.items():
        name = ALIASES.get(word, word)
        if name in known:
            setattr(options, name, _value(known[name], value))
        elif name in RULES and "rule" in known:
            rules.append(f"{name}={','.join(value) if isinstance(value, list | tuple) else value}")
        else:
            hint = did_you_mean(word, known)
            raise ProblemError(f"{command} has no {word!r}{hint}; give {', '.join(sorted(known))}")
    if rules:
        options.rule = [*options.rule, *rules]
    return options


def _actions(whole: argparse.ArgumentParser, command: str) -> dict[str, argparse.Action]:
    """Return what a command takes, by name."""
    (commands,) = (a for a in whole._actions if isinstance(a, argparse._SubParsersAction))
    return {action.dest: action for action in commands.choices[command]._actions}


def _value(action: argparse.Action, value: Any) -> Any:
    """Return the value of an option as the command line would read it; values stay values."""
    if value is None or isinstance(value, Scene | ShownBuild) or action.nargs == 0:
        return value
    if isinstance(action, argparse._AppendAction):
        several = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
        return [_text(each) for each in several]
    text = _text(value)
    if action.choices is not None and text not in action.choices:
        known = [*map(str, action.choices)]
        hint = did_you_mean(text, known)
        raise ProblemError(f"{action.dest} {text!r} does not exist{hint}; give {', '.join(known)}")
    return action.type(text) if callable(action.type) else text


def _text(value: Any) -> Any:
    """Return what words say of a value; what is none of numbers, paths or lists stays."""
    if isinstance(value, int | float | os.PathLike):
        return os.fspath(value) if isinstance(value, os.PathLike) else f"{value!r}"
    if isinstance(value, list | tuple | range):
        return ",".join(str(_text(each)) for each in value)
    return value
