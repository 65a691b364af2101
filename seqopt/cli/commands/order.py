"""The order that a free schedule is best in, on the command line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace

from seqopt.cli.saying.answer import Answer
from seqopt.cli.saying.free_files import free_files
from seqopt.cli.saying.layout import wrapped
from seqopt.cli.saying.outputs import require_out, write_outputs, written_to
from seqopt.cli.status import Status
from seqopt.cli.words.asked import exceeded, level_notes, strictly
from seqopt.cli.words.facts import scene_facts
from seqopt.cli.words.values import parse_numbers, parse_time_limit
from seqopt.errors import ProblemError
from seqopt.graph.orders.orders import AllOrders
from seqopt.graph.states.states import States
from seqopt.plan.calling.schedule_formulation import Finds, find_schedule_formulation
from seqopt.plan.free_plan import FreePlan
from seqopt.plan.order_plan import OrderPlan, solve_order
from seqopt.work.progress import within

SEARCH = "search"  # the order that is sought


def optimize_order(
    options: argparse.Namespace,
    free: States,
    judged: Callable[[FreePlan], dict[str, object]] | None = None,
) -> Answer:
    """Find the order whose best free schedule is best, and write its plan.

    ``options``: of the command ``optimize``; ``free``: in the scene's own order; ``judged``:
    returns what else is to be said of the plan that is found. Raises `ProblemError` if an option
    does not go with it.
    """
    if options.max_memory is not None:
        raise ProblemError(
            "--max-memory: the search of orders has none; leave it out, or give --option most=N"
        )
    formulation = find_schedule_formulation(options.formulation or "order_search", Finds.ORDER)
    numbers = parse_numbers("--option", options.option, formulation.options)
    whole = {name: type(formulation.options[name])(value) for name, value in numbers.items()}
    problem = AllOrders(free)
    require_out(options)
    limit = parse_time_limit(options.time_limit)
    found = solve_order(
        problem,
        formulation,
        proof=not options.no_proof,
        progress=within(options.tell, limit),
        resources=free.resources,
        **{"seconds": limit, **whole},
    )
    report = found.summary() | ({} if judged is None else judged(found.plan))
    written = write_outputs(
        options, lambda: free_files(found.plan, report, "best order", _said(found))
    )
    answer = _answer(options, found, formulation.name)
    return replace(answer, facts={**answer.facts, "summary": report}, written=written)


def _answer(options: argparse.Namespace, found: OrderPlan, name: str) -> Answer:
    """Return the order and what its plan is worth, once it is written."""
    said = f"{name} {_said(found)}; {written_to(options.out)}"
    order = ", ".join(map(str, found.order))
    stopped = found.selection.stopped == "interrupt"
    scene, table = found.plan.problem.network.scene, found.responses()
    over = exceeded(scene, table)
    lines = [said, wrapped(order, first="order: "), *(f"payload exceeded: {each}" for each in over)]
    answer = Answer(
        facts={
            "scene": scene_facts(scene),
            "order": found.order,
            "summary": found.summary(),
            "plan": table,
        },
        notes=level_notes(found.engine),
        text="\n".join(lines),
        status=Status.INTERRUPTED if stopped else Status.DONE,
    )
    return strictly(answer, options, over, found.departures)


def _said(found: OrderPlan) -> str:
    values = ", ".join(f"{name} {value:.6g}" for name, value in found.plan.objective.items())
    return f"({found.status}): {values}, {found.bound_said}; {len(found.plan.steps)} steps"
