"""The commands ``instance`` and ``judge``: the graph of a problem, and any solution of it."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Annotated

from seqopt._cli.answer import Answer, Status
from seqopt._cli.signatures import Call
from seqopt._cli.words import File
from seqopt.engines.registry import engine_mortar
from seqopt.errors import ProblemError, SolverError
from seqopt.exchange._files import Output
from seqopt.instances._files import WRITTEN, read_instance, save_instance
from seqopt.instances._judge import judge_instance
from seqopt.instances.compiled import instance
from seqopt.instances.model import Instance
from seqopt.judge.certificate import TOLERANCE, Certificate, _known_gap
from seqopt.work import Tell

OUTPUT = re.compile(r" (--(quiet|json|out[= ]('[^']*'|\S+))|'--out=[^']*')(?= |$)")


def write(
    asked: Annotated[Call, ("call", instance)],
    *,
    out: File = None,
    made_by: Sequence[str] = (),
    progress: Tell,
) -> Answer:
    """Write the graph of a problem: its nodes and arcs, what they take, what is small and capped.

    Reading it needs no scene. The options are those of optimize; what concerns the search
    alone has no effect.

    Parameters
    ----------
    out : pathlib.Path, optional
        File to write: .npz (the instance) or .mps (a program); without an end a folder with both.
    made_by : sequence of str
        The words of the shell.

    Examples
    --------
    $ seqopt instance arch25 --out arch25.npz
    $ seqopt instance arch25 --budget travel=0.8 --out arch25.mps
    $ seqopt instance chain:bricks=7 --schedule free --aim minmax,steps --out chain7
    """
    words = asked.words
    if out and out.suffix not in ("", *WRITTEN):
        raise ProblemError(f"--out {out}: give a name with {', '.join(WRITTEN)}, or a folder")
    mortar = engine_mortar(words.get("engine"), words.get("mortar"), verdicts=True)
    found: Instance = asked(mortar=mortar, progress=progress)
    to = out or Path(re.sub(r"\W+", "-", found.name).strip("-") + ".npz")
    made = {"made_by": OUTPUT.sub("", shlex.join(["seqopt", *made_by]))}
    found = replace(found, name=to.stem, facts={**found.facts, **made})
    progress("writing the instance")
    Output(out, words.get("scene"), words.get("schedule")).keep_apart(to)
    save_instance(found, to)
    limited = ", ".join(f"{c.name} {c.most:g}" for c in found.caps if c.column is not None)
    lines = [f"{found!r}".strip("<>"), *([f"capped: {limited}"] if limited else [])]
    judged = "its .npz" if to.suffix == ".mps" else to
    lines += [f"written to {to}; seqopt judge {judged} SOLUTION checks an answer"]
    notes = () if out else (f"file: {to}; --out names another, or a folder for every format",)
    return Answer(found.facts_of(), "\n".join(lines), written=(to,), notes=notes)


def judge(asked: Annotated[Call, ("call", judge_instance)]) -> Answer:
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
            text = "nothing is proven"
        elif left <= TOLERANCE:
            text = "proven: no path takes less"
        else:
            text = f"proven {bound:.9g}, gap {100 * left:.3g} %"
        yield f"  {goal.name}: {value:.9g}; {text}"
    if proof.claimed_gap < proof.gap - TOLERANCE:
        yield f"  claimed without proof: gap {100 * _known_gap(proof.claimed_gap):.3g} %"
