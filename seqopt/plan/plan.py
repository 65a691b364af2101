"""The plan: a solved problem with its certificate and the time that it took."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any, NoReturn

import pandas as pd

from seqopt._registry import Later, display
from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine, OpeningEngine, Want
from seqopt.engines.registry import DEFAULT, provenance
from seqopt.graph.formulation import End, Finding, Formulation, FormulationKind, Run, Solution
from seqopt.graph.states import States
from seqopt.judge.certificate import TOLERANCE, Certificate, _known_gap
from seqopt.plan.build import ShownBuild
from seqopt.problem.criteria import Criterion
from seqopt.problem.problem import Problem
from seqopt.problem.requirements import (
    LIMIT_TOLERANCE,
    Excess,
    Filter,
    Limit,
    _said_limits,
    overloads,
)
from seqopt.responses._grip_sets import Moved
from seqopt.responses._tolerance import value_text, values_text
from seqopt.responses.table import (
    FAR_OFF,
    OUTSIDE,
    Departure,
    _Columns,
    _each_fields,
    _response_columns,
)
from seqopt.scene.scene import Order
from seqopt.sequence.steps import Site, Step, StepKind, idle_robots
from seqopt.stability.standing import Standing
from seqopt.work import Tell

PROOFS = Later("seqopt.judge._schedules")  # 20 ms
SPENT = Later("seqopt.plan._spent")  # where it is asked for
STEPS = Later("seqopt.stability._steps")  # where it is asked whether steps stand
ENDS = {"": End.DONE, "interrupt": End.INTERRUPTED}  # of searches over states


class Status(StrEnum):
    """Optimality status of a plan."""

    OPTIMAL = "optimal"  # proven
    OUTSIDE = "optimal in the linear model alone"  # or claimed so; it does not hold of the plan
    CLAIMED = "claimed optimal"  # the formulation says so; less is proven
    FEASIBLE = "feasible"  # it ended early, is a heuristic, or its bound leaves something open
    UNPROVEN = "unproven"  # no proof was asked for, or it was left out


class Given(ABC):
    """A problem that no scene has, such as an instance: it is solved, and shown, as it says."""

    title, among, scenarios, models = "", "", (), 0
    standing: Any = None
    begin: Any = None

    @abstractmethod
    def solved(self, named: Formulation | str | None, run: Run) -> Plan:
        """Return the plan that a formulation finds, by name or the usual one."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """The names of the goals."""

    @property
    @abstractmethod
    def alone_in_scene(self) -> NoReturn:
        """Raise a `ProblemError`, as it has no scene."""

    @abstractmethod
    def chosen_nodes(
        self, steps: Sequence[Step], states: Sequence[Sequence[int]]
    ) -> tuple[int, ...]:
        """Return the nodes of a path."""

    @abstractmethod
    def facts_of(self) -> dict[str, object]:
        """Return its properties for a summary, ready for JSON."""

    def in_display_units(self, values: Sequence[float]) -> dict[str, float]:
        """Return values of the first goals by their names."""
        return dict(zip(self.names, values, strict=False))

    def bounded(self, bounds: Sequence[Any]) -> Sequence[Any]:
        """Return the bounds of goals."""
        return bounds

    def settles(self, *, exact: bool) -> bool:
        """Return whether a judged plan is optimal though it has a gap: never."""
        return False


@dataclass(frozen=True, repr=False)
class Plan(ShownBuild):
    """A solved problem: every grip of a build, with objective values and bounds.

    Attributes
    ----------
    problem : Problem
        The problem; or the graph of choices, if that was given.
    graph : States or Given
        What was chosen from.
    formulation : Formulation
        The formulation that solved it.
    selection : Solution
        What was chosen, a candidate for every move or states, and what is claimed of it.
    certificate : Certificate or None
        The checked values; None without a proof.
    steps : tuple of Step
        The steps of the build, checked; none of costs that are given without steps.
    seconds : mapping of str to float
        By stage, s: assemble, compile (preparing a program for a solver), solve, verify.
    arms : seqopt.arms._kept.KeptPostures or None
        The postures of arms; None where no robot has one, or a graph was solved.
    moved : Moved or None
        How far steps move nodes over the limit of the linear range, in the worst scenario; None
        where a graph was solved.
    beyond : str
        Why it leaves the linear range although plans that keep it are preferred; empty otherwise.
    changes : mapping of str to object
        Of one of `seqopt.replan` what is other than planned; empty otherwise.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.optimize("arch25")
    Plan('arch25', 'three-robot', by overlap_dp: 90 steps, sum 657.465, optimal)
    >>> plan = seqopt.optimize("arch25", "free", aim="minmax,steps")
    >>> plan.status, plan.regrips
    (<Status.OPTIMAL: 'optimal'>, 0)
    """

    problem: Problem | States | Given
    graph: States | Given
    formulation: Formulation
    selection: Solution
    certificate: Certificate | None
    steps: tuple[Step, ...]
    seconds: Mapping[str, float] = field(compare=False, hash=False)
    arms: Any = None
    moved: Moved | None = None
    beyond: str = ""
    changes: Mapping[str, object] = field(default_factory=dict, compare=False, hash=False)

    def __repr__(self) -> str:
        what = f"{self.engine.network.scene.name!r}, {self.method!r}, " if self.steps else ""
        count = f"{len(self.steps)} steps" if self.steps else f"{len(self.nodes)} nodes"
        outside = f"{OUTSIDE}: " if self.outside else ""
        return f"Plan({outside}{what}by {self.formulation.name}: {count}, {self._value})"

    def replan(  # noqa: PLR0913  # every question is a word of its own
        self,
        at: int = 1,
        *,
        lost: Sequence[str] = (),
        missing: Sequence[int | str] = (),
        payload: Sequence[float | str] = (),
        grips: str | None = None,
        durations: Sequence[str] = (),
        robots: int | Sequence[str] | None = None,
        to: Site | int | str | None = None,
        measured: Path | str | None = None,
        criterion: Criterion | str | None = None,
        aim: str | None = None,
        limits: Sequence[Limit | Filter | str] | str = (),
        rules: Sequence[str] | str = (),
        stands: Standing | Mortar | str | None = None,
        formulation: str | None = None,
        engine: str = DEFAULT,
        mortar: Mortar | str | None = None,
        search: Any = None,
        progress: Tell | None = None,
    ) -> Plan:
        """Plan the rest after a change, as `seqopt.replan`: ``plan.replan(12, lost=["rob3"])``."""
        asked = {name: each for name, each in locals().items() if name != "self"}
        asked = {name: each for name, each in asked.items() if each is not None}
        found: Plan = display(Plan, "replan")(self, **asked)
        return found

    @property
    def is_far(self) -> bool:
        """Whether displacements are known to exceed the linear range."""
        return self.moved is not None and self.moved.share > 1 + LIMIT_TOLERANCE

    @property
    def outside(self) -> bool:
        """Whether steps exceed any limit of the linear range: then responses are not valid."""
        opens = self.moved is not None and isinstance(self.engine, OpeningEngine)
        return self.is_far or bool(self.steps and not opens and self.departures)

    @cached_property
    def departures(self) -> tuple[Departure, ...]:
        """The limits of the linear range that steps exceed, in the scene or in any scenario."""
        found = self._within.departures(self._columns)
        if self.moved is None or not self.is_far or any(d.what == FAR_OFF for d in found):
            return found
        text = f"{self.moved.share:.4g} times what the linear range allows, in a scenario"
        return (Departure(FAR_OFF, text, (self.moved.step,)), *found)

    @property
    def states(self) -> States:
        """The states and moves that it was chosen from; a `ProblemError` if these are costs."""
        return self.graph.alone_in_scene

    @property
    def engine(self) -> Engine:  # type: ignore[override]
        """The engine of the responses, for the scene in the order of the plan."""
        return self.states.engine

    @property
    def standing(self) -> Standing | None:  # type: ignore[override]
        """The demand that every state stands, if there was one."""
        return self.graph.standing

    @property
    def method(self) -> str:
        """The name of the schedule, or ``free``."""
        return self.states.method

    @property
    def title(self) -> str:  # type: ignore[override]
        """The name of the plan where it is shown next to others."""
        if self.order:
            return "best order"
        opens_grips = self.steps and self.states.rules.moves
        return self.formulation.name if opens_grips else self.graph.title or self.formulation.name

    @property
    def order(self) -> Order:
        """The names of all bricks in the optimized order; empty if the order was given."""
        return self.selection.order

    @property
    def goals(self) -> tuple[str, ...]:
        """Names of goals, the most important first, then of budgets."""
        return self.graph.names

    @property
    def objective(self) -> dict[str, float]:
        """The value of every goal by its name; of a tilt the critical one, in degrees."""
        if self.certificate is not None:
            return self.graph.in_display_units(self.certificate.values)
        claimed = self.selection.objective
        return self.graph.in_display_units(claimed) if isfinite(claimed[0]) else {}

    @property
    def bound(self) -> dict[str, float | None]:
        """The lower bound of every goal by its name, None where there is none.

        Of a search that stopped early it is the one that it claims.
        """
        proof, claimed = self.certificate, self.selection.bound
        bounds: tuple[float, ...] = () if proof is None else proof.bounds
        if proof is None and self.objective:  # of a search without models nothing is known
            bounds = claimed
        elif proof is not None and self.stopped and not isfinite(proof.gap):
            bounds = tuple(map(max, claimed, bounds))
        found = self.graph.in_display_units(self.graph.bounded(bounds))
        return {name: bound if isfinite(bound) else None for name, bound in found.items()}

    @property
    def gap(self) -> float | None:
        """Relative optimality gap that is proven; None without proof."""
        if self.certificate is None or not isfinite(self.certificate.gap):
            return None
        return _known_gap(self.certificate.gap)

    @property
    def ended(self) -> End:
        """How the formulation ended."""
        return ENDS.get(self.stopped, End.STOPPED)

    @property
    def stopped(self) -> str:
        """Why a search of states or orders ended early, as ``time``, ``memory`` or ``size``."""
        return self.selection.stopped

    @property
    def trace(self) -> tuple[Finding, ...]:
        """Incumbents and bounds over time; empty for states."""
        return self.selection.trace

    @property
    def status(self) -> Status:
        """Optimality status of the plan, among the candidates that were considered.

        A margin of stability is optimal within the gap, which ``result`` and the summary name.
        """
        proof, stopped = self.certificate, bool(self.stopped)
        if proof is None:
            return Status.FEASIBLE if stopped else Status.UNPROVEN
        exact = not stopped and self.formulation.kind is FormulationKind.EXACT
        settled = self.graph.settles(exact=exact) and isfinite(proof.gap)
        is_proven = settled or proof.gap <= TOLERANCE
        if not is_proven and not proof.claimed_gap <= TOLERANCE:
            return Status.FEASIBLE
        best = Status.OPTIMAL if is_proven else Status.CLAIMED
        return Status.OUTSIDE if self.is_far else best

    @property
    def result(self) -> str:  # type: ignore[override]
        """The objective of the plan, and what is proven about it, in words.

        It begins with a warning if steps exceed the linear range.
        """
        return f"{OUTSIDE}: {self._value}" if self.outside else self._value

    @property
    def _value(self) -> str:
        within = f" within {self.gap:.2g}" if self.gap else ""
        among = f", among these: {self.graph.among}" if self.graph.among else ""
        values = values_text(self.objective) or "not compared with the optimum"
        return f"{values}, {self.status}{within}{among}"

    @property
    def choice(self) -> tuple[int, ...]:
        """The number of the chosen candidate of every move; raises `ProblemError` without moves."""
        pairs = zip(self.states.rules.moves, self.nodes, strict=True)
        return tuple(move.candidates.index(node) for move, node in pairs)

    @property
    def nodes(self) -> tuple[int, ...]:
        """The node chosen for every move, or the nodes of a path through an instance."""
        return self.graph.chosen_nodes(self.steps, self.selection.states)

    @property
    def _begin(self) -> Site | None:  # type: ignore[override]
        return self.graph.begin

    @property
    def models(self) -> int:
        """How many different models were solved."""
        return self.graph.models + self.selection.effort[1]

    @property
    def regrips(self) -> int:
        """Number of grips taken besides those that place a brick."""
        return sum(step.kind is StepKind.REPOSITION for step in self.steps)

    @cached_property
    def overloads(self) -> tuple[Excess, ...]:
        """The payloads that steps exceed, also without a limit on payloads."""
        return overloads(self.engine.network.scene, self._columns)

    @cached_property
    def _columns(self) -> _Columns:
        # of all fields, which what steps leave is judged by too
        fields = _each_fields(self.engine, self.steps, Want.ALL)
        answers = ((s, self._within.seen(s, f)) for s, f in zip(self.steps, fields, strict=True))
        columns = _response_columns(self.engine.network, answers)
        rules = self.states.rules
        own = {s.number: ";".join(rules.moves[m].robot for m in s.moves) for s in rules.steps}
        if own:  # whose grips were open
            columns["optimized_robot"] = [own.get(step.number, nan) for step in self.steps]
        return columns

    def stability(self, mortar: Mortar | str | None = None) -> pd.DataFrame:
        """Return whether every step stands and by which margins, by the cone program.

        ``mortar``: of all joints; by default that which was demanded, or dry. Result: as of
        `seqopt.stability._steps.stability_table`.
        """
        if mortar is None and self.standing is not None:
            results = PROOFS.certified(self.states, self.steps)
            table: pd.DataFrame = STEPS.stability_table(self.steps, results)
            return table
        return super().stability("dry" if mortar is None else mortar)

    def summary(self) -> dict[str, object]:
        """Return the summary of the plan, ready for JSON; its keys are the same for all plans.

        Result: names of scene, schedule, formulation and criterion, ``aims``; ``candidates``, all
        or a choice of them; ``status``; by aim ``objective``, ``bound`` and ``bound_rests_on``
        (rebuilt, given or claimed); then the ``gap`` and the ``claimed_gap``; of every one of the
        ``budgets`` what is there, spent, and what one more unit would save; ``limits``, ``rules``,
        ``scenarios``, what ``stands``; how it ``ended`` and what ``stopped`` it; ``steps``,
        ``steps_before_release`` without those that let all go at the end, ``regrips``, ``makespan``
        (s, if it is known how long robots take), ``idle_robots``, which never grip; limits of the
        linear range that are left, which model was ``enough``, what is known of ``arms``, and
        payloads that are exceeded; what was ``spent``, ``seconds``; of an order that was sought
        ``order``, ``orders`` (among which) and ``order_evaluated``; the ``engine`` and
        ``versions``.
        """
        named = {"formulation": self.formulation.name, "kind": self.formulation.kind.value}
        if not self.steps:  # a path through an instance, or given costs
            known = self.graph.facts_of() if isinstance(self.graph, Given) else {}
            spent = dict(getattr(self.certificate, "spent", {}))
            whole = {**named, **known, **self._answer(), "budgets": spent}
            return whole | {"nodes_of_path": [*self.nodes], "seconds": dict(self.seconds)}
        graph, scene = self.states, self.engine.network.scene
        asked = self.problem if isinstance(self.problem, Problem) else graph
        of_order: dict[str, object] = {}
        if self.order:
            sought = self.problem.orders.value  # type: ignore[union-attr]  # one was
            evaluated = self.selection.effort[0]
            of_order = {"order": [*self.order], "orders": sought, "order_evaluated": evaluated}
        return {
            "scene": scene.name,
            "schedule": self.method,
            **named,
            **graph.described(_said_limits(asked.limits)),
            "candidates": f"heuristic: {graph.among}" if graph.among else "all",
            **self._answer(),
            "budgets": graph.spent(self.objective, self.selection),
            "steps": len(self.steps),
            "steps_before_release": len(self.steps) - graph.rules.letting_go(scene, self.steps),
            "regrips": self.regrips,
            "makespan": self.makespan,
            "idle_robots": list(idle_robots(scene, self.steps)),
            "outside_linear_range": [str(departure) for departure in self.departures],
            "enough": self.enough.facts(),
            **({} if self.arms is None else self.arms.described()),
            "payload_exceeded": [str(excess) for excess in self.overloads],
            "spent": self.spent,
            **of_order,
            "seconds": dict(self.seconds),
            **provenance(self.engine),
        }

    @property
    def spent(self) -> dict[str, dict[str, Any]]:
        """What was computed to choose and prove, beside what had to be: `seqopt.plan._spent`."""
        proof = None if self.gap is None else self.certificate
        spent: dict[str, dict[str, Any]] = SPENT.spent_on(
            self.states, self.steps, self.models, proof
        )
        return spent

    def _answer(self) -> dict[str, object]:
        """Return the entries of a summary about values and what is proven of them."""
        proof = self.certificate
        rests_on = () if proof is None else self.graph.bounded(proof.rests_on)
        narrowed = self.graph.among and "optimal" in self.status
        left = None if proof is None or proof.claimed_gap == inf else _known_gap(proof.claimed_gap)
        return {
            "status": f"{self.status} among these" if narrowed else str(self.status),
            "ended": self.ended.value,
            "stopped": self.stopped,
            "objective": self.objective,
            "bound": self.bound,
            "bound_rests_on": dict(zip(self.goals, map(str, rests_on), strict=False)),
            "gap": self.gap,
            "claimed_gap": left,
        }

    @property
    def order_bound_said(self) -> str:
        """The lower bound over all orders in words, and whether it is proven."""
        proof, goal, claimed = self.certificate, self.states.goals[0], " (claimed, not proven)"
        bound = self.selection.bound[0]
        if proof is not None and isfinite(proof.bounds[0]):
            bound, claimed = proof.bounds[0], ""
        if not isfinite(bound):
            return "others are not looked at yet"
        above = "below" if goal.show is None else "above"  # of a tolerance or tilt more is better
        return f"no order {above} {value_text(goal.name, goal.shown(bound))}{claimed}"
