"""What an experiment declares, how it is found and run, and where its verdict goes.

An experiment is a module whose text begins with what it claims. It ends with

    CLAIM = Claim(experiment, quick="few states")

where ``experiment`` takes the options of the command line and returns a `Finding`.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from experiments.harness.results import HOME, RESULTS, save_figure, save_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Options = argparse.Namespace
START = "Claim: "  # of the text of a module that makes one
PREFIX = "verdict: the claim "  # of the last line of a run
HOLDS, FAILS, MISSING = 0, 1, 2  # exit status; the last where an extra is not installed
VERDICTS = RESULTS / "verdicts.csv"


class ClaimError(Exception):
    """What is wrong with how a claim is declared, or where it stands."""


@dataclass(frozen=True)
class Finding:
    """What a run finds: whether the claim holds, what follows that word, and tables to store.

    ``holds``: or the parts of the claim with whether each does, which are printed.
    """

    holds: bool | Mapping[str, bool]
    note: str = ""
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)


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

    ``experiment`` runs it, and returns None where an option asks for something else; ``quick``:
    what ``--quick`` does instead; ``timed``: whether the verdict rests on times, and may differ
    between machines; ``needs``: without these it is left out; ``pictures`` are what draws the
    figures of the documentation from stored results alone, by file name; ``digits`` of floats.
    Tables and figures are stored with ``--store`` alone.
    """

    experiment: Callable[[Options], Finding | None]
    quick: str
    timed: bool = False
    options: tuple[Option, ...] = ()
    needs: tuple[Extra, ...] = ()
    pictures: Mapping[str, Callable[[], Figure]] = field(default_factory=dict)
    digits: int | Mapping[str, int] | None = None

    @property
    def name(self) -> str:
        """Plain name of the module that makes the claim."""
        return self.experiment.__module__.rpartition(".")[2]

    def parse(self, arguments: Sequence[str]) -> Options:
        """Return the options of a command line."""
        parser = argparse.ArgumentParser(f"python -m experiments {self.name}")
        parser.add_argument("--quick", action="store_true", help=f"{self.quick}; nothing stored")
        parser.add_argument("--store", action="store_true", help="store rows, figures, verdict")
        parser.add_argument("--redraw", action="store_true", help="draw figures of stored rows")
        for option in self.options:
            text = option.default is not None
            kind = {"default": option.default} if text else {"action": "store_true"}
            parser.add_argument(option.flag, help=option.help, **kind)
        return parser.parse_args(arguments)

    def main(self, arguments: Sequence[str] = ()) -> int:
        """Run the experiment and print its verdict; return the exit status."""
        options, start = self.parse(arguments), time.perf_counter()
        options.store = options.store and not options.quick
        if options.redraw:
            self.redraw()
            return HOLDS
        for extra in self.needs:
            if find_spec(extra.module) is None:
                print(f"{extra.module} is not installed: {extra.install}")
                return MISSING
        finding = self.experiment(options)
        if finding is None:
            return HOLDS
        holds = finding.holds
        if isinstance(holds, Mapping):
            for part, true in holds.items():
                print(f"{'yes' if true else 'NO'}: {part}")
            holds = all(holds.values())
        late = " on this run" if self.timed and not holds else ""
        verdict = f"{'holds' if holds else 'does not hold'}{late}{finding.note}"
        if options.store:
            for name, table in finding.tables.items():
                own = self.digits.get(name) if isinstance(self.digits, Mapping) else self.digits
                save_table(table, name, own)
            self.redraw()
            record(self.name, verdict, time.perf_counter() - start)
        print(f"{PREFIX}{verdict}")
        return HOLDS if holds else FAILS

    def redraw(self) -> None:
        """Draw the figures of the documentation from stored results."""
        for name, draw in self.pictures.items():
            save_figure(draw(), name)
            print(f"drawn: {name}")


def verdicts() -> pd.DataFrame:
    """Return the last stored verdict of every experiment and the seconds it took, by name."""
    if VERDICTS.exists():
        return pd.read_csv(VERDICTS, index_col=0)
    return pd.DataFrame(columns=["verdict", "seconds"])


def record(name: str, verdict: str, seconds: float) -> None:
    """Store a verdict beside those of other experiments."""
    table = verdicts()
    table.loc[name] = [verdict, seconds]
    table = table[table.index.isin(modules())].sort_index().rename_axis("experiment")
    table.to_csv(VERDICTS, float_format="%.1f", lineterminator="\n")


def modules(home: Path = HOME) -> dict[str, tuple[str, str]]:
    """Return the dotted module of every experiment and what it claims, by its plain name.

    Nothing is imported. It is an error if there are none, or if two have one name.
    """
    found: dict[str, tuple[str, str]] = {}
    for path in sorted(home.rglob("*.py")):
        _, _, rest = path.read_text(encoding="utf-8").partition('"""')
        text = rest.partition('"""')[0]
        if not text.startswith(START):
            continue
        module = ".".join(path.relative_to(home.parent).with_suffix("").parts)
        if path.stem in found:
            twice = f"{found[path.stem][0]}, {module}"
            raise ClaimError(f"two experiments are named {path.stem}: {twice}")
        claim = text.removeprefix(START).partition("\n\n")[0].replace("\n", " ")
        found[path.stem] = (module, claim)
    if not found:
        raise ClaimError(f"no experiments found in {home}: a module that begins with {START!r}")
    return dict(sorted(found.items()))


def find_claim(name: str) -> Claim:
    """Return what an experiment declares; it is an error if there is none of that name."""
    known = modules()
    if name not in known:
        raise ClaimError(f"{name}: there is no such experiment; give one of {', '.join(known)}")
    module = known[name][0]
    claim = getattr(import_module(module), "CLAIM", None)
    if not isinstance(claim, Claim):
        raise ClaimError(f"{module} declares no CLAIM; let it end with one")
    return claim


def claims() -> dict[str, Claim]:
    """Return what all experiments declare, by name."""
    return {name: find_claim(name) for name in modules()}
