"""The steps of a schedule in which no grip is open: they are the same whatever is chosen."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import pandas as pd

from seqopt.arrays import Terse
from seqopt.engines.interface import Engine
from seqopt.responses._tolerance import is_tolerance, with_tolerances
from seqopt.responses.table import analyze
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import Grips, Step


@dataclass(frozen=True, repr=False)
class GivenSteps(Terse):
    """Steps without an open grip, in which bricks stand; their responses are computed once."""

    engine: Engine
    schedule: Schedule

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """The steps, in order."""
        some = (step for step in self.schedule.steps if not step.moves and step.bricks)
        return tuple(Step(s.number, s.kind, s.bricks, cast(Grips, s.grips)) for s in some)

    @cached_property
    def _table(self) -> pd.DataFrame:
        return analyze(self.engine, self.steps)

    def table(self, names: Iterable[str] = ()) -> pd.DataFrame:
        """Return their table of `seqopt.analyze`, with the tolerances among some responses."""
        table = self._table
        for name in {*filter(is_tolerance, names)}:
            table = with_tolerances(self.engine, self.steps, table, name)
        return table
