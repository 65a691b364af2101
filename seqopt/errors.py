"""The exceptions of seqopt. Their classes say who can fix the problem."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points


@cache
def _installed(_path: tuple[str, ...], group: str) -> EntryPoints:
    """Those on a path, for which a file of every installed package is read: 5 ms."""
    return entry_points(group=group)


def plugins(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name.

    >>> sorted(plugins("seqopt.limit_analysis"))
    ['lp', 'socp']
    """
    return {entry.name: entry for entry in _installed(tuple(sys.path), group)}


class SeqoptError(Exception):
    """Base of all errors that seqopt raises; the text is one line that says what to change.

    Examples
    --------
    >>> import seqopt
    >>> try:
    ...     seqopt.load_scene("wall:columns=x,courses=4")
    ... except seqopt.SeqoptError as error:
    ...     print(error)
    scene wall:columns=x,courses=4: columns is 'x'; give a whole number, as 12
    """


class FileError(SeqoptError, OSError):
    """A file cannot be read or written; name another one."""


class SceneError(SeqoptError, ValueError):
    """A scene, or a file that describes one, is wrong and must be corrected."""


class StepError(SeqoptError, ValueError):
    """A step of a sequence or plan is impossible in its scene; the plan must be changed."""


class GripError(SeqoptError, ValueError):
    """A grip set given to an engine is malformed."""


class ProblemError(SeqoptError, ValueError):
    """A problem is malformed, or a formulation cannot solve problems of its kind."""


class InfeasibleError(ProblemError):
    """No plan is allowed: a search that left nothing out found none."""


class MechanismError(SeqoptError, ArithmeticError):
    """Bricks, joints and grips leave a motion that nothing resists; the text names a brick.

    Its ``mode`` has the name and (translation, rotation) of every brick, the largest component 1.
    """

    def __init__(self, message: str, mode: tuple[tuple[int, tuple[float, ...]], ...] = ()) -> None:
        super().__init__(message)
        self.mode = mode


class SolverError(SeqoptError, ArithmeticError):
    """A numerical method failed to answer; this says nothing about the structure."""


class NothingFoundError(SolverError):
    """A search that left something out found no plan; there may be one."""


class TimeUpError(SolverError):
    """The time that was given is over before any answer was found; more time may find one."""


class MemoryShortError(SeqoptError, MemoryError):
    """There is not enough memory; the text says how much is needed."""


class WorkerError(SeqoptError, RuntimeError):
    """Worker processes or machines ended without a result several times in a row."""


class ExtraError(SeqoptError, ImportError):
    """A library that only some users need is not installed: the text says how to install it."""


class SceneWarning(UserWarning):
    """Something in a scene is possible but probably a mistake."""


class PluginWarning(UserWarning):
    """A package of others registers something that cannot be used; it is left out."""


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """Return a suggestion for a mistyped word, or an empty string if none or two are near.

    >>> did_you_mean("overlap_pd", ["cascade", "overlap_dp"])
    ' (did you mean overlap_dp?)'
    >>> did_you_mean("t_max", ["T_max"]), did_you_mean("x", ["cascade", "overlap_dp"])
    (' (did you mean T_max?)', '')
    """
    meant = {name.lower(): name for name in known}
    if not isinstance(given, str) or given in meant.values():
        return ""
    word = given.lower()
    near = difflib.get_close_matches(word, meant, 2)
    tied = len({difflib.SequenceMatcher(None, name, word).ratio() for name in near}) < len(near)
    return f" (did you mean {meant[near[0]]}?)" if near and not tied else ""


def message_of(error: BaseException) -> str:
    """Return the message of an error in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
