"""Formulations of the free schedule: what solves it, and how they are found."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from seqopt.errors import ProblemError, did_you_mean
from seqopt.plan.calling.formulation import Formulation, FormulationKind
from seqopt.plugins import plugins

GROUP = "seqopt.schedule_formulations"


class Finds(Enum):
    """What a formulation of the free schedule answers."""

    PLAN = "one plan"
    FRONT = "a Pareto set"
    ORDER = "an order"


@dataclass(frozen=True, repr=False)
class ScheduleFormulation:
    """A way to solve the free schedule.

    ``name``, ``summary``: what it is called, and what it does in a few words; ``kind``: what it
    promises; ``solve``: takes the problem and named options, returns a `StatePath`, or of a
    Pareto set a `seqopt.plan.front.FrontSelection`; ``finds``: which of the two.
    """

    name: str
    summary: str
    kind: FormulationKind
    solve: Callable[..., Any]
    finds: Finds = Finds.PLAN

    def __repr__(self) -> str:
        what = f"{self.kind.value}, finds {self.finds.value}"
        return f"<ScheduleFormulation {self.name}: {self.summary} ({what})>"

    @property
    def options(self) -> dict[str, int | float]:
        """The options of ``solve`` that are numbers, by name, and their defaults."""
        return {
            name: parameter.default
            for name, parameter in inspect.signature(self.solve).parameters.items()
            if isinstance(parameter.default, int | float)
        }

    def require_options(self, given: Iterable[str]) -> None:
        """Raise an error unless options are of this formulation.

        ``given``: their names; ``progress`` need not be listed. Raises `ProblemError`, naming the
        one that is not.
        """
        for name in given:
            if name not in (*self.options, "progress"):
                known = ", ".join(self.options) or "no options"
                raise ProblemError(f"option {name}: {self.name} has {known}")


def schedule_formulation_names(*finds: Finds) -> tuple[str, ...]:
    """Return the names of the formulations of the free schedule that answer something.

    ``*finds``: what. Result: in alphabetical order.

    Examples
    --------
    >>> "schedule_search" in schedule_formulation_names(Finds.PLAN)
    True
    """
    return tuple(name for name in sorted(plugins(GROUP)) if _loaded(name).finds in finds)


def find_schedule_formulation(
    given: ScheduleFormulation | Formulation | str, finds: Finds = Finds.PLAN
) -> ScheduleFormulation:
    """Return a formulation of the free schedule, by name or itself.

    ``given``: a formulation of another kind is refused; ``finds``: what it has to answer. Raises
    `ProblemError` if there is none of that name, or it is something else, or answers something
    else.

    Examples
    --------
    >>> find_schedule_formulation("schedule_search").kind.value
    'exact'
    """
    found = given if isinstance(given, ScheduleFormulation) else _loaded(given)
    if found.finds is not finds:
        able = [name for name in plugins(GROUP) if _loaded(name).finds is finds]
        raise ProblemError(
            f"{found.name} finds {found.finds.value}, and {finds.value} is asked for; "
            f"use {' or '.join(able)}"
        )
    return found


def _loaded(given: Formulation | str) -> ScheduleFormulation:
    """Return the formulation of a name."""
    if isinstance(given, Formulation):
        raise ProblemError(
            f"{given.name}: a free schedule has no moves to choose; use schedule_search"
        )
    entries = plugins(GROUP)
    if not isinstance(given, str) or given not in entries:
        known = ", ".join(sorted(entries))
        hint = did_you_mean(given, entries)
        raise ProblemError(
            f"{given!r} is not a formulation of the free schedule{hint}; give {known}"
        )
    found: object = entries[given].load()
    if not isinstance(found, ScheduleFormulation):
        raise ProblemError(
            f"formulation {given!r}: {entries[given].value} is a {type(found).__name__}; let the "
            "entry point name a ScheduleFormulation"
        )
    return found
