"""What an experiment declares, and how it is run: its options, its verdict, its exit status.

An experiment ends with

    CLAIM = Claim(experiment, quick="few states, nothing written")

    if __name__ == "__main__":
        CLAIM.main()

where ``experiment`` takes the options and returns a `Finding`. The first paragraph of the module's
text is what is claimed, with others that begin so where several claims share what they rest on.
"""

from __future__ import annotations

import argparse
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.harness.results import HOME, save_figure, save_table

if TYPE_CHECKING:
    import pandas as pd
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
    """What a run finds: whether the claim holds, what follows that word, and tables to store."""

    holds: bool
    note: str = ""
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{'holds' if self.holds else 'does not hold'}{self.note}"


def on_this_run(*, holds: bool, **tables: pd.DataFrame) -> Finding:
    """Return a verdict on times: another run may find otherwise."""
    return Finding(holds, "" if holds else " on this run", tables)


def told(parts: Mapping[str, bool]) -> bool:
    """Print whether each part of a claim holds; return whether all do."""
    for text, true in parts.items():
        print(f"{'yes' if true else 'NO'}: {text}")
    return all(parts.values())


def none_of(faults: Sequence[str]) -> bool:
    """Print what speaks against a claim; return whether nothing does."""
    for fault in faults:
        print(f"against it: {fault}")
    return not faults


@dataclass(frozen=True)
class Option:
    """A further option of an experiment's command: a switch, or a text if it has a default."""

    flag: str
    help: str
    default: str | None = None


Part = Callable[[argparse.Namespace], Finding]
ONLY = Option("--only", "one part of the claim alone, by its name in the method", "")


def together(options: Options, parts: Mapping[str, Part]) -> Finding:
    """Run the parts of a claim, or the one that is asked for; return what they find together."""
    if options.only and options.only not in parts:
        raise SystemExit(f"--only: there is no part {options.only!r}; give one of {[*parts]}")
    found = [part(options) for name, part in parts.items() if options.only in ("", name)]
    notes = dict.fromkeys(one.note for one in found)
    tables = {name: table for one in found for name, table in one.tables.items()}
    return Finding(all(one.holds for one in found), "".join(notes), tables)


@dataclass(frozen=True)
class Extra:
    """A package that an experiment cannot do without, and how it is installed."""

    module: str
    install: str


@dataclass(frozen=True)
class Claim:
    """What an experiment declares.

    ``experiment`` runs it, or each of its parts by name, of which ``--only`` runs one alone: a
    finding, or None where an option asks for something else. Unless
    ``quick``, which is what ``--quick`` leaves out, the tables of the finding are stored, floats
    with so many ``digits``. ``pictures`` are what draws the figures of the documentation from
    stored results alone, by file name: they are drawn anew after a run, and ``--redraw`` draws them
    and runs nothing. Without what it ``needs`` a run ends with exit status 2; one whose ``times``
    are a result runs alone.
    """

    experiment: Callable[[Options], Finding | None] | Mapping[str, Part]
    quick: str
    times: Times = Times.NONE
    options: tuple[Option, ...] = ()
    needs: tuple[Extra, ...] = ()
    pictures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    digits: int | Mapping[str, int] | None = None

    @property
    def module(self) -> str:
        """The module that makes the claim, dotted."""
        return next(iter(self.parts.values()), self.experiment).__module__

    @property
    def parts(self) -> Mapping[str, Part]:
        """The parts of the experiment by name, if it has some."""
        return self.experiment if isinstance(self.experiment, Mapping) else {}

    @property
    def takes_time(self) -> bool:
        """Whether times are a result."""
        return self.times is not Times.NONE

    @property
    def text(self) -> str:
        """What is claimed: the first paragraph of the module's text, and others that begin so."""
        text = inspect.getdoc(sys.modules[self.module]) or ""
        if not text.startswith(START):
            raise ClaimError(f"{self.module}: its text starts with {text[:20]!r}, not {START!r}")
        parts = [part for part in text.split("\n\n") if part.startswith(START)]
        return " ".join(part.removeprefix(START) for part in parts).replace("\n", " ")

    def parse(self, arguments: Sequence[str] | None = None) -> Options:
        """Return the options of a command line, that of the process by default."""
        parser = argparse.ArgumentParser(description=START + self.text)
        parser.add_argument("--quick", action="store_true", help=self.quick)
        if self.pictures:
            text = "draw the figures anew from stored results, run nothing"
            parser.add_argument("--redraw", action="store_true", help=text)
        for option in (*self.options, *([ONLY] if self.parts else [])):
            text = option.default is not None
            kind = {"default": option.default} if text else {"action": "store_true"}
            parser.add_argument(option.flag, help=option.help, **kind)
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
        finding = together(options, self.parts) if self.parts else self.experiment(options)
        if finding is None:
            return
        if not options.quick and finding.tables:
            for name, table in finding.tables.items():
                own = self.digits.get(name) if isinstance(self.digits, Mapping) else self.digits
                save_table(table, name, own)
            self.redraw(say=False)
        print(f"{PREFIX}{finding}")

    def redraw(self, *, say: bool = True) -> None:
        """Draw the figures of the documentation from stored results."""
        for name, draw in self.pictures.items():
            save_figure(draw(), name)
            if say:
                print(f"drawn: {name}")


def modules(home: Path = HOME) -> dict[str, str]:
    """Return the modules that make claims, dotted, by their plain names in alphabetical order.

    It is an error if there are none, or if two have one name.
    """
    found: dict[str, str] = {}
    for path in (*home.glob("*.py"), *home.glob("*/*.py")):
        if path.stem.startswith("__") or path.parent.name == "harness":
            continue
        module = ".".join(path.relative_to(home.parent).with_suffix("").parts)
        if path.stem in found:
            raise ClaimError(f"two experiments are named {path.stem}: {found[path.stem]}, {module}")
        found[path.stem] = module
    if not found:
        raise ClaimError(f"no experiments found in {home}: one per file in a folder by topic")
    return dict(sorted(found.items()))


def claims() -> dict[str, Claim]:
    """Return what every experiment declares, by its plain name; it is an error if one does not."""
    out = {}
    for name, module in modules().items():
        claim = getattr(import_module(module), "CLAIM", None)
        if not isinstance(claim, Claim):
            raise ClaimError(f"{module} declares no CLAIM: what makes none belongs in parts")
        out[name] = claim
    return out
