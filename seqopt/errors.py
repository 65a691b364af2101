"""The exceptions of seqopt: one small tree that says who must act."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class SeqoptError(Exception):
    """Base of every error seqopt raises on purpose; its text is one line a user can act on.

    Examples
    --------
    >>> import seqopt
    >>> try:
    ...     seqopt.load_scene("wall:columns=x,courses=4")
    ... except seqopt.SeqoptError as error:
    ...     print(error)
    scene wall:columns=x,courses=4: columns is 'x'; give it as 12
    """


class FileError(SeqoptError, OSError):
    """A file cannot be read or written: the caller must name another."""


class SceneError(SeqoptError, ValueError):
    """A scene, or a file that describes one, is wrong: its author must act."""


class StepError(SeqoptError, ValueError):
    """A step of a sequence or plan is impossible in its scene: the plan's author must act."""


class GripError(SeqoptError, ValueError):
    """A grip set handed to an engine is malformed: the caller must act."""


class ProblemError(SeqoptError, ValueError):
    """A placement problem is malformed, or not of the kind a formulation solves."""


class InfeasibleError(ProblemError):
    """No choice of candidates is allowed."""


class MechanismError(SeqoptError, ArithmeticError):
    """Bricks, joints and grips leave a motion that nothing resists.

    Parameters
    ----------
    message : str
        One line that names the brick which moves most.

    Attributes
    ----------
    mode : tuple of (int, tuple of 6 float)
        The unresisted motion: per brick its name and (translation, rotation), the largest
        component of all scaled to 1.
    """

    def __init__(self, message: str, mode: tuple[tuple[int, tuple[float, ...]], ...] = ()) -> None:
        super().__init__(message)
        self.mode = mode


class SolverError(SeqoptError, ArithmeticError):
    """A numerical method failed to answer; this says nothing about the structure."""


class MemoryShortError(SeqoptError, MemoryError):
    """There is not the memory for what is asked; the text says how much it takes."""


class WorkerError(SeqoptError, RuntimeError):
    """Processes or machines that work was given to end without an answer, again and again."""


class SceneWarning(UserWarning):
    """Something in a scene can be, and probably is not meant."""


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """Return a hint at the word that was probably meant.

    Parameters
    ----------
    given : str
        A word that is none; there is no hint at anything else.
    known : iterable of str
        Those that there are.

    Returns
    -------
    str
        To be put after the word; empty if none is near.

    Examples
    --------
    >>> did_you_mean("overlap_pd", ["cascade", "overlap_dp"])
    ' (did you mean overlap_dp?)'
    >>> did_you_mean("t_max", ["T_max"]), did_you_mean("x", ["cascade", "overlap_dp"])
    (' (did you mean T_max?)', '')
    """
    meant = {name.lower(): name for name in known}
    if not isinstance(given, str) or given in meant.values():
        return ""
    near = difflib.get_close_matches(given.lower(), meant, 1)
    return f" (did you mean {meant[near[0]]}?)" if near else ""
