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
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from seqopt.arrays import Bools, Floats, Ints, Terse
from seqopt.errors import ProblemError, message_of
from seqopt.responses._tolerance import is_tolerance
from seqopt.responses.quantities import robot_response
from seqopt.responses.scales import NEVER, SCALED, SceneFacts
from seqopt.scene._checks import short

if TYPE_CHECKING:
    from seqopt.sequence._space import Candidates

ROUNDED = (
    ("F", 0.0278513762761887),
    ("T", 0.0278513762761887),
    ("C", 0.0278513762761887),
    ("M", 0.11321697673247444),
    ("D", 8.531988813508194),
)
"""What ranks round responses to, by first letter, in the units of `Units`.

About a thirty-sixth of a brick's weight, a ninth of it at a brick's length, and eight times
what a joint gives way under it: 1 N, 1 N m and 1e-6 m on the arch of Bruun et al., whose published
choices speak for such a rounding.
"""


ChoiceResponses = Mapping[str, Floats]


class Criterion(Protocol):
    """What a step costs."""

    @property
    def name(self) -> str:
        """Its name."""

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs of a move.

        Parameters
        ----------
        bricks : int
            Bricks placed when the move is made.

        Returns
        -------
        tuple of str
            Names of responses.
        """

    @property
    def settings(self) -> Mapping[str, object]:
        """The numbers that it uses, for the summary, ready for JSON."""

    def for_scene(self, facts: SceneFacts) -> Criterion:
        """Return the criterion with everything that it takes from a scene filled in.

        Parameters
        ----------
        facts : SceneFacts
            Robots, crown, units and scales of the scene.

        Returns
        -------
        Criterion
            With ``F_each`` spelled out for the robots, and no number left open.
        """

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the costs of all choices in one step.

        Parameters
        ----------
        responses : mapping of str to (C,) or (C, D) float
            SI units; NaN where a choice is impossible, all NaN where a robot does not grip.
        bricks : int
            Bricks that stand in the step; of ranks, at the move that decides it: the later of two.
        choices : int
            How many candidates that move has.

        Returns
        -------
        (C,) or (C, D) float
            NaN where a choice is impossible.
        """


class Ranked(Enum):
    """What the choices of a step that two moves share are ranked among."""

    PAIRS = "pairs"  # all pairs of the two moves
    CONDITIONAL = "conditional"  # the later move's candidates, the earlier choice being made


def _ranks_of(values: Floats, choices: int, ranked: Ranked = Ranked.PAIRS) -> Floats:
    """Return mean ranks of the choices in a step, (C,) or (C, D), rounded to whole numbers.

    Values are in units of their resolution, NaN where a choice is impossible. Ranks over pairs are
    scaled so that they run from 1 to ``choices``; those given the choice before are of every row
    for itself. NaN stays NaN, except that all ranks are equal where all values are NaN.
    """
    known = np.isfinite(values)
    if not known.any():
        return np.full(values.shape, 0.5 * (choices + 1))
    if values.ndim == 1 or ranked is Ranked.CONDITIONAL:  # what is impossible comes last
        return np.where(known, _mean_ranks(np.where(known, np.round(values), np.inf)), np.nan)
    out = np.full(values.shape, np.nan)
    out[known] = (_mean_ranks(np.round(values[known])) - 0.5) * choices / known.sum() + 0.5
    return out


def _mean_ranks(values: Floats) -> Floats:
    """Return ranks from 1 of values (..., n), row by row; ties share the mean of theirs.

    As `scipy.stats.rankdata`, in a fraction of its time for the few values of a step.
    """
    order = np.argsort(values, axis=-1, kind="stable")
    ordered, place = np.take_along_axis(values, order, axis=-1), np.arange(values.shape[-1])
    new = np.ones(values.shape, dtype=bool)
    new[..., 1:] = ordered[..., 1:] != ordered[..., :-1]
    last = np.roll(new, -1, axis=-1)  # the first is always new, so that the last is one
    first_of = np.maximum.accumulate(np.where(new, place, 0), axis=-1)
    back = np.where(last, place, len(place))[..., ::-1]
    last_of = np.minimum.accumulate(back, axis=-1)[..., ::-1]
    ranks = np.empty(values.shape)
    np.put_along_axis(ranks, order, 0.5 * (first_of + last_of) + 1.0, axis=-1)
    return ranks


