"""The exceptions of seqopt: one small tree that says who must act."""

from __future__ import annotations


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
