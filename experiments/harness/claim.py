"""What an experiment declares, and how it is run: its options, its verdict, its exit status.

An experiment ends with

    CLAIM = Claim(experiment, quick="few states, nothing written")

    if __name__ == "__main__":
        CLAIM.main()

where ``experiment`` takes the options and returns a `Finding`. The first paragraph of the module's
text is what is claimed.
"""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Options = argparse.Namespace
START = "Claim: "  # of the text of a module that makes one
PREFIX = "verdict: the claim "  # of the last line of a run
MISSING = 2  # exit status where an extra is not installed


class ClaimError(Exception):
    """What is wrong with how a claim is declared, or where it stands."""


class Times(Enum):
    """What times mean to a claim."""

    NONE = "no time is a result"
    SHOWN = "times are a result, but a quick verdict does not rest on them"
    JUDGED = "the verdict rests on them, also a quick one: it may differ between machines"


@dataclass(frozen=True)
class Finding:
    """What a run finds, said in its verdict.

    Attributes
    ----------
    holds : bool
        Whether the claim does.
    note : str
        What follows the words, with the mark that separates it.
    """

    holds: bool
    note: str = ""

    def __str__(self) -> str:
        return f"{'holds' if self.holds else 'does not hold'}{self.note}"


def on_this_run(*, holds: bool) -> Finding:
    """Return a verdict on times: another run may find otherwise."""
    return Finding(holds, "" if holds else " on this run")


@dataclass(frozen=True)
class Option:
    """A further option of an experiment's command: a switch, or a text if it has a default."""

    flag: str
    help: str
    default: str | None = None


@dataclass(frozen=True)
class Extra:
    """A package that an experiment cannot do without, and how it is installed."""

    module: str
    install: str


@dataclass(frozen=True)
class Claim:
    """What an experiment declares.

    Attributes
    ----------
    experiment : callable
        Runs it; None instead of a verdict where an option asks for something else.
    quick : str
        What ``--quick`` leaves out.
    times : Times
        An experiment whose times are a result runs alone.
    options : tuple of Option
        Beyond ``--quick``.
    needs : tuple of Extra
        Without one of these it ends with exit status 2.
    pictures : mapping of str to callable
        What draws each figure of the documentation from stored results alone, by file name:
        ``--redraw`` does, and runs nothing.
    """

    experiment: Callable[[Options], Finding | None]
    quick: str
    times: Times = Times.NONE
    options: tuple[Option, ...] = ()
    needs: tuple[Extra, ...] = ()
    pictures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)

    @property
    def module(self) -> str:
        """The module that makes the claim, dotted."""
        return self.experiment.__module__

    @property
    def takes_time(self) -> bool:
        """Whether times are a result."""
        return self.times is not Times.NONE

    @property
    def text(self) -> str:
        """What is claimed: the first paragraph of the module's text."""
        text = inspect.getdoc(sys.modules[self.module]) or ""
        if not text.startswith(START):
            raise ClaimError(f"{self.module}: its text starts with {text[:20]!r}, not {START!r}")
        return text.split("\n\n")[0].removeprefix(START).replace("\n", " ")

    def parse(self, arguments: Sequence[str] | None = None) -> Options:
        """Return the options of a command line, that of the process by default."""
        parser = argparse.ArgumentParser(description=START + self.text)
        parser.add_argument("--quick", action="store_true", help=self.quick)
        if self.pictures:
            text = "draw the figures anew from stored results, run nothing"
            parser.add_argument("--redraw", action="store_true", help=text)
        for option in self.options:
            if option.default is None:
                parser.add_argument(option.flag, action="store_true", help=option.help)
            else:
                parser.add_argument(option.flag, default=option.default, help=option.help)
        return parser.parse_args(arguments)

    def main(self, arguments: Sequence[str] | None = None) -> None:
        """Run the experiment and print its verdict; exit with status 2 if an extra is missing."""
        options = self.parse(arguments)
        if self.pictures and options.redraw:
            self.redraw()
            return
        for extra in self.needs:
            if find_spec(extra.module) is None:
                print(f"{extra.module} is not installed: {extra.install}")
                sys.exit(MISSING)
        verdict = self.experiment(options)
        if verdict is not None:
            print(f"{PREFIX}{verdict}")

    def redraw(self) -> None:
        """Draw the figures of the documentation from stored results."""
        from experiments.harness.plotting import save_figure  # noqa: PLC0415  # an extra

        for name, draw in self.pictures.items():
            save_figure(draw(), name)
            print(f"drawn: {name}")