_Term = tuple[Any, ...]  # a name and its numbers
_Number = TypeVar("_Number")


def _scaled(name: str, terms: tuple[_Term, ...], facts: SceneFacts) -> tuple[str, tuple[Any, ...]]:
    """Return the name and the terms of a criterion, with the scene's scales where one is open.

    The name says where these are not those of fixed methods.
    """
    spelled = _spell_out(terms, facts.robots)
    if all(term[-1] is not None for term in spelled):
        return name, spelled
    out, scales = [], facts.reference
    for response, *weight, scale in spelled:
        if scale is None and response not in scales:
            raise ProblemError(f"{response} has no scale of its own; give one, or take F_largest")
        # what every method keeps at zero has the scale 1
        out.append((response, *weight, scale or scales[response] or 1.0))
    return name + facts.basis, tuple(out)


def _known(number: _Number | None, criterion: str) -> _Number:
    """Return a number of a criterion, which is not open any more once it is posed for a scene."""
    if number is None:
        raise ProblemError(f"criterion {criterion}: it is not posed for a scene; use seqopt.pose")
    return number


def _present(values: Floats) -> Floats:
    """Return the values, or zeros where the robot does not grip in any choice."""
    return np.zeros_like(values) if np.isnan(values).all() else values


def _spell_out(terms: tuple[_Term, ...], robots: Sequence[str]) -> tuple[_Term, ...]:
    """Return terms in which ``F_each`` stands once for every robot; all numbers are positive."""
    if not terms:
        raise ProblemError("a criterion of no response; name at least one, as T_max")
    out: list[_Term] = []
    for name, *numbers in terms:
        for number in (each for each in numbers if each is not None):
            if not (isinstance(number, Real) and 0 < float(number) < np.inf):
                raise ProblemError(
                    f"criterion: {name} has the weight, scale or rounding "
                    f"{short(number)}; give a positive number"
                )
        names = map(robot_response, robots) if name == "F_each" else [name]
        out += [(each, *numbers) for each in names]
    return tuple(out)


def equal(*names: str) -> tuple[tuple[str, float], ...]:
    """Return equally weighted terms of a `RankSum`, by the names of responses."""
    return tuple((name, 1.0) for name in names)


