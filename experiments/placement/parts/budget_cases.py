"""A problem with or without budgets, solved by one formulation in a process of its own.

Command: ``python -m experiments.placement.parts.budget_cases BRICKS CRITERION CASE FORMULATION
SECONDS``, which prints a row as JSON. The process keeps to one core, and to the addresses that
`MOST_MEMORY` allows.
"""

import json
import os
import resource
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments.harness.runs import scene_named
from seqopt import CRITERIA, build_network, solve, three_robot_loop
from seqopt.engines.rigid.compliance import ComplianceEngine
from seqopt.errors import InfeasibleError, SeqoptError
from seqopt.graph.formulation import End, Formulation, Solution, Watch, find_formulation
from seqopt.graph.layers.compiled import compile_layers
from seqopt.graph.layers.costs import Budget
from seqopt.graph.layers.layers import Layers, candidate_layers, steps_over, travel

COUNTED = ("F_largest", "M_sup")
COMPARED = ("equations-2-3", "weighted")
LEVEL = 0.7  # of the steps of the free optimum stay below the level that is counted
NO_BUDGET = "no budget"
CASES: dict[str, tuple[float | None, float | None, float | None]] = {
    NO_BUDGET: (None, None, None),
    "travel 0.8": (0.8, None, None),
    "travel 0.5": (0.5, None, None),
    "force 0.7": (None, 0.7, None),
    "travel and force 0.8": (0.8, 0.8, None),
    "all three": (0.8, 0.8, 0.9),
}  # shares of what the free optimum takes of way, steps over a force and over a moment
MOST_MEMORY = 6 * 2**30  # bytes of addresses, several times what answers take
SHORT, ROUNDS = 0.2, 5  # s; what takes less is repeated, and the median counts


def posed(bricks: int, criterion: str, case: str) -> Layers:
    """Return a problem with its costs computed, its budgets shares of what the optimum takes."""
    network = build_network(scene_named("arch25" if bricks == 25 else f"chain{bricks}"))
    also = () if case == NO_BUDGET else COUNTED
    loop = three_robot_loop(network)
    problem = candidate_layers(ComplianceEngine(network), loop, CRITERIA[criterion], also=also)
    choice = solve(problem, "overlap_dp").choice
    if case == NO_BUDGET:
        return problem
    kept = []
    for i, (budget, share) in enumerate(zip(_whole(problem, choice), CASES[case], strict=True)):
        if share is not None:
            bound = share * budget.spent(choice)
            kept.append(replace(budget, bound=float(np.floor(bound)) if i else bound))
    return replace(problem, budgets=tuple(kept))


def _whole(problem: Layers, choice: tuple[int, ...]) -> list[Budget]:
    """Return a budget of each kind without a bound; levels are those that the choice meets."""
    budgets = [travel(problem, np.inf)]
    for name in COUNTED:
        met = [
            float(step.responses[name][tuple(choice[m] for m in step.moves)])
            for step in problem.evaluation.steps
        ]
        budgets.append(steps_over(problem, name, float(np.quantile(met, LEVEL)), np.inf))
    return budgets


def timed(
    problem: Layers, formulation: Formulation, limit: float
) -> tuple[Solution | SeqoptError, float]:
    """Return what a formulation chooses, or how it fails, and the seconds of the processor."""
    formulation.aim.costs(problem)
    took: list[float] = []
    while not took or (took[0] < SHORT and len(took) < ROUNDS):
        start = time.process_time()
        try:
            graph = compile_layers(problem, formulation.aim, alone=formulation.alone).instance
            found: Solution | SeqoptError = formulation.solve(graph, watch=Watch(limit))
        except SeqoptError as error:
            found = error
        took.append(time.process_time() - start)
    return found, statistics.median(took)


def row(problem: Layers, name: str, limit: float) -> dict[str, object]:
    formulation = find_formulation(name)
    found, seconds = timed(problem, formulation, limit)
    out: dict[str, object] = {"solve": seconds, "verify": 0.0}
    if isinstance(found, SeqoptError):
        infeasible = isinstance(found, InfeasibleError)
        return out | {"end": "infeasible" if infeasible else "no choice", "said": str(found)}
    out |= {"end": (End.STOPPED if found.stopped else End.DONE).value, "bound": found.bound[0]}
    told = replace(formulation, solve=lambda *_, **__: found)
    try:
        plan = solve(problem, told)
    except SeqoptError as error:  # a relaxation may follow a choice that exceeds a budget
        return out | {"end": "no choice", "said": str(error)}
    return out | {
        "objective": plan.certificate.objective,
        "proven_gap": plan.certificate.gap,
        "verify": plan.seconds["verify"],
    }


def peak_memory() -> int:
    """Return the most memory that this process has had, bytes; on Linux without its parent's."""
    status = Path("/proc/self/status")
    if status.exists():  # what the system counts elsewhere begins before this program does
        words = status.read_text(encoding="ascii").split()
        return int(words[words.index("VmHWM:") + 1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def main(bricks: int, criterion: str, case: str, formulation: str, limit: float) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    problem = posed(bricks, criterion, case)
    found = row(problem, formulation, limit)
    found |= {"budgets": len(problem.budgets), "memory_MB": peak_memory() / 2**20}
    print(json.dumps(found))


if __name__ == "__main__":
    main(int(sys.argv[1]), *sys.argv[2:5], float(sys.argv[5]))
