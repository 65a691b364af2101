"""The command ``instance``: write the graph of a problem, for any solver."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Annotated

from seqopt._cli import inputs
from seqopt._cli.answer import Answer, Result
from seqopt._cli.commands.optimize import posed
from seqopt._cli.outputs import Output
from seqopt._cli.signatures import Call, door
from seqopt._cli.words import File, shown
from seqopt.errors import ProblemError
from seqopt.graph.formulation import find_formulation
from seqopt.graph.instance import Instance
from seqopt.instances._files import WRITERS, save_instance
from seqopt.instances.compiled import compile_instance
from seqopt.judge.arithmetic import first_stage
from seqopt.problem.problem import Problem
from seqopt.work.progress import Clock, Tell
from seqopt.workflow import _pose_build, optimize

SAID = ("--quiet", "--json")


@door
def instance(
    asked: Annotated[Call, ("call", optimize)],
    *,
    name: str | None = None,
    below: Annotated[float, ("value", "VALUE")] = inf,
    out: File | None = None,
    made_by: Sequence[str] = (),
    progress: Tell = shown,
) -> Result[Instance]:
    """Write the graph of a problem: its nodes and arcs, what they take, what is small and capped.

    Reading it needs no scene. The options are those of optimize; what concerns the search
    alone has no effect.

    Parameters
    ----------
    asked : Problem, Scene, ShownBuild, pathlib.Path or str
        The problem; or in place of it a scene, and other arguments as of `optimize`.
    name : str, optional
        What it is called (default: as the file).
    below : float, optional
        Leave out states of which the first aim, a worst step, takes more; plans that are better
        than this stay.
    out : pathlib.Path or str, optional
        File to write: .npz (the instance) or .mps (a program); without an end a folder with both.
    made_by : sequence of str, optional
        The words of the shell that say so.
    progress : callable, optional
        Called with the progress.

    Returns
    -------
    Instance
        The graph of the problem, for any solver.

    Examples
    --------
    $ seqopt instance arch25 --out arch25.npz
    $ seqopt instance arch25 --budget travel=0.8 --out arch25.mps
    $ seqopt instance chain:bricks=7 --schedule free --aim minmax,steps --out chain7
    """
    path, words = None if out is None else Path(out), asked.words
    if path and path.suffix not in ("", *WRITERS):
        raise ProblemError(f"--out {path}: give a name with {', '.join(WRITERS)}, or a folder")
    clock, formulation = Clock(words.get("time_limit", inf)), words.get("formulation")
    with clock.needed("posing the problem"):
        given = words.get("scene")
        call = Call(_pose_build, {**words, "progress": progress})
        problem: Problem = given if isinstance(given, Problem) else posed(call, verdicts=True)()
    aim = None if formulation is None else find_formulation(formulation).aim
    progress("computing all that arcs take")
    usual = inputs.file_name(problem.scene.name, ".npz")
    called = path.stem if path else usual.stem if made_by else problem.scene.name
    facts = {"made_by": _command_line(made_by)} if made_by else {}
    with clock.needed("writing down the graph"):
        found = compile_instance(problem, name=name or called, aim=aim, below=below, facts=facts)

    def answer() -> Answer[Instance]:
        progress("writing the instance")
        to = path or usual
        Output(out, words.get("scene"), words.get("schedule")).keep_apart(to)
        save_instance(found, to)
        limited = ", ".join(f"{name} {most:g}" for name, _, most in first_stage(found).limited)
        lines = [f"{found!r}".strip("<>"), *([f"capped: {limited}"] if limited else [])]
        lines += [f"written to {to}; seqopt judge {to} SOLUTION checks an answer"]
        said = f"file: {to}; --out names another, or a folder for every format"
        notes = () if path else (said,)
        return Answer(found.facts_of(), "\n".join(lines), written=(to,), notes=notes, value=found)

    return Result(found, answer)


def _command_line(words: Sequence[str]) -> str:
    """Return the command line without options of output."""
    kept = list[str]()
    left = iter(words)
    for word in left:
        if word == "--out":
            next(left, None)
        elif word not in SAID and not word.startswith("--out="):
            kept.append(word)
    return shlex.join(["seqopt", *kept])
