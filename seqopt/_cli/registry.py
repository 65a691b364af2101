"""The commands by name: those that are always there, and those that packages and users register."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from seqopt._registry import Part, load, registered


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

    @property
    def line(self) -> str:
        """What it is for, in a line."""
        return self.about or (self.load().__doc__ or "").strip().partition("\n")[0]

    def load(self) -> Callable[..., Any]:
        """Return the function."""
        function: Callable[..., Any]
        function = load(self.function) if isinstance(self.function, str) else self.function
        return function


COMMANDS = {
    name: Command(name, f"seqopt._cli.commands.{home}", about)
    for name, home, about in (
        ("compare", "compare:run", "show all ways to build a scene side by side"),
        ("optimize", "optimize:run", "choose where robots hold, and write the plan"),
        ("replan", "replan:run", "plan the rest of a build after a change"),
        ("pareto", "pareto:run", "find all plans that no other one beats in every aim"),
        ("sweep", "sweep:run", "plan many problems, a row of a table for each"),
        ("analyze", "analyze:run", "compute forces and displacements in every step"),
        ("times", "times:run", "say how long a build takes, and who does what when"),
        ("assess", "assess:run", "prove which steps stand, and with what margins"),
        ("report", "report:run", "make a page that shows plans step by step"),
        ("reach", "reach:run", "say who reaches which nodes, and how"),
        ("scene", "scene:run", "check, describe, export or list scenes"),
        ("import", "exchange:read", "make a scene of an assembly of COMPAS, a mesh or a table"),
        ("export", "exchange:write", "write a plan in a format of others"),
        ("instance", "instances:write", "write the graph of a problem, for any solver"),
        ("judge", "instances:judge", "check a bare solution of an instance, and a bound"),
    )
}
"""The commands that are always there, by name."""
Command.built_in = COMMANDS


def every_command() -> dict[str, Command]:
    """Return all commands by name; those of plug-ins are looked for."""
    return {**COMMANDS, **registered(Command)}


def find_command(name: str) -> Command:
    """Return a command by name; those of plug-ins are only looked for if there is no other."""
    return COMMANDS.get(name) or registered(Command)[name]