@dataclass(frozen=True, repr=False)
class RankSum(Terse):
    """The criteria of Bruun et al.: ranks of responses, averaged, least is best (a Borda count).

    Ranks start at 1; ties share the mean of their ranks. Responses are rounded to a resolution
    before they are ranked, so that differences without meaning decide nothing: by default `ROUNDED`
    in the scene's own units, so that density, length, stiffness and units of force change no
    choice. A robot that does not grip ranks all choices equal. In a step with two open moves ranks
    run over all pairs, scaled down to as many as the later move has candidates, or over its
    candidates given the choice before. Source: equations (1) to (3) of Bruun et al.
    """

    name: str
    before: tuple[tuple[str, float], ...]  # weights of responses in moves before the crown
    after: tuple[tuple[str, float], ...]  # and from it on
    crown: float | None = None  # from which ``after`` holds, or `NEVER`; by default the scene's
    delay: int = 0  # bricks after the scene's crown until ``after`` holds
    resolution: tuple[tuple[str, float], ...] | None = None  # by first letter: N, N m, m
    ranked: Ranked = Ranked.PAIRS

    @property
    def settings(self) -> Mapping[str, object]:
        """Its weights and crown, None if it has none, what it rounds to, and how pairs rank."""
        return {
            "weights": {"before_crown": dict(self.before), "from_crown_on": dict(self.after)},
            "crown": None if self.crown == NEVER else self.crown,
            "resolution": dict(self.resolution or ()),
            "ranked": self.ranked.value,
        }

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs with so many bricks."""
        return tuple(name for name, _ in self._terms(bricks))

    def for_scene(self, facts: SceneFacts) -> RankSum:
        """Return the criterion with everything that it takes from a scene filled in."""
        if any(is_tolerance(name) for name, _ in (*self.before, *self.after)):
            raise ProblemError("tolerance has no ranks; make it an aim or a limit")
        crown = facts.crown + self.delay if self.crown is None else self.crown
        crown = NEVER if self.before == self.after else crown
        resolution = self.resolution
        if resolution is None:
            resolution = tuple((name, share * facts.units.of(name)) for name, share in ROUNDED)
        before, after = (_spell_out(each, facts.robots) for each in (self.before, self.after))
        posed = replace(self, before=before, after=after, crown=crown, delay=0)
        return replace(posed, resolution=_spell_out(resolution, ()))

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the weighted mean of the ranks, NaN where a choice is impossible."""
        terms, rounding = self._terms(bricks), dict(_known(self.resolution, self.name))
        parts = [
            weight * _ranks_of(responses[name] / rounding[name[0]], choices, self.ranked)
            for name, weight in terms
        ]
        return np.asarray(sum(parts) / sum(weight for _, weight in terms))

    def is_close(self, responses: ChoiceResponses, bricks: int, share: float) -> Bools:
        """Return which choices (C,) an error of a share of a response may round otherwise."""
        rounding, out = dict(_known(self.resolution, self.name)), []
        for name, _ in self._terms(bricks):
            values = np.abs(np.nan_to_num(responses[name] / rounding[name[0]], posinf=0.0))
            out.append(np.abs(values % 1.0 - 0.5) <= share * values)
        return np.asarray(np.any(out, axis=0))

    def _terms(self, bricks: int) -> tuple[tuple[str, float], ...]:
        return self.before if bricks < _known(self.crown, self.name) else self.after


@dataclass(frozen=True, repr=False)
class WeightedSum(Terse):
    """A weighted sum of responses, each divided by a scale of its own.

    By default (None) the scale is the least that any fixed method of the scene reaches of the
    response's largest value.
    """

    name: str
    terms: tuple[tuple[str, float, float | None], ...]  # response, weight, scale (N, N m or m)

    @property
    def settings(self) -> Mapping[str, object]:
        """What responses are divided by, SI units, and their weights."""
        weights = {name: weight for name, weight, _ in self.terms}
        return {"scales": {name: scale for name, _, scale in self.terms}, "weights": weights}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs, for every move the same."""
        return tuple(name for name, _, _ in self.terms)

    def for_scene(self, facts: SceneFacts) -> WeightedSum:
        """Return the criterion with everything that it takes from a scene filled in."""
        name, terms = _scaled(self.name, self.terms, facts)
        return replace(self, name=name, terms=terms)

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the weighted sums, NaN where a choice is impossible; no part is below zero."""
        parts = [  # the largest tension is below zero where all edges are compressed
            weight / _known(scale, self.name) * np.maximum(_present(responses[name]), 0.0)
            for name, weight, scale in self.terms
        ]
        return np.asarray(sum(parts))


@dataclass(frozen=True, repr=False)
class WorstRatio(Terse):
    """The largest ratio of a response to its limit: a step is as bad as its worst response.

    By default (None) the limit is the least that any fixed method of the scene reaches of the
    response's largest value.
    """

    name: str
    limits: tuple[tuple[str, float | None], ...]  # N, N m or m

    @property
    def settings(self) -> Mapping[str, object]:
        """What responses are divided by, SI units."""
        return {"scales": dict(self.limits)}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs, for every move the same."""
        return tuple(name for name, _ in self.limits)

    def for_scene(self, facts: SceneFacts) -> WorstRatio:
        """Return the criterion with everything that it takes from a scene filled in."""
        name, limits = _scaled(self.name, self.limits, facts)
        return replace(self, name=name, limits=limits)

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the largest ratios: 1 at a limit, NaN where a choice is impossible."""
        parts = [_present(responses[name]) / _known(s, self.name) for name, s in self.limits]
        return np.asarray(np.max(parts, axis=0))


