"""Parsers of the command line: commands, their arguments, and their help."""

from __future__ import annotations

import argparse
import re
from argparse import SUPPRESS
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from types import ModuleType
from typing import Any, NoReturn

from seqopt._cli.answer import Status
from seqopt._cli.terminal import columns, complain, show
from seqopt.errors import did_you_mean

EXAMPLES = """Three examples:

  seqopt compare arch25
      all methods and formulations on the arch of Bruun et al., side by side
  seqopt optimize arch25 --schedule free --aim minmax --out best
      the best build by three robots; best/report.html shows it step by step
  seqopt optimize arch:span=2,rise=0.8 --formulation overlap_dp --out mine
      where to hold an arch of your own

seqopt --help names all commands, seqopt COMMAND --help what each is for, and
seqopt COMMAND --help-all what it can do.
"""
LINES = 40  # of a screen
ALL = "--help-all"
WRONG_CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)")
UNKNOWN = re.compile(r"unrecognized arguments: (--?[^ =]+)")
MISSING = "the following arguments are required"


def _nearest(message: str, options: Iterable[str]) -> str:
    """Return a suggestion for the word that an error of the parser names, or an empty string.

    >>> _nearest("unrecognized arguments: --formulaton=beam", ["--formulation", "--out"])
    ' (did you mean --formulation?)'
    >>> _nearest("invalid choice: 'optimise' (choose from 'optimize', 'scene')", [])
    ' (did you mean optimize?)'
    """
    if found := WRONG_CHOICE.search(message):
        return did_you_mean(found[1], [word.strip(" '") for word in found[2].split(",")])
    found = UNKNOWN.search(message)
    if found is None:
        return ""
    known = {option.lstrip("-"): option for option in options}
    if found[1] in known.values():
        return " (options stand after the command)"
    return did_you_mean(found[1].lstrip("-"), known).replace("mean ", "mean --")


def _first_wrong(message: str, given: Sequence[str], options: Sequence[str]) -> str:
    """Return the parser's message, or one about the mistyped option that causes it.

    >>> given = ["arch25", "--ot", "best"]
    >>> _first_wrong("the following arguments are required: --out", given, ["--out"])
    'unrecognized arguments: --ot'
    """
    if not message.startswith(MISSING) or message.endswith("COMMAND"):
        return message
    for word in given:
        name = word.partition("=")[0]
        if name.startswith("--") and not any(option.startswith(name) for option in options):
            return f"unrecognized arguments: {word}"
    return message


def _layout(prog: str) -> argparse.HelpFormatter:
    return argparse.RawDescriptionHelpFormatter(prog, width=columns())


@dataclass(frozen=True, eq=False, repr=False)
class _Command:
    """A command: a short description, and the class of `seqopt._cli.commands` with its options.

    Its module, which has ``run`` as well, is loaded on demand.
    """

    about: str
    where: str

    def load(self) -> ModuleType:
        """Return the module."""
        return import_module(f"seqopt._cli.commands.{self.where.partition(':')[0]}")

    @property
    def asked(self) -> Any:
        """The class of its options."""
        return getattr(self.load(), self.where.partition(":")[2])


COMMANDS = {
    "compare": _Command("show all ways to build a scene side by side", "compare:Compare"),
    "optimize": _Command("choose where robots hold, and write the plan", "optimize:Optimize"),
    "replan": _Command("plan the rest of a build after a change", "replan:ReplanWords"),
    "pareto": _Command("find all plans that no other one beats in every aim", "pareto:ParetoWords"),
    "analyze": _Command("compute forces and displacements in every step", "analyze:Analyze"),
    "times": _Command("say how long a build takes, and who does what when", "times:Times"),
    "assess": _Command("prove which steps stand, and with what margins", "assess:AssessWords"),
    "report": _Command("make a page that shows plans step by step", "report:ReportWords"),
    "reach": _Command("say which arms reach which nodes, and how", "reach:Reach"),
    "scene": _Command("check, describe, export or list scenes", "scene:SceneAsked"),
    "import": _Command(
        "make a scene of an assembly of COMPAS, a mesh or a table", "importing:Import"
    ),
    "export": _Command("write a plan in a format of others", "exporting:Export"),
    "instance": _Command("write the graph of a problem, for any solver", "instance:InstanceWords"),
    "judge": _Command("check a bare solution of an instance, and a bound", "judge:Judge"),
    "completion": _Command("let the shell complete words of seqopt", "completion:Completion"),
}


