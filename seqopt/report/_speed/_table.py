"""How long every engine and formulation takes and how accurate it is; which of them to take."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from seqopt._showing import display
from seqopt.arrays import Bools

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DONE, CUT, FAILED = "done", "cut off", "failed"
COLUMNS = 80  # of a terminal
SAME = 1.1  # times that differ by less are equal: repetitions do
USUAL_NAMES = ("overlap_dp", "schedule_search")


def dominated(table: pd.DataFrame) -> Bools:
    """Return which rows are dominated: another is as good in everything, and better in something.

    ``table``: with ``seconds``, ``gap``, ``error`` and ``exact``: what proves its plan is not
    dominated by what does not. A row without a plan is dominated. Times count as equal where they
    differ by less than `SAME`, so that noise decides nothing.
    """
    known = np.isfinite(table[["seconds", "gap", "error"]].to_numpy(float)).all(axis=1)
    seconds, proves = table["seconds"].to_numpy(float), table["exact"].to_numpy(bool)
    no_later = seconds[:, None] <= SAME * seconds
    better = seconds[:, None] * SAME < seconds
    for values in (table["gap"].to_numpy(float), table["error"].to_numpy(float), ~proves):
        no_later &= values[:, None] <= values
        better |= values[:, None] < values
    beats = no_later & better & known[:, None]
    return np.asarray(beats.any(axis=0) | ~known)


@dataclass(frozen=True, eq=False, repr=False)
class SpeedTable:
    """One problem by every engine and formulation.

    ``reference``: the engine that others are compared with; ``limit``: of each, s; ``table``: a row
    per ``engine`` and ``formulation``, with or without its ``proof``, whether it proves its plan
    (``exact``), the ``seconds`` from scene to plan, the ``gap`` to the proven optimum and the
    ``error`` of responses, both by the reference, its ``status`` and ``why`` there is no plan;
    ``refused``: engines that cannot compute the scene, and why.

    >>> rows = [("compliance", "overlap_dp", True, True, 0.1, 0.0, 0.0, "done", "")]
    >>> names = ["engine", "formulation", "proof", "exact", "seconds", "gap", "error"]
    >>> table = pd.DataFrame(rows, columns=[*names, "status", "why"])
    >>> print(SpeedTable("arch25", 25, "three-robot", "compliance", 10.0, table).sentence[:55])
    Take compliance with overlap_dp: the proven best plan i
    """

    scene: str
    bricks: int
    method: str
    reference: str
    limit: float
    table: pd.DataFrame
    refused: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"<SpeedTable of {self.scene}: {self.sentence}>"

    def __str__(self) -> str:
        return "\n".join([self.sentence, "", *self.lines()])

    def _repr_html_(self) -> str:
        return f"<p>{self.sentence}</p>{self.rows()._repr_html_()}"  # type: ignore[operator]

    def plot(self) -> Figure:
        """Return the chart of speed against accuracy (extra ``plot``)."""
        found: Figure = display(SpeedTable, "plot")(self)
        return found

    @cached_property
    def kept(self) -> Bools:
        """Which rows no other one beats."""
        return ~dominated(self.table)

    @cached_property
    def take(self) -> pd.Series[float]:
        """The row to take: the most accurate, one that proves its plan if any does, the soonest.

        Of those that are equally soon one of the reference, and the usual formulation.
        """
        best = self.table[self.kept & (self.table["status"] == DONE)]
        for name in ("error", "gap"):
            best = best[best[name] == best[name].min()]
        best = best[best["exact"] == best["exact"].max()]
        best = best[best["seconds"] <= SAME * best["seconds"].min()]
        other, usual = best["engine"] != self.reference, best["formulation"].isin(USUAL_NAMES)
        by = pd.DataFrame({"other": other, "unusual": ~usual, "seconds": best["seconds"]})
        found: pd.Series[float] = best.loc[by.sort_values([*by]).index[0]]
        return found

    @property
    def sentence(self) -> str:
        """Which engine and formulation to take, and what would be sooner."""
        took = self.take
        proven = "the proven best plan" if took["exact"] else "the best plan"
        worth = proven if took["gap"] == 0 else f"a plan {100 * took['gap']:.2g} % above the best"
        said = f"Take {way_named(took)}: {worth} in {seconds_text(took['seconds'])}"
        if took["error"]:
            said += f", responses off by {error_text(took['error'])}"
        sooner = self.table[self.kept & (self.table["seconds"] * SAME < took["seconds"])]
        if sooner.empty:
            return f"{said}; nothing else is sooner by more than a tenth."
        at: Any = sooner["seconds"].idxmin()
        first: pd.Series[float] = sooner.loc[at]
        lost = "its plan is the best one too, which it does not prove"
        lost = f"its plan is {100 * first['gap']:.2g} % above the best" if first["gap"] else lost
        if first["error"] > took["error"]:
            lost += f", responses are off by {error_text(first['error'])}"
        return f"{said}; sooner is {way_named(first)} in {seconds_text(first['seconds'])}: {lost}."

    def facts(self) -> dict[str, object]:
        """Return all of it as plain values, for scripts."""
        names = ("reference", "limit", "sentence")
        rows = self.table.assign(kept=self.kept)
        return {name: getattr(self, name) for name in names} | {
            "take": {name: self.take[name] for name in ("engine", "formulation", "proof")},
            "rows": rows,
            "refused": dict(self.refused),
        }

    def rows(self) -> pd.DataFrame:
        """Return the table in words, gaps in percent, with a mark for what is not dominated."""
        table = self.table
        columns = {
            "engine": table["engine"],
            "formulation": [way_named(row, engine=False) for _, row in table.iterrows()],
            "time, s": table["seconds"],
            "above the best, %": 100 * table["gap"],
            "error of responses": table["error"],
            "how it ended": table["status"],
            "not dominated": np.where(self.kept, "yes", ""),
        }
        return pd.DataFrame(columns)

    def describe(self, wrapped: Callable[[str], str]) -> Iterator[str]:
        """Yield what to take, the table, and what its columns are, as lines."""
        yield from (wrapped(self.sentence), "", *self.lines(), "")
        yield wrapped(
            f"The {self.method} problem, {self.limit:g} s for each. Seconds: from scene to plan. "
            "Gap: of the plan, above the proven optimum. Error: of its responses, beside those of "
            f"{self.reference}, over the largest of their kind. *: none is better in one of these, "
            "or proves more, and as good in the rest; times within a tenth count as equal."
        )

    def lines(self) -> Iterator[str]:
        """Yield the table in at most 80 columns, an engine after the other."""
        yield f"{'':29}{'seconds':>9}{'gap':>10}{'error':>10}"
        for name, own in self.table.groupby("engine", sort=False):
            yield str(name) + ", the reference" * (name == self.reference)
            without = own[own["gap"].isna()]
            for at, row in own.drop(without.index).iterrows():
                mark = "*" if self.kept[self.table.index.get_loc(at)] else " "
                late = f"  {CUT}" if row["status"] == CUT else ""
                gap = "forbidden" if np.isinf(row["gap"]) else f"{100 * row['gap']:.2g} %"
                yield (
                    f"{mark} {way_named(row, engine=False):27}{_digits(row['seconds']):>9}"
                    f"{gap:>10}{error_text(row['error']):>10}{late}"
                )
            for _, rows in without.groupby("why", sort=False):
                one = way_named(rows.iloc[0], engine=False)
                what = one if len(rows) == 1 else f"{len(rows)} formulations"
                said = str(own["why"][rows.index[0]]) or f"not ready after {self.limit:g} s"
                yield from _wrapped(f"  {what}: {said}")
        for name, why in self.refused.items():
            yield from _wrapped(f"{name}: {why}")


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, COLUMNS, subsequent_indent="    ", break_on_hyphens=False)


def way_named(row: pd.Series[float], *, engine: bool = True) -> str:
    """Return what is typed for a row: ``compliance with overlap_dp``, ``cascade (no proof)``."""
    name = f"{row['formulation']}{'' if row['proof'] else ' (no proof)'}"
    return f"{row['engine']} with {name}" if engine else name


def _digits(seconds: float) -> str:
    """Return a time with three digits that count."""
    return f"{seconds:,.0f}" if seconds >= 100 else f"{seconds:#.3g}"


def seconds_text(seconds: float) -> str:
    """Return a time in words.

    >>> seconds_text(0.1014), seconds_text(26.04), seconds_text(512.2)
    ('0.101 s', '26.0 s', '512 s')
    """
    return f"{_digits(seconds)} s"


def error_text(error: float) -> str:
    """Return an error as people write it: 2e-6, 0.02.

    >>> error_text(2.1e-6), error_text(0.0213), error_text(0.0)
    ('2e-6', '0.021', '0')
    """
    if np.isnan(error):
        return "-"
    return f"{error:.2g}" if error >= 1e-3 or not error else f"{error:.0e}".replace("e-0", "e-")