OVER_METHODS = WeightedSum("weighted", tuple((name, 1.0, None) for name in SCALED))
"""The sum of responses over the best values of the scene's fixed methods."""
WORST_OVER_METHODS = WorstRatio("worst-ratio", tuple((name, None) for name in SCALED))
"""The largest of these ratios."""


def _counts_every_step(criterion: Criterion) -> bool:
    """Return whether a criterion is defined in every step: sums and worst values are over these.

    Ranks are among the candidates of open grips, and in other steps no robot takes its grip.
    """
    return not isinstance(criterion, RankSum) and "F_move" not in criterion.wanted(1)


StepFunction = Callable[[Mapping[str, Floats], int], Floats]
"""Takes responses by name, (C,) or (C, D) in SI units, and the brick count; returns their costs."""


@dataclass(frozen=True)
class StepCost:
    """What a step costs is a function of its responses.

    The function is called once for every step, with the responses of all choices at once, so it is
    written with NumPy. A robot that does not grip has force zero. What it returns for choices
    that are impossible is passed over.

    Parameters
    ----------
    name : str
        What the criterion is called.
    responses : tuple of str
        Those that the function takes, as `seqopt.problem.criteria` names them; ``F_each`` stands
        for the forces of all robots, one by one.
    function : callable
        Of responses by name, each (C,) or (C, D), N, N m or m, and of the bricks that stand in the
        step; returns costs of the same shape, finite or, for what is not allowed, infinite.

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

    def __post_init__(self) -> None:
        what = f"criterion {self.name}: "
        if isinstance(self.responses, str) or not self.responses or not callable(self.function):
            raise ProblemError(
                f"{what}give names of responses, as ('T_max', 'M_sup'), and a function of them"
            )
        object.__setattr__(self, "responses", tuple(self.responses))

    @property
    def settings(self) -> Mapping[str, object]:
        """The responses it takes, and the name of its function."""
        called = getattr(self.function, "__qualname__", type(self.function).__name__)
        return {"responses": list(self.responses), "function": called}

    def wanted(self, bricks: int) -> tuple[str, ...]:
        """Return the responses that it needs, for every move the same."""
        return self.responses

    def for_scene(self, facts: SceneFacts) -> StepCost:
        """Return the criterion with ``F_each`` spelled out for the scene's robots."""
        terms = _spell_out(tuple((name,) for name in self.responses), facts.robots)
        return replace(self, responses=tuple(name for (name,) in terms))

    def costs(self, responses: ChoiceResponses, bricks: int, choices: int) -> Floats:
        """Return the function of the responses, NaN where a choice is impossible."""
        given = {name: _present(responses[name]) for name in self.responses}
        impossible = np.isnan([*given.values()]).any(axis=0)
        what = f"criterion {self.name}: its function"
        try:
            with np.errstate(all="ignore"):
                found = np.array(self.function(given, bricks), dtype=float)
        except Exception as error:  # foreign code may raise any error
            raise ProblemError(f"{what} failed: {message_of(error)}") from error
        if found.shape != impossible.shape:
            raise ProblemError(
                f"{what} returned shape {found.shape} for responses "
                f"of {impossible.shape}; give a cost for every choice"
            )
        wrong = ~impossible & (np.isnan(found) | (found == -np.inf))
        if wrong.any():
            raise ProblemError(
                f"{what} returned {found[wrong][0]} for a possible "
                f"choice at {bricks} bricks; give a number, or inf for what is not allowed"
            )
        return np.where(impossible, np.nan, found)