class _Parser(argparse.ArgumentParser):
    """A parser with one-line errors that prints help as a result on standard output."""

    color: bool  # of Python 3.14
    given: Sequence[str] = ()  # what it was asked to parse: a missing word may be a mistyped one
    asked = ""  # the command that is asked for, and its options
    spoken: tuple[str, ...] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        self.given = args or ()
        return super().parse_known_args(args, namespace)

    def format_help(self) -> str:
        return super().format_help().replace("?:\n", "?\n")  # titles that are questions

    def print_help(self, file: object = None) -> None:
        show(first_screen(self))

    def error(self, message: str) -> NoReturn:
        own = tuple(self._option_string_actions)
        message = _first_wrong(message, self.given, own)
        hint = _nearest(message, self.spoken or own)
        where = f"{self.prog} {self.asked}".rstrip()
        complain(f"{self.prog}: error: {message}{hint} (see {where} --help)")
        self.exit(Status.BAD_INPUT)


class _Show(argparse.Action):
    """An option that prints a text, created on demand."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        show(self.const(parser))
        parser.exit()


def parser(asked: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the command line, or of one command.

    ``command``: the only one to parse. A wrong word ends the program with `Status.BAD_INPUT`.
    """
    whole = _Parser(
        prog="seqopt",
        formatter_class=_layout,
        description="Where should each robot hold a half-built structure, over the whole build?",
        epilog="seqopt COMMAND --help has what a first use of a command needs, and examples;\n"
        "seqopt COMMAND --help-all has all of its options.",
    )
    about = "show program's version number and exit"
    how: dict[str, Any] = {"action": _Show, "nargs": 0, "default": SUPPRESS}
    whole.add_argument(
        "--version", const=lambda _: f"seqopt {version('seqopt')}\n", help=about, **how
    )
    whole.color = False  # signs of color would be printed as codes
    commands = whole.add_subparsers(
        required=True, title="commands", metavar="COMMAND", dest="command"
    )
    for name, command in COMMANDS.items():
        added = commands.add_parser(name, help=command.about, formatter_class=_layout)
        added.color = False
        if asked in (None, name):
            from seqopt._cli.signatures import fill  # noqa: PLC0415  # of which help needs nothing

            all_help = "show every option of the command, and exit"
            added.add_argument(ALL, const=_Parser.format_help, help=all_help, **how)
            fill(added, command.asked)
        if asked == name:
            whole.asked, whole.spoken = name, tuple(added._option_string_actions)
    return whole


@dataclass(frozen=True)
class Printed:
    """Output format of an answer, and whether violations set the exit status."""

    quiet: bool = False
    json: bool = False
    strict: bool = False


def request(words: Sequence[str], tell: Any = None) -> tuple[str, Any, Printed]:
    """Parse words into a command and its options; a wrong word ends the program."""
    options = vars(parser(named_command(words)).parse_args(words))
    from seqopt._cli.signatures import given  # noqa: PLC0415  # of which help needs nothing

    name = options.pop("command")
    kind = COMMANDS[name].asked
    told = {each: options.pop(each) for each in ("quiet", "json", "strict") if each in options}
    more = {"made_by": words} if hasattr(kind, "made_by") else {}
    return name, given(kind, options | more | {"progress": tell}), Printed(**told)


def first_screen(command: argparse.ArgumentParser) -> str:
    """Return the help of a command on one screen, in full if that fits.

    Otherwise only required options, those of examples, and positional arguments, with their help up
    to the first semicolon.
    """
    whole = command.format_help()
    if whole.count("\n") <= LINES or command._subparsers is not None:
        return whole
    given = {word.partition("=")[0] for word in (command.epilog or "").split()}
    first = [
        action
        for action in command._actions
        if action.required or not action.option_strings or given & {*action.option_strings}
    ]
    more = len(command._actions) - len(first) - 2  # both forms of help are no answer to more
    lines = command._get_formatter()
    lines.add_usage(command.usage, first, ())
    lines.add_text(command.description)
    lines.start_section("what a first use needs")
    brief = [*map(copy, first)]
    for action in brief:
        action.help = (action.help or "").partition("; ")[0]
    lines.add_arguments(brief)
    lines.end_section()
    lines.add_text(command.epilog)
    lines.add_text(f"{command.prog} {ALL} has {more} more options, by question.")
    return lines.format_help()


def named_command(words: Sequence[str]) -> str:
    """Return the command among the words after ``seqopt``, empty if there is none."""
    return next((word for word in words if not word.startswith("-")), "")
