"""Help in two lengths: one screen of what a first use needs, and all options by question.

On the screen is what must be given, what an example of the command gives, and the argument that
has no dashes; of its help as much as stands before the first semicolon. A command whose whole help
fits a screen has one length.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from copy import copy

from seqopt._cli.terminal import columns, show, wrapped

LINES = 40  # of a screen
ALL = "--help-all"


class HelpAll(argparse.Action):
    """The option that prints the help of a command with all its options."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        show(parser.format_help())
        parser.exit()


def question(
    command: argparse.ArgumentParser, title: str, about: str = ""
) -> argparse._ArgumentGroup:
    """Return the group of arguments that answer a question, made if the command has none.

    ``about``: what excludes what among them.
    """
    for group in command._action_groups:
        if group.title == title:
            return group
    return command.add_argument_group(title, wrapped(about, columns() - 2) or None)


def first_screen(command: argparse.ArgumentParser) -> str:
    """Return the help of a command on one screen: the whole of it where that fits."""
    whole = command.format_help()
    if whole.count("\n") <= LINES or command._subparsers is not None:
        return whole
    given = {word.partition("=")[0] for word in (command.epilog or "").split()}
    first = [action for action in command._actions if _is_first(action, given)]
    more = len(command._actions) - len(first) - 2  # both forms of help are no answer to more
    lines = command._get_formatter()
    lines.add_usage(command.usage, first, ())
    lines.add_text(command.description)
    lines.start_section("what a first use needs")
    lines.add_arguments(_briefly(first))
    lines.end_section()
    lines.add_text(command.epilog)
    lines.add_text(f"{command.prog} {ALL} has {more} more options, by question.")
    return lines.format_help()


def _is_first(action: argparse.Action, given: set[str]) -> bool:
    return action.required or not action.option_strings or bool(given & {*action.option_strings})


def _briefly(actions: Sequence[argparse.Action]) -> list[argparse.Action]:
    """Return actions whose help ends before its first semicolon."""
    brief = [*map(copy, actions)]
    for action in brief:
        action.help = (action.help or "").partition("; ")[0]
    return brief
