"""The plan: a solved problem with its certificate and the time that it took."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.engines.registry import provenance
from seqopt.errors import ProblemError
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.layers.layers import Layers
from seqopt.graph.layers.objectives import split_gap, under_both
from seqopt.graph.layers.ranking import move_costs, rank_of
from seqopt.plan.build import ShownBuild
from seqopt.plan.calling.formulation import (
    Formulation,
    FormulationKind,
    Reads,
    Selection,
)
from seqopt.plan.judge.certificate import TOLERANCE, Certificate
from seqopt.plan.search.window_search import WindowSearch
from seqopt.plan.tables import alternatives, moves_table
from seqopt.problem.overloads import Excess, overloads
from seqopt.responses.choices import window_models
from seqopt.responses.table import analyze
from seqopt.sequence.steps import Step, idle_robots


@dataclass(frozen=True, repr=False)
class Plan(ShownBuild):
    """A solved problem: where every robot holds over the whole build, and how good that is.

    Attributes
    ----------
    problem : PlacementProblem
        The problem that was solved.
    formulation : Formulation
        The formulation that solved it.
    selection : Selection
        The choice, and what the formulation claims about it.
    certificate : Certificate or None
        The checked value of the choice; None without a proof.
    steps : tuple of Step
        The schedule with every move at its chosen node, checked.
    seconds : mapping of str to float
        By stage, s: respond, rank, compile (preparing a program for a solver), solve, verify.
    search : WindowSearch or None
        The models solved by a search without proof; None if all were solved.
    looked_at : int or None
        How many models a lazy search solved; None if all were solved.

    Examples
    --------
    >>> import seqopt
    >>> plan = seqopt.optimize(seqopt.load_scene("arch25"))
    >>> plan
    Plan('arch25', 'three-robot', by overlap_dp: 90 steps, 22 moves, objective 657.465, gap 0 %)
    >>> plan.nodes[:5]
    (4, 2, 6, 4, 6)
    """

    problem: PlacementProblem
    formulation: Formulation
    selection: Selection
    certificate: Certificate | None
    steps: tuple[Step, ...]
    seconds: Mapping[str, float] = field(compare=False, hash=False)
    search: WindowSearch | None = None
    looked_at: int | None = None

    def __repr__(self) -> str:
        counts = f"{len(self.steps)} steps, {len(self.selection.choice)} moves"
        proof = "without proof"
        if self.certificate is not None:
            gap = 100 * self.certificate.gap
            proof = f"objective {self.certificate.objective:.6g}, gap {gap:.3g} %"
        what = ""
        if isinstance(self.problem, Layers):
            schedule = self.problem.schedule
            what = f"{schedule.scene.name!r}, {schedule.method!r}, "
        return f"Plan({what}by {self.formulation.name}: {counts}, {proof})"

    @property
    def engine(self) -> Engine:
        """What computes the responses."""
        return self._posed.engine

    @property
    def title(self) -> str:
        """The name of the formulation that found it."""
        return self.formulation.name

    @property
    def worth(self) -> str:
        """The value of the plan, and what is proven about it, in words."""
        if self.certificate is None:
            return "not compared with the optimum"
        value, left_out = self.certificate.objective, self._posed.schedule.left_out
        gap = f"heuristic: {left_out}" if left_out else f"gap {100 * self.certificate.gap:.3g} %"
        return f"objective {value:.6g}, {gap}"

    @property
    def nodes(self) -> tuple[int, ...]:
        """The node chosen for every move."""
        return self.problem.nodes(self.selection.choice)

    @property
    def explored(self) -> tuple[Layers, ...]:
        """The problems whose responses were computed: the whole, or what a search needed."""
        return (self._posed,) if self.search is None else self.search.explored

    @property
    def models(self) -> int:
        """How many different models were solved."""
        if self.looked_at is not None:
            return self.looked_at
        return self._posed.evaluation.models if self.search is None else self._window_models

    @property
    def models_needed(self) -> int:
        """How many different models the formulation looks at: fewer where it asks for windows."""
        return self._window_models if self.formulation.reads is Reads.WINDOW else self.models

    @property
    def _window_models(self) -> int:
        return window_models(self._posed.schedule, self.selection.choice)

    @property
    def _posed(self) -> Layers:
        if not isinstance(self.problem, Layers):
            raise ProblemError(
                "the problem is given by its costs alone and has no steps; pose it with a schedule"
            )
        return self.problem

    @cached_property
    def overloads(self) -> tuple[Excess, ...]:
        """The payloads that steps of the plan exceed, whether or not a limit was asked for."""
        return overloads(self._posed.schedule.scene, self._responses)

    def responses(self) -> pd.DataFrame:
        """Return the responses of every step and the robots whose grips were chosen in it.

        Result: a row per step; the columns of `seqopt.analyze`, and ``optimized_robot``. Raises
        `ProblemError` if the problem is given by its costs alone; so do the tables below.
        """
        return self._responses.copy()

    @cached_property
    def _responses(self) -> pd.DataFrame:
        schedule = self._posed.schedule
        table = analyze(self._posed.engine, self.steps)
        open_at = {step.number: step.moves for step in schedule.steps}
        table["optimized_robot"] = [
            ";".join(schedule.moves[m].robot for m in open_at[number]) for number in table["step"]
        ]
        return table

    def table(self) -> pd.DataFrame:
        """Return what was chosen for every move, what it costs and how it ranks.

        Result: a row per move. Columns: ``move``, ``step``, ``to_step`` (the last in which the node
        is held), ``bricks``, ``robot``, ``brick``, ``node``, ``largest_force_N``, ``candidates``
        (how many there were); then ``single_cost``, ``shared_cost`` and ``rank_in_window``, or
        without proof ``cost`` and the ``margin`` to the next candidate.
        """
        chosen = moves_table(self._posed, self.selection.choice, self.grips())
        worth = pd.DataFrame([*self._worths()])
        return pd.concat([chosen, worth], axis=1)

    def _worths(self) -> Iterator[dict[str, float]]:
        """Yield the cells of the table that say what the choice of every move is worth."""
        choice = self.selection.choice
        for k, (before, now) in enumerate(pairwise((0, *choice))):
            if self.search is not None:
                costs = self.search.costs(k)
                margin = np.delete(costs, now).min(initial=np.inf) - costs[now]
                yield {"cost": costs[now], "margin": margin}
                continue
            layered = self.formulation.aim.costs(self.problem)
            yield {
                "single_cost": layered.single[k][now],
                "shared_cost": layered.shared[k][before, now],
                "rank_in_window": rank_of(move_costs(self._posed, k, before), now),
            }

    def alternatives(self) -> pd.DataFrame:
        """Return the responses and the cost of every choice that was evaluated.

        Result: a row per choice, by step; ``second_node`` where two moves are open. SI units. Where
        the responses of all choices are not kept, those that go with the plan's choices before.
        """
        return alternatives(self._posed, self.selection.choice, self.search)

    def _budgets(self) -> dict[str, dict[str, float | None]]:
        """Return what there is of every budget, what is spent, and its price."""
        prices = self.selection.prices
        return {
            budget.name: {
                "bound": budget.bound if np.isfinite(budget.bound) else None,
                "spent": budget.spent(self.selection.choice),
                "price": prices.get(budget.name),
            }
            for budget in self.problem.budgets
        }

    def objectives(self) -> dict[str, dict[str, float | None] | None]:
        """Return the sum of ranks under both objectives, and the two parts of a heuristic's gap.

        Result: ``objectives`` as of `under_both`; ``gap_parts`` with ``short_sight`` and
        ``objective``, as of `split_gap`, for heuristics. None without proof or without ranks.
        """
        none: dict[str, dict[str, float | None] | None] = {"objectives": None, "gap_parts": None}
        if self.certificate is None or self.search is not None:
            return none
        values = under_both(self._posed, self.selection.choice)
        if None in values.values():
            return none
        heuristic = self.formulation.kind is FormulationKind.HEURISTIC
        parts = split_gap(self._posed, self.selection.choice) if heuristic else None
        if parts is None:
            return {"objectives": values, "gap_parts": None}
        split: dict[str, float | None] = {"short_sight": parts.short_sight}
        return {"objectives": values, "gap_parts": split | {"objective": parts.objective}}

    def summary(self) -> dict[str, object]:
        """Return the summary of the plan, ready for JSON.

        Result: names of scene, schedule, formulation and criterion; ``candidates``, all or a
        heuristic choice of them; ``status`` (``optimal``, ``claimed optimal`` where the proof is
        left to a solver, both ``among these`` where candidates were left out, ``feasible`` or
        ``unproven``), ``objective``, ``bound``, ``gap``, ``claimed_gap``; of criteria of ranks the
        sums under both ``objectives`` and of heuristics the two ``gap_parts`` (see
        `seqopt.graph.layers.objectives`), null without proof; of every one of the ``budgets`` what
        is there, spent and what one more unit would save; whether it ``ended`` ``done``, was
        ``stopped`` before that or ``interrupted``; the limits of the linear range that are left and
        the payloads that are exceeded; ``idle_robots``, which never grip; ``models_evaluated`` and
        ``seconds``; the ``engine`` and ``versions`` (see `seqopt.engines.registry`).
        """
        schedule, proof = self._posed.schedule, self.certificate
        status = "unproven"
        if proof is not None:
            proven, claimed = proof.gap <= TOLERANCE, proof.claimed_gap <= TOLERANCE
            status = "optimal" if proven else "claimed optimal" if claimed else "feasible"
        among = f"heuristic: {schedule.left_out}" if schedule.left_out else "all"
        status += " among these" if schedule.left_out and status.endswith("optimal") else ""
        return {
            "scene": schedule.scene.name,
            "schedule": schedule.method,
            "formulation": self.formulation.name,
            "kind": self.formulation.kind.value,
            "aim": self.formulation.aim.value,
            "candidates": among,
            "criterion": self._posed.criterion.name,
            **self._posed.criterion.settings,
            "status": status,
            "objective": None if proof is None else proof.objective,
            "bound": None if proof is None else proof.bound,
            "gap": None if proof is None else proof.gap,
            "claimed_gap": None if proof is None else proof.claimed_gap,
            **self.objectives(),
            "budgets": self._budgets(),
            "ended": self.selection.end.value,
            "idle_robots": list(idle_robots(schedule.scene, self.steps)),
            "outside_linear_range": [str(departure) for departure in self.departures],
            "payload_exceeded": [str(excess) for excess in self.overloads],
            "models_evaluated": self.models,
            "seconds": dict(self.seconds),
            **provenance(self.engine),
        }
