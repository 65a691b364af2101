"""What a run computed, beside what had to be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from seqopt.graph.states import States
from seqopt.judge.certificate import Certificate
from seqopt.responses._grip_sets import GripSets
from seqopt.sequence.steps import Step
from seqopt.stability.standing import counted

Spent = dict[str, dict[str, Any]]


def spent_on(
    graph: States, steps: Sequence[Step], searched: int, proof: Certificate | None = None
) -> Spent:
    """Return what was computed to choose steps of a graph, and to prove that none are better.

    ``models``: ``searched``, ``six_digits`` of them, solved ``again`` with all digits, in the
    ``proof`` (None without one) and its ``states``; ``needed``: at least, by its own
    steps and the proof; ``answered`` by the engines for any purpose, ``corrected`` of them.
    ``responses``: names that goals, criterion and limits ``asked``, names that were ``computed``,
    and how many ``values``; grip forces come with all. ``verdicts``: ``asked`` of grip sets, and
    the linear ``programs`` that these took.
    """
    every = graph.each or (graph,)
    proven = None if proof is None else proof.models or searched
    own = len({(step.bricks, step.grips) for step in steps if step.bricks}) * len(every)
    engines = {*(each.engine for each in every), graph.engine}
    models = {
        "searched": searched,
        "six_digits": graph.six_digit_models,
        "again": sum(
            each.screened.solved_by(each.sets) for each in every if each.screened is not each.sets
        ),
        "proof": proven,
        "states": 0 if proof is None else proof.states,
        "needed": max(own, 0 if proof is None else proof.models),
        "answered": sum(getattr(engine, "answered", 0) for engine in engines),
        "corrected": sum(getattr(engine, "corrected", 0) for engine in engines),
    }
    known = [each for each in graph.answers.values() if isinstance(each, GripSets) and each.solved]
    computed = {name for sets in known for name in sets.names}
    values = sum(sets.solved * len(sets.names) for sets in known)
    responses = {"asked": sorted(graph.asked), "computed": sorted(computed), "values": values}
    asks = graph.standing is not None or any(goal.margins for goal in graph.goals)
    known_to_stand = counted(each.stability for each in every if asks)
    verdicts = {"asked": known_to_stand["looked_at"], "programs": known_to_stand["programs"]}
    return {"models": models, "responses": responses, "verdicts": verdicts}
