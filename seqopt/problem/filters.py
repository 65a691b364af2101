r"""Filters: which states a plan may pass.

A filter answers twice, since what it asks may stay open. A plan passes states :math:`s` that are
*proven to pass*; a proof leaves out those that are *proven not to*:

.. math:: P = \{s : f(s) \text{ is proven}\}, \qquad R = \{s : \neg f(s) \text{ is proven}\}, \qquad
   P \cap R = \emptyset .

Limits, payloads, rules, standing and arms are filters of one kind. Each knows how it can be
loosened, from which remedies of an infeasible problem are found. A further one is registered
(`seqopt.register`) and named as a limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np

from seqopt._registry import ADDED, Part, registered
from seqopt.arrays import Bools
from seqopt.engines.registry import recipe_of
from seqopt.errors import ProblemError, did_you_mean
from seqopt.problem.amounts import BUILT_IN, Amount, StateArrays, call
from seqopt.problem.requirements import (
    LIFTED,
    LIMIT_TOLERANCE,
    LINEAR_RANGE,
    NAMES,
    UNITS,
    Limit,
    as_limits,
    length_word,
    number_word,
    payload_limits,
    split_word,
)
from seqopt.problem.resources import Resource
from seqopt.responses.quantities import TOLERANCE
from seqopt.scene._checks import short
from seqopt.scene.scene import Scene

Passes = Callable[[StateArrays], Bools]
Loosened = Callable[[Any], Iterator[tuple[str, Any]]]


@dataclass(frozen=True, repr=False)
class Filter:
    """Which states a plan may pass.

    Parameters
    ----------
    name : str
        By which it is asked for, among limits.
    passes : callable or None
        Takes `StateArrays`, returns which states are proven to pass, (n,) bool; None where moves
        lead only to what passes.
    responses : tuple of str
        Those that it needs.
    refuses : callable, optional
        Returns which states are proven not to pass, (n,) bool; by default all others.
    expensive : bool
        Whether it is asked only of states that pass all other filters.
    twin : callable, optional
        An independent implementation of ``refuses``, with which the judge proves bounds; without
        one the certificate says "claimed".
    loosened : callable, optional
        Takes a problem; yields a relaxation in words, and the relaxed problem. By default the
        filter is left out.

    Examples
    --------
    >>> Filter("two robots hold", lambda states: (states.nodes >= 0).sum(axis=1) == 2)
    Filter('two robots hold')
    """

    name: str
    passes: Passes | None = field(compare=False)
    responses: tuple[str, ...] = ()
    refuses: Passes | None = field(default=None, compare=False)
    expensive: bool = False
    twin: Passes | None = field(default=None, compare=False)
    loosened: Loosened | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"Filter({self.name!r})"

    def proven(self, states: StateArrays) -> Bools:
        """Return which states are proven to pass, (n,)."""
        if self.passes is None:
            return np.ones(len(states.rows), dtype=bool)
        return call(f"filter {self.name}", self.passes, states).astype(bool)

    def refuted(self, states: StateArrays) -> Bools:
        """Return which states are proven not to pass, (n,)."""
        if self.refuses is None:
            return ~self.proven(states)
        return call(f"filter {self.name}", self.refuses, states).astype(bool)

    def refuted_again(self, states: StateArrays) -> Bools:
        """Return which states its twin proves not to pass, (n,); none without a twin."""
        if self.twin is None:
            return np.zeros(len(states.rows), dtype=bool)
        return call(f"twin of filter {self.name}", self.twin, states).astype(bool)

    def ways(self, problem: Any) -> Iterator[tuple[str, Any]]:
        """Yield relaxations of a problem in this filter: in words, and the relaxed problem."""
        if self.loosened is not None:
            yield from self.loosened(problem)
        else:
            rest = _without(self, problem.filters)
            yield f"the filter {self.name} left out", replace(problem, filters=rest)


def _without(part: object, parts: Sequence[Any]) -> tuple[Any, ...]:
    return tuple(other for other in parts if other is not part)


def _limit_filter(limit: Limit) -> Filter:
    """Return the filter of a limit on a response."""

    def passes(states: StateArrays) -> Bools:
        values = states.responses.get(limit.response)
        return states.possible if values is None else ~limit.exceeded(values)

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        yield limit.label, replace(problem, limits=_without(limit, problem.limits))

    return Filter(limit.label, passes, (limit.response,), loosened=loosened)


IGNORED = "payload=ignored"
STANDING = "no requirement to stand"
PAYLOADS = "robots that carry more"  # where states must stand, held by what robots carry
ARMS = "arms that reach more, or stand elsewhere"
APART = "arms that are out of each other's way (slimmer, or elsewhere)"
TAKEN = ("payload", LINEAR_RANGE, "rules", "stands", "arms")
LARGE = 1e6  # N; more than robots have to carry


def _rules_filter() -> Filter:
    """Return the filter of the rules of a free schedule: moves lead only to states that pass."""

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        for words, rules in problem.rules.loosened(problem.network.scene):
            if not (problem.demands and words == IGNORED):  # robots hold with payloads
                yield words, replace(problem, rules=rules)

    return Filter("rules", None, loosened=loosened)


def _standing_filter(problem: Any) -> Filter:
    """Return the filter of the stability requirement, which may stay open for a state."""

    def passes(states: StateArrays) -> Bools:
        held = problem.held_to_stand(states.rows)
        return np.asarray(problem.stability.stand(states.bricks, *held))

    def refuses(states: StateArrays) -> Bools:
        held = problem.held_to_stand(states.rows)
        return np.asarray(~problem.stability.may_stand(states.bricks, *held))

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        yield STANDING, replace(problem, standing=None, settled=())

    return Filter("stands", passes, refuses=refuses, expensive=True, loosened=loosened)


def _payloads_filter() -> Filter:
    """Return the filter of payloads, by each grip."""

    def passes(states: StateArrays) -> Bools:
        over = states.forces > states.most + LIMIT_TOLERANCE * states.most
        return np.asarray(~over.any(axis=1))

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        if recipe_of(problem.engine):
            yield PAYLOADS, problem.carrying(LARGE)

    return Filter("payload", passes, loosened=loosened)


def _arms_filter() -> Filter:
    """Return the filter of compatible postures: moves lead only to states that pass."""

    def loosened(problem: Any) -> Iterator[tuple[str, Any]]:
        scene = problem.network.scene  # robots without arms hold as those whose joints are rigid
        if scene.grip_kinds.arms.any() or not recipe_of(problem.engine):
            return
        alone = replace(problem, scenarios=())
        near = (
            r if r.arm is None else replace(r, arm=replace(r.arm, keeps_apart=False))
            for r in scene.robots
        )
        yield APART, alone.in_scene(scene.with_robots(*near))
        yield ARMS, alone.in_scene(scene.with_robots(*(replace(r, arm=None) for r in scene.robots)))

    return Filter("arms", None, loosened=loosened)


def filters_of(problem: Any) -> tuple[Filter, ...]:
    """Return all that states of a problem must pass, in the order in which each is loosened."""
    out = [_rules_filter()]
    out += [_standing_filter(problem)] if problem.demands else []
    out += [_payloads_filter()]
    out += [_arms_filter()] if problem.network.scene.has_arms else []
    return (*out, *map(_limit_filter, problem.limits), *problem.filters)


Asked: TypeAlias = Limit | Filter | Resource


def parse_limits(
    given: Sequence[str | Asked] | str | Asked, scene: Scene, where: str = "limit"
) -> tuple[Asked, ...]:
    """Return limits, filters and resources that are given as such, or in words.

    Words are ``payload``, of the scene's robots, ``RESPONSE=VALUE``, SI units,
    ``linear_range=SHARE``, or ``any`` to lift it, and names of what was registered.
    ``where``: for messages.
    """
    several = (given,) if isinstance(given, str | Asked) else given
    if not isinstance(several, Sequence):
        return as_limits(several)
    out: list[Asked] = []
    for each in several:
        if isinstance(each, Filter | Resource):
            out.append(each)
        elif not isinstance(each, str):
            out += as_limits([each])
        elif each == "payload":
            out += payload_limits(scene)
        elif "=" not in each and each in (own := registered(Filter) | registered(Resource)):
            out.append(own[each])
        else:
            out.append(_limit_of(each, where))
    return tuple(out)


def _limit_of(text: str, where: str) -> Limit:
    """Return a limit from ``NAME=VALUE``."""
    (name, value), said = split_word(text), f"{where} {text}"
    if name == "payload":
        raise ProblemError(f"{said}: give payload alone, and values with --payload")
    if name == LINEAR_RANGE and value == LIFTED:
        return Limit(name, math.inf)
    if name == LINEAR_RANGE:
        try:
            return Limit(name, number_word(value, said))
        except ProblemError as error:
            hint = f"give a share of it, as 0.5, or {LIFTED} to lift it"
            raise ProblemError(f"{error}; {hint}") from None
    if name not in (*NAMES, "F_each") and not name.startswith("F_"):
        names = ("payload", *NAMES, LINEAR_RANGE)
        hint = did_you_mean(name, names)
        raise ProblemError(f"{where} {name} does not exist{hint}; give {', '.join(names)}, F_ROBOT")
    if name == TOLERANCE:
        return Limit(name, length_word(value, said))
    return Limit(name, number_word(value, said, UNITS.get(name[0], "")))


def register(*parts: Amount | Filter | Resource | Part) -> None:
    """Add amounts, filters, resources, formats and commands, asked for by name.

    Packages register theirs by entry points of the group ``seqopt.parts``.

    Parameters
    ----------
    *parts : Amount, Filter, Resource, Format or Command
        Each takes the place of one of its kind that was registered by its name before.

    Raises
    ------
    ProblemError
        If something is none of these, or has the name of something that is always there.

    Examples
    --------
    >>> import seqopt
    >>> from seqopt.problem import Amount
    >>> seqopt.register(Amount("held", lambda states: (states.nodes >= 0).sum(axis=1)))
    >>> seqopt.optimize("chain:bricks=7", "free", aim="minmax,held").objective["held"]
    26.0
    """
    for part in parts:
        if not isinstance(part, Amount | Filter | Resource | Part):
            raise ProblemError(
                f"{short(part)}: give an Amount, a Filter or a Resource of seqopt.problem, a "
                "Format of seqopt.exchange or a Command of seqopt"
            )
        taken = part.reserved() if isinstance(part, Part) else (*BUILT_IN, *TAKEN)
        if part.name in taken:
            raise ProblemError(f"{part!r}: this name has a meaning already; give another one")
        ADDED[type(part), part.name] = part
