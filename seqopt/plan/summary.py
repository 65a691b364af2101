"""The summary of a plan, ready for JSON, with the same keys whatever it was chosen from."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from seqopt.engines.registry import provenance
from seqopt.graph.layers.interface import PlacementProblem
from seqopt.graph.scenarios.scenarios import ScenarioLayers
from seqopt.graph.states.states import States
from seqopt.plan.calling.formulation import Selection
from seqopt.plan.calling.schedule_selection import StatePath
from seqopt.problem.goals import judged_by
from seqopt.sequence.free_rules import Ending
from seqopt.sequence.schedule import Schedule
from seqopt.sequence.steps import StepKind, idle_robots

if TYPE_CHECKING:
    from seqopt.plan.plan import Plan


def summarized(plan: Plan) -> dict[str, object]:
    """Return the summary of a plan; see `seqopt.plan.plan.Plan.summary`."""
    graph, proof, scene = plan.graph, plan.certificate, plan.engine.network.scene
    of_states = isinstance(graph, States)
    asked = _states_asked(graph) if isinstance(graph, States) else _layers_asked(plan)
    return {
        "scene": scene.name,
        "schedule": plan.method,
        "formulation": plan.formulation.name,
        "kind": plan.formulation.kind.value,
        **asked,
        "candidates": f"heuristic: {plan.among}" if plan.among else "all",
        "status": f"{plan.status} among these" if _narrowed(plan) else str(plan.status),
        "ended": plan.ended.value,
        "stopped": plan.stopped,
        "objective": plan.objective,
        "bound": _bounds(plan),
        "gap": plan.gap,
        "claimed_gap": None if proof is None or plan.gap is None else proof.claimed_gap,
        **plan.objectives(),
        "budgets": _spent_states(plan) if of_states else _spent(plan),
        "steps": len(plan.steps),
        "steps_before_release": len(plan.steps) - _letting_go(plan),
        "regrips": plan.regrips,
        "idle_robots": list(idle_robots(scene, plan.steps)),
        "outside_linear_range": [str(departure) for departure in plan.departures],
        "payload_exceeded": [str(excess) for excess in plan.overloads],
        "models_evaluated": plan.models,
        "states_in_proof": 0 if proof is None else proof.states,
        **_order(plan),
        "seconds": dict(plan.seconds),
        **provenance(plan.engine),
    }


def _narrowed(plan: Plan) -> bool:
    return bool(plan.among) and plan.status.endswith("optimal")


def _layers_asked(plan: Plan) -> dict[str, object]:
    """Return what was asked of candidates."""
    layers, graph = plan.layers, plan.graph
    scenarios = len(graph.scenes) if isinstance(graph, ScenarioLayers) else 0
    return {
        "aims": list(plan.goals),
        "criterion": layers.criterion.name,
        **layers.criterion.settings,
        "scenarios": scenarios,
        "limits": {limit.response: limit.bound for limit in layers.limits},
        "rules": {},
        "stands": None,
    }


def _states_asked(graph: States) -> dict[str, object]:
    """Return what was asked of states."""
    rules = graph.rules
    stands = None
    if graph.standing is not None:
        sets = graph.stability
        counts = {"looked_at": sets.looked_at, "programs": sets.programs}
        stands = {**graph.standing.described(), **counts, "undecided": sets.undecided}
    return {
        "aims": [str(goal) for goal in graph.aims],
        **judged_by(graph.goals, graph.criterion),
        "scenarios": len(graph.scenarios),
        "limits": {limit.response: limit.bound for limit in graph.limits},
        "rules": {} if isinstance(rules, Schedule) else rules.described(graph.network.scene),
        "stands": stands,
    }


def _bounds(plan: Plan) -> dict[str, float | None]:
    """Return what no plan stays below, by aim; claimed of a search that ended early."""
    proof, graph = plan.certificate, plan.graph
    if isinstance(graph, States) and isinstance(plan.selection, StatePath):
        early = proof is None or plan.selection.stopped
        bounds = plan.selection.bound if early or proof is None else proof.bounds
        pairs = zip(graph.aims, bounds, strict=False)
        return {str(g): g.shown(b) if isfinite(b) else None for g, b in pairs}
    if proof is None:
        return {}
    return {
        name: b if isfinite(b) else None for name, b in zip(plan.goals, proof.bounds, strict=True)
    }


def _spent_states(plan: Plan) -> dict[str, dict[str, float | None]]:
    """Return what there is of every budget of states, and what is spent."""
    graph = plan.states
    names = plan.goals[len(graph.aims) :]
    return {
        name: {"bound": cap, "spent": plan.objective[name], "price": None}
        for name, cap in zip(names, graph.budgets, strict=True)
    }


def _spent(plan: Plan) -> dict[str, dict[str, float | None]]:
    """Return what there is of every budget of candidates, what is spent, and its price."""
    graph, chosen = plan.graph, plan.selection
    assert isinstance(chosen, Selection)
    assert not isinstance(graph, States)
    problem: PlacementProblem = graph
    return {
        budget.name: {
            "bound": budget.bound if isfinite(budget.bound) else None,
            "spent": budget.spent(chosen.choice),
            "price": chosen.prices.get(budget.name),
        }
        for budget in problem.budgets
    }


def _letting_go(plan: Plan) -> int:
    """Return how many steps at the end only let go."""
    if not isinstance(plan.graph, States) or isinstance(plan.graph.rules, Schedule):
        return 0
    rules, steps = plan.graph.rules, plan.steps
    if rules.ending is Ending.HELD:
        return 0
    kinds = [step.kind is StepKind.RELEASE for step in reversed(steps)]
    count = 0
    while kinds[count] and len(steps[-1 - count].held) < rules.least_grips:
        count += 1
    return count


def _order(plan: Plan) -> dict[str, object]:
    """Return what there is to say of an order that was sought; nothing of one that was given."""
    if plan.order is None:
        return {}
    found = plan.order.selection
    return {
        "order": [*found.order],
        "orders": plan.order.problem.among.value,
        "order_status": str(plan.order.status),
        "order_bound": found.bound if isfinite(found.bound) else None,
        "order_bound_proven": plan.order.proven,
        "order_evaluated": found.evaluated,
        "order_stopped": found.stopped,
    }
