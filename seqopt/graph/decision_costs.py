"""Costs and budgets of candidates and pairs, as arrays, independent of what they mean."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np

from seqopt.arrays import Floats, FrozenValue
from seqopt.errors import ProblemError
from seqopt.problem.problem import Aim

TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True, eq=False, repr=False)
class LayeredCosts(FrozenValue):
    """Costs of single choices and of neighboring pairs.

    One candidate per move is to be chosen; choices ``o`` cost
    ``sum_k single[k][o[k]] + sum_k shared[k][o[k-1], o[k]]``.

    ``single`` (tuple of (C_k,) float): of each candidate in the steps in which its move alone is
    open; infinite where it is not allowed; ``shared`` (tuple of (C_{k-1}, C_k) float): of each pair
    in the steps that the move shares with the one before; of the first move (1, C_0). Raises
    `ProblemError` if there is no move, a move has no candidates, a shape is wrong, a value is NaN,
    or values are so large that their sum overflows.
    """

    single: tuple[Floats, ...]
    shared: tuple[Floats, ...]

    def __post_init__(self) -> None:
        for name in ("single", "shared"):
            copied = tuple(_copied(costs) for costs in getattr(self, name))
            object.__setattr__(self, name, copied)
        if not self.single:
            raise ProblemError("the problem has no moves; give at least one")
        if len(self.shared) != len(self.single):
            raise ProblemError(
                f"{len(self.single)} single and {len(self.shared)} shared costs; give as many"
            )
        for k, shape in enumerate(zip((1, *self.sizes[:-1]), self.sizes, strict=True)):
            self._check_move(k, shape)
        some = [*map(_values, (*self.single, *self.shared))]  # the largest that is allowed counts
        if sum(float(np.abs(v[np.isfinite(v)]).max(initial=0.0)) for v in some) == np.inf:
            raise ProblemError("the costs are so large that their sum overflows; rescale them")
        super().__post_init__()

    def _check_move(self, k: int, shape: tuple[int, int]) -> None:
        if not shape[1]:
            raise ProblemError(f"move {k + 1} has no candidates; widen a reach or free a node")
        if self.shared[k].shape != shape:
            raise ProblemError(
                f"move {k + 1}: shared costs {self.shared[k].shape}; give them for {shape}"
            )
        for name, costs in (("single", self.single[k]), ("shared", self.shared[k])):
            some = _values(costs)
            if np.isnan(some).any() or (some == -np.inf).any():
                raise ProblemError(
                    f"move {k + 1}: a {name} cost is NaN or -inf; mark what is not allowed as inf"
                )

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many candidates every move has."""
        return tuple(len(single) for single in self.single)

    def arcs(self, aim: Aim = Aim.SUM) -> list[Floats]:
        """Return what a pair and its later choice cost together, (C_{k-1}, C_k) for every move."""
        pairs = zip(self.shared, self.single, strict=True)
        return [aim.join(shared, single) for shared, single in pairs]

    def parts(self, choice: Sequence[int]) -> list[float]:
        """Return what a choice meets, by move: its cost, and that shared with the move before."""
        out, before = [], 0
        for single, shared, now in zip(self.single, self.shared, choice, strict=True):
            out += [float(single[now]), float(shared[before, now])]
            before = now
        return out

    def cost(self, choice: Sequence[int]) -> float:
        """Return the total cost of a choice; infinite if it is not allowed."""
        return sum(self.parts(choice))

    def worst(self, choice: Sequence[int]) -> float:
        """Return the largest cost that a choice meets; infinite if it is not allowed."""
        return max(self.parts(choice))

    def least(self, aim: Aim) -> float:
        """Return the least total, or largest cost, of any choice; infinite if there is none."""
        reached, join = np.zeros(1), aim.join
        for k, arcs in enumerate(self.arcs(aim)):
            reached = (join(reached[:, None], arcs) if k else arcs).min(axis=0)
        return float(reached.min())


def _copied(costs: Floats) -> Floats:
    """Return a copy; one number for all choices stays one number."""
    given = np.asarray(costs)
    if given.size and not any(given.strides):
        return np.broadcast_to(np.array(given.flat[0], dtype=float), given.shape)
    return np.array(given, dtype=float)


def _values(costs: Floats) -> Floats:
    """Return the costs, or the one number that they all are, (1,)."""
    return costs if any(costs.strides) or not costs.size else np.array([costs.flat[0]])


