"""Criteria: what a step costs, from the responses of all choices that compete in it.

Every criterion turns responses over choices, ``(C,)`` for one open move or ``(C, D)`` for two, into
costs of the same shape. A name stands for a response: ``T_max``, ``M_sup``, ``D_max``, ``C_max``
(the largest compression), ``F_move`` (the robot that takes its grip), ``F_largest`` (the largest
grip force), ``F_`` and a robot's name (its force), ``F_each`` (the forces of all robots, a term
each).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from seqopt.arrays import Floats
from seqopt.placement.ranks import scaled_ranks
from seqopt.placement.requirements import ChoiceResponses

Term = tuple[Any, ...]  # a name and its numbers
RESOLUTION = (("F", 1.0), ("T", 1.0), ("C", 1.0), ("M", 1.0), ("D", 1e-6))  # N, N, N, N m, m


@dataclass(frozen=True)
class RankSum:
    """The criteria of Bruun et al.: ranks of responses, averaged, least is best (a Borda count).

    Ranks start at 1; ties share the mean of their ranks. Responses are rounded to a resolution
    before they are ranked, so that differences without meaning decide nothing. In a step with two
    open moves the ranks run over all pairs and are scaled down to as many as the later move has
    candidates, so that it weighs as much as any other step. A robot that does not grip ranks all
    choices equal. Source: equations (1) to (3) of Bruun et al.

    Parameters
    ----------
    name : str
        What the criterion is called.
    before, after : tuple of (str, float)
        Weight of every response in moves before the crown and from it on.
    crown : int, optional
        Brick count of a move from which ``after`` holds; by default it never does.
    resolution : tuple of (str, float)
        What a response is rounded to, by its first letter: N, N m, m.
    """

    name: str
    before: tuple[tuple[str, float], ...]
    after: tuple[tuple[str, float], ...]
    crown: int | None = None
    resolution: tuple[tuple[str, float], ...] = RESOLUTION

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs of a move.

        Parameters
        ----------
        bricks : int
            Bricks placed when the move is made; decides between ``before`` and ``after``.

        Returns
        -------
        tuple of str
            Names of responses.
        """
        return tuple(name for name, _ in self._terms(bricks))

    def for_robots(self, robots: Sequence[str]) -> RankSum:
        """Return the criterion with ``F_each`` spelled out for the robots of a scene.

        Parameters
        ----------
        robots : sequence of str
            Their names.

        Returns
        -------
        RankSum
        """
        return replace(self, before=_each(self.before, robots), after=_each(self.after, robots))

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the weighted mean of the ranks.

        Parameters
        ----------
        responses : mapping of str to (C,) or (C, D) float
            As in `Criterion.costs`.
        bricks : int
            Bricks placed at the move that decides the step.
        choices : int
            How many candidates that move has; ranks run from 1 to it.

        Returns
        -------
        (C,) or (C, D) float
            NaN where a choice is impossible.
        """
        terms = self._terms(bricks)
        total: Floats = np.zeros_like(responses[terms[0][0]])
        steps = dict(self.resolution)
        for name, weight in terms:
            total = total + weight * scaled_ranks(responses[name] / steps[name[0]], choices)
        return total / sum(weight for _, weight in terms)

    def _terms(self, bricks: int) -> tuple[tuple[str, float], ...]:
        return self.before if self.crown is None or bricks < self.crown else self.after


@dataclass(frozen=True)
class WeightedSum:
    """A weighted sum of responses, each divided by a scale of its own.

    Parameters
    ----------
    name : str
        What the criterion is called.
    terms : tuple of (str, float, float)
        Response, weight, scale (N, N m or m).
    """

    name: str
    terms: tuple[tuple[str, float, float], ...]

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs.

        Parameters
        ----------
        bricks : int
            Without effect: it needs the same for every move.

        Returns
        -------
        tuple of str
            Names of responses.
        """
        return tuple(name for name, _, _ in self.terms)

    def for_robots(self, robots: Sequence[str]) -> WeightedSum:
        """Return the criterion with ``F_each`` spelled out for the robots of a scene.

        Parameters
        ----------
        robots : sequence of str
            Their names.

        Returns
        -------
        WeightedSum
        """
        return replace(self, terms=_each(self.terms, robots))

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the weighted sums.

        Parameters
        ----------
        responses : mapping of str to (C,) or (C, D) float
            As in `Criterion.costs`.
        bricks, choices : int
            Without effect.

        Returns
        -------
        (C,) or (C, D) float
            NaN where a choice is impossible.
        """
        parts = [w / scale * _present(responses[name]) for name, w, scale in self.terms]
        return np.asarray(sum(parts))


@dataclass(frozen=True)
class WorstRatio:
    """The largest ratio of a response to its limit: a step is as bad as its worst response.

    Parameters
    ----------
    name : str
        What the criterion is called.
    limits : tuple of (str, float)
        Response and limit (N, N m or m).
    """

    name: str
    limits: tuple[tuple[str, float], ...]

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs.

        Parameters
        ----------
        bricks : int
            Without effect: it needs the same for every move.

        Returns
        -------
        tuple of str
            Names of responses.
        """
        return tuple(name for name, _ in self.limits)

    def for_robots(self, robots: Sequence[str]) -> WorstRatio:
        """Return the criterion with ``F_each`` spelled out for the robots of a scene.

        Parameters
        ----------
        robots : sequence of str
            Their names.

        Returns
        -------
        WorstRatio
        """
        return replace(self, limits=_each(self.limits, robots))

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the largest ratios.

        Parameters
        ----------
        responses : mapping of str to (C,) or (C, D) float
            As in `Criterion.costs`.
        bricks, choices : int
            Without effect.

        Returns
        -------
        (C,) or (C, D) float
            1 where a response is at its limit; NaN where a choice is impossible.
        """
        parts = [_present(responses[name]) / limit for name, limit in self.limits]
        return np.asarray(np.max(np.stack(parts), axis=0))


def _present(values: Floats) -> Floats:
    """Return the values, or zeros where the robot does not grip in any choice."""
    return np.zeros_like(values) if np.isnan(values).all() else values


def _each(terms: tuple[Term, ...], robots: Sequence[str]) -> tuple[Term, ...]:
    """Return terms in which ``F_each`` stands once for every robot."""
    out: list[Term] = []
    for term in terms:
        names = [f"F_{robot}" for robot in robots] if term[0] == "F_each" else [term[0]]
        out += [(name, *term[1:]) for name in names]
    return tuple(out)


def equal(*names: str) -> tuple[tuple[str, float], ...]:
    """Return equally weighted terms of a `RankSum`.

    Parameters
    ----------
    *names : str
        Responses.

    Returns
    -------
    tuple of (str, float)
        Each with weight 1.
    """
    return tuple((name, 1.0) for name in names)
