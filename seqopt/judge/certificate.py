"""Certificates of optimality: a selection checked from the problem's data alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from itertools import chain
from math import isfinite

import numpy as np

from seqopt.arrays import FrozenValue
from seqopt.errors import FileError
from seqopt.graph.decisions import Decisions
from seqopt.network.network import Network
from seqopt.responses._blocks import packed, remade
from seqopt.responses._choices import Evaluation
from seqopt.responses.quantities import CHOSEN_BY

SAME = 1e-5  # over its largest, that a response may differ: ten times what a screen may err


_Met = Mapping[int, Mapping[str, float]]  # responses, by step


def _require_anew(
    problem: Decisions, choice: Sequence[int], met: Callable[[], _Met] | None = None
) -> None:
    """Raise an error if a choice leads to other responses than its problem has from a cache.

    ``choice``: a candidate for every move; ``met``: returns the responses that it meets, by step,
    where those of all choices are not computed.
    Raises `FileError` if a response of a step is another one when it is computed anew.
    """
    evaluation, cache = problem.evaluation, problem.evaluation.resources.cache
    if cache is None:
        return
    schedule = problem.schedule
    chosen = tuple(
        replace(move, candidates=(move.candidates[i],))
        for move, i in zip(schedule.moves, choice, strict=True)
    )
    engine = remade(packed(problem.engine))
    anew = Evaluation(engine, replace(schedule, moves=chosen), evaluation.wanted)
    found = dict(_met(anew, [0] * len(chosen)))
    kept = dict(_met(evaluation, choice)) if met is None else met()
    sizes = _sizes(engine.network, [*kept.values(), *found.values()])
    for step, responses in found.items():
        for name, value in responses.items():
            there = kept[step][name]
            if not np.isclose(there, value, rtol=0.0, atol=SAME * sizes[name], equal_nan=True):
                raise FileError(
                    f"cache {cache}: {name} of step {step} is {there:.6g} in a file, and "
                    f"{value:.6g} when it is computed; delete the folder"
                )


def _met(
    evaluation: Evaluation, choice: Sequence[int]
) -> Iterator[tuple[int, Mapping[str, float]]]:
    """Yield the responses that a choice meets, by step."""
    for choices in chain.from_iterable(evaluation.levels()):
        at = tuple(choice[move] for move in choices.moves)
        yield choices.step.number, {n: float(v[at]) for n, v in choices.responses.items()}


def _sizes(network: Network, steps: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the scale of each response: its largest value, of forces at least the whole weight."""
    force = float(np.linalg.norm(network.weight, axis=1).sum())
    floors = {"N": force, "Nm": force * float(np.ptp(network.node_position, axis=0).max())}
    sizes: dict[str, float] = {}
    for name, value in chain.from_iterable(step.items() for step in steps):
        unit = CHOSEN_BY[name].column.split("_")[-1] if name in CHOSEN_BY else "N"
        sizes[name] = float(np.fmax(sizes.get(name, floors.get(unit, 0.0)), abs(value)))
    return sizes


TOLERANCE = 1e-6  # of the costs that a choice meets: how far a claim may be from what the data say


def _known_gap(gap: float) -> float:
    """Return a gap, or zero if it is within the tolerance of proofs."""
    return 0.0 if gap <= TOLERANCE else gap


class Basis(StrEnum):
    """What a lower bound rests on."""

    REBUILT = "rebuilt"  # states and their responses, which the judge computed again
    GIVEN = "given"  # costs: of an instance, or of all choices of open grips
    CLAIMED = "claimed"  # by the formulation; nothing is proven


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(FrozenValue):
    """The values of a plan and bounds on all others, from the problem's data alone.

    Attributes
    ----------
    values : tuple of float
        The value of every goal, recomputed; of candidates one, in the unit of the criterion.
    bounds : tuple of float
        Lexicographic lower bounds of the goals, recomputed from the data; minus infinity where
        nothing is proven.
    gap : float
        Largest difference of value and bound, relative to the size of the values: of the costs
        that a choice of candidates meets, their sum or the largest. Infinite where nothing is
        proven; margins of stability are proven to `seqopt.problem.standing.NARROW`.
    claimed_gap : float
        Gap to the formulation's own bound, if that is higher; it is not proven.
    spent : mapping of str to float
        The amount that the plan uses of each budget.
    states : int
        Number of states in the proof, where it is about states.
    basis : Basis
        What proven bounds rest on.

    Examples
    --------
    >>> import seqopt
    >>> proof = seqopt.optimize("arch25", criterion="worst-ratio-published").certificate
    >>> round(proof.objective, 3), round(proof.bound, 3), proof.gap
    (57.941, 57.941, 0.0)
    """

    values: tuple[float, ...]
    bounds: tuple[float, ...]
    gap: float
    claimed_gap: float
    spent: Mapping[str, float] = field(default_factory=dict)
    states: int = 0
    basis: Basis = Basis.GIVEN

    def __repr__(self) -> str:
        values = f"objective {self.objective:.6g}, no choice below {self.bound:.6g}"
        return f"<Certificate: {values}, gap {100 * _known_gap(self.gap):.3g} %>"

    @property
    def objective(self) -> float:
        """The value of the first goal."""
        return self.values[0]

    @property
    def bound(self) -> float:
        """Lower bound of the first goal."""
        return self.bounds[0]

    @property
    def rests_on(self) -> tuple[Basis, ...]:
        """What the bound of each goal rests on: a claim where nothing is proven."""
        return tuple(self.basis if isfinite(bound) else Basis.CLAIMED for bound in self.bounds)
