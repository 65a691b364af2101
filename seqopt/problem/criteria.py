"""Criteria: what a step costs, from the responses of all choices that compete in it.

Every criterion turns responses over choices, ``(C,)`` for one open move or ``(C, D)`` for two, into
costs of the same shape. A name stands for a response: ``T_max``, ``M_sup``, ``D_max``, ``C_max``
(the largest compression), ``F_move`` (the robot that takes its grip), ``F_largest`` (the largest
grip force), ``F_`` and a robot's name (its force; in brackets where that means something else, as
``F_[sup]``), ``F_each`` (the forces of all robots, a term each).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from seqopt.arrays import Floats, Terse
from seqopt.errors import ProblemError, message_of
from seqopt.problem.requirements import NEVER, ROUNDED, ChoiceResponses, SceneFacts
from seqopt.responses.quantities import robot_response
from seqopt.scene._checks import short


class Ranked(Enum):
    """What the choices of a step that two moves share are ranked among."""

    PAIRS = "pairs"  # all pairs of the two moves
    CONDITIONAL = "conditional"  # the later move's candidates, the earlier choice being made


class Among(Enum):
    """Which candidates of a move are ranked in the steps in which it alone is open."""

    ALL = "all"
    POSSIBLE = "possible"  # without those that the choice before it makes impossible


def _ranks_of(values: Floats, choices: int, ranked: Ranked) -> Floats:
    """Return mean ranks of the choices in a step.

    ``values`` ((C,) or (C, D) float): as in `_scaled_ranks`; ``choices``: how many candidates the
    move has that decides the step; ``ranked``: what pairs are ranked among. Result ((C,) or (C, D)
    float).
    """
    if values.ndim == 2 and ranked is Ranked.CONDITIONAL:
        return _row_ranks(values, choices)
    return _scaled_ranks(values, choices)


def _row_ranks(values: Floats, choices: int) -> Floats:
    """Return mean ranks, from 1, of values rounded to whole numbers, every row for itself.

    ``values`` (C, D): in units of their resolution; NaN where a choice is impossible; ``choices``:
    all ranks are the mean of 1 and this where all values are NaN. Result (C, D): as `_scaled_ranks`
    of each row; NaN stays NaN where any value is known.
    """
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.shape, 0.5 * (choices + 1))
    rounded = np.where(known, np.round(values), np.inf)  # what is impossible comes last
    order = np.argsort(rounded, axis=1, kind="stable")
    ordered = np.take_along_axis(rounded, order, axis=1)
    place = np.arange(values.shape[1])
    new = np.ones(values.shape, dtype=bool)
    new[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    last = np.ones(values.shape, dtype=bool)
    last[:, :-1] = new[:, 1:]
    first_of = np.maximum.accumulate(np.where(new, place, 0), axis=1)
    last_of = np.minimum.accumulate(np.where(last, place, len(place))[:, ::-1], axis=1)[:, ::-1]
    ranks = np.empty(values.shape)
    np.put_along_axis(ranks, order, 0.5 * (first_of + last_of) + 1.0, axis=1)
    return np.where(known, ranks, np.nan)


def _scaled_ranks(values: Floats, choices: int) -> Floats:
    """Return mean ranks of values rounded to whole numbers.

    ``values`` ((C,) or (C, D) float): in units of their resolution; NaN where a choice is
    impossible; ``choices``: ranks over pairs are scaled so that they run from 1 to this. Result
    ((C,) or (C, D) float): NaN stays NaN, except that all ranks are equal where all values are NaN.
    """
    flat = values.ravel()
    known = np.isfinite(flat)
    out = np.full(flat.shape, np.nan)
    if not known.any():
        return np.full(values.shape, 0.5 * (choices + 1))
    ranks = _mean_ranks(np.round(flat[known]))
    out[known] = ranks if values.ndim == 1 else (ranks - 0.5) * choices / known.sum() + 0.5
    return out.reshape(values.shape)


def _mean_ranks(values: Floats) -> Floats:
    """Return ranks from 1; ties share the mean of theirs.

    As `scipy.stats.rankdata`, in a fifth of its time for the few values of a step.

    ``values`` (n,). Result (n,).
    """
    order = np.argsort(values)
    ordered = values[order]
    new = np.flatnonzero(ordered[1:] != ordered[:-1]) + 1
    ends = np.concatenate([[0], new, [len(values)]])
    ranks = np.empty(len(values))
    ranks[order] = np.repeat(0.5 * (ends[1:] + ends[:-1] + 1), np.diff(ends))
    return ranks


Term = tuple[Any, ...]  # a name and its numbers
Number = TypeVar("Number")


def _scale_of(facts: SceneFacts, response: str, given: float | None) -> float:
    """Return the scale of a response: that which is given, or the scene's.

    Result: SI units. Raises `ProblemError` if none is given and the scene's methods give none.
    """
    if given is not None:
        return given
    scales = facts.reference
    if response not in scales:
        raise ProblemError(f"{response} has no scale of its own; give one, or take F_largest")
    return scales[response] or 1.0  # what every method keeps at zero


def named(name: str, facts: SceneFacts, given: Sequence[float | None]) -> str:
    """Return the name of a criterion, which says where its scales are not those of fixed methods.

    ``given``: its scales before it was posed, None where it takes them from the scene.
    """
    return name + facts.basis if None in given else name


def known(number: Number | None, criterion: str) -> Number:
    """Return a number that must not be open any more.

    ``criterion``: whose number it is. Result: the number. Raises `ProblemError` if it is None: the
    criterion was not posed for a scene.
    """
    if number is None:
        raise ProblemError(f"criterion {criterion}: it is not posed for a scene; use seqopt.pose")
    return number


def present(values: Floats) -> Floats:
    """Return the values, or zeros where the robot does not grip in any choice.

    ``values`` ((C,) or (C, D) float). Result ((C,) or (C, D) float).
    """
    return np.zeros_like(values) if np.isnan(values).all() else values


def _spell_out(terms: tuple[Term, ...], robots: Sequence[str]) -> tuple[Term, ...]:
    """Return terms in which ``F_each`` stands once for every robot; all numbers are positive.

    ``robots``: their names. Raises `ProblemError` if there is no term, or a number of one is not
    positive and finite.
    """
    if not terms:
        raise ProblemError("a criterion of no response; name at least one, as T_max")
    out: list[Term] = []
    for term in terms:
        for number in term[1:]:
            if number is not None and not (isinstance(number, Real) and 0 < float(number) < np.inf):
                raise ProblemError(
                    f"criterion: {term[0]} has the weight, scale or rounding "
                    f"{short(number)}; give a positive number"
                )
        names = [robot_response(robot) for robot in robots] if term[0] == "F_each" else [term[0]]
        out += [(name, *term[1:]) for name in names]
    return tuple(out)


def equal(*names: str) -> tuple[tuple[str, float], ...]:
    """Return equally weighted terms of a `RankSum`.

    ``*names``: responses. Result (tuple of (str, float)): each with weight 1.
    """
    return tuple((name, 1.0) for name in names)


@dataclass(frozen=True, repr=False)
class RankSum(Terse):
    """The criteria of Bruun et al.: ranks of responses, averaged, least is best (a Borda count).

    Ranks start at 1; ties share the mean of their ranks. Responses are rounded to a resolution
    before they are ranked, so that differences without meaning decide nothing. A robot that does
    not grip ranks all choices equal. Source: equations (1) to (3) of Bruun et al.

    ``name``: what the criterion is called; ``before``, ``after`` (tuple of (str, float)): weight of
    every response in moves before the crown and from it on; ``crown``: brick count of a move from
    which ``after`` holds, `NEVER` if it does not; by default that at which the scene's build
    reaches its crown; ``delay``: how many bricks after the scene's crown ``after`` begins to hold;
    ``resolution`` (tuple of (str, float)): what a response is rounded to, by its first letter: N, N
    m, m. By default `ROUNDED` in the scene's own units, so that density, length, stiffness and
    units of force change no choice. ``ranked``: in a step with two open moves ranks run over all
    pairs, scaled down to as many as the later move has candidates, or over its candidates given the
    choice before; ``among``: whether a node that the choice before makes impossible is ranked in
    later steps.
    """

    name: str
    before: tuple[tuple[str, float], ...]
    after: tuple[tuple[str, float], ...]
    crown: float | None = None
    delay: int = 0
    resolution: tuple[tuple[str, float], ...] | None = None
    ranked: Ranked = Ranked.PAIRS
    among: Among = Among.ALL

    @property
    def settings(self) -> Mapping[str, object]:
        """Its weights and crown, None if it has none, what it rounds to and what it ranks among."""
        crown = None if self.crown == NEVER else self.crown
        weights = {"before_crown": dict(self.before), "from_crown_on": dict(self.after)}
        ranks = {"ranked": self.ranked.value, "among": self.among.value}
        rounding = {"resolution": dict(self.resolution or ())}
        return {"weights": weights, "crown": crown, **rounding, **ranks}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs of a move.

        ``bricks``: bricks placed when the move is made; decides between ``before`` and ``after``.
        Result: names of responses.
        """
        return tuple(name for name, _ in self._terms(bricks))

    def for_scene(self, facts: SceneFacts) -> RankSum:
        """Return the criterion with everything that it takes from a scene filled in.

        ``facts``: of the scene.
        """
        crown = self.crown
        if self.before == self.after:
            crown = NEVER
        elif crown is None:
            crown = facts.crown + self.delay
        resolution = self.resolution
        if resolution is None:
            resolution = tuple((name, share * facts.units.of(name)) for name, share in ROUNDED)
        return replace(
            self,
            before=_spell_out(self.before, facts.robots),
            after=_spell_out(self.after, facts.robots),
            crown=crown,
            delay=0,
            resolution=_spell_out(resolution, ()),
        )

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the weighted mean of the ranks.

        ``responses`` (mapping of str to (C,) or (C, D) float): as in `Criterion.costs`; ``bricks``:
        bricks placed at the move that decides the step; ``choices``: how many candidates that move
        has; ranks run from 1 to it. Result ((C,) or (C, D) float): NaN where a choice is
        impossible.
        """
        terms = self._terms(bricks)
        total: Floats = np.zeros_like(responses[terms[0][0]])
        rounding = dict(known(self.resolution, self.name))
        for name, weight in terms:
            units = responses[name] / rounding[name[0]]
            total = total + weight * _ranks_of(units, choices, self.ranked)
        return total / sum(weight for _, weight in terms)

    def _terms(self, bricks: int) -> tuple[tuple[str, float], ...]:
        return self.before if bricks < known(self.crown, self.name) else self.after


@dataclass(frozen=True, repr=False)
class WeightedSum(Terse):
    """A weighted sum of responses, each divided by a scale of its own.

    ``name``: what the criterion is called; ``terms`` (tuple of (str, float, float or None)):
    response, weight, scale (N, N m or m). By default (None) the scale is the least that any fixed
    method of the scene reaches of the response's largest value.
    """

    name: str
    terms: tuple[tuple[str, float, float | None], ...]

    @property
    def settings(self) -> Mapping[str, object]:
        """What responses are divided by, SI units, and their weights."""
        weights = {name: weight for name, weight, _ in self.terms}
        return {"scales": {name: scale for name, _, scale in self.terms}, "weights": weights}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs.

        ``bricks``: without effect: it needs the same for every move. Result: names of responses.
        """
        return tuple(name for name, _, _ in self.terms)

    def for_scene(self, facts: SceneFacts) -> WeightedSum:
        """Return the criterion with everything that it takes from a scene filled in.

        ``facts``: of the scene.
        """
        terms = _spell_out(self.terms, facts.robots)
        scaled = tuple(
            (name, weight, _scale_of(facts, name, scale)) for name, weight, scale in terms
        )
        name = named(self.name, facts, [scale for _, _, scale in terms])
        return replace(self, name=name, terms=scaled)

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the weighted sums.

        ``responses`` (mapping of str to (C,) or (C, D) float): as in `Criterion.costs`; ``bricks``,
        ``choices``: without effect. Result ((C,) or (C, D) float): NaN where a choice is
        impossible.
        """
        parts = [
            weight / known(scale, self.name) * present(responses[name])
            for name, weight, scale in self.terms
        ]
        return np.asarray(sum(parts))


@dataclass(frozen=True, repr=False)
class WorstRatio(Terse):
    """The largest ratio of a response to its limit: a step is as bad as its worst response.

    ``name``: what the criterion is called; ``limits`` (tuple of (str, float or None)): response and
    limit (N, N m or m). By default (None) the limit is the least that any fixed method of the scene
    reaches of the response's largest value.
    """

    name: str
    limits: tuple[tuple[str, float | None], ...]

    @property
    def settings(self) -> Mapping[str, object]:
        """What responses are divided by, SI units."""
        return {"scales": dict(self.limits)}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs.

        ``bricks``: without effect: it needs the same for every move. Result: names of responses.
        """
        return tuple(name for name, _ in self.limits)

    def for_scene(self, facts: SceneFacts) -> WorstRatio:
        """Return the criterion with everything that it takes from a scene filled in.

        ``facts``: of the scene.
        """
        limits = _spell_out(self.limits, facts.robots)
        name = named(self.name, facts, [scale for _, scale in limits])
        scaled = tuple((response, _scale_of(facts, response, s)) for response, s in limits)
        return replace(self, name=name, limits=scaled)

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the largest ratios.

        ``responses`` (mapping of str to (C,) or (C, D) float): as in `Criterion.costs`; ``bricks``,
        ``choices``: without effect. Result ((C,) or (C, D) float): 1 where a response is at its
        limit; NaN where a choice is impossible.
        """
        parts = [present(responses[name]) / known(limit, self.name) for name, limit in self.limits]
        return np.asarray(np.max(np.stack(parts), axis=0))


SCALED = ("F_largest", "M_sup", "T_max", "D_max")
OVER_METHODS = WeightedSum("weighted", tuple((name, 1.0, None) for name in SCALED))
"""The sum of responses over what the scene's fixed methods reach."""
WORST_OVER_METHODS = WorstRatio("worst-ratio", tuple((name, None) for name in SCALED))
"""The largest of these ratios."""


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
        terms = _spell_out(tuple((name,) for name in self.responses), facts.robots)
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
            raise ProblemError(
                f"criterion {self.name}: its function failed: {message_of(error)}"
            ) from (error)
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
