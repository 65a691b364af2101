"""The plan: a solved problem with its certificate and the time that it took."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from math import isfinite, isinf

import pandas as pd

from seqopt.contact.mortar import Mortar
from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.layers import Layers
from seqopt.graph.orders.orders import AllOrders, OrderSelection
from seqopt.graph.scenarios.scenarios import ScenarioLayers
from seqopt.graph.states.states import States
from seqopt.plan.build import ShownBuild
from seqopt.plan.calling.formulation import End, Formulation, FormulationKind, Reads, Selection
from seqopt.plan.calling.schedule_selection import StatePath
from seqopt.plan.calling.watch import Finding
from seqopt.plan.judge.certificate import TOLERANCE, Certificate
from seqopt.plan.judge.standing_proof import certified
from seqopt.plan.search.window_search import WindowSearch
from seqopt.plan.summary import summarized
from seqopt.plan.tables import alternatives, chosen_table, split_objectives
from seqopt.problem.aims import Aim
from seqopt.problem.overloads import Excess, overloads
from seqopt.problem.problem import Problem
from seqopt.responses.choices import window_models
from seqopt.responses.table import analyze
from seqopt.sequence.steps import Step, StepKind
from seqopt.stability.assessment import stability_table

ENDS = {"": End.DONE, "interrupt": End.INTERRUPTED}  # of searches over states


class Status(StrEnum):
    """What is known of a plan."""

    OPTIMAL = "optimal"  # proven
    CLAIMED = "claimed optimal"  # the formulation says so; less is proven
    FEASIBLE = "feasible"  # it ended early, is a heuristic, or its bound leaves something open
    UNPROVEN = "unproven"  # no proof was asked for


@dataclass(frozen=True, repr=False)
class FoundOrder:
    """The build order of a plan, and what is known of all others.

    ``problem``: among which orders it was sought; ``selection``: what the formulation claims;
    ``proven``: whether it is proven that no order stays below the bound; else it is claimed.
    """

    problem: AllOrders
    selection: OrderSelection
    proven: bool

    def __repr__(self) -> str:
        return f"<FoundOrder of {len(self.selection.order)} bricks: {self.bound_said}>"

    @property
    def gap(self) -> float:
        """What the bound leaves open, over the value."""
        value = self.selection.objective
        return max(0.0, value - self.selection.bound) / max(abs(value), TOLERANCE)

    @property
    def status(self) -> Status:
        """What is known of the order: whether none is better."""
        if self.gap > TOLERANCE:
            return Status.FEASIBLE
        return Status.OPTIMAL if self.proven else Status.CLAIMED

    @property
    def bound_said(self) -> str:
        """What no order stays below, and whether that is proven, in words."""
        if not isfinite(self.selection.bound):
            return "others are not looked at yet"
        claimed = "" if self.proven else " (claimed, not proven)"
        return f"no order below {self.selection.bound:.6g}{claimed}"


@dataclass(frozen=True, repr=False)
class Plan(ShownBuild):
    """A solved problem: every grip of a build, and how good that is.

    Attributes
    ----------
    problem : Problem or PlacementProblem
        What was asked; or the graph of choices, where that was given.
    graph : Layers, ScenarioLayers, States or PlacementProblem
        What was chosen from.
    formulation : Formulation
        The formulation that solved it.
    selection : Selection or StatePath
        What was chosen, a candidate for every move or states, and what is claimed of it.
    certificate : Certificate or None
        The checked values; None without a proof.
    steps : tuple of Step
        The steps of the build, checked; none of costs that are given without steps.
    seconds : mapping of str to float
        By stage, s: respond, rank, compile (preparing a program for a solver), solve, verify.
    search : WindowSearch or None
        The models solved by a search without proof; None if all were solved.
    looked_at : int or None
        How many models a lazy search solved; None if all were solved.
    order : FoundOrder or None
        The build order, where it was sought.

    Examples
    --------
    >>> import seqopt
    >>> seqopt.optimize("arch25")
    Plan('arch25', 'three-robot', by overlap_dp: 90 steps, objective 657.465, gap 0 %)
    >>> plan = seqopt.optimize("arch25", "free", aim="minmax,steps")
    >>> plan.status, plan.regrips
    (<Status.OPTIMAL: 'optimal'>, 0)
    """

    problem: Problem | PlacementProblem | States | AllOrders
    graph: PlacementProblem | States
    formulation: Formulation
    selection: Selection | StatePath
    certificate: Certificate | None
    steps: tuple[Step, ...]
    seconds: Mapping[str, float] = field(compare=False, hash=False)
    search: WindowSearch | None = None
    looked_at: int | None = None
    order: FoundOrder | None = None

    def __repr__(self) -> str:
        what = f"{self.scene_name!r}, {self.method!r}, " if self.steps else ""
        return f"Plan({what}by {self.formulation.name}: {len(self.steps)} steps, {self.worth})"

    @property
    def layers(self) -> Layers:
        """The layers of candidates that it was chosen from; a `ProblemError` says if none were."""
        graph = self.graph
        if isinstance(graph, ScenarioLayers):
            return graph.nominal
        if not isinstance(graph, Layers):
            why = "it was chosen from states of the build, which have no candidates"
            if not isinstance(graph, States):
                why = "the problem is given by its costs alone; pose it with a schedule"
            raise ProblemError(f"the plan has no moves to show: {why}")
        return graph

    @property
    def states(self) -> States:
        """The states that it was chosen from; a `ProblemError` says if there were none."""
        if not isinstance(self.graph, States):
            raise ProblemError("the plan was chosen from candidates, not from states of the build")
        return self.graph

    @property
    def engine(self) -> Engine:
        """What computes the responses, of the scene in the order of the plan."""
        return self.graph.engine if isinstance(self.graph, States) else self.layers.engine

    @property
    def scene_name(self) -> str:
        """The name of the scene."""
        return self.engine.network.scene.name

    @property
    def method(self) -> str:
        """The name of the schedule, or ``free``."""
        if isinstance(self.graph, States):
            return self.graph.method
        return self.layers.schedule.method

    @property
    def title(self) -> str:
        """The name of the plan where it is shown next to others."""
        if self.order is not None:
            return "best order"
        if isinstance(self.graph, ScenarioLayers):
            return str(self.graph.aim)
        return self.graph.title if isinstance(self.graph, States) else self.formulation.name

    @property
    def goals(self) -> tuple[str, ...]:
        """The names of what was made small, the most important first, then of what has budgets."""
        if isinstance(self.graph, States):
            return tuple(map(str, self.graph.goals))
        if isinstance(self.graph, ScenarioLayers):
            return (str(self.graph.aim),)
        return ("minmax" if self.formulation.aim is Aim.PEAK else "sum",)

    @property
    def objective(self) -> dict[str, float]:
        """The value of every goal by its name; of a tilt, what is survived, in degrees."""
        if isinstance(self.graph, States):
            pairs = zip(self.graph.goals, self.selection.objective, strict=True)  # type: ignore[arg-type]
            return {str(goal): goal.shown(value) for goal, value in pairs}
        if self.certificate is None:
            return {}
        return dict(zip(self.goals, self.certificate.values, strict=True))

    @property
    def gap(self) -> float | None:
        """What is proven to be left between value and bound, over the value; None without proof."""
        early = isinstance(self.selection, StatePath) and self.selection.stopped
        return None if self.certificate is None or early else self.certificate.gap

    @property
    def ended(self) -> End:
        """How the formulation ended."""
        if isinstance(self.selection, StatePath):
            return ENDS.get(self.stopped, End.STOPPED)
        return self.selection.end

    @property
    def stopped(self) -> str:
        """Why a search of states or orders ended early: ``time``, ``memory``, ``size``, say."""
        if self.order is not None and self.order.selection.stopped:
            return self.order.selection.stopped
        return self.selection.stopped if isinstance(self.selection, StatePath) else ""

    @property
    def trace(self) -> tuple[Finding, ...]:
        """What the formulation knew at which time; of states nothing."""
        return () if isinstance(self.selection, StatePath) else self.selection.trace

    @property
    def among(self) -> str:
        """Which candidates alone were looked at, in words; empty for all."""
        if isinstance(self.graph, States):
            return self.graph.among
        return self.layers.schedule.left_out

    @property
    def status(self) -> Status:
        """What is known of the plan, among the candidates that were looked at.

        A margin of stability is optimal within the gap, which ``worth`` and the summary name.
        """
        proof = self.certificate
        if self.order is not None and self.order.status is not Status.OPTIMAL:
            return self.order.status
        if isinstance(self.selection, StatePath) and self.selection.stopped:
            return Status.FEASIBLE
        if proof is None:
            return Status.UNPROVEN
        if isinstance(self.graph, States):
            exact = self.formulation.kind is not FormulationKind.HEURISTIC
            if exact and not self.graph.budgets:
                return Status.OPTIMAL
        if proof.gap <= TOLERANCE:
            return Status.OPTIMAL
        return Status.CLAIMED if proof.claimed_gap <= TOLERANCE else Status.FEASIBLE

    @property
    def worth(self) -> str:
        """The value of the plan, and what is proven about it, in words."""
        if isinstance(self.graph, States):
            values = ", ".join(f"{name} {value:.6g}" for name, value in self.objective.items())
            left_open = 0.0 if self.certificate is None else self.certificate.gap
            within = left_open > TOLERANCE and not isinf(left_open)
            left = f" within {left_open:.2g}" if within else ""
            among = f" among candidates {self.among}" if self.among else ""
            return f"{values}, {self.status}{left}{among}"
        if self.certificate is None:
            return "not compared with the optimum"
        among = self.among if isinstance(self.graph, Layers | ScenarioLayers) else ""
        gap = f"heuristic: {among}" if among else f"gap {100 * self.certificate.gap:.3g} %"
        return f"objective {self.certificate.objective:.6g}, {gap}"

    @property
    def choice(self) -> tuple[int, ...]:
        """The candidate chosen for every move; a `ProblemError` says if states were chosen."""
        if isinstance(self.selection, StatePath):
            raise ProblemError("states were chosen, not candidates of moves; take its steps")
        return self.selection.choice

    @property
    def nodes(self) -> tuple[int, ...]:
        """The node chosen for every move."""
        choice = self.choice
        assert not isinstance(self.graph, States)  # it has no choice
        return self.graph.nodes(choice)

    @property
    def explored(self) -> tuple[Layers, ...]:
        """The layers whose responses were computed: the whole, or what a search needed."""
        return (self.layers,) if self.search is None else self.search.explored

    @property
    def models(self) -> int:
        """How many different models were solved."""
        if isinstance(self.graph, States):
            return self.graph.models
        if isinstance(self.graph, ScenarioLayers):
            return sum(costs.models for costs in self.graph.costs)
        if self.looked_at is not None:
            return self.looked_at
        return self.layers.evaluation.models if self.search is None else self._window_models

    @property
    def models_needed(self) -> int:
        """How many different models the formulation looks at: fewer where it asks for windows."""
        return self._window_models if self.formulation.reads is Reads.WINDOW else self.models

    @property
    def _window_models(self) -> int:
        return window_models(self.layers.schedule, self.choice)

    @property
    def regrips(self) -> int:
        """How many grips are taken beside those that place a brick."""
        return sum(step.kind is StepKind.REPOSITION for step in self.steps)

    @cached_property
    def overloads(self) -> tuple[Excess, ...]:
        """The payloads that steps exceed, whether or not a limit was asked for."""
        return overloads(self.engine.network.scene, self._responses)

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step; of a schedule with the robots that were chosen for.

        Result: a row per step; the columns of `seqopt.analyze`, of candidates ``optimized_robot``.
        Raises `ProblemError` if the problem is given by its costs alone; so do the tables below.
        """
        return self._responses.copy()

    @cached_property
    def _responses(self) -> pd.DataFrame:
        table = analyze(self.engine, self.steps)
        if not isinstance(self.graph, States):
            schedule = self.layers.schedule
            open_at = {step.number: step.moves for step in schedule.steps}
            table["optimized_robot"] = [
                ";".join(schedule.moves[m].robot for m in open_at[number])
                for number in table["step"]
            ]
        return table

    def table(self) -> pd.DataFrame:
        """Return what was chosen: every move with what it costs, or every grip where states were.

        Result: a row per move: ``move``, ``step``, ``to_step`` (the last in which the node is
        held), ``bricks``, ``robot``, ``brick``, ``node``, ``largest_force_N``, ``candidates`` (how
        many there were); then ``single_cost``, ``shared_cost`` and ``rank_in_window``, or without
        proof ``cost`` and the ``margin`` to the next candidate. Of states as of `grips`.
        """
        return self.grips() if isinstance(self.graph, States) else chosen_table(self)

    def alternatives(self) -> pd.DataFrame:
        """Return the responses and the cost of every choice that was evaluated.

        Result: a row per choice, by step; ``second_node`` where two moves are open. SI units. Where
        the responses of all choices are not kept, those that go with the plan's choices before.
        """
        return alternatives(self.layers, self.choice, self.search)

    def objectives(self) -> dict[str, dict[str, float | None] | None]:
        """Return the sum of ranks under both objectives, and the two parts of a heuristic's gap.

        Result: ``objectives`` as of `seqopt.graph.layers.objectives.under_both`; ``gap_parts`` with
        ``short_sight`` and ``objective``, as of `split_gap`, for heuristics. None where there is no
        proof, or no ranks.
        """
        return split_objectives(self)

    def stability(self, mortar: Mortar | str | None = None) -> pd.DataFrame:
        """Return whether every step stands and by which margins, by the cone program.

        ``mortar``: of all joints; by default that which was demanded, or dry. Result: as of
        `seqopt.stability.assessment.stability_table`.
        """
        if mortar is None and isinstance(self.graph, States):
            return stability_table(self.steps, certified(self.graph, self.steps))
        return super().stability("dry" if mortar is None else mortar)

    def summary(self) -> dict[str, object]:
        """Return the summary of the plan, ready for JSON; its keys are the same for all plans.

        Result: names of scene, schedule, formulation and criterion, ``aims``; ``candidates``, all
        or a choice of them; ``status``; by aim ``objective`` and ``bound``, then the ``gap`` and
        the ``claimed_gap``; of every one of the ``budgets`` what is there, spent, and what one more
        unit would save; ``limits``, ``rules``, ``scenarios``, what ``stands``; how it ``ended`` and
        what ``stopped`` it; ``steps``, ``steps_before_release`` without those that let all go at
        the end, ``regrips``, ``idle_robots``, which never grip; limits of the linear range that are
        left and payloads that are exceeded; ``models_evaluated``, ``states_in_proof``, ``seconds``;
        of criteria of ranks the sums under both ``objectives`` and of heuristics ``gap_parts``; of
        an order that was sought ``order``, ``orders`` (among which), ``order_status``,
        ``order_bound`` (on the first aim, of any order), ``order_bound_proven``,
        ``order_evaluated`` and ``order_stopped``; the ``engine`` and ``versions``.
        """
        return summarized(self)
