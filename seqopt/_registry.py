"""Extension points of the core: offers of outer rooms, found by name and loaded on demand.

Pictures of values are among them: `seqopt.report` draws, and imports scenes and plans. Modules and
names of a package may wait in the same way; milliseconds beside a `Later` are what others save.

A room with another amount or filter adds a line here. The core works without any
of them. Plug-ins add amounts, filters, formats and commands by entry points of the group
``seqopt.parts``, users by `seqopt.register`.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Container, Mapping
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar, TypeVar

from seqopt.errors import ExtraError, PluginWarning, message_of, plugins

_Kind = TypeVar("_Kind")


class Later(ModuleType):
    """A module by its name, loaded when something of it is first used."""

    def __getattr__(self, name: str) -> Any:
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        return getattr(import_module(self.__name__), name)


def later(
    page: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package with lazy names (PEP 562).

    ``homes``: the module of the package that defines each name.
    """
    own = vars(sys.modules[page])

    def found(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {page!r} has no attribute {name!r}")
        value: object = getattr(import_module(f"{page}.{homes[name]}"), name)
        own[name] = value
        return value

    def names() -> list[str]:
        return [*own.keys() | homes.keys()]

    return found, names


VIEWS = {
    "Shown.html": "seqopt.report._notebook:card",
    "Scene.plot": "seqopt.report._pictures:structure_picture",
    "Network.plot": "seqopt.report._pictures:structure_picture",
    "Schedule.gantt": "seqopt.report._gantt:gantt_picture",
    "ShownBuild.plot": "seqopt.report._pictures:steps_picture",
    "ShownBuild.gantt": "seqopt.report._gantt:gantt_picture",
    "ShownBuild.export": "seqopt.exchange.exports:export",
    "Plan.replan": "seqopt.questions:replan",
    "ShownBuild.report": "seqopt.report._pages:build_page",
    "Page.widget": "seqopt.report._notebook:step_viewer",
    "FailureMap.plot": "seqopt.report.charts:failure_figure",
    "RegretTable.plot": "seqopt.report._regret._chart:regret_chart",
}
"""Renderers by class of values, with its subclasses, and by name."""
OFFERS = {
    "Arm": "seqopt.arms._arm",
    "Durations": "seqopt.times._durations",
    "PostureRules": "seqopt.arms._judge",
    "as_measured": "seqopt.exchange.imports",
    "check_postures": "seqopt.arms._judge",
    "compute_held_postures": "seqopt.arms._permits",
    "find_curing": "seqopt.times._curing_law",
    "find_doubts": "seqopt.exchange._doubts",
    "find_overlaps": "seqopt.exchange._doubts",
    "find_path": "seqopt.instances._solve",
    "find_postures": "seqopt.arms.reach",
    "parse_plan": "seqopt.exchange.schedules",
    "read_plan": "seqopt.exchange.schedules",
    "read_schedule": "seqopt.exchange.schedules",
    "_read_listed": "seqopt.exchange.schedules",
    "hold_alike": "seqopt.arms._permits",
    "permits": "seqopt.arms._permits",
    "with_durations": "seqopt.times._durations",
    "with_postures": "seqopt.arms._kept",
    "makespan": "seqopt.times._twin",
    "mortar_ages": "seqopt.times._steps",
    "mortar_waits": "seqopt.times._curing",
    "reassign": "seqopt.times._tables",
    "step_times": "seqopt.times._steps",
    "timed_graph": "seqopt.times._graph",
    "times_table": "seqopt.times._tables",
}
"""By name, the module of an outer room that has it."""
PARTS = ("makespan",)  # which of these are amounts or filters
ADDED: dict[tuple[type, str], Any] = {}
"""What users registered, by its kind and name."""


class Part:
    """Base of parts that packages and users register by name: formats, commands."""

    name: str
    built_in: ClassVar[Container[str]]  # names of the parts that are always there


def load(place: str) -> Any:
    """Return what ``"module:name"`` names, for those who know it only as a word."""
    home, name = place.split(":")
    return getattr(import_module(home), name)


def offered(name: str) -> Any:
    """Return the offer of an outer room by name; None if there is none, or the room is missing."""
    home = OFFERS.get(name, "")
    try:
        return load(f"{home}:{name}") if home else None
    except ModuleNotFoundError as error:
        if error.name != ".".join(home.split(".")[:2]):
            raise
        return None


def required(name: str) -> Any:
    """Return the offer of an outer room by name. Raises `ExtraError` if the room is missing."""
    if (found := offered(name)) is None:
        home = ".".join(OFFERS[name].split(".")[:2])
        raise ExtraError(
            f"{name} is of the subpackage {home}, which is not there: install seqopt anew"
        )
    return found


def display(kind: type, way: str) -> Callable[..., Any]:
    """Return the renderer of a class of values, as ``plot``, loaded on first use."""
    keys = (f"{each.__name__}.{way}" for each in kind.__mro__)
    try:
        found: Callable[..., Any] = load(next(VIEWS[key] for key in keys if key in VIEWS))
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] != "matplotlib":
            raise
        raise ExtraError(
            "pictures need matplotlib, which is not installed: pip install 'seqopt[plot]'"
        ) from None
    return found


class Shown:
    """Base class of values that notebooks show as a small table with a picture."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return the table and, where matplotlib is installed, the picture, as HTML."""
        return str(display(type(self), "html")(self))


def registered(kind: type[_Kind]) -> dict[str, _Kind]:
    """Return the parts of a kind that rooms, plug-ins and users registered, by name."""
    every = [] if issubclass(kind, Part) else [(name, offered(name)) for name in PARTS]
    for name, entry in plugins("seqopt.parts").items():
        try:
            every.append((name, entry.load()))
        except Exception as error:  # it is code of others
            text = f"plug-in {entry.value}: {message_of(error)}; it is left out"
            warnings.warn(text, PluginWarning, stacklevel=2)
    every += [(name, part) for (_, name), part in ADDED.items()]
    return {name: part for name, part in every if isinstance(part, kind)}