def state_costs(
    criterion: Criterion, found: Mapping[str, Floats], bricks: int, possible: Bools
) -> Floats:
    """Return costs of states (n,), infinite where they are infeasible (n,).

    Steps can be added to a plan, so none that counts may cost less than nothing. ``found`` has
    responses (n,), SI units.
    """
    costs = np.where(possible, criterion.costs(found, bricks, len(possible)), np.inf)
    if (costs < 0).any():
        raise ProblemError(
            f"criterion {criterion.name}: a step costs {costs.min():.6g} at {bricks} bricks; none "
            "may cost less than zero: add a constant"
        )
    return costs


class CandidateCosts:
    """Costs of states among the candidates of the grips that are open in their step.

    Ranks of responses are those among all candidates, whether or not a build reaches them: what is
    undefined, as of one node for two robots, drops out before; limits and filters are asked later.
    ``problem``: in one scene, whose criterion has costs only where a grip is open, or in all steps.
    """

    def __init__(self, problem: Any) -> None:
        self._problem = problem
        self._candidates: dict[int, Candidates] = {}
        self._costs: dict[tuple[int, bool], Floats] = {}

    def among(self, level: int, states: Ints, *, alone: bool = False) -> Floats:
        """Return costs of states (n,) among all candidates of their level; zero if none is open.

        ``alone``: of a step that two moves share, among the candidates of the later one.
        """
        problem = self._problem
        if not problem.space.open_columns(level):
            return np.zeros(len(states))
        candidates, criterion = self._of(level), problem.criterion
        if (level, alone) not in self._costs:
            if alone and isinstance(criterion, RankSum):
                criterion = replace(criterion, ranked=Ranked.CONDITIONAL)
            found = problem.seen(level, candidates.states, rough=True).responses
            shaped = {name: candidates.spread(values) for name, values in found.items()}
            self._costs[level, alone] = self._relative(level, criterion, shaped)
        return np.asarray(self._costs[level, alone][candidates.rows(states)])

    def _of(self, level: int) -> Candidates:
        if level not in self._candidates:
            self._candidates[level] = self._problem.space.candidates(level)
        return self._candidates[level]

    def _relative(self, level: int, criterion: Criterion, found: Mapping[str, Floats]) -> Floats:
        """Return costs of choices by their responses; infinite where one is impossible."""
        move = self._problem.space.decided_by(level)
        known = {name: np.where(np.isfinite(v), v, np.nan) for name, v in found.items()}
        costs = criterion.costs(known, move.bricks, len(move.candidates))
        return np.where(np.isfinite(costs), costs, np.inf)

    def of_branches(self, level: int, states: Ints) -> Floats:
        """Return costs of states (n,) that follow from one by the candidates of its next move.

        Ranks are those among all candidates of the move, also those that steps before turn down;
        infinite is what is not within limits.
        """
        problem = self._problem
        if not (len(states) and problem.space.open_columns(level)):
            return np.zeros(len(states))
        if not problem.is_relative:
            seen = problem.seen(level, states)
            costs = state_costs(problem.criterion, seen.responses, seen.bricks, seen.possible)
            return np.where(problem.fitting(seen), costs, np.inf)
        every = problem.space.candidates(level, states[0])
        seen = problem.seen(level, every.states, rough=True)
        costs = self._relative(level, problem.criterion, seen.responses)
        own = (np.cumsum(every.possible) - 1)[every.rows(states)]
        return np.where(problem.fitting(seen.only(own)), costs[own], np.inf)

    def charges(self, level: int, states: Ints) -> Floats:
        """Return what a search of one move alone is charged of states, (n, 2).

        First in steps in which one move is open, then in those that it shares with the one before.
        """
        problem = self._problem
        if problem.each:
            every = [one.candidates.charges(level, states) for one in problem.each]
            return np.asarray(np.max(every, axis=0))
        out, columns = np.zeros((len(states), 2)), problem.space.open_columns(level)
        if columns and problem.is_relative:
            out[:, int(len(columns) > 1)] = self.among(level, states, alone=True)
        elif columns:
            out[:, int(len(columns) > 1)] = problem.costs(level, problem.seen(level, states))
        return out
