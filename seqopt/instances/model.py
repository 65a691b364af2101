"""An instance: the compiled graph of a problem, with all that is asked of paths through it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, NoReturn

import numpy as np

from seqopt._registry import Shown, offered
from seqopt.arrays import Bools, Floats, FrozenValue, Ints
from seqopt.errors import ProblemError
from seqopt.graph.formulation import Formulation, Run, as_formulation, formulations
from seqopt.graph.graph import PEAK, TAIL, TIME, Graph, Rows, _Target
from seqopt.plan.plan import Given, Plan
from seqopt.problem.problem import Aim
from seqopt.sequence.steps import Step
from seqopt.times._graph import TimedGraph


class _Cap(NamedTuple):
    """What the sum of a column may be at most; of no column, when the last act may end."""

    name: str
    column: int | None
    most: float


@dataclass(frozen=True, eq=False, repr=False)
class Instance(FrozenValue, Given, Shown):
    """A graph with amounts of its arcs, goals and caps of paths through it; no scene is needed.

    A path leads from node 0 to one of the ends. Goals are minimized one after the other: of the
    paths that are best in the first, the best in the second, and so on.

    Attributes
    ----------
    name : str
        What it is called.
    source, target : (m,) int
        The nodes that every arc leads from and to; arcs are sorted by these.
    ends : (n,) bool
        At which nodes a path may end.
    columns : tuple of str
        What arcs take, by name.
    amounts : (m, c) float
        How much they take, a column for every name.
    goals, caps : tuple
        What is minimized, and which sums are capped.
    states : (n, s) int
        What nodes stand for; the first column is the level: no arc leads to a lower one.
    timed : TimedGraph or None
        Who may act on every arc and for how long, where times are asked.
    alone : (m, 2) float or None
        What a search of one move alone is charged, as of `seqopt.graph.graph.Graph`.
    facts : mapping
        Where it comes from: the command that made it, and the version.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.compile_instance(seqopt.optimize("arch25").problem)
    <Instance 'arch25': 493 nodes, 12453 arcs, sum>
    """

    name: str
    source: Rows
    target: Rows
    ends: Bools
    columns: tuple[str, ...]
    amounts: Floats
    goals: tuple[_Target, ...]
    caps: tuple[_Cap, ...] = ()
    states: Ints = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    timed: TimedGraph | None = field(default=None, compare=False)
    alone: Floats | None = None
    facts: Mapping[str, Any] = field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        if not self.goals:
            raise ProblemError(f"instance {self.name}: nothing is to be minimized; name a goal")
        for name in ("source", "target"):
            rows = np.ascontiguousarray(getattr(self, name), dtype=np.int32)
            if len(rows) and not (rows.min() >= 0 and rows.max() < self.nodes):
                raise ProblemError(f"instance {self.name}: an arc names a node that does not exist")
            object.__setattr__(self, name, rows)
        codes = self.source.astype(np.int64) * self.nodes + self.target
        if (np.diff(codes) < 0).any():
            raise ProblemError(f"instance {self.name}: sort its arcs by source, then target")
        if self.asks_time and self.timed is None:
            raise ProblemError(f"instance {self.name}: a time is asked, and no durations are given")
        super().__post_init__()
        _ = self.graph  # says what is wrong with amounts

    def __repr__(self) -> str:
        asked = ", ".join([goal.name for goal in self.goals])
        capped = "".join(f", {cap.name} <= {cap.most:g}" for cap in self.caps)
        return f"<Instance {self.name!r}: {self.nodes} nodes, {self.arcs} arcs, {asked}{capped}>"

    @property
    def alone_in_scene(self) -> NoReturn:
        """Nothing: an instance has no scene; a `ProblemError` says so."""
        raise ProblemError(f"instance {self.name}: it is costs alone; no scene, no steps")

    def solved(self, named: Formulation | str | None, run: Run) -> Plan:
        """Return the path that a formulation finds, judged, as a plan.

        A `ProblemError` says which fit if it does not.
        """
        names = self.fitting
        found = as_formulation(named or names[0])
        if found.name not in names and found.name in formulations():
            raise ProblemError(
                f"{found.name}: instance {self.name} does not fit; use {' or '.join(names)}"
            )
        return Plan(self, self, found, *offered("find_path")(self, found, run))

    @property
    def fitting(self) -> tuple[str, ...]:
        """The names of formulations that fit, the default first."""
        every, kinds = formulations(), [goal.kind for goal in self.goals]
        question = "time" if self.asks_time else "tail" if kinds == [TAIL] else "goals"
        found = [n for n, f in every.items() if f.fits(question, "instance")]
        if kinds[0] != PEAK:
            found = [name for name in found if every[name].aim is not Aim.PEAK]
        if self.caps:
            found = [name for name in found if every[name].takes_budgets]
        usual = ("makespan_labels", "labels" if self.caps else "overlap_dp", "schedule_search")
        first = next(name for name in usual if name in found)
        return (first, *(name for name in found if name != first))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the goals."""
        return tuple(goal.name for goal in self.goals)

    def chosen_nodes(
        self, steps: Sequence[Step], states: Sequence[Sequence[int]]
    ) -> tuple[int, ...]:
        """Return the nodes of a path."""
        return tuple(state[-1] for state in states)

    @property
    def nodes(self) -> int:
        """How many nodes there are."""
        return len(self.ends)

    @property
    def arcs(self) -> int:
        """How many arcs there are."""
        return len(self.source)

    @property
    def levels(self) -> Ints:
        """The level of every node, (n,): no arc leads to a lower one."""
        return self.states[:, 0]

    @cached_property
    def graph(self) -> Graph:
        """Its graph, with all columns as amounts."""
        peaks = {c for goal in self.goals if goal.kind == PEAK for c in goal.columns}
        kinds = tuple(c in peaks for c in range(len(self.columns)))
        return Graph(self.source, self.target, self.amounts, kinds, self.ends)

    @cached_property
    def asked(self) -> Graph:
        """Its graph with the columns of goals, then those with caps, in order."""
        graph, goals = self.graph, [c for goal in self.goals for c in goal.columns]
        columns = [*goals, *(cap.column for cap in self.caps if cap.column is not None)]
        caps = tuple(cap.most for cap in self.caps if cap.column is not None)
        peaks = tuple(graph.peaks[c] for c in columns)
        rows = graph.source, graph.target, graph.amounts[:, columns]
        return Graph(*rows, peaks, graph.ends, caps, self.alone)

    @property
    def asks_time(self) -> bool:
        """Whether it counts when acts end."""
        kinds = [goal.kind == TIME for goal in self.goals]
        return any(kinds) or any(cap.column is None for cap in self.caps)

    @cached_property
    def is_layered(self) -> bool:
        """Whether every path has a node on every level, as where open grips are chosen."""
        levels, last = self.levels, int(self.levels.max(initial=0))
        steps = bool((levels[self.target] == levels[self.source] + 1).all())
        steps &= bool((np.diff(levels) >= 0).all())  # candidates are counted level by level
        alone = int((levels == 0).sum()) == 1 and last > 0
        return steps and alone and bool((self.ends == (levels == last)).all())

    def facts_of(self) -> dict[str, object]:
        """Return its properties for a summary, ready for JSON."""
        return {
            "instance": self.name,
            "nodes": self.nodes,
            "arcs": self.arcs,
            "aims": [goal.name for goal in self.goals],
            "caps": {cap.name: cap.most for cap in self.caps},
            "made_by": self.facts.get("made_by", ""),
        }


def _by_goal(graph: Graph, asked: tuple[tuple[_Target, ...], tuple[_Cap, ...]]) -> Graph:
    """Return a graph with one column for every goal and cap, nothing where a time is asked."""
    goals, caps = asked
    columns = [g.columns[0] if g.columns else None for g in goals] + [cap.column for cap in caps]
    none = np.zeros(len(graph.source))
    taken = np.column_stack([none if c is None else graph.amounts[:, c] for c in columns])
    peaks = tuple(goal.kind == PEAK for goal in goals) + (False,) * len(caps)
    return Graph(graph.source, graph.target, taken, peaks, graph.ends)
