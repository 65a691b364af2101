"""A criterion of your own: any function of the responses as the cost of a step."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from numbers import Real

import numpy as np

from seqopt.arrays import Floats
from seqopt.errors import ProblemError, said
from seqopt.problem.criteria import present, spell_out
from seqopt.problem.requirements import ChoiceResponses
from seqopt.problem.scales import SceneFacts
from seqopt.scene.checks import short

StepFunction = Callable[[Mapping[str, Floats], int], Floats]
"""Takes responses by name, (C,) or (C, D) in SI units, and the brick count; returns their costs."""


@dataclass(frozen=True)
class StepCost:
    """What a step costs is a function of its responses.

    The function is called once for every open step, with the responses of all choices at once, so
    it is written with NumPy. A robot that does not grip has force zero. What it returns for choices
    that are impossible is passed over.

    Parameters
    ----------
    name : str
        What the criterion is called.
    responses : tuple of str
        Those that the function takes, as `seqopt.problem.criteria` names them; ``F_each`` stands
        for the forces of all robots, one by one.
    function : callable
        Of responses by name, each (C,) or (C, D), N, N m or m, and of the bricks placed when the
        move is made; returns costs of the same shape, finite or, for what is not allowed, infinite.
    least : float, optional
        What a step costs at least, from zero: a lazy search needs it to rule pairs out.

    Raises
    ------
    ProblemError
        If it names no responses, or the function is none.

    Examples
    --------
    >>> import seqopt
    >>> def squares(responses, bricks):
    ...     return (responses["F_largest"] / 270) ** 2 + (responses["T_max"] / 87.7) ** 2
    >>> own = StepCost("squares", ("F_largest", "T_max"), squares)
    >>> plan = seqopt.optimize("arch25", criterion=own)
    >>> plan.certificate.gap < 1e-12
    True
    """

    name: str
    responses: tuple[str, ...]
    function: StepFunction
    least: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.responses, str) or not self.responses or not callable(self.function):
            raise ProblemError(
                f"criterion {self.name}: give names of responses, as ('T_max', 'M_sup'), and a "
                "function of them"
            )
        object.__setattr__(self, "responses", tuple(self.responses))
        if not (self.least is None or (isinstance(self.least, Real) and 0 <= self.least < np.inf)):
            raise ProblemError(
                f"criterion {self.name}: least is {short(self.least)}; give a number from 0"
            )

    @property
    def settings(self) -> Mapping[str, object]:
        """The responses it takes, and what its function is called."""
        called = getattr(self.function, "__qualname__", type(self.function).__name__)
        return {"responses": list(self.responses), "function": called}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs.

        ``bricks``: without effect: it needs the same for every move. Result: names of responses.
        """
        return self.responses

    def for_scene(self, facts: SceneFacts) -> StepCost:
        """Return the criterion with ``F_each`` spelled out for the scene's robots.

        ``facts``: of the scene.
        """
        terms = spell_out(tuple((name,) for name in self.responses), facts.robots)
        return replace(self, responses=tuple(name for (name,) in terms))

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return what the function makes of the responses.

        ``responses`` (mapping of str to (C,) or (C, D) float): as in `Criterion.costs`; ``bricks``:
        bricks placed at the move that decides the step; ``choices``: without effect. Result ((C,)
        or (C, D) float): NaN where a choice is impossible. Raises `ProblemError` if the function
        fails, or returns another shape or what is no number.
        """
        given = {name: present(responses[name]) for name in self.responses}
        impossible = np.isnan(np.stack([*given.values()])).any(axis=0)
        try:
            with np.errstate(all="ignore"):
                found = np.array(self.function(given, bricks), dtype=float)
        except Exception as error:  # whatever a function of others may raise
            raise ProblemError(f"criterion {self.name}: its function failed: {said(error)}") from (
                error
            )
        if found.shape != impossible.shape:
            raise ProblemError(
                f"criterion {self.name}: its function returned shape {found.shape} for responses "
                f"of {impossible.shape}; give a cost for every choice"
            )
        wrong = ~impossible & (np.isnan(found) | (found == -np.inf))
        if wrong.any():
            raise ProblemError(
                f"criterion {self.name}: its function returned {found[wrong][0]} for a possible "
                f"choice at {bricks} bricks; give a number, or inf for what is not allowed"
            )
        if self.least is not None and (found[~impossible] < self.least).any():
            raise ProblemError(
                f"criterion {self.name}: its function returned {found[~impossible].min():.6g} at "
                f"{bricks} bricks, below its least, {self.least:.6g}; state a lower one"
            )
        return np.where(impossible, np.nan, found)
