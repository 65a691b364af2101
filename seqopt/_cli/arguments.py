"""Parsers of the command line: commands, their arguments, and their help.

They are those of argparse: cyclopts, which reads docstrings too, starts 0.2 s later, as long as all
of ``seqopt --version`` takes, and brings seven packages.
"""

from __future__ import annotations

import argparse
import re
from argparse import SUPPRESS
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, NoReturn

from seqopt._cli.answer import Answer, Status, answer_of
from seqopt._cli.registry import COMMANDS, every_command, find_command
from seqopt._cli.terminal import columns, complain, show
from seqopt._registry import Later
from seqopt.errors import did_you_mean

EXAMPLES = """Three examples:

  seqopt compare arch25
      all methods and formulations on the arch of Bruun et al., side by side
  seqopt optimize arch25 --schedule free --aim minmax --out best
      the best build by three robots; best/report.html shows it step by step
  seqopt optimize arch:span=2,rise=0.8 --formulation overlap_dp --out mine
      where to hold an arch of your own

seqopt --help names all commands, seqopt COMMAND --help what each can do.
"""
SIGNATURES = Later("seqopt._cli.signatures")  # 240 ms: it needs all that is computed
WRONG_CHOICE = re.compile(r"invalid choice: '(.*?)' \(choose from (.*)\)")
UNKNOWN = re.compile(r"unrecognized arguments: (--?[^ =]+)")
METHODS = Later("seqopt.sequence.methods")  # of a wrong word alone
WORD = re.compile(r"unrecognized arguments: (\w[\w-]*)")
LEADS = {"limit": "limits", "option": "options", "round": "rounding"}
NAMES = "begin criterion curing direction durations engine grips holds lost max_memory"
NAMES += " measured missing mortar payload props reference robots rules stands to vary"
LEADS |= {name: name for name in NAMES.split()}
"""Parameters, by the words that messages begin with."""
LEAD = re.compile(r"\w+")
GIVEN = re.compile(r"\b(\w+)='([\w-]+)'")


def _nearest(message: str, options: Iterable[str]) -> str:
    """Return a suggestion for the word that an error of the parser names, or an empty string.

    >>> _nearest("unrecognized arguments: --formulaton=beam", ["--formulation", "--out"])
    ' (did you mean --formulation?)'
    >>> _nearest("unrecognized arguments: free", ["--schedule"])
    ' (did you mean --schedule free?)'
    >>> _nearest("invalid choice: 'optimise' (choose from 'optimize', 'scene')", [])
    ' (did you mean optimize?)'
    """
    if found := WRONG_CHOICE.search(message):
        return did_you_mean(found[1], [word.strip(" '") for word in found[2].split(",")])
    found = WORD.search(message)
    if "--schedule" in options and found and found[1] in (*METHODS.SCHEDULES, "free"):
        return f" (did you mean --schedule {found[1]}?)"
    found = UNKNOWN.search(message)
    if found is None:
        return ""
    known = {option.lstrip("-"): option for option in options}
    if found[1] in known.values():
        return " (options stand after the command)"
    return did_you_mean(found[1].lstrip("-"), known).replace("mean ", "mean --")


class _Parser(argparse.ArgumentParser):
    """A parser with one-line errors that prints help as a result on standard output."""

    color: bool  # of Python 3.14
    asked = ""  # the command that is asked for, after a blank, and its options
    spoken: tuple[str, ...] = ()

    def _get_formatter(self) -> argparse.HelpFormatter:
        return argparse.RawDescriptionHelpFormatter(self.prog, width=columns())

    def print_help(self, file: object = None) -> None:
        show(self.format_help().replace("?:\n", "?\n"))  # titles that are questions

    def error(self, message: str) -> NoReturn:
        hint = _nearest(message, self.spoken or tuple(self._option_string_actions))
        complain(f"{self.prog}: error: {message}{hint} (see {self.prog}{self.asked} --help)")
        self.exit(Status.BAD_INPUT)


class _Version(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        show(f"seqopt {version('seqopt')}\n")
        parser.exit()


def parser(asked: str | None = None, *, helps: bool = True) -> argparse.ArgumentParser:
    """Return the parser of the command line, or of one command.

    ``asked``: the only one to parse; ``helps``: whether its help is read. A wrong word ends the
    program with `Status.BAD_INPUT`.
    """
    whole = _Parser(
        prog="seqopt",
        description="Where should each robot hold a half-built structure, over the whole build?",
        epilog="seqopt COMMAND --help has the options of a command by question, and examples.",
    )
    about = "show program's version number and exit"
    whole.add_argument("--version", action=_Version, nargs=0, default=SUPPRESS, help=about)
    whole.color = False  # signs of color would be printed as codes
    subs = whole.add_subparsers(required=True, title="commands", metavar="COMMAND", dest="command")
    for name, command in (COMMANDS if asked in COMMANDS else every_command()).items():
        added = subs.add_parser(name, help=command.line)
        added.color = False
        added._negative_number_matcher = re.compile(r"-\.?\d")  # -1e6 is a value, too
        if asked in (None, name):
            SIGNATURES.signature_of(command.load()).fill(added, helps=helps)
        if asked == name:
            whole.asked, whole.spoken = f" {name}", tuple(added._option_string_actions)
    return whole


@dataclass(frozen=True)
class Request:
    """A command with the values of its options, and how its answer is printed."""

    name: str
    values: Mapping[str, Any]
    quiet: bool
    json: bool

    def answer(self, progress: Callable[[object], object]) -> Answer:
        """Run the command; ``progress`` is called with its progress."""
        function = find_command(self.name).load()
        values = SIGNATURES.signature_of(function).values({**self.values, "progress": progress})
        return answer_of(function(**values))

    def spoken(self, message: str) -> str:
        """Return a message about parameters of Python as one about options."""
        options = SIGNATURES.signature_of(find_command(self.name).load()).options
        lead = LEAD.match(message)
        if lead is not None and LEADS.get(lead[0]) in options:
            message = options[LEADS[lead[0]]].flag + message[lead.end() :]

        def given(found: re.Match[str]) -> str:
            return f"{options[found[1]].flag} {found[2]}" if found[1] in options else found[0]

        return GIVEN.sub(given, message)


def request(words: Sequence[str]) -> Request:
    """Parse words into a command and its options; a wrong word ends the program."""
    helps = any(word.startswith(("-h", "--h")) for word in words)  # argparse takes it shortened
    values = vars(parser(named_command(words), helps=helps).parse_args(words))
    name = values.pop("command")
    if name == "instance":
        values["made_by"] = words
    return Request(name, values, quiet=values.pop("quiet"), json=values.pop("json"))


def named_command(words: Sequence[str]) -> str:
    """Return the command among the words after ``seqopt``, empty if there is none."""
    return next((word for word in words if not word.startswith("-")), "")
