"""Formulations: what solves a placement problem, and what it returns."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from importlib.metadata import entry_points

import numpy as np

from seqopt.errors import ProblemError


class FormulationKind(Enum):
    """What a formulation promises."""

    EXACT = "exact"
    HEURISTIC = "heuristic"
    BOUND = "bound"  # a proven bound; its choice is exact where nothing couples the moves


class Reads(Enum):
    """Which states a formulation looks at."""

    ALL = "all"  # every pair of every shared state
    WINDOW = "window"  # by default, shared states only for choices already made


class Aim(Enum):
    """What is to be least over the build."""

    SUM = "sum"
    PEAK = "peak"


@dataclass(frozen=True)
class Selection:
    """A candidate per move, and what its formulation claims of it.

    Attributes
    ----------
    choice : tuple of int
        Place of the chosen node among each move's candidates.
    objective : float
        Claimed value.
    bound : float
        Claimed lower bound, budgets included; minus infinity if none.
    prices : mapping of str to float
        Dual value of each budget: the rate at which one more unit would lower the bound.
    compile_seconds : float
        Part of the time to solve that went into writing the program down for a solver.
    """

    choice: tuple[int, ...]
    objective: float
    bound: float = -np.inf
    prices: Mapping[str, float] = field(default_factory=dict)
    compile_seconds: float = 0.0


@dataclass(frozen=True)
class Formulation:
    """A way to solve the problem.

    Attributes
    ----------
    name, summary : str
    kind : Kind
    aim : Aim
    solve : callable
        Takes the problem and named options, returns a `Selection`.
    reads : Reads
        Which states it looks at with its default options.
    """

    name: str
    summary: str
    kind: FormulationKind
    aim: Aim
    solve: Callable[..., Selection]
    reads: Reads = Reads.ALL


def formulations() -> dict[str, Formulation]:
    """Return all registered formulations (entry points of the group ``seqopt.formulations``)."""
    found = {entry.name: entry.load() for entry in entry_points(group="seqopt.formulations")}
    return dict(sorted(found.items()))


def find_formulation(name: str) -> Formulation:
    """Return a formulation by name, or raise a `ProblemError` that lists those there are."""
    known = formulations()
    if name not in known:
        raise ProblemError(
            f"formulation {name!r}: there is no such; give one of {', '.join(known)}"
        )
    return known[name]