@dataclass(frozen=True, eq=False, repr=False)
class Budget(FrozenValue):
    """A cap on a total over the build.

    ``name``: what is capped, with its unit; ``single`` (tuple of (C_k,) float): use of each choice,
    finite; ``shared`` (tuple of (C_{k-1}, C_k) float): use of each pair, finite; ``bound``:
    infinite if there is no cap. Raises `ProblemError` if a shape is wrong, an amount is not finite,
    or the bound is NaN or -inf.
    """

    name: str
    single: tuple[Floats, ...]
    shared: tuple[Floats, ...]
    bound: float

    def __post_init__(self) -> None:
        try:
            _ = self.amounts
        except ProblemError as error:
            raise ProblemError(f"budget {self.name!r}: {error}") from error
        if not all(np.isfinite(amounts).all() for amounts in (*self.single, *self.shared)):
            raise ProblemError(f"budget {self.name!r}: an amount is infinite; limit the choice")
        if not self.bound > -np.inf:
            raise ProblemError(f"budget {self.name!r}: the bound is {self.bound}; give a number")
        super().__post_init__()

    @property
    def amounts(self) -> LayeredCosts:
        """Uses of the budget as costs of choices; made anew each time, as judges need it."""
        return LayeredCosts(self.single, self.shared)

    def spent(self, choice: Sequence[int]) -> float:
        """Return the use of the budget by a choice, in its unit."""
        return self.amounts.cost(choice)


class ScenarioCosts(NamedTuple):
    """What candidates cost in one scenario, models that were solved, and seconds that took."""

    sums: LayeredCosts
    peaks: LayeredCosts
    models: int
    seconds: float


def largest_of(layers: Sequence[LayeredCosts]) -> LayeredCosts:
    """Return the largest of several costs of the same moves, choice by choice and pair by pair.

    The largest cost that a choice meets in any of them is the largest that it meets in this one.
    """
    # one after the other: all in one array would be a large one
    single, shared = (
        tuple(reduce(np.maximum, each) for each in zip(*arrays, strict=True))
        for arrays in ([own.single for own in layers], [own.shared for own in layers])
    )
    return LayeredCosts(single, shared)


class Joined:
    """The costs of all choices, steps of the same moves joined as they come.

    ``sizes``: how many candidates every move has; ``join``: ``numpy.add`` or ``numpy.maximum``.
    """

    def __init__(self, sizes: Sequence[int], join: np.ufunc) -> None:
        self._sizes, self._join = tuple(sizes), join
        self._found: dict[tuple[int, ...], Floats] = {}
        self._least = np.inf

    def add(self, moves: tuple[int, ...], costs: Floats) -> None:
        """Join the costs, (C,) or (C, D), of a step with one open move, or two neighboring ones."""
        finite = costs[np.isfinite(costs)]
        self._least = min(self._least, float(finite.min(initial=np.inf)))
        before = self._found.get(moves)
        if before is None:
            before = np.zeros(1) if self._join is np.add else costs
        self._found[moves] = self._join(before, costs)

    def add_anyway(self, cost: float) -> None:
        """Join the cost that all choices share, to the costs of the first move."""
        self.add((-1, 0), np.full((1, self._sizes[0]), cost))

    def single(self, move: int) -> Floats:
        """Return the costs of a move's candidates where it alone is open.

        Result (C_k,): nothing where it never is, or no more than any cost.
        """
        return self._of((move,), (self._sizes[move],))

    def layered(self) -> LayeredCosts:
        """Return the costs of choices and pairs; moves that share no step take no memory."""
        pairs = zip([1, *self._sizes[:-1]], self._sizes, strict=True)
        shared = tuple(self._of((k - 1, k), pair) for k, pair in enumerate(pairs))
        return LayeredCosts(tuple(map(self.single, range(len(self._sizes)))), shared)

    def budget(self, name: str, bound: float) -> Budget:
        """Return the budget that caps the joined total."""
        amounts = self.layered()
        return Budget(name, amounts.single, amounts.shared, bound)

    def _of(self, moves: tuple[int, ...], shape: tuple[int, ...]) -> Floats:
        if moves in self._found:
            return self._found[moves]
        nothing = self._join is np.add or np.isinf(self._least)
        return np.broadcast_to(0.0 if nothing else self._least, shape)
