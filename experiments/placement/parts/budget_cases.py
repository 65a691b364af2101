"""Problems with budgets, solved by one formulation in a process of its own.

Command: ``python -m experiments.placement.parts.budget_cases BRICKS FORMULATION LIMIT``, which
prints a JSON list of rows.
"""

from __future__ import annotations

import json
import resource
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from experiments.harness.runs import scene_named
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, SolverError
from seqopt.network.build import build_network
from seqopt.placement.budgets import steps_over, travel
from seqopt.placement.costs import Budget
from seqopt.placement.problem import Problem, pose
from seqopt.placement.solving import solve
from seqopt.sequence.three_robots import three_robot_loop
from seqopt.study.presets import CRITERIA

COUNTED = ("F_largest", "M_sup")
COMPARED = ("equations-2-3", "weighted")
LEVEL = 0.7  # of the steps of the free optimum stay below the level that is counted
CASES: dict[str, tuple[float | None, float | None, float | None]] = {
    "travel 0.8": (0.8, None, None),
    "travel 0.5": (0.5, None, None),
    "force 0.7": (None, 0.7, None),
    "moment 0.7": (None, None, 0.7),
    "travel and force 0.8": (0.8, 0.8, None),
    "all three": (0.8, 0.8, 0.9),
}  # shares of what the free optimum takes of way, steps over a force and over a moment


def posed(bricks: int, criterion: str) -> tuple[Problem, list[Budget], list[float]]:
    """Return the free problem, a budget of each kind, and what the free optimum takes of it."""
    scene = scene_named("arch25" if bricks == 25 else f"chain{bricks}")
    network = build_network(scene)
    loop = three_robot_loop(network)
    problem = pose(ComplianceEngine(network), loop, CRITERIA[criterion], also=COUNTED)
    choice = solve(problem, "overlap_dp").selection.choice
    budgets = [travel(problem, np.inf)]
    for name in COUNTED:
        met = [
            float(step.responses[name][tuple(choice[m] for m in step.moves)])
            for step in problem.evaluation.steps
        ]
        budgets.append(steps_over(problem, name, float(np.quantile(met, LEVEL)), np.inf))
    return problem, budgets, [budget.spent(choice) for budget in budgets]


def problems(bricks: int) -> Iterator[tuple[str, str, Problem]]:
    """Yield every problem with its criterion and the name of its case."""
    for criterion in COMPARED:
        problem, budgets, spent = posed(bricks, criterion)
        for name, shares in CASES.items():
            kept = [
                replace(budget, bound=share * most if i == 0 else float(np.floor(share * most)))
                for i, (budget, share, most) in enumerate(zip(budgets, shares, spent, strict=True))
                if share is not None
            ]
            yield criterion, name, replace(problem, budgets=tuple(kept))


def row(problem: Problem, formulation: str, limit: float) -> dict[str, object]:
    """Return what a formulation finds and proves of a problem, and what that takes."""
    try:
        plan = solve(problem, formulation, time_limit=limit)
    except SolverError:
        return {"end": "stopped without a choice", "solve": limit, "verify": 0.0}
    except InfeasibleError:
        return {"end": "infeasible", "solve": 0.0, "verify": 0.0}
    proof = plan.certificate
    assert proof is not None  # asked for
    return {
        "end": plan.selection.end.value,
        "objective": proof.objective,
        "claimed_gap": max(0.0, 1 - plan.selection.bound / proof.objective),
        "proven_gap": proof.gap,
        "solve": plan.seconds["solve"] + plan.seconds["compile"],
        "verify": plan.seconds["verify"],
    }


def main(bricks: int, formulation: str, limit: float) -> None:
    rows = []
    for criterion, case, problem in problems(bricks):
        base = {"bricks": bricks, "criterion": criterion, "case": case, "formulation": formulation}
        base |= row(problem, formulation, limit)
        base["memory_MB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        rows.append(base)
        print(base, file=sys.stderr, flush=True)
    print(json.dumps(rows))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
