"""What every way to a plan takes and costs, and which of them to take."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from seqopt._registry import display
from seqopt.arrays import Bools
from seqopt.errors import NothingFoundError
from seqopt.graph.formulation import Finding
from seqopt.sequence.rules import FREE
from seqopt.sequence.steps import Step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DONE, CUT, FAILED, FALLS = "done", "stopped", "failed", "falls"
COLUMNS = 80  # of a terminal
NOTHING = 1e-9  # regrets and errors below are none
MANY = 4  # ways that are counted, not named, where they fail alike
SAME = 1.1  # times that differ by less are equal: repetitions do
LOST = {CUT: "stopped", FAILED: "without a plan", FALLS: "fall", DONE: "not allowed"}
OF = {"regret": "", "gap": " to its bound", "error": " of its model"}
PARTS = {
    "regret": ("D", "regret"),
    "gap": ("|", "proven gap"),
    "error": ("x", "error of the model"),
}
USUAL_NAMES = ("overlap_dp", "schedule_search")
NAMED = {FREE: "the free schedule", "loop": "the loop"}


def dominated(table: pd.DataFrame) -> Bools:
    """Return which rows are dominated: another is as good in everything, and better in something.

    What proves its plan (``exact``) is not dominated by what does not; a row without a plan that
    holds is. Times that differ by less than `SAME` are equal, so that noise decides nothing.
    """
    known = np.isfinite(table[["seconds", "regret"]].to_numpy(float)).all(axis=1)
    seconds, proves = table["seconds"].to_numpy(float), table["exact"].to_numpy(bool)
    no_later = seconds[:, None] <= SAME * seconds
    better = seconds[:, None] * SAME < seconds
    for values in (table["regret"].to_numpy(float), ~proves):
        no_later &= values[:, None] <= values
        better |= values[:, None] < values
    beats = no_later & better & known[:, None]
    return np.asarray(beats.any(axis=0) | ~known)


def apart(shares: pd.Series[float]) -> Bools:
    """Return which shares differ by more than half a decade from those kept before."""
    logs, kept = np.log10(shares.clip(lower=NOTHING).to_numpy()), list[int]()
    for i, each in enumerate(logs):
        kept += [i] * bool((np.abs(logs[kept] - each) > 0.5).all())
    return np.isin(np.arange(len(logs)), kept)


def with_regrets(table: pd.DataFrame) -> pd.DataFrame:
    """Return rows with the regret of their values over the least; what is tiny is none."""
    best = table["value"].min()
    regret = ((table["value"] - best) / (abs(best) or 1.0)).clip(lower=0.0)
    shares = pd.DataFrame({"regret": regret, "error": table["error"]})
    return table.assign(**shares.where(~(shares < NOTHING), 0.0))


@dataclass(frozen=True, eq=False, repr=False)
class RegretTable:
    """What the plans of all ways cost in the most detailed model of one scene.

    ``reference``: the engine that values plans, and ``valued`` with what it takes into account;
    ``worst``: the criterion whose largest value counts; ``limit``: of all ways together, s;
    ``table``: a row per ``engine``, ``schedule``, ``formulation`` and what it leaves out
    (``without``), with the ``seconds`` from scene to plan, its ``value`` in the reference and in
    its ``own`` model, the ``regret`` over the best known, the ``gap`` to the bound that it proves,
    the ``error`` of what its model promised, whether it proves its plan (``exact``), ``models``
    solved, its ``status``, and ``why`` there is no plan, or none that holds; ``refused``: engines
    that cannot model it, and why; ``curves``: incumbents and bounds, ``plans``: steps, row by row.
    """

    scene: str
    bricks: int
    reference: str
    valued: str
    worst: str
    limit: float
    table: pd.DataFrame
    refused: Mapping[str, str] = field(default_factory=dict)
    curves: Sequence[Sequence[Finding]] = ()
    plans: Sequence[tuple[Step, ...]] = ()

    def __repr__(self) -> str:
        return f"<RegretTable of {self.scene}: {self.sentence}>"

    def __str__(self) -> str:
        return "\n".join([*_wrapped(self.sentence), "", *self.lines()])

    def _repr_html_(self) -> str:
        return f"<p>{self.sentence}</p>{self.shown._repr_html_()}"  # type: ignore[operator]

    def plot(self) -> Figure:
        """Return the chart of speed against regret (extra ``plot``)."""
        found: Figure = display(RegretTable, "plot")(self)
        return found

    def valued_by(self, model: str, worst: Callable[[tuple[Step, ...]], float]) -> RegretTable:
        """Return the regrets of the same plans in a model of one's own, in which none is proven.

        ``worst``: takes a plan's steps; infinite where it falls. `NothingFoundError` if all do.
        """
        known = {steps: worst(steps) for steps in dict.fromkeys(self.plans) if steps}
        value = pd.Series([known.get(steps, np.nan) for steps in self.plans])
        if not np.isfinite(value.min()):
            raise NothingFoundError(f"{model}: no plan holds in it")
        rows = self.table.assign(value=value, error=(self.table["own"] / value - 1.0).abs())
        rows.loc[np.isfinite(value) & (rows["status"] != CUT), ["status", "why"]] = DONE, ""
        rows.loc[np.isinf(value), ["status", "why"]] = FALLS, ""
        return replace(self, reference=model, valued=model, table=with_regrets(rows))

    @cached_property
    def kept(self) -> Bools:
        """Which rows no other one beats; a proof counts in the model that values plans."""
        proves = self.table["exact"] & (self.table["engine"] == self.reference)
        return ~dominated(self.table.assign(exact=proves))

    @property
    def front(self) -> pd.DataFrame:
        """The rows that are worth a name, those near each other once, the one to take first."""
        kept = self.table[self.kept].sort_values("seconds")
        kept = kept[kept["regret"] <= kept["regret"].cummin()]
        kept = kept.sort_index(key=lambda names: names != self.take.name, kind="stable")
        return kept[apart(kept["regret"])]

    @property
    def alike(self) -> pd.DataFrame:
        """A row for the ways whose regret has the same parts, and how many; the best last."""
        own = self.table[np.isfinite(self.table["regret"].to_numpy(float))]
        own = own.assign(other=~own["formulation"].isin(USUAL_NAMES) | (own["without"] != ""))
        own = own.sort_values(["regret", "other", "seconds"])
        by = [own["engine"], own["schedule"], *(own[part].map(percent) for part in PARTS)]
        alike = own.groupby(by, sort=False)
        found: pd.DataFrame = alike.head(1).assign(ways=alike["regret"].size().to_numpy())[::-1]
        return found

    @cached_property
    def is_proven(self) -> bool:
        """Whether no plan of the free schedule is better in the reference than the best known."""
        best = self.table[self.table["exact"] & (self.table["regret"] == 0)]
        return bool(((best["engine"] == self.reference) & (best["schedule"] == FREE)).any())

    @cached_property
    def take(self) -> pd.Series[float]:
        """The row to take: of least regret, proven if any is, soonest, of the reference, usual."""
        done = self.kept & (self.table["status"] == DONE)
        best = self.table[done if done.any() else self.kept]  # all that have a plan were stopped
        best = best[best["regret"] == best["regret"].min()]
        best = best[best["exact"] == best["exact"].max()]
        best = best[best["seconds"] <= SAME * best["seconds"].min()]
        other, usual = best["engine"] != self.reference, best["formulation"].isin(USUAL_NAMES)
        by = pd.DataFrame({"other": other, "unusual": ~usual, "seconds": best["seconds"]})
        found: pd.Series[float] = best.loc[by.sort_values([*by]).index[0]]
        return found

    @property
    def shown(self) -> pd.DataFrame:
        """The table for readers: numbers in words, what there is to say of each way last."""
        rows = self.table
        shares = {f"{name}{of}": rows[name].map(percent) for name, of in OF.items()}
        way = rows[["engine", "schedule"]].assign(formulation=rows.apply(_short, axis=1))
        why = rows["why"].radd(", ").where(rows["why"] != "", "")
        proven = rows["exact"].map({True: "yes", False: ""}).rename("proven")
        seconds = rows["seconds"].rename("time, s")
        found = way.join([seconds, pd.DataFrame(shares), proven, rows["models"]])
        return found.assign(outcome=rows["status"] + why)

    @cached_property
    def sooner(self) -> pd.DataFrame:
        """The rows that are sooner than the one to take, `apart`: worse, or without a proof."""
        soon = self.table[self.kept & (self.table["seconds"] * SAME < self.take["seconds"])]
        worse = soon[soon["regret"] > self.take["regret"]]
        found = (soon if worse.empty else worse).sort_values("seconds")
        return found[apart(found["regret"])].sort_values("regret")

    @property
    def sentence(self) -> str:
        """Which way to take, why, and what a sooner one gives up."""
        took = self.take
        known = (
            "no plan of the free schedule is better, which is proven"
            if self.is_proven
            else "no plan known is better"
        )
        lost = known if took["regret"] == 0 else f"{percent(took['regret'])} above the best known"
        text = f"Take {way_named(took)}: {lost}, in {seconds_text(took['seconds'])}"
        if self.sooner.empty:
            return f"{text}; nothing else is sooner by more than a tenth."
        one: Any = self.sooner.iloc[0]
        worse = f"its plan is {percent(one['regret'])} worse"
        end = worse if one["regret"] > took["regret"] else "its plan is as good, without a proof"
        return f"{text}; sooner is {way_named(one)} in {seconds_text(one['seconds'])}: {end}."

    def facts(self) -> dict[str, object]:
        """Return the summary, for scripts."""
        rows = self.table.astype(object).where(self.table.notna(), None).to_dict("records")
        return {
            "sentence": self.sentence,
            "reference": self.reference,
            "worst": self.worst,
            "proven": self.is_proven,
            "take": {n: self.take[n] for n in ("engine", "schedule", "formulation", "without")},
            "rows": rows,
            "refused": self.refused,
        }

    def lines(self) -> Iterator[str]:
        """Yield the table in at most `COLUMNS` letters: ``*`` marks ways that are not dominated."""
        zero = "proven best of the free schedule" if self.is_proven else "of the best plan known"
        yield from _wrapped(
            f"Regret: what the worst step ({self.worst}) takes, valued by {self.valued}, above "
            f"that {zero}. Gap: to the bound that a way proves in its own model. Error: of the "
            f"worst step that it promised. All ways had {seconds_text(self.limit)}."
        )
        yield f"{'':41}{'seconds':>9}{'regret':>10}{'gap':>10}{'error':>10}"
        for (engine, schedule), own in self.table.groupby(["engine", "schedule"], sort=False):
            yield f"{engine}, {NAMED[str(schedule)]}"
            without = own[~np.isfinite(own["regret"].to_numpy(float))]
            for at, row in own.drop(without.index).iterrows():
                mark = "*" if self.kept[self.table.index.get_loc(at)] else " "
                numbers = [percent(row[name]) for name in ("regret", "gap", "error")]
                late = f"  {CUT}" if row["status"] == CUT else ""
                yield (
                    f"{mark} {_short(row):39}{seconds_text(row['seconds']).removesuffix(' s'):>9}"
                    f"{''.join(f'{number:>10}' for number in numbers)}{late}"
                )
            for (status, why), rows in without.groupby(["status", "why"], sort=False):
                named = [_short(row) for _, row in rows.iterrows()]
                what = ", ".join(named) if len(named) < MANY else f"{len(named)} ways"
                yield from _wrapped(f"  {what}: {status}{f', {why}' if why else ''}")
        for name, why in self.refused.items():
            yield from _wrapped(f"{name}: {why}")


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, COLUMNS, subsequent_indent="    ", break_on_hyphens=False)


def _short(row: pd.Series[float]) -> str:
    return str(row["formulation"]) + (f", {row['without']}" if row["without"] else "")


def way_named(row: pd.Series[float]) -> str:
    """Return a way in words: ``compliance with cascade, no proof, on the loop``."""
    comma = "," if row["without"] else ""
    return f"{row['engine']} with {_short(row)}{comma} on {NAMED[str(row['schedule'])]}"


def percent(share: float) -> str:
    """Return a share as people write it.

    >>> percent(0.1837), percent(2e-7), percent(0.0), percent(float("inf"))
    ('18 %', '2e-05 %', '0', '-')
    """
    if not np.isfinite(share):
        return "-"
    number = f"{100 * share:,.0f}" if share >= 1 else f"{100 * share:.2g}"
    return f"{number} %" if share else "0"


def seconds_text(seconds: float) -> str:
    """Return a time in words, with three digits that count.

    >>> seconds_text(0.1014), seconds_text(26.04), seconds_text(512.2)
    ('0.101 s', '26.0 s', '512 s')
    """
    return f"{seconds:,.0f} s" if seconds >= 100 else f"{seconds:#.3g} s"
