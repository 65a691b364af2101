"""Extension points of the core: offers of outer rooms, found by name and loaded on demand.

Pictures of values are among them: `seqopt.report` draws, and imports scenes and plans. Modules and
names of a package may wait in the same way; milliseconds beside a `Later` are what others save.

A room with another amount, filter or command adds a line here. The core works without any
of them. Plug-ins add amounts, filters, formats and commands by entry points of the group
``seqopt.parts``, users by `seqopt.register`.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from types import ModuleType
from typing import Any, TypeVar

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
    "Page.widget": "seqopt.report._widget:step_viewer",
    "FailureMap.plot": "seqopt.report.charts:failure_figure",
    "RegretTable.plot": "seqopt.report._regret._chart:regret_chart",
}
"""Renderers by class of values, with its subclasses, and by name."""
OFFERS = {
    "PostureRules": "seqopt.arms._judge",
    "check_postures": "seqopt.arms._judge",
    "compute_held_postures": "seqopt.arms._permits",
    "find_path": "seqopt.instances._solve",
    "find_postures": "seqopt.arms.reach",
    "read_measured": "seqopt.exchange.imports",
    "hold_alike": "seqopt.arms._permits",
    "permits": "seqopt.arms._permits",
    "with_postures": "seqopt.arms._kept",
    "makespan": "seqopt.times._twin",
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

    def reserved(self) -> Container[str]:
        """Return names that are always there."""
        raise NotImplementedError


@dataclass(frozen=True, repr=False)
class Command(Part):
    """A command of the command line: a function, whose parameters are its options.

    Parameters
    ----------
    name : str
        The word for it.
    function : callable or str
        Its docstring is the help, its annotations and defaults say how options are read. It returns
        a text or a table. ``"module:function"`` is loaded on demand.
    about : str, optional
        A line in the list of all commands; by default the first line of the docstring.

    Examples
    --------
    >>> Command("weigh", lambda scene="arch25": f"{scene} weighs a lot")
    Command('weigh')
    """

    name: str
    function: Callable[..., Any] | str = field(compare=False)
    about: str = field(default="", compare=False)

    def __repr__(self) -> str:
        return f"Command({self.name!r})"

    def reserved(self) -> Container[str]:
        """Return the names of the commands that are always there."""
        return COMMANDS

    @property
    def line(self) -> str:
        """What it is for, in a line."""
        return self.about or (self.load().__doc__ or "").strip().partition("\n")[0]

    def load(self) -> Callable[..., Any]:
        """Return the function."""
        if callable(self.function):
            return self.function
        home, name = self.function.split(":")
        found: Callable[..., Any] = getattr(import_module(home), name)
        return found


COMMANDS = {
    name: Command(name, f"seqopt._cli.commands.{home}:run", about)
    for name, home, about in (
        ("compare", "compare", "show all ways to build a scene side by side"),
        ("optimize", "optimize", "choose where robots hold, and write the plan"),
        ("replan", "replan", "plan the rest of a build after a change"),
        ("pareto", "pareto", "find all plans that no other one beats in every aim"),
        ("sweep", "sweep", "plan many problems, a row of a table for each"),
        ("analyze", "analyze", "compute forces and displacements in every step"),
        ("times", "times", "say how long a build takes, and who does what when"),
        ("assess", "assess", "prove which steps stand, and with what margins"),
        ("report", "report", "make a page that shows plans step by step"),
        ("reach", "reach", "say which arms reach which nodes, and how"),
        ("scene", "scene", "check, describe, export or list scenes"),
        ("import", "importing", "make a scene of an assembly of COMPAS, a mesh or a table"),
        ("export", "exporting", "write a plan in a format of others"),
        ("instance", "instance", "write the graph of a problem, for any solver"),
        ("judge", "judge", "check a bare solution of an instance, and a bound"),
    )
}
"""The commands that are always there, by name."""


def every_command() -> dict[str, Command]:
    """Return all commands by name: those that are always there, and those that are registered."""
    return {**COMMANDS, **registered(Command)}


def find_command(name: str) -> Command:
    """Return a command by name; those of plug-ins are only looked for if there is no other."""
    return COMMANDS.get(name) or registered(Command)[name]


def offered(name: str) -> Any:
    """Return the offer of an outer room by name; None if there is none, or the room is missing."""
    home = OFFERS.get(name, "")
    try:
        return getattr(import_module(home), name) if home else None
    except ModuleNotFoundError as error:
        if error.name != ".".join(home.split(".")[:2]):
            raise
        return None


def display(kind: type, way: str) -> Callable[..., Any]:
    """Return the renderer of a class of values, as ``plot``, loaded on first use."""
    keys = (f"{each.__name__}.{way}" for each in kind.__mro__)
    home, name = next(VIEWS[key] for key in keys if key in VIEWS).split(":")
    try:
        found: Callable[..., Any] = getattr(import_module(home), name)
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
            said = f"plug-in {entry.value}: {message_of(error)}; it is left out"
            warnings.warn(said, PluginWarning, stacklevel=2)
    every += [(name, part) for (_, name), part in ADDED.items()]
    return {name: part for name, part in every if isinstance(part, kind)}
