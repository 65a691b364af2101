"""The command ``judge``: check a bare solution of an instance, and a bound."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Annotated

from seqopt._cli.answer import Answer, Status
from seqopt._cli.signatures import Call
from seqopt.errors import SolverError
from seqopt.instances._files import read_instance
from seqopt.instances._judge import judge_instance
from seqopt.instances.model import Instance
from seqopt.judge.certificate import TOLERANCE, Certificate, _known_gap


def run(asked: Annotated[Call, ("call", judge_instance)]) -> Answer:
    """Check a path through an instance, and bounds on all others, with arithmetic alone.

    No scene is needed. What is claimed without proof is called claimed. The exit status is 1 if
    something does not hold.

    Examples
    --------
    $ seqopt judge arch25.npz mine.txt
    $ seqopt judge arch25.npz mine.json --bound claims.json
    """
    graph = read_instance(asked.words["instance"])
    try:
        proof: Certificate = asked(instance=graph)
    except SolverError as error:
        facts = {**graph.facts_of(), "holds": False, "why": str(error)}
        failed = (f"seqopt: {asked.words['solution']}: {error}",)
        return Answer(facts, "it does not hold", failures=failed, status=Status.DOES_NOT_HOLD)
    names = [goal.name for goal in graph.goals]
    facts = {
        **graph.facts_of(),
        "holds": True,
        "values": dict(zip(names, proof.values, strict=True)),
        "bounds": dict(zip(names, proof.bounds, strict=True)),
        "gap": _known_gap(proof.gap),
        "claimed_gap": _known_gap(proof.claimed_gap),
        "spent": dict(proof.spent),
    }
    return Answer(facts, "\n".join(_lines(graph, proof)))


def _lines(instance: Instance, proof: Certificate) -> Iterator[str]:
    """Yield value, bound and gap, goal by goal."""
    within = " within all caps" if instance.caps else ""
    yield f"{instance.name}: the path leads from node 0 to an end{within}"
    caps = {cap.name: cap.most for cap in instance.caps}
    yield from (f"  {name}: {v:.9g} of {caps[name]:.9g}" for name, v in proof.spent.items())
    for goal, value, bound in zip(instance.goals, proof.values, proof.bounds, strict=True):
        left = (value - bound) / (abs(value) or 1.0)
        if not isfinite(bound):
            said = "nothing is proven"
        elif left <= TOLERANCE:
            said = "proven: no path takes less"
        else:
            said = f"proven {bound:.9g}, gap {100 * left:.3g} %"
        yield f"  {goal.name}: {value:.9g}; {said}"
    if proof.claimed_gap < proof.gap - TOLERANCE:
        yield f"  claimed without proof: gap {100 * _known_gap(proof.claimed_gap):.3g} %"
